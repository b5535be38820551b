// Every number of the simulated robot, by name and with its unit.
#pragma once

#include <array>
#include <string>

namespace setae {
namespace sim {

struct Parameters {
  struct Spring {
    double free_length_mm, axial_rate_n_per_mm, mean_diameter_mm, outer_diameter_mm, poisson_ratio;
    double bending_scale_x, bending_scale_y, bending_axis_deg, stiffness_gradient, shear_scale;
    double solid_length_mm, bore_radius_mm, mass_g, damping_time_s;
  } spring;
  struct Tendon {
    double radius_mm, diameter_mm, stiffness_n_per_mm, pulley_radius_mm, backlash_mm;
    double friction, presliding_mm, winding_slip;
    std::array<double, 4> angle_deg, offset_mm, winding_error;
    std::array<double, 4> base_radial_mm, base_tangential_mm, top_radial_mm, top_tangential_mm;
  } tendon;
  struct Servo {
    double dead_band_us, speed_mm_s, time_constant_s, stiffness_n_per_mm;
    std::array<double, 4> pulse_free_us, direction, us_per_degree;
  } servo;
  struct Bristle {
    double tip_offset_mm, filament_length_mm;
    double filament_diameter_mm, filament_modulus_n_per_mm2, filament_bow_mm,
        filament_bow_angle_deg;
    double gel_stiffness_n_per_mm, gel_rotation_n_mm_per_rad, friction;
    double pressure_hpa_per_n, pressure_hpa_per_n_mm, pressure_saturation_hpa;
    double relaxation_fraction, relaxation_time_s;
    double motion_axial_hpa_s2_per_mm, motion_lateral_hpa_s2_per_mm;
    double natural_frequency_hz, damping_ratio;
  } bristle;
  struct Sensor {
    double ambient_hpa, rate_hz, rate_error, noise_hpa, drift_hpa_per_sqrt_s;
  } sensor;
  struct Line {
    double byte_us, down_latency_us, up_flush_us;
  } line;
  struct Board {
    double clock_rate_ppm, poll_us, boot_us, pose_known;
  } board;
  struct PlantPart {
    double tip_mass_g, gravity_m_s2, gravity_tilt_deg, gravity_azimuth_deg;
    double load_x_n, load_y_n, load_z_n, load_offset_mm;
    double rod_elements, rod_extra_modes;
  } plant;
};

Parameters default_parameters();

int parameter_count();
const char* parameter_name(int index);  // null where there is none
// What each may be; false where there is no such one.
bool parameter_range(int index, double& least, double& most);

// Both return false where there is no such name, or the value is no good; then
// `error` says which parameter and what it may be.
bool set_parameter(Parameters& parameters, const std::string& name, double value,
                   std::string& error);
bool get_parameter(const Parameters& parameters, const std::string& name, double& value,
                   std::string& error);

// Whether the values fit each other.
bool check_parameters(const Parameters& parameters, std::string& error);

}  // namespace sim
}  // namespace setae
