#include "bristle.h"

#include <algorithm>
#include <cmath>

namespace setae {
namespace sim {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr int kSubsteps = 8;

}  // namespace

Bristle::Bristle(const BristleSettings& settings, uint64_t seed)
    : settings_(settings), filament_(settings.filament), noise_(seed, 1), drift_(seed, 2) {}

void Bristle::place(const Vec3& root_mm, const Mat3& axes) {
  root_mm_ = root_mm;
  filament_.place(root_mm, axes);
}

void Bristle::step(double duration_s, const Vec3& root_mm, const Mat3& axes,
                   const Environment& environment) {
  if (duration_s <= 0)
    return;  // asked again at the same time
  filament_.step(duration_s, root_mm, axes, environment);
  const Vec3 velocity = (1 / duration_s) * (root_mm - root_mm_);
  const Vec3 acceleration = (1 / duration_s) * (velocity - velocity_mm_s_);
  root_mm_ = root_mm;
  velocity_mm_s_ = velocity;

  // Implicit steps: stable at every frequency that may be asked for.
  const double omega = kTwoPi * settings_.natural_frequency_hz;
  const double h = duration_s / kSubsteps;
  const double scale = 1 / (1 + 2 * settings_.damping_ratio * omega * h + omega * omega * h * h);
  for (int i = 0; i < kSubsteps; ++i) {
    lag_rate_ = scale * (lag_rate_ + (h * omega * omega) * (acceleration - lag_mm_s2_));
    lag_mm_s2_ = lag_mm_s2_ + h * lag_rate_;
  }
  const double axial = dot(axes.ez, lag_mm_s2_);
  const double lateral = norm(lag_mm_s2_ - axial * axes.ez);
  motion_hpa_ = settings_.motion_axial_hpa_s2_per_mm * axial +
                settings_.motion_lateral_hpa_s2_per_mm * lateral;

  // Standard linear solid: stiff at once, softer in time.
  const double pressed_hpa = settings_.pressure_hpa_per_n * filament_.push_n() +
                             settings_.pressure_hpa_per_n_mm * filament_.moment_n_mm();
  const double most_hpa = settings_.pressure_saturation_hpa;
  const double touch_hpa = most_hpa * (1 - std::exp(-pressed_hpa / most_hpa));
  relaxed_hpa_ +=
      (touch_hpa - relaxed_hpa_) * (1 - std::exp(-duration_s / settings_.relaxation_time_s));
  contact_hpa_ = touch_hpa - settings_.relaxation_fraction * relaxed_hpa_;

  drift_hpa_ += settings_.drift_hpa_per_sqrt_s * std::sqrt(duration_s) * drift_.normal();
  noise_hpa_ = settings_.noise_hpa * noise_.normal();
}

}  // namespace sim
}  // namespace setae
