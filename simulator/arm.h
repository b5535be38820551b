// The robot arm, as far as it matters here: straight moves with a trapezoidal
// speed profile.
#pragma once

#include <stdint.h>

#include <array>

#include "geometry.h"

namespace setae {
namespace sim {

class Arm {
 public:
  void place(const Vec3& position_mm);

  // The arm must be at rest.
  void move(int64_t now_us, const Vec3& target_mm, double speed_mm_s, double acceleration_mm_s2);
  // Something outside the world moves the arm and is there now. That is told in steps, and late
  // ones are large: so the arm comes after it smoothly, as a mass on a critically damped spring.
  void follow(int64_t now_us, const Vec3& leader_mm);
  // Brakes on the present line, never beyond its end.
  void stop(int64_t now_us, double acceleration_mm_s2);

  Vec3 position_mm(int64_t now_us) const;
  const Vec3& target_mm() const { return target_mm_; }
  bool moving(int64_t now_us) const;

 private:
  struct Phase {
    double duration_s, acceleration_mm_s2;
  };
  struct Motion {
    double along_mm, speed_mm_s;
    bool ended;
  };
  Motion at(int64_t now_us) const;

  Vec3 start_mm_{};
  Vec3 target_mm_{};
  Vec3 direction_{};
  double distance_mm_ = 0;
  int64_t start_us_ = 0;
  double start_speed_mm_s_ = 0;
  std::array<Phase, 3> phases_{};
  // While it follows: how far it was from its leader, and how fast, at start_us_.
  bool following_ = false;
  Vec3 behind_mm_{};
  Vec3 velocity_mm_s_{};
};

}  // namespace sim
}  // namespace setae
