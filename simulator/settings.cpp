#include "settings.h"

#include <cmath>

namespace setae {
namespace sim {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

Vec3 hole_mm(double angle_rad, double radial_mm, double tangential_mm) {
  const double cosine = std::cos(angle_rad), sine = std::sin(angle_rad);
  return {radial_mm * cosine - tangential_mm * sine, radial_mm * sine + tangential_mm * cosine, 0};
}

}  // namespace

PlantSettings plant_settings(const Parameters& p) {
  PlantSettings s{};
  s.free_length_mm = p.spring.free_length_mm;
  s.axial_rate_n_per_mm = p.spring.axial_rate_n_per_mm;
  s.mean_diameter_mm = p.spring.mean_diameter_mm;
  s.outer_diameter_mm = p.spring.outer_diameter_mm;
  s.poisson_ratio = p.spring.poisson_ratio;
  s.bending_scale_x = p.spring.bending_scale_x;
  s.bending_scale_y = p.spring.bending_scale_y;
  s.shear_scale = p.spring.shear_scale;
  s.solid_length_mm = p.spring.solid_length_mm;
  s.bending_axis_rad = kDegree * p.spring.bending_axis_deg;
  s.stiffness_gradient = p.spring.stiffness_gradient;
  s.bore_radius_mm = p.spring.bore_radius_mm - 0.5 * p.tendon.diameter_mm;
  s.damping_time_s = p.spring.damping_time_s;
  s.spring_mass_g = p.spring.mass_g;
  s.tip_mass_g = p.plant.tip_mass_g;
  const double tilt = kDegree * p.plant.gravity_tilt_deg;
  const double azimuth = kDegree * p.plant.gravity_azimuth_deg;
  s.gravity_m_s2 = p.plant.gravity_m_s2 * Vec3{std::sin(tilt) * std::cos(azimuth),
                                               std::sin(tilt) * std::sin(azimuth), std::cos(tilt)};
  s.load_n = {p.plant.load_x_n, p.plant.load_y_n, p.plant.load_z_n};
  s.load_offset_mm = p.plant.load_offset_mm;
  const double servo = p.servo.stiffness_n_per_mm, line = p.tendon.stiffness_n_per_mm;
  s.tendon_stiffness_n_per_mm = servo * line / (servo + line);
  s.friction = p.tendon.friction;
  s.presliding_mm = p.tendon.presliding_mm;
  s.tendons = kTendons;
  for (int i = 0; i < kTendons; ++i) {
    const double angle = kDegree * p.tendon.angle_deg[i];
    s.base_hole_mm[i] = hole_mm(angle, p.tendon.radius_mm + p.tendon.base_radial_mm[i],
                                p.tendon.base_tangential_mm[i]);
    s.top_hole_mm[i] = hole_mm(angle, p.tendon.radius_mm + p.tendon.top_radial_mm[i],
                               p.tendon.top_tangential_mm[i]);
  }
  const bool changes = s.stiffness_gradient != 0;
  s.rod_elements = static_cast<int>(p.plant.rod_elements);
  s.rod_extra_modes = static_cast<int>(p.plant.rod_extra_modes);
  if (s.rod_elements == 0) {
    s.rod_elements = kMaxElements;
    s.rod_extra_modes = changes ? 1 : s.rod_extra_modes;
  }
  return s;
}

ServoSettings servo_settings(const Parameters& p, int i) {
  const double mm_per_us = kDegree * p.tendon.pulley_radius_mm / p.servo.us_per_degree[i];
  ServoSettings s{};
  s.dead_band_us = p.servo.dead_band_us;
  s.speed_us_s = p.servo.speed_mm_s / mm_per_us;
  s.time_constant_s = p.servo.time_constant_s;
  s.pulse_free_us = p.servo.pulse_free_us[i];
  s.mm_per_us = mm_per_us * p.servo.direction[i];
  s.free_length_mm = p.spring.free_length_mm + p.tendon.offset_mm[i];
  s.winding_error = p.tendon.winding_error[i];
  s.backlash_mm = p.tendon.backlash_mm;
  s.winding_slip = p.tendon.winding_slip;
  return s;
}

BristleSettings bristle_settings(const Parameters& p) {
  BristleSettings s{};
  FilamentSettings& f = s.filament;
  f.length_mm = p.bristle.filament_length_mm;
  f.diameter_mm = p.bristle.filament_diameter_mm;
  f.modulus_n_per_mm2 = p.bristle.filament_modulus_n_per_mm2;
  f.bow_mm = p.bristle.filament_bow_mm;
  f.bow_rad = kDegree * p.bristle.filament_bow_angle_deg;
  f.gel_stiffness_n_per_mm = p.bristle.gel_stiffness_n_per_mm;
  f.gel_rotation_n_mm_per_rad = p.bristle.gel_rotation_n_mm_per_rad;
  f.friction = p.bristle.friction;
  f.settling_s = 2 * p.bristle.damping_ratio / (360 * kDegree * p.bristle.natural_frequency_hz);
  s.pressure_hpa_per_n = p.bristle.pressure_hpa_per_n;
  s.pressure_hpa_per_n_mm = p.bristle.pressure_hpa_per_n_mm;
  s.pressure_saturation_hpa = p.bristle.pressure_saturation_hpa;
  s.relaxation_fraction = p.bristle.relaxation_fraction;
  s.relaxation_time_s = p.bristle.relaxation_time_s;
  s.motion_axial_hpa_s2_per_mm = p.bristle.motion_axial_hpa_s2_per_mm;
  s.motion_lateral_hpa_s2_per_mm = p.bristle.motion_lateral_hpa_s2_per_mm;
  s.natural_frequency_hz = p.bristle.natural_frequency_hz;
  s.damping_ratio = p.bristle.damping_ratio;
  s.noise_hpa = p.sensor.noise_hpa;
  s.drift_hpa_per_sqrt_s = p.sensor.drift_hpa_per_sqrt_s;
  return s;
}

LineSettings line_settings(const Parameters& p) {
  return {std::llround(p.line.byte_us), std::llround(p.line.down_latency_us),
          std::llround(p.line.up_flush_us)};
}

PlantSettings with_tendons(const Parameters& p, const std::vector<double>& angles_rad) {
  PlantSettings s = plant_settings(p);
  s.tendons = static_cast<int>(angles_rad.size());
  s.friction = 0;
  for (int i = 0; i < s.tendons; ++i)
    s.base_hole_mm[i] = s.top_hole_mm[i] = hole_mm(angles_rad[i], p.tendon.radius_mm, 0);
  return s;
}

}  // namespace sim
}  // namespace setae
