"""Puts the host's solids into a simulated world."""

from __future__ import annotations

from setae.sim.world import World
from setae.solids import Box, Ellipsoid, Prism, Ring, Solid, Tube

__all__ = ["add_solid"]


def add_solid(world: World, solid: Solid) -> None:
    """Add a solid, before the world's start."""
    match solid:
        case Tube():
            world.add_tube(solid.axis_mm, solid.inner_radius_mm)
        case Box():
            world.add_box(solid.centre_mm, solid.edges_mm, solid.yaw_rad)
        case Prism():
            world.add_prism(
                solid.centre_mm,
                solid.edges_mm,
                corner_mm=solid.corner_mm,
                wall_mm=solid.wall_mm,
                yaw_rad=solid.yaw_rad,
            )
        case Ring():
            world.add_ring(solid.centre_mm, solid.ring_radius_mm, solid.section_radius_mm)
        case Ellipsoid():
            world.add_ellipsoid(solid.centre_mm, solid.semi_axes_mm, solid.yaw_rad)
