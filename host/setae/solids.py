"""Solids in the world that a bristle can touch; z points up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A vertical tube; its wall is all beyond the inner radius."""

    axis_mm: Point
    inner_radius_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An upright box, turned by yaw about z."""

    centre_mm: Point
    edges_mm: Point
    yaw_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Prism:
    """An upright prism with rounded upright edges, turned by yaw about z.

    Attributes
    ----------
    corner_mm
        Radius of the four upright edges.
    wall_mm
        Above 0: open at the top, its walls and bottom this thick.
    """

    centre_mm: Point
    edges_mm: Point
    corner_mm: float = 0.0
    wall_mm: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """A lying ring of round section."""

    centre_mm: Point
    ring_radius_mm: float
    section_radius_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """An upright ellipsoid, turned by yaw about z."""

    centre_mm: Point
    semi_axes_mm: Point
    yaw_rad: float = 0.0


Solid: TypeAlias = Tube | Box | Prism | Ring | Ellipsoid
