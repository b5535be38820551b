// The spring as a rod: six strains along its reference length, each a sum of a
// few Legendre polynomials, and the shape that follows from them (geometric
// variable strain). Nothing here assumes constant curvature.
#pragma once

#include <array>

#include "geometry.h"

namespace setae {
namespace sim {

constexpr int kElements = 10;
constexpr int kStations = kElements + 1;
// Curvature x and y three each, torsion one, shear and axial two each: the tip is
// within 0.01 mm of the rod's strong form. With one of shear it is within 0.1 mm,
// and tensions are off by 0.3 N.
constexpr int kModes = 13;

// Amplitudes scaled so that the elastic energy is half their sum of squares
// (unit: root of N mm). This makes the plant's Hessian well conditioned.
using Modes = std::array<double, kModes>;

// Stiffness per strain of the homogenised helix.
struct Rigidity {
  double bending_x_nmm2;
  double bending_y_nmm2;
  double torsion_nmm2;
  double shear_n;
  double axial_n;
};

struct Strain {
  Vec3 curvature;  // rad per mm of reference length
  Vec3 stretch;    // (0, 0, 1) is unstrained
};

struct Wrench {
  Vec3 moment;
  Vec3 force;
};

struct Shape {
  std::array<Vec3, kStations> position;
  std::array<Mat3, kStations> rotation;
  std::array<Strain, kElements> strain;
  std::array<Vec3, kElements> step_position;  // element's end in its start's frame
  std::array<Mat3, kElements> step_rotation;
};

class Rod {
 public:
  Rod(const Rigidity& rigidity, double length_mm);

  void shape(const Modes& modes, Shape& out) const;

  // Adds to `gradient` what the wrenches on the stations (each in its station's
  // own frame) do on a change of each mode: the transposed Jacobian, without
  // ever forming it.
  void pull_back(const Shape& shape, const std::array<Wrench, kStations>& wrenches,
                 Modes& gradient) const;

  // Adds what derivatives by the strains of element `element` do on each mode.
  void pull_back_strain(int element, const Strain& derivative, Modes& gradient) const;

  // A point halfway along element `element`.
  Vec3 midpoint(const Shape& shape, int element) const;

  double element_mm() const { return element_mm_; }
  // Start value: uniformly compressed to `length_mm`.
  Modes compressed(double length_mm) const;

 private:
  double length_mm_;
  double element_mm_;
  double basis_[kElements][kModes];
};

}  // namespace sim
}  // namespace setae
