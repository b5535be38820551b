"""Whether measured positions would fit their targets clearly better in another frame.

A frame that is mirrored, or whose scale or origin is wrong, gives errors that look like a robot's.
Hardly a robot errs so: each of its poses on the other side, or all by the same factor or way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from setae.arc import FloatArray
from setae.experiments.accuracy import Pose
from setae.experiments.targets import COUPLED, GROUPS
from setae.wording import counted

__all__ = ["doubts"]

_POSES: Final = 3  # of a group, at least: one may be a slip
_SCALE_OFF: Final = 0.05
# What is left of the median error where another frame is clearly the better one.
_LEFT_MIRRORED: Final = 0.8
_LEFT_SCALED: Final = 0.8
_LEFT_SCALED_GROUP: Final = 0.6  # fewer poses, and a robot may err to one side as if scaled
# A shift looks like a scale, for all heights are positive: the scale must leave this much less.
_LEFT_OF_SHIFTED: Final = 0.8


def doubts(poses: Sequence[Pose]) -> tuple[str, ...]:
    """Say which groups fit better mirrored, scaled or shifted; empty where none does.

    A shift alone is no reason for doubt: robots hang aside, too.

    Parameters
    ----------
    poses
        As they were measured.

    Examples
    --------
    >>> from setae.config import load
    >>> from setae.experiments.targets import paper_targets
    >>> right = [target for target in paper_targets(load()) if target.group == "+X"]
    >>> mirrored = [Pose(t, np.array(t.position_mm) * [-1, 1, 1]) for t in right]
    >>> doubts(mirrored)[0][:43]
    'The 34 positions of +X lie on the other sid'
    """
    planes = {
        group: _Plane.of([pose for pose in poses if pose.target.group == group]) for group in GROUPS
    }
    planes = {group: plane for group, plane in planes.items() if len(plane.wanted_mm)}
    told = []
    for group in COUPLED:
        if group in planes and planes[group].mirrored:
            count = counted(len(planes.pop(group).wanted_mm), "position")
            told.append(
                f"The {count} of {group} lie on the other side of the axis than their targets, and "
                f"would fit mirrored: check the direction of {group[1]} in the frame."
            )
    if not planes:
        return tuple(told)
    whole = _Plane(*(np.concatenate(part) for part in zip(*planes.values(), strict=True)))
    if whole.seems_scaled(_LEFT_SCALED):
        told.append(whole.wrong("", _LEFT_SCALED))
    else:
        told += [
            plane.wrong(f" of {group}", _LEFT_SCALED_GROUP)
            for group, plane in planes.items()
            if group in COUPLED and plane.seems_scaled(_LEFT_SCALED_GROUP)
        ]
    return tuple(text for text in told if text)


class _Plane(NamedTuple):
    """Targets and positions in the plane in which the robot bends, (n, 2) each."""

    wanted_mm: FloatArray
    found_mm: FloatArray

    @classmethod
    def of(cls, poses: Sequence[Pose]) -> _Plane:
        """Of those that were seen; a straight one may have been seen from either side."""
        pairs = []
        for pose in poses:
            wanted = np.array(pose.target.position_mm)[[pose.target.lateral_axis, 2]]
            pairs.append((wanted, wanted + np.array([pose.lateral_mm, pose.height_mm])))
        both = np.array(pairs).reshape(-1, 2, 2)
        both = both[np.isfinite(both).all(axis=(1, 2))]
        return cls(both[:, 0], both[:, 1])

    @property
    def mirrored(self) -> bool:
        """Whether these fit clearly better on the other side."""
        if len(self.wanted_mm) < _POSES:
            return False
        other_side = np.median(np.sign(self.wanted_mm[:, 0] * self.found_mm[:, 0])) < 0
        mirrored = _Plane(self.wanted_mm, self.found_mm * [-1, 1])
        return bool(other_side) and mirrored.median_mm < _LEFT_MIRRORED * self.median_mm

    @property
    def factor(self) -> float:
        """How many times as far from the origin they are as their targets, by the median."""
        along = (self.wanted_mm * self.found_mm).sum(axis=1)
        return float(np.median(along / (self.wanted_mm * self.wanted_mm).sum(axis=1)))

    @property
    def left_scaled(self) -> float:
        """What is left of the median error where that factor is taken out."""
        scaled = _Plane(self.factor * self.wanted_mm, self.found_mm)
        return scaled.median_mm / self.median_mm if self.median_mm else 1.0

    @property
    def median_mm(self) -> float:
        """Median error."""
        return float(np.median(np.linalg.norm(self.found_mm - self.wanted_mm, axis=1)))

    @property
    def shift_mm(self) -> FloatArray:
        """By how much they are off sideways and in z, by the median, (2,)."""
        return np.asarray(np.median(self.found_mm - self.wanted_mm, axis=0))

    @property
    def left_shifted(self) -> float:
        """What is left of the median error where that shift is taken out."""
        shifted = _Plane(self.wanted_mm + self.shift_mm, self.found_mm)
        return shifted.median_mm / self.median_mm if self.median_mm else 1.0

    def seems_scaled(self, left: float) -> bool:
        """Whether these fit clearly better with another scale."""
        enough = len(self.wanted_mm) >= _POSES
        return enough and abs(self.factor - 1) > _SCALE_OFF and self.left_scaled < left

    def wrong(self, name: str, left: float) -> str:
        """Say whether it is the scale or the origin; empty where neither is clear."""
        if self.left_scaled < _LEFT_OF_SHIFTED * self.left_shifted:
            return (
                f"The positions{name} are {self.factor:.2f} times as far from the origin as their "
                f"targets, which explains {1 - self.left_scaled:.0%} of the median error: check "
                "the scale."
            )
        if self.left_shifted < left:
            sideways_mm, z_mm = self.shift_mm
            return (
                f"The positions{name} are off by {sideways_mm:+.1f} mm sideways and {z_mm:+.1f} mm "
                f"in z, which explains {1 - self.left_shifted:.0%} of the median error: check the "
                "origin."
            )
        return ""
