#include "environment.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace setae {
namespace sim {
namespace {

constexpr int kFilamentPoints = 16;  // 3.5 mm apart on a filament of 53 mm
constexpr double kMarchMm = 0.25;    // thinner than any wall
constexpr int kHalvings = 20;

// Depth in both of two solids. Outside of both, the way to the edge where they meet.
double in_both(double a, double b) {
  return a < 0 && b < 0 ? -std::hypot(a, b) : std::min(a, b);
}

}  // namespace

void Environment::add_tube(const Vec3& axis_point_mm, double inner_radius_mm) {
  tubes_.push_back({axis_point_mm, inner_radius_mm});
}

void Environment::add_box(const Vec3& centre_mm, const Vec3& edges_mm, double yaw_rad) {
  add_prism(centre_mm, edges_mm, 0, 0, yaw_rad);
}

void Environment::add_prism(const Vec3& centre_mm, const Vec3& edges_mm, double corner_mm,
                            double wall_mm, double yaw_rad) {
  prisms_.push_back(
      {{centre_mm, std::cos(yaw_rad), std::sin(yaw_rad)}, 0.5 * edges_mm, corner_mm, wall_mm});
}

void Environment::add_ring(const Vec3& centre_mm, double ring_radius_mm, double section_radius_mm) {
  rings_.push_back({centre_mm, ring_radius_mm, section_radius_mm});
}

void Environment::add_ellipsoid(const Vec3& centre_mm, const Vec3& semi_axes_mm, double yaw_rad) {
  ellipsoids_.push_back({{centre_mm, std::cos(yaw_rad), std::sin(yaw_rad)}, semi_axes_mm});
}

Vec3 Environment::Frame::into(const Vec3& point) const {
  const Vec3 away = point - centre;
  return {cosine * away.x + sine * away.y, -sine * away.x + cosine * away.y, away.z};
}

double Environment::depth(const Prism& prism, const Vec3& point_mm) {
  const Vec3 p = prism.frame.into(point_mm);
  // Distance to the rounded rectangle, seen from above.
  const double x = std::fabs(p.x) - prism.half_edges.x + prism.corner;
  const double y = std::fabs(p.y) - prism.half_edges.y + prism.corner;
  const double beside =
      std::hypot(std::max(x, 0.0), std::max(y, 0.0)) + std::min(std::max(x, y), 0.0) - prism.corner;
  const double solid = in_both(-beside, prism.half_edges.z - std::fabs(p.z));
  if (prism.wall == 0)
    return solid;
  const double cavity = std::min(-beside - prism.wall, p.z + prism.half_edges.z - prism.wall);
  return in_both(solid, -cavity);
}

double Environment::depth(const Ring& ring, const Vec3& point_mm) {
  const Vec3 p = point_mm - ring.centre;
  return ring.section_radius - std::hypot(std::hypot(p.x, p.y) - ring.ring_radius, p.z);
}

double Environment::depth(const Ellipsoid& ellipsoid, const Vec3& point_mm) {
  const Vec3 p = ellipsoid.frame.into(point_mm);
  const Vec3& r = ellipsoid.semi_axes;
  const Vec3 scaled = {p.x / r.x, p.y / r.y, p.z / r.z};
  const double reach = norm(scaled);
  // Distance along the gradient, to first order; exact for a sphere.
  const double slope = norm({scaled.x / r.x, scaled.y / r.y, scaled.z / r.z});
  return slope == 0 ? std::min({r.x, r.y, r.z}) : reach * (1 - reach) / slope;
}

double Environment::depth_mm(const Vec3& point_mm) const {
  double deepest = -std::numeric_limits<double>::infinity();
  for (const Tube& tube : tubes_) {
    const Vec3 away = point_mm - tube.axis_point;
    deepest = std::max(deepest, std::hypot(away.x, away.y) - tube.radius);
  }
  for (const Prism& prism : prisms_)
    deepest = std::max(deepest, depth(prism, point_mm));
  for (const Ring& ring : rings_)
    deepest = std::max(deepest, depth(ring, point_mm));
  for (const Ellipsoid& ellipsoid : ellipsoids_)
    deepest = std::max(deepest, depth(ellipsoid, point_mm));
  return deepest;
}

double Environment::surface_mm(double x_mm, double y_mm, double bottom_mm, double top_mm) const {
  double z_mm = top_mm;
  while (z_mm >= bottom_mm) {
    const double depth = depth_mm({x_mm, y_mm, z_mm});
    if (depth > 0) {
      // The step before was outside: halve to the surface between.
      double outside_mm = std::min(z_mm + kMarchMm, top_mm);
      for (int i = 0; i < kHalvings; ++i) {
        const double middle_mm = 0.5 * (z_mm + outside_mm);
        (depth_mm({x_mm, y_mm, middle_mm}) > 0 ? z_mm : outside_mm) = middle_mm;
      }
      return z_mm;
    }
    z_mm -= kMarchMm;
  }
  return -std::numeric_limits<double>::infinity();
}

Contact Environment::deepest(const Vec3& root_mm, const Vec3& tip_mm) const {
  Contact contact = {0, {0, 0, 0}};
  for (int i = 0; i < kFilamentPoints; ++i) {
    const double along = static_cast<double>(i) / (kFilamentPoints - 1);
    const Vec3 point = root_mm + along * (tip_mm - root_mm);
    const double depth = depth_mm(point);
    if (depth > contact.depth_mm)
      contact = {depth, point};
  }
  return contact;
}

}  // namespace sim
}  // namespace setae
