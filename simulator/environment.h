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
  // An upright prism, its four upright edges rounded. With a wall it is open at the top, and as
  // thick everywhere.
  void add_prism(const Vec3& centre_mm, const Vec3& edges_mm, double corner_mm, double wall_mm,
                 double yaw_rad);
  // A lying ring of round section.
  void add_ring(const Vec3& centre_mm, double ring_radius_mm, double section_radius_mm);
  void add_ellipsoid(const Vec3& centre_mm, const Vec3& semi_axes_mm, double yaw_rad);

  // How deep a point is in any solid; at most 0 outside.
  double depth_mm(const Vec3& point_mm) const;
  // Height of the topmost surface under and over a point of the plane; -infinity where
  // nothing is from `top_mm` down to `bottom_mm`.
  double surface_mm(double x_mm, double y_mm, double bottom_mm, double top_mm) const;
  // The deepest point of a straight filament.
  Contact deepest(const Vec3& root_mm, const Vec3& tip_mm) const;

 private:
  struct Tube {
    Vec3 axis_point;
    double radius;
  };
  // Upright, turned by yaw.
  struct Frame {
    Vec3 centre;
    double cosine, sine;
    Vec3 into(const Vec3& point) const;
  };
  struct Prism {
    Frame frame;
    Vec3 half_edges;
    double corner, wall;
  };
  struct Ring {
    Vec3 centre;
    double ring_radius, section_radius;
  };
  struct Ellipsoid {
    Frame frame;
    Vec3 semi_axes;
  };
  static double depth(const Prism& prism, const Vec3& point_mm);
  static double depth(const Ring& ring, const Vec3& point_mm);
  static double depth(const Ellipsoid& ellipsoid, const Vec3& point_mm);

  std::vector<Tube> tubes_;
  std::vector<Prism> prisms_;
  std::vector<Ring> rings_;
  std::vector<Ellipsoid> ellipsoids_;
};

}  // namespace sim
}  // namespace setae
