// The spring as a rod: six strains along its reference length, each a sum of a
// few Legendre polynomials, and the shape that follows from them (geometric
// variable strain). Nothing here assumes constant curvature.
#pragma once

#include <array>

#include "geometry.h"

namespace setae {
namespace sim {

// As many as there can be, and usually are. With tendons along the wall of the bore 10 are
// off by 0.06 mm from the strong form, 20 by 0.01.
constexpr int kMaxElements = 20;
constexpr int kMaxStations = kMaxElements + 1;
// Curvature x and y four each, torsion two, shear four each, axial three: the tip is
// within 0.05 mm of the rod's strong form, all over the workspace nearly. `extra_modes`
// adds one to each, which a stiffness that changes along the rod needs. A robot
// that is symmetric needs only 13 of these; one of uneven stiffness that carries a
// load bends in an S, and with 13 its tip is off by 0.5 mm.
constexpr int kComponents = 6;
constexpr int kPlainModes = 21;
constexpr int kMaxModes = kPlainModes + kComponents;
constexpr int kMaxOrders = 5;  // of a component's

// Amplitudes scaled so that the elastic energy is half their sum of squares
// (unit: root of N mm). This makes the plant's Hessian well conditioned.
// Those that a rod does not use are zero.
using Modes = std::array<double, kMaxModes>;

// Stiffness per strain of the homogenised helix, in the middle of its length.
struct Rigidity {
  double bending_x_nmm2;
  double bending_y_nmm2;
  double torsion_nmm2;
  double shear_n;
  double axial_n;
  double axis_rad;  // from x to the axis that bending_x belongs to
  double gradient;  // how much stiffer the top is than the middle, relative
};

struct Strain {
  Vec3 curvature;  // rad per mm of reference length
  Vec3 stretch;    // (0, 0, 1) is unstrained
};

struct Wrench {
  Vec3 moment;
  Vec3 force;
};

// Of an element's exponential: what its derivative needs.
struct Turning {
  double b, c;              // (1 - cos)/angle^2 and (angle - sin)/angle^3
  double b_along, c_along;  // their derivatives along the element's stretch
};

struct Shape {
  int elements;
  std::array<Vec3, kMaxStations> position;
  std::array<Mat3, kMaxStations> rotation;
  std::array<Strain, kMaxElements> strain;
  std::array<Vec3, kMaxElements> step_position;  // element's end in its start's frame
  std::array<Mat3, kMaxElements> step_rotation;
  std::array<Turning, kMaxElements> turning;
};

// Away from straight: bent about x and y, and sheared along them.
struct Aside {
  double bend_x_rad, bend_y_rad, shift_x_mm, shift_y_mm;
};

using Wrenches = std::array<Wrench, kMaxStations>;

class Rod {
 public:
  // 10 or 20 elements, 0 or 1 extra mode of each strain.
  Rod(const Rigidity& rigidity, double length_mm, int elements, int extra_modes);

  int elements() const { return elements_; }
  int modes() const { return modes_; }

  void shape(const Modes& modes, Shape& out) const;

  // Adds to `gradient` what the wrenches on the stations (each in its station's
  // own frame) do on a change of each mode: the transposed Jacobian, without
  // ever forming it.
  void pull_back(const Shape& shape, const Wrenches& wrenches, Modes& gradient) const;

  // Adds what derivatives by the strains of element `element` do on each mode.
  void pull_back_strain(int element, const Strain& derivative, Modes& gradient) const;

  // A point halfway along element `element`.
  Vec3 midpoint(const Shape& shape, int element) const;

  double element_mm() const { return element_mm_; }
  // Start value: uniformly compressed to `length_mm`, and put aside.
  Modes compressed(double length_mm, const Aside& aside) const;

 private:
  using Grid = double[kMaxOrders][kComponents];
  void add_strain(int element, const Strain& derivative, Grid& sum) const;
  void add_grid(const Grid& sum, Modes& gradient) const;

  struct Mode {
    int component;
    int order;
  };

  double length_mm_;
  int elements_;
  int modes_ = 0;
  double element_mm_;
  double cosine_, sine_;  // of the stiffer axis
  double weight_0_ = 1;   // stiffness of the first element, relative to the middle
  Mode table_[kMaxModes];
  // By element, order and component, zero where there is no such mode: loops over these
  // have no end to look up.
  double basis_[kMaxElements][kMaxOrders][kComponents];
};

}  // namespace sim
}  // namespace setae
