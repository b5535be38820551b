// The C interface to what only a simulator knows.
#include <cstring>
#include <limits>

#include "c_world.h"

using setae::sim::fail;
using setae::sim::guarded;
using setae::sim::kBadArgument;
using setae::sim::kNotStarted;
using setae::sim::kWrongTime;
using setae::sim::Plant;
using setae::sim::Shape;
using setae::sim::Top;
using setae::sim::Truth;
using setae::sim::Vec3;
using setae::sim::World;
using setae::sim::write;

namespace {

// The centre line of a plant that tells its top only: the cubic from D to U with
// the directions of both ends. For pictures.
void write_cubic(const Top& top, double (*out)[3]) {
  const double reach = norm(top.position_mm);
  const Vec3 leave = {0, 0, reach}, arrive = reach * top.rotation.ez;
  for (int j = 0; j < SETAE_BACKBONE_POINTS; ++j) {
    const double u = static_cast<double>(j) / (SETAE_BACKBONE_POINTS - 1);
    write((u * u * (3 - 2 * u)) * top.position_mm + (u * (1 - u) * (1 - u)) * leave +
              (u * u * (u - 1)) * arrive,
          out[j]);
  }
}

}  // namespace

SETAE_EXPORT int setae_world_truth(const setae_world* world, setae_truth* out) {
  setae_world* mutable_world = const_cast<setae_world*>(world);  // for the error's text
  if (!world->world)
    return fail(mutable_world, kWrongTime, kNotStarted);
  if (out == nullptr)
    return fail(mutable_world, kBadArgument, "truth needs a place to go");
  return guarded(mutable_world, [&] {
    const World& w = *world->world;
    const Truth truth = w.truth();
    const Plant& plant = truth.body.plant;
    const Shape& shape = plant.shape();
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
    if (w.foreign()) {
      out->plant_residual = out->largest_residual = std::numeric_limits<double>::quiet_NaN();
      out->unsolved_samples = out->plant_iterations = -1;
    } else {
      out->plant_residual = plant.residual();
      out->largest_residual = w.largest_residual();
      out->unsolved_samples = w.unsolved_samples();
      out->plant_iterations = plant.iterations();
    }
    return 0;
  });
}
