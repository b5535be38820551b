"""What a log of the tube exploration says, in the form that reports draw."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from setae.errors import LogError
from setae.record import Log

Floats = NDArray[np.float64]

DEFAULT_THRESHOLD_HPA = 15.0  # the paper's; a log's own configuration comes first


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
        The level and the direction in which it happened.
    point_mm
        (3,) the bristle's tip in the world, as the robot estimates it; NaN
        where the log has no estimate.
    true_point_mm
        (3,) where the simulated bristle touched, in the world; NaN where the
        log isn't of a simulation.
    pressure_hpa, baseline_hpa
        The deciding sample, and what it was compared with.
    """

    time_us: int
    descent_mm: float
    alpha_deg: float
    point_mm: Floats
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
    time_us
        (n,)
    arm_mm
        (n, 3) origin of frame D.
    backbone_mm
        (n, 21, 3) from the spring's base to its top.
    filament_mm
        (n, 2, 3) the undeformed bristle, root and tip.
    """

    time_us: NDArray[np.int64]
    arm_mm: Floats
    backbone_mm: Floats
    filament_mm: Floats

    def at(self, time_us: float) -> int:
        """Index of the sample at or after a time."""
        return min(int(np.searchsorted(self.time_us, time_us)), len(self.time_us) - 1)


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
    """

    number: int
    obstacle_below_tip_mm: float | None
    descent_mm: float
    complete: bool
    start_us: int
    end_us: int
    levels: tuple[Level, ...]
    tube: Tube | None
    cube: Cube | None
    motion: Motion | None
    threshold_hpa: float
    log: Log

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All touches, in order."""
        return tuple(
            direction.contact
            for level in self.levels
            for direction in level.directions
            if direction.contact is not None
        )

    @property
    def touched(self) -> bool:
        """Whether anything was touched at all."""
        return any(direction.touched for level in self.levels for direction in level.directions)

    @property
    def simulated(self) -> bool:
        """Whether the robot was simulated."""
        return self.log.simulated

    def seconds(self, time_us: Any) -> Any:
        """Time since the trial's start, in s."""
        return (np.asarray(time_us) - self.start_us) / 1e6


def to_world(point_mm: Any, arm_mm: Any) -> Floats:
    """Frame D to the world: D hangs from the arm with its z down; (..., 3) → (..., 3)."""
    return np.asarray(point_mm, dtype=float) * (1.0, -1.0, -1.0) + np.asarray(arm_mm, dtype=float)


def load(log: Log, *, number: int = 1) -> Trial:
    """Find the trial in a log.

    Parameters
    ----------
    log
        A log of the tube exploration, of one trial.
    number
        The trial's number where the log doesn't say it.

    Raises
    ------
    LogError
        The log holds no exploration.
    """
    events = log.events()
    starts = [event for event in events if event.name == "trial_start"]
    if not starts:
        raise LogError(
            f"{log.path} holds no exploration.", "Give the log of a run of `setae explore`."
        )
    start = starts[0]
    about = {**log.metadata, **start.data}
    ends = [event for event in events if event.name == "trial_end"]
    levels = _levels(log)
    deepest_mm = max((level.descent_mm for level in levels), default=0.0)
    obstacle = about.get("obstacle_below_tip_mm")
    scene = about.get("scene") or {}
    return Trial(
        number=int(about.get("trial") or number),
        obstacle_below_tip_mm=None if obstacle is None else float(obstacle),
        descent_mm=float(ends[-1].data.get("descent_mm", deepest_mm)) if ends else deepest_mm,
        complete=bool(ends),
        start_us=start.time_us,
        end_us=ends[-1].time_us if ends else log.span_us[1],
        levels=levels,
        tube=_tube(scene),
        cube=_cube(scene),
        motion=_motion(log),
        threshold_hpa=_threshold_hpa(log),
        log=log,
    )


def _levels(log: Log) -> tuple[Level, ...]:
    levels: list[Level] = []
    directions: list[Direction] = []
    level_start: tuple[int, float] | None = None
    direction_start: tuple[int, float] | None = None
    last_us = log.span_us[1]

    def close_level(end_us: int) -> None:
        nonlocal level_start
        if level_start is not None:
            levels.append(
                Level(
                    descent_mm=level_start[1],
                    start_us=level_start[0],
                    end_us=end_us,
                    directions=tuple(directions),
                )
            )
        directions.clear()
        level_start = None

    for event in log.events():
        if event.name == "level_start":
            close_level(event.time_us)
            level_start = (event.time_us, float(event.data["descent_mm"]))
        elif event.name == "direction_start":
            direction_start = (event.time_us, float(event.data["alpha_deg"]))
        elif event.name == "direction_end" and direction_start and level_start:
            start_us, alpha_deg = direction_start
            touched = bool(event.data.get("touched"))
            contact = None
            if touched:
                contact = _contact(
                    log, event.data.get("contact"), start_us, event.time_us,
                    level_start[1], alpha_deg,
                )  # fmt: skip
            directions.append(
                Direction(
                    alpha_deg=alpha_deg,
                    start_us=start_us,
                    end_us=event.time_us,
                    touched=touched,
                    contact=contact,
                )
            )
            direction_start = None
        elif event.name in ("level_end", "arm_return", "trial_end"):
            close_level(event.time_us)
    close_level(last_us)
    return tuple(levels)


def _contact(
    log: Log,
    estimate: Mapping[str, Any] | None,
    start_us: int,
    end_us: int,
    descent_mm: float,
    alpha_deg: float,
) -> Contact:
    """Gather a contact from the estimate, the trip record and the truth around it."""
    about: dict[str, Any] = {}
    for trip in log.messages("/trip"):
        if start_us <= trip["time_us"] <= end_us and trip["cause"] != "deadline":
            about = {**trip, **(trip["contact"] or {}), "time_us": trip["sample_time_us"]}
            break
    about |= {key: value for key, value in (estimate or {}).items() if value is not None}
    time_us = int(about.get("time_us", end_us))

    point_mm = np.full(3, np.nan)
    if about.get("tip_mm") is not None:
        point_mm = to_world(about["tip_mm"], _arm_mm(log, time_us))

    true_point_mm = np.full(3, np.nan)
    times = log.times_us("/truth")
    near = np.flatnonzero((times >= start_us) & (times <= end_us))
    if near.size:
        depth_mm = log.array("/truth", "contact_depth_mm")[near]
        touching = near[depth_mm > 0]
        if touching.size:
            nearest = touching[np.argmin(np.abs(times[touching] - time_us))]
            true_point_mm = log.array("/truth", "contact_point_mm")[nearest]
    return Contact(
        time_us=time_us,
        descent_mm=descent_mm,
        alpha_deg=alpha_deg,
        point_mm=point_mm,
        true_point_mm=true_point_mm,
        pressure_hpa=float(about.get("pressure_hpa", math.nan)),
        baseline_hpa=float(about.get("baseline_hpa", math.nan)),
    )


def _arm_mm(log: Log, time_us: int) -> Floats:
    for topic, field in (("/truth", "arm_mm"), ("/stage", "position_mm")):
        times = log.times_us(topic)
        if times.size:
            index = max(int(np.searchsorted(times, time_us, side="right")) - 1, 0)
            found: Floats = log.array(topic, field)[index]
            return found
    return np.zeros(3)


def _motion(log: Log) -> Motion | None:
    times = log.times_us("/truth")
    if not times.size:
        return None
    order = np.argsort(times, kind="stable")
    arm_mm = log.array("/truth", "arm_mm")[order]
    return Motion(
        time_us=times[order],
        arm_mm=arm_mm,
        backbone_mm=to_world(log.array("/truth", "backbone_mm")[order], arm_mm[:, None]),
        filament_mm=to_world(log.array("/truth", "filament_mm")[order], arm_mm[:, None]),
    )


def _threshold_hpa(log: Log) -> float:
    import tomllib

    try:
        config = tomllib.loads(str(log.metadata.get("config", "")))
    except tomllib.TOMLDecodeError:
        return DEFAULT_THRESHOLD_HPA
    return float(config.get("bristle", {}).get("threshold_hpa", DEFAULT_THRESHOLD_HPA))


def _tube(scene: Mapping[str, Any]) -> Tube | None:
    tube = scene.get("tube")
    if not tube:
        return None
    axis: Sequence[float] = tube["axis_mm"]
    return Tube(
        axis_mm=(float(axis[0]), float(axis[1])), inner_radius_mm=float(tube["inner_radius_mm"])
    )


def _cube(scene: Mapping[str, Any]) -> Cube | None:
    cube = scene.get("cube")
    if not cube:
        return None
    x, y, z = (float(value) for value in cube["centre_mm"])
    return Cube(
        centre_mm=(x, y, z),
        edge_mm=float(cube["edge_mm"]),
        yaw_rad=float(cube.get("yaw_rad", 0.0)),
    )
