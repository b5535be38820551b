// The robot's body: the spring between four pull-only tendons, always near the
// least energy that the tendons' free lengths allow.
#pragma once

#include <array>
#include <cmath>

#include "dense.h"
#include "rod.h"
#include "tendon_path.h"

namespace setae {
namespace sim {

constexpr int kTendonsMost = 8;
using PerTendon = std::array<double, kTendonsMost>;  // what is beyond their number is 0
using Tendons = std::array<bool, kTendonsMost>;      // some of them

struct PlantSettings {
  double free_length_mm;
  double axial_rate_n_per_mm;
  double mean_diameter_mm;
  double outer_diameter_mm;
  double poisson_ratio;
  double bending_scale_x;
  double bending_scale_y;
  double bending_axis_rad;
  double stiffness_gradient;
  double shear_scale;
  double solid_length_mm;
  double bore_radius_mm;
  double damping_time_s;
  double spring_mass_g;
  double tip_mass_g;
  Vec3 gravity_m_s2;      // in frame D
  Vec3 load_n;            // in frame D
  double load_offset_mm;  // beyond U
  double tendon_stiffness_n_per_mm;
  double friction;
  double presliding_mm;
  int tendons;                                               // 3 to kTendonsMost
  std::array<Vec3, kTendonsMost> base_hole_mm, top_hole_mm;  // in the plates' planes
  int rod_elements;
  int rod_extra_modes;
};

class Plant {
 public:
  explicit Plant(const PlantSettings& settings);

  // Held so, away from rest: compressed to the shortest of these free tendon lengths.
  void place(const PerTendon& lengths_mm, const Aside& aside);
  // Goes to the equilibrium at these free tendon lengths, at rest; from straight.
  void settle(const PerTendon& lengths_mm);
  // One implicit step of the overdamped rod.
  void step(const PerTendon& lengths_mm, double duration_s);

  const PerTendon& lengths_mm() const { return lengths_mm_; }
  const Shape& shape() const { return state().shape; }
  const Rod& rod() const { return rod_; }
  const PerTendon& tension_n() const { return state().tension_n; }
  const std::array<TendonPath, kTendonsMost>& paths() const { return state().paths; }

  // Scaled gradient norm that the last solution left; below kTolerance it counts
  // as solved. Never NaN.
  double residual() const { return std::isfinite(residual_) ? residual_ : kNone; }
  bool solved() const { return residual_ < kTolerance; }
  // Newton's steps that the last solution took.
  int iterations() const { return iterations_; }
  // Still moving though its tendons are not.
  bool creeping() const { return creeping_; }
  // Whether the energy rises in every direction from here. Asks anew, so it takes long.
  bool stable();
  double energy_n_mm() const { return state().energy; }
  long evaluations() const { return evaluations_; }

  // Root of N mm: moves the tip by less than 0.01 mm.
  static constexpr double kTolerance = 1e-4;
  static constexpr double kNone = 1e300;  // of what is no number any more

 private:
  struct State {
    // Of the shape alone:
    Modes modes;
    Shape shape;
    std::array<TendonPath, kTendonsMost> paths;
    std::array<Modes, kTendonsMost> path_gradient;
    Tendons path_known;  // and its gradient: not of the slackest
    double weight_energy;
    Modes weight_gradient;
    // Under the tendons' present lengths, damping and friction:
    double energy;
    Modes gradient;   // friction's load included
    Modes geometric;  // the part of the gradient that needs a secant
    PerTendon stretch_mm;
    PerTendon tension_n;
  };

  // Touching coils of one element.
  struct SolidContact {
    double gap, bend_per_mm;
    double x, y;   // direction of the bend
    Strain slope;  // of the gap
  };

  State& state() { return states_[present_]; }
  const State& state() const { return states_[present_]; }
  State& trial() { return states_[1 - present_]; }

  void evaluate(const Modes& modes, State& state);
  void evaluate_beside(const Modes& modes);
  void reload(State& state);
  void find_path(int i, State& state) const;
  void load(State& state) const;
  Tendons taut() const;
  void solve();
  bool leave_saddle();
  void settle_friction(State& state);
  bool falls_nowhere(Cholesky& solver) const;
  void add_weight(State& state) const;
  bool solid_contact(const Strain& strain, SolidContact& contact) const;
  void add_solid(State& state) const;
  void add_solid_hessian(Matrix& hessian) const;
  Modes frozen_gradient(const State& state, const PerTendon& tension_n) const;
  void rebuild_secant();
  void update_secant(const State& from, const State& to);
  Matrix hessian(const Tendons& taut) const;
  bool newton_step(Modes& step) const;
  bool newton_step(const Tendons& taut, Modes& step) const;

  PlantSettings settings_;
  Rod rod_;
  double solid_penalty_;
  double solid_ratio_;
  PerTendon lengths_mm_{};
  Modes anchor_{};      // where the damper pulls to: the last step's end
  double damping_ = 0;  // relative to the rod's own stiffness
  // Friction of each tendon in the bore. It has no energy: within a step of Newton's
  // it is a constant load, and its derivative is a column beside the tendon's gradient.
  PerTendon slide_from_{};  // at the step's start: -1 unwinds, 1 winds
  PerTendon slide_{};
  PerTendon path_from_mm_{};
  bool may_slide_ = false;
  Modes friction_load_{};
  std::array<Modes, kTendonsMost> friction_column_{};
  std::array<Modes, kTendonsMost> friction_loss_{};  // of a tension of 1: its load
  Tendons rubs_{};                                   // those that the two are for
  Tendons was_taut_{};             // at the last step's end; empty where that is over
  std::array<State, 2> states_{};  // where it is, and where it tries to go
  int present_ = 0;
  Matrix secant_{};  // geometric stiffness, learnt from step to step
  bool secant_known_ = false;
  double residual_ = 0;
  int iterations_ = 0;
  bool creeping_ = false;
  long evaluations_ = 0;
};

}  // namespace sim
}  // namespace setae
