#include "rod.h"

namespace setae {
namespace sim {
namespace {

enum Component { kBendX, kBendY, kTwist, kShearX, kShearY, kAxial, kComponents };

struct Mode {
  Component component;
  int order;
};

constexpr Mode kModeTable[kModes] = {
    {kBendX, 0},  {kBendX, 1},  {kBendX, 2},  {kBendY, 0},  {kBendY, 1}, {kBendY, 2}, {kTwist, 0},
    {kShearX, 0}, {kShearX, 1}, {kShearY, 0}, {kShearY, 1}, {kAxial, 0}, {kAxial, 1}};

double legendre(int order, double u) {  // on 0..1
  const double x = 2 * u - 1;
  switch (order) {
    case 0:
      return 1;
    case 1:
      return x;
    default:
      return 0.5 * (3 * x * x - 1);
  }
}

double component(const Strain& strain, Component which) {
  switch (which) {
    case kBendX:
      return strain.curvature.x;
    case kBendY:
      return strain.curvature.y;
    case kTwist:
      return strain.curvature.z;
    case kShearX:
      return strain.stretch.x;
    case kShearY:
      return strain.stretch.y;
    default:
      return strain.stretch.z;
  }
}

// Exponential of a twist in SE(3): an element of constant strain.
void exponential(const Vec3& turn, const Vec3& move, Mat3& rotation, Vec3& position) {
  const double angle2 = dot(turn, turn);
  double a, b, c;
  if (angle2 < 1e-4) {
    a = 1 - angle2 / 6 + angle2 * angle2 / 120;
    b = 0.5 - angle2 / 24 + angle2 * angle2 / 720;
    c = 1.0 / 6 - angle2 / 120 + angle2 * angle2 / 5040;
  } else {
    const double angle = std::sqrt(angle2);
    a = std::sin(angle) / angle;
    b = (1 - std::cos(angle)) / angle2;
    c = (1 - a) / angle2;
  }
  const double xx = turn.x * turn.x, yy = turn.y * turn.y, zz = turn.z * turn.z;
  const double xy = turn.x * turn.y, xz = turn.x * turn.z, yz = turn.y * turn.z;
  rotation.ex = {1 - b * (yy + zz), a * turn.z + b * xy, -a * turn.y + b * xz};
  rotation.ey = {-a * turn.z + b * xy, 1 - b * (xx + zz), a * turn.x + b * yz};
  rotation.ez = {a * turn.y + b * xz, -a * turn.x + b * yz, 1 - b * (xx + yy)};
  const Vec3 once = cross(turn, move);
  position = move + b * once + c * cross(turn, once);
}

}  // namespace

Rod::Rod(const Rigidity& rigidity, double length_mm)
    : length_mm_(length_mm), element_mm_(length_mm / kElements) {
  const double stiffness[kComponents] = {rigidity.bending_x_nmm2, rigidity.bending_y_nmm2,
                                         rigidity.torsion_nmm2,   rigidity.shear_n,
                                         rigidity.shear_n,        rigidity.axial_n};
  for (int m = 0; m < kModes; ++m) {
    for (int e = 0; e < kElements; ++e) {
      basis_[e][m] = legendre(kModeTable[m].order, (e + 0.5) / kElements);
    }
    // Sampled at the midpoints the polynomials are not quite orthogonal: make
    // them so, then the elastic energy needs no matrix.
    for (int k = 0; k < m; ++k) {
      if (kModeTable[k].component != kModeTable[m].component)
        continue;
      double overlap = 0, square = 0;
      for (int e = 0; e < kElements; ++e) {
        overlap += basis_[e][m] * basis_[e][k];
        square += basis_[e][k] * basis_[e][k];
      }
      for (int e = 0; e < kElements; ++e)
        basis_[e][m] -= overlap / square * basis_[e][k];
    }
    double square = 0;
    for (int e = 0; e < kElements; ++e)
      square += basis_[e][m] * basis_[e][m];
    const double scale = 1 / std::sqrt(square * element_mm_ * stiffness[kModeTable[m].component]);
    for (int e = 0; e < kElements; ++e)
      basis_[e][m] *= scale;
  }
}

void Rod::shape(const Modes& modes, Shape& out) const {
  out.position[0] = {0, 0, 0};
  out.rotation[0] = identity();
  for (int e = 0; e < kElements; ++e) {
    double strain[kComponents] = {0, 0, 0, 0, 0, 1};
    for (int m = 0; m < kModes; ++m) {
      strain[kModeTable[m].component] += basis_[e][m] * modes[m];
    }
    out.strain[e] = {{strain[kBendX], strain[kBendY], strain[kTwist]},
                     {strain[kShearX], strain[kShearY], strain[kAxial]}};
    exponential(element_mm_ * out.strain[e].curvature, element_mm_ * out.strain[e].stretch,
                out.step_rotation[e], out.step_position[e]);
    out.position[e + 1] = out.position[e] + out.rotation[e] * out.step_position[e];
    out.rotation[e + 1] = out.rotation[e] * out.step_rotation[e];
  }
}

void Rod::pull_back(const Shape& shape, const std::array<Wrench, kStations>& wrenches,
                    Modes& gradient) const {
  Wrench load = wrenches[kElements];  // all beyond this station, in its frame
  for (int e = kElements - 1; e >= 0; --e) {
    // Transposed right Jacobian of the exponential, as a series in ad: at 0.3 rad
    // an element what is cut off is below 1e-7.
    const Vec3 turn = element_mm_ * shape.strain[e].curvature;
    const Vec3 move = element_mm_ * shape.strain[e].stretch;
    Wrench term = load;
    Wrench sum = load;
    double factor = 1;
    for (int k = 1; k <= 5; ++k) {
      term = {cross(term.moment, turn) + cross(term.force, move), cross(term.force, turn)};
      factor /= -(k + 1);
      sum.moment = sum.moment + factor * term.moment;
      sum.force = sum.force + factor * term.force;
    }
    pull_back_strain(e, {element_mm_ * sum.moment, element_mm_ * sum.force}, gradient);
    const Vec3 force = shape.step_rotation[e] * load.force;
    load.moment = wrenches[e].moment + shape.step_rotation[e] * load.moment +
                  cross(shape.step_position[e], force);
    load.force = wrenches[e].force + force;
  }
}

void Rod::pull_back_strain(int element, const Strain& derivative, Modes& gradient) const {
  for (int m = 0; m < kModes; ++m) {
    gradient[m] += basis_[element][m] * component(derivative, kModeTable[m].component);
  }
}

Vec3 Rod::midpoint(const Shape& shape, int element) const {
  Mat3 rotation;
  Vec3 position;
  exponential(0.5 * element_mm_ * shape.strain[element].curvature,
              0.5 * element_mm_ * shape.strain[element].stretch, rotation, position);
  return shape.position[element] + shape.rotation[element] * position;
}

Modes Rod::compressed(double length_mm) const {
  Modes modes{};
  for (int m = 0; m < kModes; ++m) {
    if (kModeTable[m].component == kAxial && kModeTable[m].order == 0) {
      modes[m] = (length_mm / length_mm_ - 1) / basis_[0][m];
    }
  }
  return modes;
}

}  // namespace sim
}  // namespace setae
