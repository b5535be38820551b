"""How near a scan is to the true surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from setae import extras
from setae.arc import FloatArray
from setae.heightmap import HeightMap
from setae.perception import maps
from setae.perception.surface import height_mm
from setae.solids import Solid

__all__ = ["EDGE_MM", "EDGE_STEP_MM", "Nearness", "away_from_edges", "nearness"]

EDGE_MM: Final = 5.0
EDGE_STEP_MM: Final = 3.0
"""A place is at an edge where the true surface within `EDGE_MM` of it, along x and y, differs by
this much or more: there the bristle may bend past what it should touch, or touch it from the side.
"""

_DENSE_MM = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearness:
    """A scan against the true surface.

    Attributes
    ----------
    height_rms_mm
        Root mean square of the map's less the true height, over places away from edges that have
        a height, touched or inferred; NaN where there is none.
    height_bias_mm
        Mean of the same differences.
    places
        How many those are.
    chamfer_mm
        Mean of the next two.
    to_surface_mm
        Mean distance in space of the map's points from the true upper surface.
    from_surface_mm
        Mean distance of the true surface, at the places of the scan, from the map's points.
    """

    height_rms_mm: float
    height_bias_mm: float
    places: int
    chamfer_mm: float
    to_surface_mm: float
    from_surface_mm: float


def away_from_edges(
    solids: Sequence[Solid], x_mm: FloatArray, y_mm: FloatArray
) -> NDArray[np.bool_]:
    """Say which places are not at an edge (`EDGE_STEP_MM`).

    Parameters
    ----------
    solids
        Table and object.
    x_mm, y_mm
        Places, of one shape.
    """
    beside_mm = np.linspace(-EDGE_MM, EDGE_MM, 5)
    around = np.stack([height_mm(solids, x_mm + a, y_mm + b) for a in beside_mm for b in beside_mm])
    return np.asarray(around.max(axis=0) - around.min(axis=0) < EDGE_STEP_MM)


def nearness(heights: HeightMap, solids: Sequence[Solid], *, reach_mm: float) -> Nearness:
    """Hold a scan against the true surface.

    Parameters
    ----------
    heights
        The scan.
    solids
        Table and object, in the world.
    reach_mm
        z of the world that the fully extended tip reaches: what lies deeper can't be felt, and
        doesn't count.

    Raises
    ------
    ExtraMissingError
        SciPy isn't installed.
    """
    tree = extras.load("scipy.spatial", "perception", "Measuring distances").cKDTree
    x, y = np.meshgrid(heights.x_mm, heights.y_mm)
    true = height_mm(solids, x, y)
    judged = np.isfinite(heights.height_mm) & away_from_edges(solids, x, y) & (true >= reach_mm)
    error = heights.height_mm[judged] - true[judged]
    points = maps.known(heights)
    there = true >= reach_mm
    at_places = np.stack([x[there], y[there], true[there]], axis=1)
    dense = _dense_mm(heights, solids, reach_mm)
    none = float("nan")
    to_surface = float(tree(dense).query(points)[0].mean()) if len(points) and len(dense) else none
    both = len(points) > 0 and len(at_places) > 0
    from_surface = float(tree(points).query(at_places)[0].mean()) if both else none
    return Nearness(
        height_rms_mm=float(np.sqrt((error**2).mean())) if len(error) else none,
        height_bias_mm=float(error.mean()) if len(error) else none,
        places=len(error),
        chamfer_mm=(to_surface + from_surface) / 2,
        to_surface_mm=to_surface,
        from_surface_mm=from_surface,
    )


def _dense_mm(heights: HeightMap, solids: Sequence[Solid], reach_mm: float) -> FloatArray:
    """Points of the true surface, a millimetre apart; a wall is filled from top to foot."""
    x, y = np.meshgrid(
        np.arange(heights.x_mm[0], heights.x_mm[-1] + _DENSE_MM / 2, _DENSE_MM),
        np.arange(heights.y_mm[0], heights.y_mm[-1] + _DENSE_MM / 2, _DENSE_MM),
    )
    z = height_mm(solids, x, y)
    beside = np.pad(z, 1, mode="edge")  # at the square's border nobody knows of a wall
    low = np.minimum.reduce(
        [z, beside[:-2, 1:-1], beside[2:, 1:-1], beside[1:-1, :-2], beside[1:-1, 2:]]
    )
    low = np.maximum(low, reach_mm)
    parts = []
    for down in np.arange(0.0, max(float((z - low).max()), 0.0) + _DENSE_MM, _DENSE_MM):
        some = (z - down >= low) & (z >= reach_mm)
        parts.append(np.stack([x[some], y[some], z[some] - down], axis=1))
    return np.concatenate(parts)
