// The bristle: a filament in silicone gel on a pressure sensor.
#pragma once

#include "environment.h"
#include "filament.h"
#include "geometry.h"
#include "random.h"

namespace setae {
namespace sim {

struct BristleSettings {
  FilamentSettings filament;
  double pressure_hpa_per_n;     // by what pushes the filament into the gel
  double pressure_hpa_per_n_mm;  // by what turns it in there
  double pressure_saturation_hpa;
  double relaxation_fraction;  // of a held contact's pressure, lost in time
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

  // Where the filament's root starts, at rest; axes.ez points along the filament.
  void place(const Vec3& root_mm, const Mat3& axes);

  // Pressure change at the end of a step that moved the root there, among solids.
  void step(double duration_s, const Vec3& root_mm, const Mat3& axes,
            const Environment& environment);

  // Against the ambient pressure.
  double pressure_hpa() const { return contact_hpa_ + motion_hpa_ + drift_hpa_ + noise_hpa_; }
  double motion_hpa() const { return motion_hpa_; }
  const Filament& filament() const { return filament_; }

 private:
  BristleSettings settings_;
  Filament filament_;
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
