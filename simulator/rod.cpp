#include "rod.h"

namespace setae {
namespace sim {
namespace {

enum Component { kBendX, kBendY, kTwist, kShearX, kShearY, kAxial };

constexpr int kOrders[kComponents] = {4, 4, 2, 4, 4, 3};

double legendre(int order, double u) {  // on 0..1
  const double x = 2 * u - 1;
  double before = 1, value = order > 0 ? x : 1;
  for (int n = 2; n <= order; ++n) {
    const double next = ((2 * n - 1) * x * value - (n - 1) * before) / n;
    before = value;
    value = next;
  }
  return value;
}

// Exponential of a twist in SE(3): an element of constant strain.
void exponential(const Vec3& turn, const Vec3& move, Mat3& rotation, Vec3& position,
                 Turning& turning) {
  const double angle2 = dot(turn, turn);
  double a, b, c, b_slope, c_slope;  // slopes by the angle's square
  if (angle2 < 1e-4) {
    a = 1 - angle2 / 6 + angle2 * angle2 / 120;
    b = 0.5 - angle2 / 24 + angle2 * angle2 / 720;
    c = 1.0 / 6 - angle2 / 120 + angle2 * angle2 / 5040;
    b_slope = -1.0 / 24 + angle2 / 360;
    c_slope = -1.0 / 120 + angle2 / 2520;
  } else {
    const double angle = std::sqrt(angle2);
    const double cosine = std::cos(angle);
    a = std::sin(angle) / angle;
    b = (1 - cosine) / angle2;
    c = (1 - a) / angle2;
    b_slope = (0.5 * a - b) / angle2;
    c_slope = (0.5 * (a - cosine) / angle2 - c) / angle2;
  }
  const double along = 2 * dot(turn, move);
  turning = {b, c, along * b_slope, along * c_slope};
  const double xx = turn.x * turn.x, yy = turn.y * turn.y, zz = turn.z * turn.z;
  const double xy = turn.x * turn.y, xz = turn.x * turn.z, yz = turn.y * turn.z;
  rotation.ex = {1 - b * (yy + zz), a * turn.z + b * xy, -a * turn.y + b * xz};
  rotation.ey = {-a * turn.z + b * xy, 1 - b * (xx + zz), a * turn.x + b * yz};
  rotation.ez = {a * turn.y + b * xz, -a * turn.x + b * yz, 1 - b * (xx + yy)};
  const Vec3 once = cross(turn, move);
  position = move + b * once + c * cross(turn, once);
}

}  // namespace

Rod::Rod(const Rigidity& rigidity, double length_mm, int elements, int extra_modes)
    : length_mm_(length_mm),
      elements_(elements),
      element_mm_(length_mm / elements),
      cosine_(std::cos(rigidity.axis_rad)),
      sine_(std::sin(rigidity.axis_rad)),
      table_{},
      basis_{} {
  const double stiffness[kComponents] = {rigidity.bending_x_nmm2, rigidity.bending_y_nmm2,
                                         rigidity.torsion_nmm2,   rigidity.shear_n,
                                         rigidity.shear_n,        rigidity.axial_n};
  for (int c = 0; c < kComponents; ++c) {
    for (int order = 0; order < kOrders[c] + extra_modes; ++order)
      table_[modes_++] = {c, order};
  }
  double weight[kMaxElements];
  for (int e = 0; e < elements_; ++e)
    weight[e] = 1 + rigidity.gradient * (2 * (e + 0.5) / elements_ - 1);
  weight_0_ = weight[0];
  double basis[kMaxModes][kMaxElements];
  for (int m = 0; m < modes_; ++m) {
    for (int e = 0; e < elements_; ++e) {
      // Forces and moments change little along the rod, strains as the stiffness does.
      basis[m][e] = legendre(table_[m].order, (e + 0.5) / elements_) / weight[e];
    }
    // Sampled at the midpoints, and weighted by the stiffness there, these are not
    // orthogonal: make them so, then the elastic energy needs no matrix.
    for (int k = 0; k < m; ++k) {
      if (table_[k].component != table_[m].component)
        continue;
      double overlap = 0, square = 0;
      for (int e = 0; e < elements_; ++e) {
        overlap += weight[e] * basis[m][e] * basis[k][e];
        square += weight[e] * basis[k][e] * basis[k][e];
      }
      for (int e = 0; e < elements_; ++e)
        basis[m][e] -= overlap / square * basis[k][e];
    }
    double square = 0;
    for (int e = 0; e < elements_; ++e)
      square += weight[e] * basis[m][e] * basis[m][e];
    const double scale = 1 / std::sqrt(square * element_mm_ * stiffness[table_[m].component]);
    for (int e = 0; e < elements_; ++e)
      basis_[e][table_[m].order][table_[m].component] = scale * basis[m][e];
  }
}

void Rod::shape(const Modes& modes, Shape& out) const {
  Grid grid = {};
  for (int m = 0; m < modes_; ++m)
    grid[table_[m].order][table_[m].component] = modes[m];
  out.elements = elements_;
  out.position[0] = {0, 0, 0};
  out.rotation[0] = identity();
  for (int e = 0; e < elements_; ++e) {
    double strain[kComponents] = {0, 0, 0, 0, 0, 1};
    for (int order = 0; order < kMaxOrders; ++order) {
      for (int c = 0; c < kComponents; ++c)
        strain[c] += basis_[e][order][c] * grid[order][c];
    }
    out.strain[e] = {{cosine_ * strain[kBendX] - sine_ * strain[kBendY],
                      sine_ * strain[kBendX] + cosine_ * strain[kBendY], strain[kTwist]},
                     {strain[kShearX], strain[kShearY], strain[kAxial]}};
    exponential(element_mm_ * out.strain[e].curvature, element_mm_ * out.strain[e].stretch,
                out.step_rotation[e], out.step_position[e], out.turning[e]);
    out.position[e + 1] = out.position[e] + out.rotation[e] * out.step_position[e];
    out.rotation[e + 1] = out.rotation[e] * out.step_rotation[e];
  }
}

inline void Rod::add_strain(int element, const Strain& derivative, Grid& sum) const {
  const Vec3& bend = derivative.curvature;
  const double by_component[kComponents] = {cosine_ * bend.x + sine_ * bend.y,
                                            -sine_ * bend.x + cosine_ * bend.y,
                                            bend.z,
                                            derivative.stretch.x,
                                            derivative.stretch.y,
                                            derivative.stretch.z};
  for (int order = 0; order < kMaxOrders; ++order) {
    for (int c = 0; c < kComponents; ++c)
      sum[order][c] += basis_[element][order][c] * by_component[c];
  }
}

void Rod::pull_back(const Shape& shape, const Wrenches& wrenches, Modes& gradient) const {
  Grid sum = {};
  Wrench load = wrenches[elements_];  // all beyond this station, in its frame
  for (int e = elements_ - 1; e >= 0; --e) {
    // Transposed right Jacobian of the exponential. Of a turn alone it is
    // 1 + b [turn] + c [turn]^2; the force's part of the moment is its derivative along
    // the element's stretch.
    const Vec3 turn = element_mm_ * shape.strain[e].curvature;
    const Vec3 move = element_mm_ * shape.strain[e].stretch;
    const Turning& k = shape.turning[e];
    const Vec3 once = cross(turn, load.force);
    const Vec3 mixed = cross(turn, load.moment) + cross(move, load.force);
    const Vec3 by_force = k.b * load.force + k.c * once;
    const Vec3 by_moment =
        k.b * load.moment + k.c * mixed + k.b_along * load.force + k.c_along * once;
    const Vec3 moment = load.moment + cross(turn, by_moment) + cross(move, by_force);
    const Vec3 along = load.force + cross(turn, by_force);
    add_strain(e, {element_mm_ * moment, element_mm_ * along}, sum);
    const Vec3 force = shape.step_rotation[e] * load.force;
    load.moment = wrenches[e].moment + shape.step_rotation[e] * load.moment +
                  cross(shape.step_position[e], force);
    load.force = wrenches[e].force + force;
  }
  add_grid(sum, gradient);
}

void Rod::pull_back_strain(int element, const Strain& derivative, Modes& gradient) const {
  Grid sum = {};
  add_strain(element, derivative, sum);
  add_grid(sum, gradient);
}

void Rod::add_grid(const Grid& sum, Modes& gradient) const {
  for (int m = 0; m < modes_; ++m)
    gradient[m] += sum[table_[m].order][table_[m].component];
}

Vec3 Rod::midpoint(const Shape& shape, int element) const {
  Mat3 rotation;
  Vec3 position;
  Turning turning;
  exponential(0.5 * element_mm_ * shape.strain[element].curvature,
              0.5 * element_mm_ * shape.strain[element].stretch, rotation, position, turning);
  return shape.position[element] + shape.rotation[element] * position;
}

Modes Rod::compressed(double length_mm, const Aside& aside) const {
  // The lowest mode of each strain is the same all along, over the stiffness.
  const double wanted[kComponents] = {
      aside.bend_x_rad / length_mm_, aside.bend_y_rad / length_mm_, 0,
      aside.shift_x_mm / length_mm_, aside.shift_y_mm / length_mm_, length_mm / length_mm_ - 1};
  Modes modes{};
  for (int m = 0; m < modes_; ++m) {
    if (table_[m].order == 0)
      modes[m] = wanted[table_[m].component] / (basis_[0][0][table_[m].component] * weight_0_);
  }
  return modes;
}

}  // namespace sim
}  // namespace setae
