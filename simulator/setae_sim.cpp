// The C interface: a world's life, its parameters, and its board.
#include "setae_sim.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "c_world.h"

using setae::sim::fail;
using setae::sim::finite;
using setae::sim::guarded;
using setae::sim::kBadArgument;
using setae::sim::kForeignPlant;
using setae::sim::kNoSolution;
using setae::sim::kNotStarted;
using setae::sim::kStarted;
using setae::sim::kWrongTime;
using setae::sim::Mat3;
using setae::sim::Outcome;
using setae::sim::read;
using setae::sim::Vec3;
using setae::sim::World;

namespace {

Mat3 matrix(const double (&rows)[9]) {
  return {{rows[0], rows[3], rows[6]}, {rows[1], rows[4], rows[7]}, {rows[2], rows[5], rows[8]}};
}

int outcome(setae_world* world, Outcome what, const char* no_solution) {
  switch (what) {
    case Outcome::kNoSolution:
      return fail(world, kNoSolution, no_solution);
    case Outcome::kForeignFailed:
      return fail(world, kForeignPlant, "the plant that was plugged in failed");
    case Outcome::kFine:
      break;
  }
  return 0;
}

}  // namespace

SETAE_EXPORT setae_world* setae_world_create(uint64_t seed) {
  try {
    return new setae_world{seed, setae::sim::default_parameters(), {}, {}, nullptr, {}};
  } catch (const std::exception&) {
    return nullptr;
  }
}

SETAE_EXPORT void setae_world_destroy(setae_world* world) {
  delete world;
}

SETAE_EXPORT const char* setae_world_error(const setae_world* world) {
  return world->error.c_str();
}

SETAE_EXPORT int setae_world_parameter_count(void) {
  return setae::sim::parameter_count();
}

SETAE_EXPORT const char* setae_world_parameter_name(int index) {
  return setae::sim::parameter_name(index);
}

SETAE_EXPORT int setae_world_parameter_range(int index, double* least, double* most) {
  return setae::sim::parameter_range(index, *least, *most) ? 0 : kBadArgument;
}

SETAE_EXPORT int setae_world_set(setae_world* world, const char* name, double value) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  if (name == nullptr)
    return fail(world, kBadArgument, "a parameter needs a name");
  return guarded(world, [&] {
    return setae::sim::set_parameter(world->parameters, name, value, world->error) ? 0
                                                                                   : kBadArgument;
  });
}

SETAE_EXPORT int setae_world_get(const setae_world* world, const char* name, double* value) {
  setae_world* mutable_world = const_cast<setae_world*>(world);  // for the error's text
  if (name == nullptr || value == nullptr) {
    return fail(mutable_world, kBadArgument, "a parameter needs a name and a place to go");
  }
  return guarded(mutable_world, [&] {
    return setae::sim::get_parameter(world->parameters, name, *value, mutable_world->error)
               ? 0
               : kBadArgument;
  });
}

SETAE_EXPORT int setae_world_use_plant(setae_world* world, setae_plant_step step, void* user) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  if (step == nullptr)
    return fail(world, kBadArgument, "a plant needs a function that steps it");
  return guarded(world, [&] {
    world->foreign = [step, user](const setae::sim::Drive& drive, setae::sim::Answer& answer) {
      setae_plant_input in{};
      in.time_us = drive.time_us;
      in.attached = static_cast<int32_t>(drive.attached);
      std::copy(drive.pulse_us.begin(), drive.pulse_us.end(), in.pulse_us);
      std::copy(drive.pull_mm.begin(), drive.pull_mm.end(), in.pull_mm);
      setae_plant_output out{};
      out.pressure_hpa = std::nan("");
      if (step(user, &in, &out) != 0)
        return false;
      Vec3 position;
      if (!read(out.position_mm, position))
        return false;
      answer.top = {position, matrix(out.rotation), {}};
      std::copy(out.tension_n, out.tension_n + SETAE_TENDONS, answer.top.tension_n.begin());
      answer.pressure_hpa = out.pressure_hpa;
      return true;
    };
    return 0;
  });
}

SETAE_EXPORT int setae_world_start(setae_world* world, const double arm_mm[3]) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 arm;
  if (!read(arm_mm, arm)) {
    return fail(world, kBadArgument, "arm_mm must be three finite numbers");
  }
  return guarded(world, [&] {
    if (!setae::sim::check_parameters(world->parameters, world->error))
      return kBadArgument;
    auto started = std::make_unique<World>(world->parameters, world->environment, world->seed, arm,
                                           world->foreign);
    const int status =
        outcome(world, started->outcome(), "the spring has no equilibrium with these parameters");
    if (status == 0)
      world->world = std::move(started);
    return status;
  });
}

SETAE_EXPORT int64_t setae_world_now_us(const setae_world* world) {
  return world->world ? world->world->now_us() : 0;
}

SETAE_EXPORT int setae_world_send(setae_world* world, const uint8_t* data, size_t size) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (data == nullptr && size > 0)
    return fail(world, kBadArgument, "no bytes to send");
  return guarded(world, [&] {
    world->world->send(data, size);
    return 0;
  });
}

SETAE_EXPORT int setae_world_run(setae_world* world, int64_t until_us, uint8_t* data,
                                 size_t* size) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (data == nullptr || size == nullptr || *size == 0) {
    return fail(world, kBadArgument, "run needs room for the bytes it returns");
  }
  const size_t room = *size;
  *size = 0;
  return guarded(world, [&] {
    const int status =
        outcome(world, world->world->run(until_us),
                "the spring's equilibrium could not be found for several samples in a row");
    if (status == 0)
      *size = world->world->read(data, room);
    return status;
  });
}

SETAE_EXPORT int setae_world_sensor_fault(setae_world* world, int fault) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (fault < 0 || fault >= setae::sim::kSensorFaults)
    return fail(world, kBadArgument, "a sensor fault is 0 (none) to 7");
  world->world->set_sensor_fault(static_cast<setae::sim::SensorFault>(fault));
  return 0;
}

SETAE_EXPORT int setae_world_supply(setae_world* world, int supply_mv) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (supply_mv < 0 || supply_mv > 6000)
    return fail(world, kBadArgument, "supply_mv is 0 to 6000");
  world->world->set_supply_mv(static_cast<uint16_t>(supply_mv));
  return 0;
}

SETAE_EXPORT int setae_world_stop_switch(setae_world* world, int open) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  world->world->set_stop_switch(open != 0);
  return 0;
}

SETAE_EXPORT int setae_world_reset_board(setae_world* world) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  return guarded(world, [&] {
    world->world->reset_board();
    return 0;
  });
}

SETAE_EXPORT int setae_world_remove_board(setae_world* world) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  return guarded(world, [&] {
    world->world->remove_board();
    return 0;
  });
}

SETAE_EXPORT int setae_world_pulse(setae_world* world, int servo, double width_us) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (servo < 0 || servo >= SETAE_TENDONS || !std::isfinite(width_us) || width_us < 0)
    return fail(world, kBadArgument, "a pulse needs a servo, 0 to 3, and a width of 0 or more");
  world->world->pulse(servo, width_us);
  return 0;
}

SETAE_EXPORT int setae_world_sense(setae_world* world, double* pressure_hpa) {
  if (!world->world)
    return fail(world, kWrongTime, kNotStarted);
  if (pressure_hpa == nullptr)
    return fail(world, kBadArgument, "the pressure needs a place to go");
  return guarded(world, [&] {
    const int status =
        outcome(world, world->world->sense(),
                "the spring's equilibrium could not be found for several samples in a row");
    *pressure_hpa = world->world->pressure_hpa();
    return status;
  });
}
