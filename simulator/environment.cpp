#include "environment.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace setae {
namespace sim {
namespace {

constexpr int kFilamentPoints = 16;  // 3.5 mm apart on a filament of 53 mm

}  // namespace

void Environment::add_tube(const Vec3& axis_point_mm, double inner_radius_mm) {
  tubes_.push_back({axis_point_mm, inner_radius_mm});
}

void Environment::add_box(const Vec3& centre_mm, const Vec3& edges_mm, double yaw_rad) {
  boxes_.push_back({centre_mm, 0.5 * edges_mm, std::cos(yaw_rad), std::sin(yaw_rad)});
}

double Environment::depth_mm(const Vec3& point_mm) const {
  double deepest = -std::numeric_limits<double>::infinity();
  for (const Tube& tube : tubes_) {
    const Vec3 away = point_mm - tube.axis_point;
    deepest = std::max(deepest, std::hypot(away.x, away.y) - tube.radius);
  }
  for (const Box& box : boxes_) {
    const Vec3 away = point_mm - box.centre;
    const double x = box.cosine * away.x + box.sine * away.y;
    const double y = -box.sine * away.x + box.cosine * away.y;
    deepest = std::max(deepest,
                       std::min({box.half_edges.x - std::fabs(x), box.half_edges.y - std::fabs(y),
                                 box.half_edges.z - std::fabs(away.z)}));
  }
  return deepest;
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
