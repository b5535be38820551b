// What the files of the C interface share: the world behind the pointer, and how errors leave.
#pragma once

#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

#include "setae_sim.h"
#include "world.h"

#if defined(_WIN32)
#define SETAE_EXPORT extern "C" __declspec(dllexport)
#else
#define SETAE_EXPORT extern "C" __attribute__((visibility("default")))
#endif

struct setae_world {
  uint64_t seed;
  setae::sim::Parameters parameters;
  setae::sim::Environment environment;
  setae::sim::ForeignPlant foreign;          // empty: the built-in spring
  std::unique_ptr<setae::sim::World> world;  // from the start on
  std::string error;
};

namespace setae {
namespace sim {

constexpr int kBadArgument = -1;
constexpr int kWrongTime = -2;
constexpr int kNoSolution = -3;
constexpr int kInternal = -4;
constexpr int kForeignPlant = -5;

inline int fail(setae_world* world, int code, const std::string& text) {
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

inline bool finite(const double (&values)[3]) {
  return std::isfinite(values[0]) && std::isfinite(values[1]) && std::isfinite(values[2]);
}

inline bool read(const double* from, Vec3& out) {
  if (from == nullptr)
    return false;
  const double values[3] = {from[0], from[1], from[2]};
  out = {values[0], values[1], values[2]};
  return finite(values);
}

inline bool positive(double value) {
  return std::isfinite(value) && value > 0;
}

inline void write(const Vec3& from, double* out) {
  out[0] = from.x;
  out[1] = from.y;
  out[2] = from.z;
}

inline void write(const Mat3& from, double* out) {  // row major
  const double rows[9] = {from.ex.x, from.ey.x, from.ez.x, from.ex.y, from.ey.y,
                          from.ez.y, from.ex.z, from.ey.z, from.ez.z};
  std::memcpy(out, rows, sizeof rows);
}

constexpr const char* kNotStarted = "the world has not been started";
constexpr const char* kStarted = "the world has been started already";

}  // namespace sim
}  // namespace setae
