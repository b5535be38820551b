// The C interface to the solids of a world.
#include <algorithm>

#include "c_world.h"

using setae::sim::fail;
using setae::sim::finite;
using setae::sim::guarded;
using setae::sim::kBadArgument;
using setae::sim::kStarted;
using setae::sim::kWrongTime;
using setae::sim::positive;
using setae::sim::read;
using setae::sim::Vec3;

SETAE_EXPORT int setae_world_add_tube(setae_world* world, const double axis_point_mm[3],
                                      double inner_radius_mm) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 axis_point;
  if (!read(axis_point_mm, axis_point)) {
    return fail(world, kBadArgument, "the tube's axis_point_mm must be three finite numbers");
  }
  if (!positive(inner_radius_mm)) {
    return fail(world, kBadArgument, "the tube's inner_radius_mm must be positive");
  }
  return guarded(world, [&] {
    world->environment.add_tube(axis_point, inner_radius_mm);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_box(setae_world* world, const double centre_mm[3],
                                     const double edges_mm[3], double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, edges;
  if (!read(centre_mm, centre)) {
    return fail(world, kBadArgument, "the box's centre_mm must be three finite numbers");
  }
  if (!read(edges_mm, edges) || edges.x <= 0 || edges.y <= 0 || edges.z <= 0) {
    return fail(world, kBadArgument, "the box's edges_mm must be three positive numbers");
  }
  if (!std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the box's yaw_rad must be finite");
  }
  return guarded(world, [&] {
    world->environment.add_box(centre, edges, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_prism(setae_world* world, const double centre_mm[3],
                                       const double edges_mm[3], double corner_mm, double wall_mm,
                                       double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, edges;
  if (!read(centre_mm, centre) || !std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the prism's centre_mm and yaw_rad must be finite");
  }
  if (!read(edges_mm, edges) || edges.x <= 0 || edges.y <= 0 || edges.z <= 0) {
    return fail(world, kBadArgument, "the prism's edges_mm must be three positive numbers");
  }
  const double half_mm = 0.5 * std::min(edges.x, edges.y);
  if (!(corner_mm >= 0 && corner_mm <= half_mm)) {
    return fail(world, kBadArgument, "the prism's corner_mm must be from 0 to half its edges");
  }
  if (!(wall_mm >= 0 && wall_mm < half_mm && wall_mm < edges.z)) {
    return fail(world, kBadArgument, "the prism's wall_mm must leave it hollow, or be 0");
  }
  return guarded(world, [&] {
    world->environment.add_prism(centre, edges, corner_mm, wall_mm, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_ring(setae_world* world, const double centre_mm[3],
                                      double ring_radius_mm, double section_radius_mm) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre;
  if (!read(centre_mm, centre)) {
    return fail(world, kBadArgument, "the ring's centre_mm must be three finite numbers");
  }
  if (!positive(ring_radius_mm) || !positive(section_radius_mm)) {
    return fail(world, kBadArgument, "the ring's radii must be positive");
  }
  return guarded(world, [&] {
    world->environment.add_ring(centre, ring_radius_mm, section_radius_mm);
    return 0;
  });
}

SETAE_EXPORT int setae_world_add_ellipsoid(setae_world* world, const double centre_mm[3],
                                           const double semi_axes_mm[3], double yaw_rad) {
  if (world->world)
    return fail(world, kWrongTime, kStarted);
  Vec3 centre, semi_axes;
  if (!read(centre_mm, centre) || !std::isfinite(yaw_rad)) {
    return fail(world, kBadArgument, "the ellipsoid's centre_mm and yaw_rad must be finite");
  }
  if (!read(semi_axes_mm, semi_axes) || semi_axes.x <= 0 || semi_axes.y <= 0 || semi_axes.z <= 0) {
    return fail(world, kBadArgument, "the ellipsoid's semi_axes_mm must be three positive numbers");
  }
  return guarded(world, [&] {
    world->environment.add_ellipsoid(centre, semi_axes, yaw_rad);
    return 0;
  });
}

SETAE_EXPORT int setae_world_surface(setae_world* world, double x_mm, double y_mm, double bottom_mm,
                                     double top_mm, double* z_mm) {
  if (!std::isfinite(x_mm) || !std::isfinite(y_mm) || !std::isfinite(bottom_mm) ||
      !std::isfinite(top_mm)) {
    return fail(world, kBadArgument, "the place and the two heights must be finite");
  }
  *z_mm = world->environment.surface_mm(x_mm, y_mm, bottom_mm, top_mm);
  return 0;
}
