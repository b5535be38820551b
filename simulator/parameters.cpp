#include "parameters.h"

#include <cmath>
#include <cstdio>

#include "protocol/messages.h"

namespace setae {
namespace sim {
namespace {

struct Entry {
  const char* name;
  double value, least, most;
  double& (*at)(Parameters&);
};

// The name in the table is the member's, so that the two can't differ.
#define SETAE_ONE(group, member, value, least, most) \
  {#group "." #member, value, least, most, [](Parameters& p) -> double& { return p.group.member; }}
#define SETAE_ITEM(group, member, index, value, least, most) \
  {#group "." #member "_" #index, value, least, most,        \
   [](Parameters& p) -> double& { return p.group.member[index]; }}
#define SETAE_FOUR(group, member, value, least, most)   \
  SETAE_ITEM(group, member, 0, value, least, most),     \
      SETAE_ITEM(group, member, 1, value, least, most), \
      SETAE_ITEM(group, member, 2, value, least, most), \
      SETAE_ITEM(group, member, 3, value, least, most)

constexpr double kUsPerDegree = 2000.0 / 180.0;

const Entry kEntries[] = {
    // The spring. Rigidities follow from the homogenised helix; the scales allow
    // for what a real one does instead.
    SETAE_ONE(spring, free_length_mm, 70, 20, 500),
    SETAE_ONE(spring, axial_rate_n_per_mm, 0.22, 0.01, 10),
    SETAE_ONE(spring, mean_diameter_mm, 19.5, 2, 200),
    SETAE_ONE(spring, outer_diameter_mm, 21, 2, 200),
    SETAE_ONE(spring, poisson_ratio, 0.3, 0, 0.5),
    SETAE_ONE(spring, bending_scale_x, 1, 0.2, 5),
    SETAE_ONE(spring, bending_scale_y, 1, 0.2, 5),
    // From x to the axis about which bending_scale_x holds.
    SETAE_ONE(spring, bending_axis_deg, 0, -180, 180),
    // How much stiffer the top is than the middle, and the base softer.
    SETAE_ONE(spring, stiffness_gradient, 0, -0.8, 0.8),
    SETAE_ONE(spring, shear_scale, 1, 0.2, 5),
    SETAE_ONE(spring, solid_length_mm, 18, 1, 400),
    SETAE_ONE(spring, bore_radius_mm, 9, 1, 100),
    SETAE_ONE(spring, mass_g, 25, 0, 500),
    // In the place of inertia: how long a released spring takes is about the inverse of
    // its lowest frequency, from bending stiffness and mass 25 rad/s. With less, what
    // snaps taut gives pressures that no real spring is fast enough for.
    SETAE_ONE(spring, damping_time_s, 0.03, 0, 0.2),

    SETAE_ONE(tendon, radius_mm, 8.3, 1, 100),
    SETAE_ONE(tendon, diameter_mm, 0, 0, 5),
    SETAE_ONE(tendon, stiffness_n_per_mm, 10, 0.5, 100),
    SETAE_ONE(tendon, pulley_radius_mm, 35, 1, 200),
    SETAE_ONE(tendon, backlash_mm, 0, 0, 10),
    // On the bore: coefficient, and how far a tendon creeps before all of it slides.
    SETAE_ONE(tendon, friction, 0, 0, 0.5),
    SETAE_ONE(tendon, presliding_mm, 0.1, 0.02, 5),
    // Most that the winding may slip, of the wound length; drawn anew at each winding.
    SETAE_ONE(tendon, winding_slip, 0, 0, 0.3),
    SETAE_ITEM(tendon, angle_deg, 0, 0, -360, 360),
    SETAE_ITEM(tendon, angle_deg, 1, 90, -360, 360),
    SETAE_ITEM(tendon, angle_deg, 2, 180, -360, 360),
    SETAE_ITEM(tendon, angle_deg, 3, 270, -360, 360),
    SETAE_FOUR(tendon, offset_mm, 0, -10, 10),
    SETAE_FOUR(tendon, winding_error, 0, -0.3, 0.3),
    // Errors of the holes in the two plates, away from the axis and anticlockwise.
    SETAE_FOUR(tendon, base_radial_mm, 0, -5, 5),
    SETAE_FOUR(tendon, base_tangential_mm, 0, -5, 5),
    SETAE_FOUR(tendon, top_radial_mm, 0, -5, 5),
    SETAE_FOUR(tendon, top_tangential_mm, 0, -5, 5),

    // MG996R: facts and dead band from its data sheet.
    SETAE_ONE(servo, dead_band_us, 5, 0, 50),
    SETAE_ONE(servo, speed_mm_s, 190, 1, 5000),
    SETAE_ONE(servo, time_constant_s, 0.02, 0.001, 1),
    // Gears and drive, at the pulley's rim; in series with the tendon.
    SETAE_ONE(servo, stiffness_n_per_mm, 1000000, 0.5, 1000000),
    SETAE_FOUR(servo, pulse_free_us, 850, 400, 2600),
    SETAE_FOUR(servo, direction, 1, -1, 1),
    SETAE_FOUR(servo, us_per_degree, kUsPerDegree, 1, 100),

    SETAE_ONE(bristle, tip_offset_mm, 65, 0, 300),
    SETAE_ONE(bristle, filament_length_mm, 53, 1, 300),
    // A nylon line, not quite straight: at rest its middle is off the axis, towards the angle.
    SETAE_ONE(bristle, filament_diameter_mm, 1, 0.1, 5),
    SETAE_ONE(bristle, filament_modulus_n_per_mm2, 2500, 10, 250000),
    SETAE_ONE(bristle, filament_bow_mm, 0.5, 0, 10),
    SETAE_ONE(bristle, filament_bow_angle_deg, 0, -360, 360),
    // What it is bonded into, far softer: along the filament, and against its root's turning.
    SETAE_ONE(bristle, gel_stiffness_n_per_mm, 0.08, 0.001, 10),
    SETAE_ONE(bristle, gel_rotation_n_mm_per_rad, 8, 0.05, 10000),
    SETAE_ONE(bristle, friction, 0.4, 0, 2),
    // 150 hPa per N are those of a disc of 9 mm; a turn presses on one half of it.
    SETAE_ONE(bristle, pressure_hpa_per_n, 150, 0, 10000),
    SETAE_ONE(bristle, pressure_hpa_per_n_mm, 100, 0, 10000),
    // It is never reached: the gel gives way to the sides.
    SETAE_ONE(bristle, pressure_saturation_hpa, 80, 1, 240),
    SETAE_ONE(bristle, relaxation_fraction, 0.15, 0, 0.95),
    SETAE_ONE(bristle, relaxation_time_s, 0.5, 0.01, 100),
    SETAE_ONE(bristle, motion_axial_hpa_s2_per_mm, 0.007, 0, 1),
    SETAE_ONE(bristle, motion_lateral_hpa_s2_per_mm, 0.004, 0, 1),
    SETAE_ONE(bristle, natural_frequency_hz, 12, 1, 200),
    SETAE_ONE(bristle, damping_ratio, 0.5, 0.05, 5),

    SETAE_ONE(sensor, ambient_hpa, 1013.25, 300, 1200),
    SETAE_ONE(sensor, rate_hz, 75, 1, 200),
    SETAE_ONE(sensor, rate_error, 0, -0.2, 0.2),
    SETAE_ONE(sensor, noise_hpa, 0.02, 0, 20),
    SETAE_ONE(sensor, drift_hpa_per_sqrt_s, 0.02, 0, 5),

    SETAE_ONE(line, byte_us, 10e6 / protocol::kBaud, 1, 10000),
    SETAE_ONE(line, down_latency_us, 1000, 0, 1000000),
    SETAE_ONE(line, up_flush_us, 4000, 0, 1000000),

    SETAE_ONE(board, clock_rate_ppm, 0, -20000, 20000),
    SETAE_ONE(board, poll_us, 1000, 50, 20000),
    SETAE_ONE(board, boot_us, 500000, 0, 10000000),
    SETAE_ONE(board, pose_known, 1, 0, 1),

    SETAE_ONE(plant, tip_mass_g, 15, 0, 500),
    // Tilted from z of frame D (the robot hangs) towards the azimuth.
    SETAE_ONE(plant, gravity_m_s2, 9.81, -20, 20),
    SETAE_ONE(plant, gravity_tilt_deg, 0, -180, 180),
    SETAE_ONE(plant, gravity_azimuth_deg, 0, -360, 360),
    // A dead load in frame D, so far beyond the spring's top.
    SETAE_ONE(plant, load_x_n, 0, -5, 5),
    SETAE_ONE(plant, load_y_n, 0, -5, 5),
    SETAE_ONE(plant, load_z_n, 0, -5, 5),
    SETAE_ONE(plant, load_offset_mm, 0, 0, 300),
    // How finely the rod is cut; 0 is by itself: 10, and 20 with an extra mode where its
    // stiffness changes along it.
    SETAE_ONE(plant, rod_elements, 0, 0, 20),
    SETAE_ONE(plant, rod_extra_modes, 0, 0, 1),
};

#undef SETAE_FOUR
#undef SETAE_ITEM
#undef SETAE_ONE

const Entry* find(const std::string& name) {
  for (const Entry& entry : kEntries) {
    if (name == entry.name)
      return &entry;
  }
  return nullptr;
}

bool fail(std::string& error, const std::string& text) {
  error = text;
  return false;
}

}  // namespace

Parameters default_parameters() {
  Parameters parameters{};
  for (const Entry& entry : kEntries)
    entry.at(parameters) = entry.value;
  return parameters;
}

int parameter_count() {
  return static_cast<int>(sizeof kEntries / sizeof kEntries[0]);
}

const char* parameter_name(int index) {
  return index >= 0 && index < parameter_count() ? kEntries[index].name : nullptr;
}

bool parameter_range(int index, double& least, double& most) {
  if (index < 0 || index >= parameter_count())
    return false;
  least = kEntries[index].least;
  most = kEntries[index].most;
  return true;
}

bool set_parameter(Parameters& parameters, const std::string& name, double value,
                   std::string& error) {
  const Entry* entry = find(name);
  if (entry == nullptr)
    return fail(error, "no parameter is named \"" + name + "\"");
  if (!(value >= entry->least && value <= entry->most)) {  // NaN fails both
    char text[160];
    std::snprintf(text, sizeof text, "%s must be between %g and %g, not %g", entry->name,
                  entry->least, entry->most, value);
    return fail(error, text);
  }
  const bool is_direction = name.compare(0, 16, "servo.direction_") == 0;
  if (is_direction && std::fabs(value) != 1)
    return fail(error, name + " must be 1 or -1");
  if (name == "plant.rod_elements" && value != 0 && value != 10 && value != 20)
    return fail(error, name + " must be 0, 10 or 20");
  const bool is_switch = name == "board.pose_known" || name == "plant.rod_extra_modes";
  if (is_switch && value != 0 && value != 1)
    return fail(error, name + " must be 0 or 1");
  entry->at(parameters) = value;
  return true;
}

bool get_parameter(const Parameters& parameters, const std::string& name, double& value,
                   std::string& error) {
  const Entry* entry = find(name);
  if (entry == nullptr)
    return fail(error, "no parameter is named \"" + name + "\"");
  value = entry->at(const_cast<Parameters&>(parameters));  // read only
  return true;
}

bool check_parameters(const Parameters& p, std::string& error) {
  const double bore_mm = p.spring.bore_radius_mm - 0.5 * p.tendon.diameter_mm;
  if (p.tendon.radius_mm > bore_mm) {
    return fail(error,
                "tendon.radius_mm must not exceed spring.bore_radius_mm less half of "
                "tendon.diameter_mm");
  }
  for (int i = 0; i < 4; ++i) {
    const double base_mm =
        std::hypot(p.tendon.radius_mm + p.tendon.base_radial_mm[i], p.tendon.base_tangential_mm[i]);
    const double top_mm =
        std::hypot(p.tendon.radius_mm + p.tendon.top_radial_mm[i], p.tendon.top_tangential_mm[i]);
    if (base_mm > bore_mm || top_mm > bore_mm) {
      return fail(error, std::string("tendon.") + (base_mm > bore_mm ? "base" : "top") +
                             "_radial_mm_" + std::to_string(i) +
                             " and its tangential_mm bring the hole outside of the bore");
    }
  }
  if (p.spring.mean_diameter_mm > p.spring.outer_diameter_mm) {
    return fail(error, "spring.mean_diameter_mm must not exceed spring.outer_diameter_mm");
  }
  if (p.spring.solid_length_mm > 0.9 * p.spring.free_length_mm) {
    return fail(error, "spring.solid_length_mm must be below 0.9 of spring.free_length_mm");
  }
  if (p.bristle.filament_length_mm > p.bristle.tip_offset_mm) {
    return fail(error, "bristle.filament_length_mm must not exceed bristle.tip_offset_mm");
  }
  return true;
}

}  // namespace sim
}  // namespace setae
