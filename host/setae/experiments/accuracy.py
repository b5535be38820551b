"""How far poses are from their targets: true position less target, by group and by axis.

The paper's camera looked at right angles to the plane in which the robot bends, so it
saw x (or y) and z. Those errors are called *in the plane* here; *3D* has the third axis
too, where it was measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from setae.arc import FloatArray
from setae.experiments.targets import COUPLED, GROUPS, Target

__all__ = ["OVERALL", "Pose", "Spread", "Summary", "by_group", "in_plane_mm"]

OVERALL: Final = "all"


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A target and where the spring's top was found.

    Attributes
    ----------
    target : Target
    position_mm : ndarray, shape (3,)
        In frame D; NaN for a coordinate that was not measured.
    """

    target: Target
    position_mm: FloatArray

    @property
    def error_mm(self) -> FloatArray:
        """True position less target, (3,)."""
        return np.asarray(self.position_mm - np.array(self.target.position_mm))

    @property
    def lateral_mm(self) -> float:
        """Error along the axis in which it bends, with its sign."""
        error = self.error_mm
        axis = self.target.lateral_axis
        # A straight pose may have been seen from either side.
        if self.target.bend_deg == 0 and math.isnan(error[axis]):
            axis = 1 - axis
        return float(error[axis])

    @property
    def height_mm(self) -> float:
        """Error along z, with its sign."""
        return float(self.error_mm[2])

    @property
    def in_plane_mm(self) -> float:
        """Distance from the target as the paper's camera saw it."""
        return math.hypot(self.lateral_mm, self.height_mm)

    @property
    def distance_mm(self) -> float:
        """Distance from the target in space; NaN where only a plane was seen."""
        return float(np.linalg.norm(self.error_mm))


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation (of the sample, n − 1) in mm; NaN where nothing is known."""

    mean_mm: float
    sd_mm: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of some values, those that are NaN left out."""
        known = np.array([value for value in values if not math.isnan(value)])
        if not len(known):
            return cls(math.nan, math.nan)
        return cls(float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else math.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """The errors of one group.

    Attributes
    ----------
    targets
        How many were measured.
    in_plane, lateral, height
        Of the distance, and of the sizes of the errors along x (or y) and z, as in the
        paper's table.
    space
        Of the distance in three dimensions.
    median_mm, max_mm
        Of the distance in the plane.
    bias_lateral_mm, bias_height_mm
        Mean errors with their signs: outwards in the group's direction, and upwards.
    """

    targets: int
    in_plane: Spread
    lateral: Spread
    height: Spread
    space: Spread
    median_mm: float
    max_mm: float
    bias_lateral_mm: float
    bias_height_mm: float


def summary(poses: Sequence[Pose]) -> Summary:
    """Summarise some poses.

    Examples
    --------
    >>> at = Target(group="+X", height_mm=60.0, bend_deg=10.0, position_mm=(5.0, 0.0, 60.0))
    >>> found = summary([Pose(at, np.array([8.0, 0.0, 56.0])), Pose(at, np.array([5.0, 1, 61]))])
    >>> found.in_plane.mean_mm, found.lateral.mean_mm, found.bias_height_mm
    (3.0, 1.5, -1.5)
    """
    plane = [pose.in_plane_mm for pose in poses]
    outwards = [
        pose.lateral_mm * (-1.0 if pose.target.group.startswith("-") else 1.0) for pose in poses
    ]
    return Summary(
        targets=len(poses),
        in_plane=Spread.of(plane),
        lateral=Spread.of([abs(pose.lateral_mm) for pose in poses]),
        height=Spread.of([abs(pose.height_mm) for pose in poses]),
        space=Spread.of([pose.distance_mm for pose in poses]),
        median_mm=float(np.median(plane)) if plane else math.nan,
        max_mm=max(plane, default=math.nan),
        bias_lateral_mm=Spread.of(outwards).mean_mm,
        bias_height_mm=Spread.of([pose.height_mm for pose in poses]).mean_mm,
    )


def by_group(poses: Sequence[Pose]) -> Mapping[str, Summary]:
    """Summarise each group that was measured, and all together as ``"all"``."""
    groups = {group: [pose for pose in poses if pose.target.group == group] for group in (*GROUPS,)}
    found = {group: summary(part) for group, part in groups.items() if part}
    found[OVERALL] = summary(poses)
    return found


def in_plane_mm(poses: Sequence[Pose]) -> Mapping[tuple[float, float], float]:
    """Mean error in the plane over the directions, by height and bending, as in the bubble plot."""
    places: dict[tuple[float, float], list[float]] = {}
    for pose in poses:
        if pose.target.group in COUPLED:
            place = (pose.target.height_mm, pose.target.bend_deg)
            places.setdefault(place, []).append(pose.in_plane_mm)
    return {place: float(np.mean(errors)) for place, errors in places.items()}
