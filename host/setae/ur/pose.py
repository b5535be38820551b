"""Where frame D is: in the arm's base frame, and in the world of the experiments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Frame D hangs in the world: its z axis points down.
_D_IN_WORLD = np.diag([1.0, -1.0, -1.0])


def rotation(vector_rad: Sequence[float]) -> Array:
    """Rotation matrix of a rotation vector, as UR's poses have it.

    Parameters
    ----------
    vector_rad
        Axis times angle, (3,).

    Returns
    -------
    (3, 3), by Rodrigues' formula.

    Examples
    --------
    >>> rotation((0.0, 0.0, math.pi / 2)).round(6).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    x, y, z = vector_rad
    angle_rad = math.hypot(x, y, z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    half_sinc = np.sinc(angle_rad / (2 * np.pi))
    turned: Array = (
        np.eye(3) + np.sinc(angle_rad / np.pi) * cross + 0.5 * half_sinc**2 * cross @ cross
    )
    return turned


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldFrame:
    """The experiments' world in the arm's base frame.

    Its origin is where frame D's origin was at the start, its x axis is D's, its z axis
    points up where D hangs straight.

    Attributes
    ----------
    origin_mm
        In the base frame, (3,).
    axes
        World to base, (3, 3).
    """

    origin_mm: Array
    axes: Array

    @classmethod
    def at(cls, pose: Sequence[float]) -> WorldFrame:
        """The world that begins at a pose of frame D: x, y, z in mm, rotation vector in rad."""
        return cls(
            origin_mm=np.array(pose[:3], dtype=np.float64), axes=rotation(pose[3:]) @ _D_IN_WORLD
        )

    @property
    def tilt_rad(self) -> float:
        """Angle between the world's z axis and the base's."""
        return math.acos(max(-1.0, min(1.0, float(self.axes[2, 2]))))

    def to_base_mm(self, position_mm: Sequence[float]) -> Array:
        """A point of the world in the base frame, (3,)."""
        return self.origin_mm + self.axes @ np.asarray(position_mm, dtype=np.float64)

    def to_world_mm(self, base_mm: Sequence[float]) -> tuple[float, float, float]:
        """A point of the base frame in the world, (3,)."""
        x_mm, y_mm, z_mm = self.axes.T @ (np.asarray(base_mm, dtype=np.float64) - self.origin_mm)
        return (float(x_mm), float(y_mm), float(z_mm))
