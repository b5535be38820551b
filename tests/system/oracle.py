"""What an exploration ought to find, from geometry alone.

Independent of the package's kinematics and of the simulator: the spring is an
arc, the bristle a straight line beyond it, the cube a box and the tube a
cylinder. The real (simulated) robot sags, lags and isn't a perfect arc, and a
contact takes a millimetre or two to be felt; so a direction is only called
touched or free with a margin, and grazing between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

STEP_MM = 20.0
STEPS = 5
COMPRESSED_MM = 45.0
TARGET_RADIUS_MM, TARGET_HEIGHT_MM = 15.0, 60.0
TIP_OFFSET_MM = 65.0
FILAMENT_MM = 53.0
DIRECTIONS_DEG = tuple(45.0 * index for index in range(8))
WALL_MM = 70.0
"""From the robot's axis to the tube's wall, on the obstacle's side."""

TOUCH_MARGIN_MM = 6.0
"""Deeper than this in the cube: has to be felt."""
FREE_MARGIN_MM = 6.0
"""Farther than this from everything: must not be felt."""


class Verdict(Enum):
    """What a direction ought to give."""

    TOUCHED = "touched"
    FREE = "free"
    GRAZING = "grazing"


@dataclass(frozen=True)
class Cube:
    """The obstacle: where its top is, where it lies, how large it is."""

    below_tip_mm: float
    azimuth_deg: float
    edge_mm: float

    def distance_mm(self, points_mm: Floats) -> Floats:
        """Signed distance (..., 3) → (...): negative inside."""
        azimuth = math.radians(self.azimuth_deg)
        towards = np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
        across = np.array([-towards[1], towards[0], 0.0])
        top_mm = -(COMPRESSED_MM + TIP_OFFSET_MM) - self.below_tip_mm
        half = self.edge_mm / 2
        local = np.stack(
            [
                points_mm @ towards - (WALL_MM - half),
                points_mm @ across,
                points_mm[..., 2] - (top_mm - half),
            ],
            axis=-1,
        )
        beyond = np.abs(local) - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        inside = np.minimum(beyond.max(axis=-1), 0.0)
        return np.asarray(outside + inside)


def filament_mm(length_mm: float, theta_rad: float, alpha_rad: float, arm_z_mm: float) -> Floats:
    """Points along the filament in the world, (n, 3), for an arc and the arm's height."""
    if theta_rad < 1e-9:
        radial, height = 0.0, length_mm
    else:
        radius = length_mm / theta_rad
        radial = radius * (1 - math.cos(theta_rad))
        height = radius * math.sin(theta_rad)
    along = np.linspace(TIP_OFFSET_MM - FILAMENT_MM, TIP_OFFSET_MM, 54)
    r = radial + along * math.sin(theta_rad)
    z = height + along * math.cos(theta_rad)
    return np.stack([r * math.cos(alpha_rad), -r * math.sin(alpha_rad), arm_z_mm - z], axis=-1)


def extension(alpha_deg: float, descent_mm: float) -> Iterator[Floats]:
    """The filament on its way from the compressed state to the target."""
    theta = 2 * math.atan2(TARGET_RADIUS_MM, TARGET_HEIGHT_MM)
    chord = math.hypot(TARGET_RADIUS_MM, TARGET_HEIGHT_MM)
    length = chord * (theta / 2) / math.sin(theta / 2)
    for part in np.linspace(0, 1, 41):
        yield filament_mm(
            COMPRESSED_MM + part * (length - COMPRESSED_MM),
            float(part) * theta,
            math.radians(alpha_deg),
            -descent_mm,
        )


def clearance_mm(cube: Cube | None, alpha_deg: float, descent_mm: float) -> float:
    """Least signed distance between filament and cube on the whole extension."""
    if cube is None:
        return math.inf
    return min(float(cube.distance_mm(line).min()) for line in extension(alpha_deg, descent_mm))


def verdict(cube: Cube | None, alpha_deg: float, descent_mm: float) -> Verdict:
    """What a direction at a depth ought to give. The tube's own wall is out of reach."""
    clearance = clearance_mm(cube, alpha_deg, descent_mm)
    if clearance <= -TOUCH_MARGIN_MM:
        return Verdict.TOUCHED
    if clearance >= FREE_MARGIN_MM:
        return Verdict.FREE
    return Verdict.GRAZING


@dataclass(frozen=True)
class Judgement:
    """How a trial compares with the oracle, in directions."""

    false_stops: int
    missed: int
    grazing: int
    clear: int


def judge(cube: Cube | None, scanned: dict[float, set[float]], lowering_contacts: int) -> Judgement:
    """Compare a trial with the oracle.

    Parameters
    ----------
    cube
        What was in the tube.
    scanned
        Depth → directions (degrees) that were felt there, for every depth scanned.
    lowering_contacts
        Contacts while the arm lowered: with the robot compressed on its axis and
        the cube beside it, always false.
    """
    false_stops, missed, grazing, clear = lowering_contacts, 0, 0, 0
    for descent_mm, touched in scanned.items():
        for alpha_deg in DIRECTIONS_DEG:
            expected = verdict(cube, alpha_deg, descent_mm)
            felt = alpha_deg in touched
            if expected is Verdict.GRAZING:
                grazing += 1
            elif felt and expected is Verdict.FREE:
                false_stops += 1
            elif not felt and expected is Verdict.TOUCHED:
                missed += 1
            else:
                clear += 1
    return Judgement(false_stops, missed, grazing, clear)


def random_cube(rng: np.random.Generator) -> Cube | None:
    """An obstacle of random height, direction and size; sometimes none."""
    if rng.random() < 0.15:
        return None
    return Cube(
        below_tip_mm=float(rng.uniform(5.0, 120.0)),
        azimuth_deg=float(rng.uniform(0.0, 360.0)),
        edge_mm=float(rng.uniform(25.0, 50.0)),
    )
