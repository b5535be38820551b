// The solids that the bristle can touch.
#pragma once

#include <vector>

#include "geometry.h"

namespace setae {
namespace sim {

struct Contact {
  double depth_mm;  // 0 where nothing is touched
  Vec3 point_mm;
};

class Environment {
 public:
  // A vertical tube; its wall is all that is outside the inner radius.
  void add_tube(const Vec3& axis_point_mm, double inner_radius_mm);
  void add_box(const Vec3& centre_mm, const Vec3& edges_mm, double yaw_rad);

  // How deep a point is in any solid; at most 0 outside.
  double depth_mm(const Vec3& point_mm) const;
  // The deepest point of a straight filament.
  Contact deepest(const Vec3& root_mm, const Vec3& tip_mm) const;

 private:
  struct Tube {
    Vec3 axis_point;
    double radius;
  };
  struct Box {
    Vec3 centre, half_edges;
    double cosine, sine;
  };
  std::vector<Tube> tubes_;
  std::vector<Box> boxes_;
};

}  // namespace sim
}  // namespace setae
