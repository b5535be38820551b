// The bristle's filament: a short elastic rod whose root is bonded into a softer gel.
#pragma once

#include <array>

#include "environment.h"
#include "geometry.h"

namespace setae {
namespace sim {

struct FilamentSettings {
  double length_mm;
  double diameter_mm;
  double modulus_n_per_mm2;
  double bow_mm;  // how far the middle is off the axis at rest
  double bow_rad;
  double gel_stiffness_n_per_mm;     // along the filament
  double gel_rotation_n_mm_per_rad;  // of its root
  double friction;                   // on solids
  double settling_s;                 // how fast it swings back; it has no inertia
};

// A chain of straight links with springs between: enough for bending, buckling and
// sliding. Always near the least energy, with damping in the place of inertia.
class Filament {
 public:
  explicit Filament(const FilamentSettings& settings);

  // Straight and at rest, its root there; axes.ez points along it. All in the world.
  void place(const Vec3& root_mm, const Mat3& axes);
  // The root has moved there on a line.
  void step(double duration_s, const Vec3& root_mm, const Mat3& axes,
            const Environment& environment);

  double push_n() const;       // along the axis, on the gel
  double moment_n_mm() const;  // at the root
  const Vec3& tip_mm() const { return tip_mm_; }
  bool bent() const { return bent_; }

 private:
  static constexpr int kLinks = 4;
  static constexpr int kPointsEach = 4;
  static constexpr int kPoints = kLinks * kPointsEach;
  static constexpr int kUnknowns = 2 * kLinks + 1;

  // Of each link, the turn from the root's axis as a vector across it; last how far
  // the root is pushed into the gel, in link lengths.
  using Unknowns = std::array<double, kUnknowns>;

  struct Link {
    Vec3 along;
    Vec3 by[2];  // its derivatives
  };
  struct Point {
    Vec3 at;
    double overlap_mm;  // with a solid, if positive: and then
    Vec3 inwards;       // to where it is deeper
    Vec3 slid_mm;       // along the surface, from the anchor
  };
  struct State {
    Unknowns unknowns;
    std::array<Link, kLinks> links;
    std::array<Point, kPoints> points;
  };
  // Where a point that touches would be without elastic slip.
  struct Anchor {
    bool holds;
    Vec3 at;
    double grip_n;  // the most that friction holds
  };
  struct System;

  Vec3 point(const State& state, int link, double along_mm) const;
  void measure(const Unknowns& unknowns, const Environment& environment, State& state) const;
  double energy(const State& state) const;
  void assemble(const State& state, System& system) const;
  void add_contact(const State& state, int index, System& system) const;
  void add_springs(const Unknowns& from, const Unknowns& to, double scale, System& system) const;
  double spring_energy(const Unknowns& from, const Unknowns& to) const;
  void solve(double duration_s, const Environment& environment);
  void grip();
  void slide();
  bool clear(const Vec3& root_mm, const Mat3& axes, const Environment& environment) const;
  double along_mm(int point) const;

  FilamentSettings settings_;
  double link_mm_;
  double joint_n_mm_, root_joint_n_mm_, gel_n_mm_;  // per rad, the gel per link length
  double contact_n_per_mm_;
  Unknowns rest_{};
  Vec3 root_mm_{};
  Mat3 axes_ = identity();
  Unknowns start_{};    // of the step
  double damping_ = 0;  // relative to the springs
  State state_{};
  std::array<Anchor, kPoints> anchors_{};
  Vec3 tip_mm_{};
  bool bent_ = false;
};

}  // namespace sim
}  // namespace setae
