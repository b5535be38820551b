#include "setae_sim.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <string>

#include "world.h"

#if defined(_WIN32)
#define SETAE_EXPORT extern "C" __declspec(dllexport)
#else
#define SETAE_EXPORT extern "C" __attribute__((visibility("default")))
#endif

using setae::sim::Environment;
using setae::sim::Mat3;
using setae::sim::Parameters;
using setae::sim::Truth;
using setae::sim::Vec3;
using setae::sim::World;

struct setae_world {
  uint64_t seed;
  Parameters parameters;
  Environment environment;
  setae::sim::ForeignPlant foreign;  // empty: the built-in spring
  std::unique_ptr<World> world;      // from the start on
  std::string error;
};

namespace {

constexpr int kBadArgument = -1;
constexpr int kWrongTime = -2;
constexpr int kNoSolution = -3;
constexpr int kInternal = -4;
constexpr int kForeignPlant = -5;

int fail(setae_world* world, int code, const std::string& text) {
  world->error = text;
  return code;
}

// No exception may cross into C.
template <typename Action>
int guarded(setae_world* world, Action action) {
  try {
    return action();
  } catch (const std::exception& error) {
    return fail(world, kInternal, error.what());
  }
}

bool finite(const double (&values)[3]) {
  return std::isfinite(values[0]) && std::isfinite(values[1]) && std::isfinite(values[2]);
}

bool read(const double* from, Vec3& out) {
  if (from == nullptr)
    return false;
  const double values[3] = {from[0], from[1], from[2]};
  out = {values[0], values[1], values[2]};
  return finite(values);
}

bool positive(double value) {
  return std::isfinite(value) && value > 0;
}

void write(const Vec3& from, double* out) {
  out[0] = from.x;
  out[1] = from.y;
  out[2] = from.z;
}

void write(const Mat3& from, double* out) {  // row major
  const double rows[9] = {from.ex.x, from.ey.x, from.ez.x, from.ex.y, from.ey.y,
                          from.ez.y, from.ex.z, from.ey.z, from.ez.z};
  std::memcpy(out, rows, sizeof rows);
}

Mat3 matrix(const double (&rows)[9]) {
  return {{rows[0], rows[3], rows[6]}, {rows[1], rows[4], rows[7]}, {rows[2], rows[5], rows[8]}};
}

// The centre line of a plant that tells its top only: the cubic from D to U with
// the directions of both ends. For pictures.
void write_cubic(const setae::sim::Top& top, double (*out)[3]) {
  const double reach = norm(top.position_mm);
  const Vec3 leave = {0, 0, reach}, arrive = reach * top.rotation.ez;
  for (int j = 0; j < SETAE_BACKBONE_POINTS; ++j) {
    const double u = static_cast<double>(j) / (SETAE_BACKBONE_POINTS - 1);
    write((u * u * (3 - 2 * u)) * top.position_mm + (u * (1 - u) * (1 - u)) * leave +
              (u * u * (u - 1)) * arrive,
          out[j]);
  }
}

int outcome(setae_world* world, setae::sim::Outcome what, const char* no_solution) {
  switch (what) {
    case setae::sim::Outcome::kNoSolution:
      return fail(world, kNoSolution, no_solution);
    case setae::sim::Outcome::kForeignFailed:
      return fail(world, kForeignPlant, "the plant that was plugged in failed");
    case setae::sim::Outcome::kFine:
      break;
  }
  return 0;
}

constexpr const char* kNotStarted = "the world has not been started";
constexpr const char* kStarted = "the world has been started already";

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

SETAE_EXPORT int setae_world_add_tube(setae_world* world, const double axis_point_mm[3],
                                      double inner_radius_mm) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 axis_point;
  if (!read(axis_point_mm, axis_point)) {
    return fail(world, kBadArgument, "the tube's axis_point_mm must be three finite numbers");
  }
  if (!positive(inner_radius_mm)) {
    return fail(world, kBadArgument, "the tube's inner_radius_mm must be positive");
  }
  return guarded(world, [&] {
    world->environment.add_tube(axis_point, inner_radius_mm);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_box(setae_world* world, const double centre_mm[3],
                                     const double edges_mm[3], double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, edges;
  if (!read(centre_mm, centre)) {
    return fail(world, kBadArgument, "the box's centre_mm must be three finite numbers");
  }
  if (!read(edges_mm, edges) || edges.x <= 0 || edges.y <= 0 || edges.z <= 0) {
    return fail(world, kBadArgument, "the box's edges_mm must be three positive numbers");
  }
  if (!std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the box's yaw_rad must be finite");
  }
  return guarded(world, [&] {
    world->environment.add_box(centre, edges, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_prism(setae_world* world, const double centre_mm[3],
                                       const double edges_mm[3], double corner_mm, double wall_mm,
                                       double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, edges;
  if (!read(centre_mm, centre) || !std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the prism's centre_mm and yaw_rad must be finite");
  }
  if (!read(edges_mm, edges) || edges.x <= 0 || edges.y <= 0 || edges.z <= 0) {
    return fail(world, kBadArgument, "the prism's edges_mm must be three positive numbers");
  }
  const double half_mm = 0.5 * std::min(edges.x, edges.y);
  if (!(corner_mm >= 0 && corner_mm <= half_mm)) {
    return fail(world, kBadArgument, "the prism's corner_mm must be from 0 to half its edges");
  }
  if (!(wall_mm >= 0 && wall_mm < half_mm && wall_mm < edges.z)) {
    return fail(world, kBadArgument, "the prism's wall_mm must leave it hollow, or be 0");
  }
  return guarded(world, [&] {
    world->environment.add_prism(centre, edges, corner_mm, wall_mm, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_ring(setae_world* world, const double centre_mm[3],
                                      double ring_radius_mm, double section_radius_mm) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre;
  if (!read(centre_mm, centre)) {
    return fail(world, kBadArgument, "the ring's centre_mm must be three finite numbers");
  }
  if (!positive(ring_radius_mm) || !positive(section_radius_mm)) {
    return fail(world, kBadArgument, "the ring's radii must be positive");
  }
  return guarded(world, [&] {
    world->environment.add_ring(centre, ring_radius_mm, section_radius_mm);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_ellipsoid(setae_world* world, const double centre_mm[3],
                                           const double semi_axes_mm[3], double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, semi_axes;
  if (!read(centre_mm, centre) || !std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the ellipsoid's centre_mm and yaw_rad must be finite");
  }
  if (!read(semi_axes_mm, semi_axes) || semi_axes.x <= 0 || semi_axes.y <= 0 || semi_axes.z <= 0) {
    return fail(world, kBadArgument, "the ellipsoid's semi_axes_mm must be three positive numbers");
  }
  return guarded(world, [&] {
    world->environment.add_ellipsoid(centre, semi_axes, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_surface(setae_world* world, double x_mm, double y_mm, double bottom_mm,
                                     double top_mm, double* z_mm) {
  if (!std::isfinite(x_mm) || !std::isfinite(y_mm) || !std::isfinite(bottom_mm) ||
      !std::isfinite(top_mm)) {
    return fail(world, kBadArgument, "the place and the two heights must be finite");
  }
  *z_mm = world->environment.surface_mm(x_mm, y_mm, bottom_mm, top_mm);
  return 0;
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

SETAE_EXPORT int setae_world_truth(const setae_world* world, setae_truth* out) {
  setae_world* mutable_world = const_cast<setae_world*>(world);  // for the error's text
  if (!world->world)
    return fail(mutable_world, kWrongTime, kNotStarted);
  if (out == nullptr)
    return fail(mutable_world, kBadArgument, "truth needs a place to go");
  return guarded(mutable_world, [&] {
    const World& w = *world->world;
    const Truth truth = w.truth();
    const setae::sim::Plant& plant = truth.body.plant;
    const setae::sim::Shape& shape = plant.shape();
    std::memset(out, 0, sizeof *out);
    out->time_us = w.now_us();
    write(w.arm().position_mm(w.now_us()), out->arm_mm);
    write(w.arm().target_mm(), out->arm_target_mm);
    out->arm_moving = w.arm().moving(w.now_us());
    out->board_attached = static_cast<int32_t>(w.attached());
    for (int i = 0; i < SETAE_TENDONS; ++i) {
      out->pulse_us[i] = w.pulse_us(i);
      out->servo_length_mm[i] = truth.body.servos[i].length_mm();
      out->tension_n[i] = truth.top.tension_n[i];
    }
    if (w.foreign()) {
      write_cubic(truth.top, out->backbone_mm);
    } else {
      // Stations, and the midpoints between where there are only half as many.
      const int stride = (SETAE_BACKBONE_POINTS - 1) / shape.elements;
      for (int j = 0; j <= shape.elements; ++j) {
        write(shape.position[j], out->backbone_mm[stride * j]);
        if (stride == 2 && j < shape.elements) {
          write(plant.rod().midpoint(shape, j), out->backbone_mm[2 * j + 1]);
        }
      }
    }
    write(truth.top.rotation, out->rotation);
    write(truth.root_mm, out->filament_mm[0]);
    write(truth.tip_mm, out->filament_mm[1]);
    out->contact_depth_mm = truth.contact.depth_mm;
    write(truth.contact.point_mm, out->contact_point_mm);
    write(truth.bent_tip_mm, out->bent_tip_mm);
    out->pressure_hpa = w.pressure_hpa();
    out->plant_residual = w.foreign() ? 0 : plant.residual();
    return 0;
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
