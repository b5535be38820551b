// The C interface to the arm of a world.
#include "c_world.h"

using setae::sim::fail;
using setae::sim::finite;
using setae::sim::kBadArgument;
using setae::sim::kNotStarted;
using setae::sim::kWrongTime;
using setae::sim::positive;
using setae::sim::read;
using setae::sim::Vec3;

SETAE_EXPORT int setae_world_arm_move(setae_world* world, const double target_mm[3],
                                      double speed_mm_s, double acceleration_mm_s2) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  Vec3 target;
  if (!read(target_mm, target)) {
    return fail(world, kBadArgument, "target_mm must be three finite numbers");
  }
  if (!positive(speed_mm_s) || !positive(acceleration_mm_s2)) {
    return fail(world, kBadArgument, "speed_mm_s and acceleration_mm_s2 must be positive");
  }
  const int64_t now_us = world->world->now_us();
  if (world->world->arm().moving(now_us)) {
    return fail(world, kWrongTime, "the arm is moving: stop it first");
  }
  world->world->arm().move(now_us, target, speed_mm_s, acceleration_mm_s2);
  return 0;
}

SETAE_EXPORT int setae_world_arm_follow(setae_world* world, const double position_mm[3]) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  Vec3 position;
  if (!read(position_mm, position)) {
    return fail(world, kBadArgument, "position_mm must be three finite numbers");
  }
  world->world->arm().follow(world->world->now_us(), position);
  return 0;
}

SETAE_EXPORT int setae_world_arm_stop(setae_world* world, double acceleration_mm_s2) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (!positive(acceleration_mm_s2)) {
    return fail(world, kBadArgument, "acceleration_mm_s2 must be positive");
  }
  world->world->arm().stop(world->world->now_us(), acceleration_mm_s2);
  return 0;
}
