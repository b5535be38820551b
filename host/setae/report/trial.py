"""A trial of the tube exploration, in the form that reports draw; `reading` finds it in a log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from setae.config import Config
from setae.record import Log

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """The tube, upright in the world: a point of its axis (x, y), and its inner radius."""

    axis_mm: tuple[float, float]
    inner_radius_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cube:
    """The obstacle: centre and edge, turned by yaw about the world's z."""

    centre_mm: tuple[float, float, float]
    edge_mm: float
    yaw_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """One touch of the bristle.

    Attributes
    ----------
    time_us
        Time of the deciding pressure sample where the log has it.
    descent_mm, alpha_deg
        The level and the direction in which it happened; `alpha_deg` is None
        for a touch while the arm went down.
    point_mm
        (3,) the bristle's tip in the world, as the robot estimates it; NaN
        where the log has no estimate.
    uncertainty_mm
        Of the estimate; NaN where the log doesn't say.
    true_point_mm
        (3,) where the simulated bristle touched, in the world; NaN where the
        log isn't of a simulation.
    pressure_hpa, baseline_hpa
        The deciding sample, and what it was compared with.
    """

    time_us: int
    descent_mm: float
    alpha_deg: float | None
    point_mm: Floats
    uncertainty_mm: float
    true_point_mm: Floats
    pressure_hpa: float
    baseline_hpa: float

    @property
    def change_hpa(self) -> float:
        """Deciding sample against the baseline."""
        return self.pressure_hpa - self.baseline_hpa


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """One extension towards the wall: when, whereto, and the contact if there was one."""

    alpha_deg: float
    start_us: int
    end_us: int
    touched: bool
    contact: Contact | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One depth at which the robot felt around."""

    descent_mm: float
    start_us: int
    end_us: int
    directions: tuple[Direction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The robot's shape over time, in the world.

    Attributes
    ----------
    measured
        True for a simulation's own shape; False for the shape that the
        commanded pulses ask for, which is all that a real robot can tell.
    time_us
        (n,)
    arm_mm
        (n, 3) origin of frame D.
    backbone_mm
        (n, 21, 3) from the spring's base to its top.
    filament_mm
        (n, 2, 3) the undeformed bristle, root and tip.
    """

    measured: bool
    time_us: NDArray[np.int64]
    arm_mm: Floats
    backbone_mm: Floats
    filament_mm: Floats

    def at(self, time_us: float) -> int:
        """Index of the sample at or after a time."""
        return min(int(np.searchsorted(self.time_us, time_us)), len(self.time_us) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pressure:
    """Samples of the bristle's sensor, in order of time.

    Attributes
    ----------
    time_us, pressure_hpa
        (n,)
    baseline_hpa
        (n,) what the board compared the sample with; NaN while it didn't watch.
    """

    time_us: NDArray[np.int64]
    pressure_hpa: Floats
    baseline_hpa: Floats

    def between(self, start_us: float, end_us: float) -> Pressure:
        """Return the samples of a stretch of time."""
        within = (self.time_us >= start_us) & (self.time_us <= end_us)
        return Pressure(
            time_us=self.time_us[within],
            pressure_hpa=self.pressure_hpa[within],
            baseline_hpa=self.baseline_hpa[within],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One way down the tube.

    Attributes
    ----------
    number
        From 1.
    obstacle_below_tip_mm
        The question: how far below the bristle the obstacle was; None where
        there was none.
    descent_mm
        The answer: the depth at which the robot ended its way down.
    complete
        Whether the log holds the trial's end.
    problem
        Why it doesn't, where that is known; else empty.
    config
        The robot's configuration in the run.
    lowering_contact
        A touch while the arm went down, which ends the way down at once.
    """

    number: int
    obstacle_below_tip_mm: float | None
    descent_mm: float
    complete: bool
    problem: str
    start_us: int
    end_us: int
    levels: tuple[Level, ...]
    lowering_contact: Contact | None
    tube: Tube | None
    cube: Cube | None
    motion: Motion | None
    pressure: Pressure
    config: Config
    log: Log

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All touches, in order."""
        found = [
            direction.contact
            for level in self.levels
            for direction in level.directions
            if direction.contact is not None
        ]
        if self.lowering_contact is not None:
            found.append(self.lowering_contact)
        return tuple(sorted(found, key=lambda contact: contact.time_us))

    @property
    def label(self) -> str:
        """What was in the tube: "no obstacle", "obstacle 35 mm below", "… at α = 135°"."""
        if self.obstacle_below_tip_mm is None:
            return "no obstacle"
        text = f"obstacle {self.obstacle_below_tip_mm:g} mm below"
        return text + (f" at α = {self.azimuth_deg:g}°" if self.azimuth_deg else "")

    @property
    def azimuth_deg(self) -> float:
        """Direction in which the cube lies, as α of frame D, from 0 to 360; 0 without a cube."""
        if self.cube is None:
            return 0.0
        x_mm, y_mm, _ = self.cube.centre_mm
        return round(math.degrees(math.atan2(-y_mm, x_mm)), 1) % 360.0

    @property
    def touched(self) -> bool:
        """Whether anything was touched at all."""
        return bool(self.contacts)

    @property
    def threshold_hpa(self) -> float:
        """Change of pressure that counts as a touch."""
        return self.config.bristle.threshold_hpa

    @property
    def simulated(self) -> bool:
        """Whether the robot was simulated."""
        return self.log.simulated

    def seconds(self, time_us: Any) -> Any:
        """Time since the trial's start, in s."""
        return (np.asarray(time_us) - self.start_us) / 1e6


def to_world(point_mm: Any, arm_mm: Any) -> Floats:
    """Frame D to the world: D hangs from the arm with its z down; (..., 3) → (..., 3)."""
    flipped = np.asarray(point_mm, dtype=float) * np.array([1.0, -1.0, -1.0])
    return np.asarray(flipped + np.asarray(arm_mm, dtype=float))


def origin_note(trials: Sequence[Trial]) -> str:
    """Say where the data come from, in one line."""
    if not trials[0].simulated:
        return "measured on the robot"
    seeds = [trial.log.metadata.get("seed") for trial in trials]
    if None in seeds:
        return "simulated"
    names = ", ".join(str(seed) for seed in dict.fromkeys(seeds))
    return f"simulated, {'seeds' if ',' in names else 'seed'} {names}"


def telling(trials: Sequence[Trial]) -> Trial:
    """Choose the trial that shows most: the second with a touch, so that one sees the way."""
    touched = [trial for trial in trials if trial.touched]
    return touched[min(1, len(touched) - 1)] if touched else trials[0]
