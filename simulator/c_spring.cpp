// The C interface to the spring alone.
#include <cmath>
#include <new>
#include <vector>

#include "c_world.h"
#include "settings.h"

using setae::sim::Aside;
using setae::sim::fail;
using setae::sim::guarded;
using setae::sim::kBadArgument;
using setae::sim::kInternal;
using setae::sim::kStarted;
using setae::sim::kTendonsMost;
using setae::sim::kWrongTime;
using setae::sim::PerTendon;
using setae::sim::Plant;
using setae::sim::Shape;
using setae::sim::write;

struct setae_spring {
  Plant plant;
  int tendons;
};

namespace {

constexpr double kStepS = 0.02;
constexpr int kStepsMost = 3000;
constexpr int kUnsolvedMost = 200;  // in a row

}  // namespace

static_assert(SETAE_TENDONS_MOST == kTendonsMost, "the C interface knows as many");

SETAE_EXPORT setae_spring* setae_world_spring(setae_world* world, int tendons,
                                              const double* angle_rad) {
  setae_spring* made = nullptr;
  if (world->world) {
    fail(world, kWrongTime, kStarted);
    return nullptr;
  }
  if (tendons < 3 || tendons > kTendonsMost || angle_rad == nullptr) {
    fail(world, kBadArgument, "a spring has 3 to 8 tendons");
    return nullptr;
  }
  guarded(world, [&] {
    const std::vector<double> angles(angle_rad, angle_rad + tendons);
    for (double angle : angles) {
      if (!std::isfinite(angle))
        return fail(world, kBadArgument, "a tendon's angle must be finite");
    }
    if (!setae::sim::check_parameters(world->parameters, world->error))
      return kBadArgument;
    made = new setae_spring{Plant(setae::sim::with_tendons(world->parameters, angles)), tendons};
    return 0;
  });
  return made;
}

SETAE_EXPORT void setae_spring_destroy(setae_spring* spring) {
  delete spring;
}

SETAE_EXPORT int setae_spring_rest(setae_spring* spring, const double* length_mm,
                                   const double bend_rad[2], const double shift_mm[2],
                                   setae_rest* out) {
  PerTendon lengths_mm{};
  for (int i = 0; i < spring->tendons; ++i) {
    if (!std::isfinite(length_mm[i]) || length_mm[i] <= 0)
      return kBadArgument;
    lengths_mm[i] = length_mm[i];
  }
  for (int axis = 0; axis < 2; ++axis) {
    if (!std::isfinite(bend_rad[axis]) || !std::isfinite(shift_mm[axis]))
      return kBadArgument;
  }
  try {
    Plant& plant = spring->plant;
    plant.place(lengths_mm, {bend_rad[0], bend_rad[1], shift_mm[0], shift_mm[1]});
    int steps = 0, unsolved = 0;
    do {
      plant.step(lengths_mm, kStepS);
      unsolved = plant.solved() ? 0 : unsolved + 1;
    } while ((plant.creeping() || !plant.solved()) && unsolved < kUnsolvedMost &&
             ++steps < kStepsMost);
    const Shape& shape = plant.shape();
    *out = {};
    write(shape.position[shape.elements], out->position_mm);
    write(shape.rotation[shape.elements], out->rotation);
    for (int i = 0; i < spring->tendons; ++i)
      out->tension_n[i] = plant.tension_n()[i];
    out->energy_n_mm = plant.energy_n_mm();
    out->stable = plant.solved() && steps < kStepsMost && plant.stable();
    out->residual = plant.residual();
  } catch (const std::exception&) {
    return kInternal;
  }
  return 0;
}
