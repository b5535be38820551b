// The bristle: a filament in silicone on a pressure sensor.
#pragma once

#include "geometry.h"
#include "random.h"

namespace setae {
namespace sim {

struct BristleSettings {
  double contact_hpa_per_mm;
  double contact_saturation_hpa;  // a deeper contact slips off
  double relaxation_fraction;     // of a held contact's pressure, lost in time
  double relaxation_time_s;
  double motion_axial_hpa_s2_per_mm;
  double motion_lateral_hpa_s2_per_mm;
  double natural_frequency_hz;
  double damping_ratio;
  double noise_hpa;
  double drift_hpa_per_sqrt_s;
};

class Bristle {
 public:
  Bristle(const BristleSettings& settings, uint64_t seed);

  // Where the filament's root starts, at rest.
  void place(const Vec3& root_mm);

  // Pressure change at the end of a step: the root has moved to `root_mm`,
  // `axis` points along the filament, `depth_mm` is the contact's depth.
  void step(double duration_s, const Vec3& root_mm, const Vec3& axis, double depth_mm);

  // Against the ambient pressure.
  double pressure_hpa() const { return contact_hpa_ + motion_hpa_ + drift_hpa_ + noise_hpa_; }
  double motion_hpa() const { return motion_hpa_; }
  double contact_hpa() const { return contact_hpa_; }

 private:
  BristleSettings settings_;
  Random noise_;
  Random drift_;
  Vec3 root_mm_{};
  Vec3 velocity_mm_s_{};
  // The filament on its silicone is a mass on a damped spring: how far it hangs
  // back, times its natural frequency squared, so as an acceleration.
  Vec3 lag_mm_s2_{};
  Vec3 lag_rate_{};
  double relaxed_hpa_ = 0;  // the slow part of the silicone follows the contact
  double contact_hpa_ = 0;
  double motion_hpa_ = 0;
  double drift_hpa_ = 0;
  double noise_hpa_ = 0;
};

}  // namespace sim
}  // namespace setae
