"""The true upper surface of solids, to hold a scan against."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from setae.arc import FloatArray
from setae.solids import Box, Ellipsoid, Prism, Ring, Solid

__all__ = ["height_mm"]


def height_mm(solids: Iterable[Solid], x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """How high the topmost solid is at some places, seen from above.

    Parameters
    ----------
    solids
        In the world; a tube is left out, it has no top.
    x_mm, y_mm
        Places, of one shape.

    Returns
    -------
    ndarray
        z of the world, of that shape; −∞ where there is nothing.

    Examples
    --------
    >>> box = Box(centre_mm=(0, 0, 5), edges_mm=(20, 10, 10), yaw_rad=0.0)
    >>> height_mm([box], np.array([0.0, 9.0, 11.0]), np.array([0.0, 4.0, 0.0]))
    array([ 10.,  10., -inf])
    """
    x_mm, y_mm = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(y_mm, float))
    highest = np.full(x_mm.shape, -np.inf)
    for solid in solids:
        highest = np.maximum(highest, _top_mm(solid, x_mm, y_mm))
    return highest


def _top_mm(solid: Solid, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    match solid:
        case Box():
            return _prism_mm(
                Prism(centre_mm=solid.centre_mm, edges_mm=solid.edges_mm, yaw_rad=solid.yaw_rad),
                x_mm,
                y_mm,
            )
        case Prism():
            return _prism_mm(solid, x_mm, y_mm)
        case Ring():
            x, y, z = solid.centre_mm
            beside = np.hypot(x_mm - x, y_mm - y) - solid.ring_radius_mm
            return _round_mm(z, solid.section_radius_mm, beside / solid.section_radius_mm)
        case Ellipsoid():
            along, across = _turned(solid.centre_mm, solid.yaw_rad, x_mm, y_mm)
            a, b, c = solid.semi_axes_mm
            return _round_mm(solid.centre_mm[2], c, np.hypot(along / a, across / b))
    return np.full(x_mm.shape, -np.inf)


def _round_mm(middle_mm: float, half_mm: float, part: FloatArray) -> FloatArray:
    """Top of something round, at a part (0 to 1) of its half width."""
    rise = np.sqrt(np.clip(1.0 - part**2, 0.0, None))
    return np.where(np.abs(part) <= 1.0, middle_mm + half_mm * rise, -np.inf)


def _prism_mm(solid: Prism, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    along, across = _turned(solid.centre_mm, solid.yaw_rad, x_mm, y_mm)
    corner = solid.corner_mm
    beyond_x = np.abs(along) - solid.edges_mm[0] / 2 + corner
    beyond_y = np.abs(across) - solid.edges_mm[1] / 2 + corner
    # Distance from the outline, negative inside.
    outside = (
        np.hypot(np.maximum(beyond_x, 0.0), np.maximum(beyond_y, 0.0))
        + np.minimum(np.maximum(beyond_x, beyond_y), 0.0)
        - corner
    )
    z, half = solid.centre_mm[2], solid.edges_mm[2] / 2
    top = np.where(outside <= 0.0, z + half, -np.inf)
    if solid.wall_mm > 0:
        top = np.where(outside < -solid.wall_mm, z - half + solid.wall_mm, top)
    return top


def _turned(
    centre_mm: tuple[float, float, float], yaw_rad: float, x_mm: FloatArray, y_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Places in a solid's own axes."""
    x, y = x_mm - centre_mm[0], y_mm - centre_mm[1]
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(cos * x + sin * y), np.asarray(-sin * x + cos * y)
