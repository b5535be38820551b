// The robot's body: the spring between four pull-only tendons, always near the
// least energy that the tendons' free lengths allow.
#pragma once

#include <array>

#include "rod.h"
#include "tendon_path.h"

namespace setae {
namespace sim {

constexpr int kTendons = 4;

struct PlantSettings {
  double free_length_mm;
  double axial_rate_n_per_mm;
  double mean_diameter_mm;
  double outer_diameter_mm;
  double poisson_ratio;
  double bending_scale_x;
  double bending_scale_y;
  double shear_scale;
  double solid_length_mm;
  double bore_radius_mm;
  double damping_time_s;
  double spring_mass_g;
  double tip_mass_g;
  double gravity_m_s2;  // along z of frame D
  double tendon_stiffness_n_per_mm;
  double tendon_radius_mm;
  std::array<double, kTendons> tendon_angle_rad;
};

class Plant {
 public:
  explicit Plant(const PlantSettings& settings);

  // Goes to the equilibrium at these free tendon lengths, at rest.
  void settle(const std::array<double, kTendons>& lengths_mm);
  // One implicit step of the overdamped rod.
  void step(const std::array<double, kTendons>& lengths_mm, double duration_s);

  const std::array<double, kTendons>& lengths_mm() const { return lengths_mm_; }
  const Shape& shape() const { return state_.shape; }
  const Rod& rod() const { return rod_; }
  const std::array<double, kTendons>& tension_n() const { return state_.tension_n; }
  const std::array<TendonPath, kTendons>& paths() const { return state_.paths; }

  // Scaled gradient norm that the last solution left; below kTolerance it counts
  // as solved.
  double residual() const { return residual_; }
  bool solved() const { return residual_ < kTolerance; }
  // Still moving though its tendons are not.
  bool creeping() const { return creeping_; }
  long evaluations() const { return evaluations_; }

  // Root of N mm: moves the tip by less than 0.01 mm.
  static constexpr double kTolerance = 1e-4;

 private:
  using Matrix = std::array<Modes, kModes>;

  struct State {
    Modes modes;
    double energy;
    Modes gradient;
    Modes geometric;  // the part of the gradient that needs a secant
    Shape shape;
    std::array<TendonPath, kTendons> paths;
    std::array<Modes, kTendons> path_gradient;
    std::array<double, kTendons> tension_n;
  };

  // Touching coils of one element.
  struct SolidContact {
    double gap, bend_per_mm;
    double x, y;   // direction of the bend
    Strain slope;  // of the gap
  };

  void evaluate(const Modes& modes, State& state);
  void solve();
  void add_weight(State& state) const;
  bool solid_contact(const Strain& strain, SolidContact& contact) const;
  void add_solid(State& state) const;
  void add_solid_hessian(const State& state, Matrix& hessian) const;
  Modes frozen_gradient(const State& state, const std::array<double, kTendons>& tension_n) const;
  void rebuild_secant();
  void update_secant(const State& from, const State& to);
  bool newton_step(Modes& step) const;

  PlantSettings settings_;
  Rod rod_;
  std::array<Vec3, kTendons> holes_;
  double solid_penalty_;
  double solid_ratio_;
  std::array<double, kTendons> lengths_mm_{};
  Modes anchor_{};      // where the damper pulls to: the last step's end
  double damping_ = 0;  // relative to the rod's own stiffness
  State state_{};
  State trial_{};
  Matrix secant_{};  // geometric stiffness, learnt from step to step
  bool secant_known_ = false;
  double residual_ = 0;
  bool creeping_ = false;
  long evaluations_ = 0;
};

}  // namespace sim
}  // namespace setae
