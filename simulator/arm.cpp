#include "arm.h"

#include <algorithm>
#include <cmath>

namespace setae {
namespace sim {
namespace {

constexpr double kFollowRate = 15;  // per second: it is 0.13 s behind an even motion

}  // namespace

void Arm::place(const Vec3& position_mm) {
  start_mm_ = target_mm_ = position_mm;
  direction_ = {0, 0, 0};
  distance_mm_ = 0;
  phases_ = {};
  following_ = false;
}

void Arm::move(int64_t now_us, const Vec3& target_mm, double speed_mm_s,
               double acceleration_mm_s2) {
  place(position_mm(now_us));
  start_us_ = now_us;
  start_speed_mm_s_ = 0;
  const Vec3 way = target_mm - start_mm_;
  distance_mm_ = norm(way);
  if (distance_mm_ == 0)
    return;
  target_mm_ = target_mm;
  direction_ = (1 / distance_mm_) * way;
  const double speed = std::min(speed_mm_s, std::sqrt(distance_mm_ * acceleration_mm_s2));
  const double ramp_s = speed / acceleration_mm_s2;
  phases_ = {{{ramp_s, acceleration_mm_s2},
              {distance_mm_ / speed - ramp_s, 0},
              {ramp_s, -acceleration_mm_s2}}};
}

void Arm::follow(int64_t now_us, const Vec3& leader_mm) {
  const Vec3 here = position_mm(now_us);
  Vec3 velocity = {0, 0, 0};
  if (following_) {
    // The derivative of what position_mm() gives.
    const double t = 1e-6 * static_cast<double>(now_us - start_us_);
    const Vec3 pull = velocity_mm_s_ + kFollowRate * behind_mm_;
    velocity = std::exp(-kFollowRate * t) * (velocity_mm_s_ - (kFollowRate * t) * pull);
  }
  place(leader_mm);
  start_us_ = now_us;
  following_ = true;
  behind_mm_ = here - leader_mm;
  velocity_mm_s_ = velocity;
}

void Arm::stop(int64_t now_us, double acceleration_mm_s2) {
  const Motion motion = at(now_us);
  if (motion.ended)
    return;
  const double left_mm = distance_mm_ - motion.along_mm;
  const double speed = motion.speed_mm_s;
  const double braking = std::max(acceleration_mm_s2, 0.5 * speed * speed / left_mm);
  start_mm_ = start_mm_ + motion.along_mm * direction_;
  start_us_ = now_us;
  start_speed_mm_s_ = speed;
  distance_mm_ = 0.5 * speed * speed / braking;
  target_mm_ = start_mm_ + distance_mm_ * direction_;
  phases_ = {};
  phases_[0] = {speed / braking, -braking};
}

Arm::Motion Arm::at(int64_t now_us) const {
  double left_s = 1e-6 * static_cast<double>(now_us - start_us_);
  Motion motion = {0, start_speed_mm_s_, false};
  for (const Phase& phase : phases_) {
    const double spent_s = std::min(left_s, phase.duration_s);
    motion.along_mm += spent_s * (motion.speed_mm_s + 0.5 * phase.acceleration_mm_s2 * spent_s);
    motion.speed_mm_s += phase.acceleration_mm_s2 * spent_s;
    if (left_s < phase.duration_s)
      return motion;
    left_s -= spent_s;
  }
  return {distance_mm_, 0, true};
}

Vec3 Arm::position_mm(int64_t now_us) const {
  if (following_) {
    const double t = 1e-6 * static_cast<double>(now_us - start_us_);
    const Vec3 pull = velocity_mm_s_ + kFollowRate * behind_mm_;
    return target_mm_ + std::exp(-kFollowRate * t) * (behind_mm_ + t * pull);
  }
  const Motion motion = at(now_us);
  return motion.ended ? target_mm_ : start_mm_ + motion.along_mm * direction_;
}

bool Arm::moving(int64_t now_us) const {
  return !at(now_us).ended;
}

}  // namespace sim
}  // namespace setae
