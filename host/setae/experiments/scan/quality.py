"""How near a scan of a simulated scene came to its true surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from setae.experiments.scan.run import ScanResult
from setae.heightmap import HeightMap
from setae.perception.measures import EDGE_MM, EDGE_STEP_MM
from setae.record import Log

__all__ = ["Quality", "Surface", "agreement", "quality", "surface_of"]

# Less than that above the extended tip is not felt for certain.
_GRAZED_MM: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """The true surface of a simulated scene.

    Attributes
    ----------
    step_mm
        Of its grid, which begins at the scan's first place.
    height_mm
        In the world, (R, C): rows along y, columns along x.
    """

    step_mm: float
    height_mm: NDArray[np.float64]

    def at(self, grid: HeightMap) -> NDArray[np.float64]:
        """Height at the places of a map, (R, C)."""
        rows, columns = self._indices(grid)
        found: NDArray[np.float64] = self.height_mm[np.ix_(rows, columns)]
        return found

    def edges(self, grid: HeightMap) -> NDArray[np.bool_]:
        """Which places of a map are at an edge, (R, C)."""
        reach = max(1, round(EDGE_MM / self.step_mm))
        rows, columns = self._indices(grid)
        edge = np.zeros((len(rows), len(columns)), dtype=bool)
        for i, row in enumerate(rows):
            for j, column in enumerate(columns):
                around = self.height_mm[
                    max(row - reach, 0) : row + reach + 1,
                    max(column - reach, 0) : column + reach + 1,
                ]
                edge[i, j] = around.max() - around.min() >= EDGE_STEP_MM
        return edge

    def _indices(self, grid: HeightMap) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows, columns = (
            np.rint(places / self.step_mm).astype(np.int64) for places in (grid.y_mm, grid.x_mm)
        )
        return rows, columns


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """A scan against the truth.

    Attributes
    ----------
    rms_mm, bias_mm
        Of height errors away from edges; NaN where there are none.
    places
        How many places that is.
    edge_rms_mm, edge_places
        Of height errors at edges; how many places there have a height.
    missed, invented
        Places away from edges where something is but no height was found, and the reverse.
    """

    rms_mm: float
    bias_mm: float
    places: int
    edge_rms_mm: float
    edge_places: int
    missed: int
    invented: int


def surface_of(log: Log) -> Surface | None:
    """The true surface that a log of a simulated scan holds; None: it holds none."""
    for event in log.events("true_surface"):
        return Surface(
            step_mm=float(event.data["step_mm"]),
            height_mm=np.array(event.data["height_mm"], dtype=float),
        )
    return None


def quality(result: ScanResult, surface: Surface, lowest_mm: float) -> Quality:
    """Compare a scan with the truth.

    Parameters
    ----------
    lowest_mm
        Height of the extended tip: what is lower is out of reach.
    """
    grid = result.height_map
    true_mm, edge = surface.at(grid), surface.edges(grid)
    has = np.isfinite(grid.height_mm)
    known = grid.mark != "unvisited"
    error_mm = grid.height_mm - true_mm
    there = true_mm > lowest_mm
    inner, outer = error_mm[has & there & ~edge], error_mm[has & edge]
    return Quality(
        rms_mm=_rms(inner),
        bias_mm=float(inner.mean()) if len(inner) else float("nan"),
        places=len(inner),
        edge_rms_mm=_rms(outer),
        edge_places=len(outer),
        missed=int((known & ~has & ~edge & (true_mm > lowest_mm + _GRAZED_MM)).sum()),
        invented=int((has & ~there & ~edge).sum()),
    )


def agreement(one: HeightMap, other: HeightMap) -> float:
    """Share of places where both maps found something, or both nothing; NaN for other grids."""
    ours, theirs = np.isfinite(one.height_mm), np.isfinite(other.height_mm)
    return float((ours == theirs).mean()) if ours.shape == theirs.shape else float("nan")


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
