"""What the simulator knows and no host can measure, and what can be broken in it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["SOLVED", "SensorFault", "Truth"]

SOLVED: Final = 1e-4
"""Scaled gradient norm, root of N mm, below which an equilibrium is solved: the tip is within
0.01 mm."""

Array = NDArray[np.float64]


class SensorFault(IntEnum):
    """What can be wrong with the simulated pressure sensor."""

    NONE = 0
    ABSENT = 1
    SILENT = 2
    BUS = 3
    WRONG = 4
    STUCK = 5
    RANGE = 6
    NOISY = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What the simulator knows and no host can measure.

    Attributes
    ----------
    time_us
        Virtual time since power-on.
    arm_mm, arm_target_mm
        Origin of frame D in the world and where it goes, (3,).
    arm_moving
        Whether the arm moves.
    attached
        Whether each servo has pulses.
    pulse_us
        What the board puts out, (4,); 0 where a servo has no pulses.
    servo_length_mm
        Free tendon length that each servo leaves, (4,).
    tension_n
        Tension of each tendon, (4,); 0 where it is slack.
    backbone_mm
        The spring's centre line in frame D, from D to U, (21, 3).
    rotation
        Frame U in frame D, (3, 3).
    filament_mm
        Root and tip E of the undeformed filament in frame D, (2, 3).
    contact_depth_mm
        Deepest penetration of the undeformed filament; 0 without contact.
    contact_point_mm
        Where that is in the world, (3,); None without contact.
    bent_tip_mm
        The filament's tip at the sensor's last sample, bent as it is, in the world, (3,).
    pressure_hpa
        Pressure at the sensor's last sample, noise included.
    plant_residual
        Scaled gradient norm of the equilibrium; below `SOLVED` it is solved. NaN for a plug-in,
        of which nobody knows.
    plant_iterations
        Newton's steps to it; None for a plug-in.
    largest_residual
        Of the samples since power-on; NaN for a plug-in.
    unsolved_samples
        How many of them have no solution; None for a plug-in.
    """

    time_us: int
    arm_mm: Array
    arm_target_mm: Array
    arm_moving: bool
    attached: tuple[bool, bool, bool, bool]
    pulse_us: Array
    servo_length_mm: Array
    tension_n: Array
    backbone_mm: Array
    rotation: Array
    filament_mm: Array
    contact_depth_mm: float
    contact_point_mm: Array | None
    bent_tip_mm: Array
    pressure_hpa: float
    plant_residual: float
    plant_iterations: int | None
    largest_residual: float
    unsolved_samples: int | None

    @property
    def solved(self) -> bool:
        """Whether the equilibrium is solved, as far as anybody knows."""
        return not self.plant_residual >= SOLVED
