"""A height map as a few numbers that neither place nor yaw changes.

Each number has a meaning that a person can check on the map. Only differences of height are
used: the arm's own height cancels. Sizes count, since a classifier should tell a lemon from a
melon, but in logarithms: a tenth larger is the same step for small and large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from setae import extras
from setae.arc import FloatArray
from setae.errors import InputError
from setae.heightmap import HeightMap
from setae.perception import maps
from setae.wording import counted

__all__ = ["FEATURES", "FEWEST", "Feature", "described", "scaled"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """One number of the description.

    Attributes
    ----------
    name
        With its unit, if it has one.
    meaning
        In words.
    spread
        By how much scans of one kind of object are expected to differ (standard deviation): sizes
        within ± 20 %, a grid of 10 mm, edges where the bristle slips. Differences count in it.
    """

    name: str
    meaning: str
    spread: float


FEATURES: Final = (
    Feature(
        name="log_size",
        meaning="logarithm of the radius, in mm, of a disc as large as what was felt",
        spread=0.12,
    ),
    Feature(
        name="slimness",
        meaning="width over length of what was felt, by its second moments",
        spread=0.05,
    ),
    Feature(
        name="hollow",
        meaning="part of the outline's inside where nothing was felt",
        spread=0.05,
    ),
    Feature(
        name="relief_log",
        meaning="logarithm of 1 mm and the way from the 10th of a hundred heights, from below, to "
        "the top",
        spread=0.15,
    ),
    Feature(
        name="high_share",
        meaning="part of what was felt that lies less than 5 mm below the top",
        spread=0.05,
    ),
    Feature(
        name="dome",
        meaning="correlation of height with nearness to the middle: 1 for a dome, -1 for a bowl",
        spread=0.1,
    ),
)
"""What `described` returns, in its order."""

FEWEST: Final = 6
"""Places with a height that a description needs."""

# A bristle that slips is in contact too low, hardly ever too high. And a container's thin walls are
# touched at few places: the top is the 98th of a hundred heights.
_LOW_SHARE = 0.1
_TOP_SHARE = 0.98
_HIGH_MM = 5.0
_LEAST_SPREAD_MM = 1.0


def described(heights: HeightMap) -> FloatArray:
    """Describe a height map by `FEATURES`.

    Parameters
    ----------
    heights
        The scan; inferred heights count.

    Returns
    -------
    ndarray, shape (f,)

    Raises
    ------
    InputError
        It has fewer than `FEWEST` heights.
    """
    points = maps.known(heights)
    if len(points) < FEWEST:
        raise InputError(
            f"The scan has {counted(len(points), 'height')}, and a shape needs {FEWEST}.",
            "Scan the whole object, or with a smaller step.",
        )
    cell_mm2 = _step_mm(heights.x_mm) * _step_mm(heights.y_mm)
    area_mm2 = len(points) * cell_mm2
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    # A cell's own spread belongs to the moments: a row of cells is as wide as one.
    moments = flat.T @ flat / len(flat) + np.eye(2) * cell_mm2 / 12
    small, large = np.linalg.eigvalsh(moments)
    z = points[:, 2]
    low, top = np.quantile(z, (_LOW_SHARE, _TOP_SHARE))
    away = np.hypot(*flat.T)
    return np.array(
        [
            math.log(math.sqrt(area_mm2 / math.pi)),
            math.sqrt(small / large),
            max(0.0, 1.0 - area_mm2 / _outline_mm2(points, heights)),
            math.log(_LEAST_SPREAD_MM + top - low),
            float((z > top - _HIGH_MM).mean()),
            -_correlation(z, away),
        ]
    )


def scaled(vectors: FloatArray) -> FloatArray:
    """Return descriptions (..., f) in units of each feature's expected spread, (..., f)."""
    return np.asarray(vectors, dtype=np.float64) / [feature.spread for feature in FEATURES]


def _step_mm(places_mm: FloatArray) -> float:
    return float(np.median(np.diff(places_mm))) if len(places_mm) > 1 else 1.0


def _correlation(z: FloatArray, away: FloatArray) -> float:
    """Like Pearson's, but 0 where heights differ by no more than their noise."""
    spread = math.hypot(float(z.std()), _LEAST_SPREAD_MM) * float(away.std())
    return float(((z - z.mean()) * (away - away.mean())).mean()) / spread if spread else 0.0


def _outline_mm2(points: FloatArray, heights: HeightMap) -> float:
    """Area of the convex hull of all cells that have a height."""
    spatial = extras.load("scipy.spatial", "perception", "Describing a shape")
    half = np.array([_step_mm(heights.x_mm), _step_mm(heights.y_mm)]) / 2
    corners = np.concatenate([points[:, :2] + half * (a, b) for a in (-1, 1) for b in (-1, 1)])
    return float(spatial.ConvexHull(corners).volume)
