"""Find a trial of the tube exploration in its log."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from setae import kinematics
from setae.arc import Arc
from setae.config import Config
from setae.errors import InputError, LogError
from setae.record import Log
from setae.report.trial import (
    Contact,
    Cube,
    Direction,
    Floats,
    Level,
    Motion,
    Pressure,
    Trial,
    Tube,
    to_world,
)
from setae.servo import ServoModel

__all__ = ["load"]

BACKBONE_POINTS = 21  # of a shape that is drawn from commanded pulses


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
    ends = [event for event in events if event.name == "trial_end"]
    aborts = [event for event in events if event.name == "trial_aborted"]
    levels = _levels(log)
    lowering_contact = _lowering_contact(log)
    deepest_mm = max((level.descent_mm for level in levels), default=0.0)
    scene = log.metadata.get("scene") or {}
    config = log.config
    trial = Trial(
        number=int(log.metadata.get("trial") or number),
        obstacle_below_tip_mm=_obstacle_below_tip_mm({**log.metadata, **start.data}),
        descent_mm=float(ends[-1].data.get("descent_mm", deepest_mm)) if ends else deepest_mm,
        complete=bool(ends),
        problem=_problem(str(aborts[-1].data.get("reason", ""))) if aborts else "",
        start_us=start.time_us,
        end_us=ends[-1].time_us if ends else log.span_us[1],
        levels=levels,
        lowering_contact=lowering_contact,
        tube=_tube(scene),
        cube=_cube(scene),
        motion=_motion(log, config),
        pressure=_pressure(log),
        config=config,
        log=log,
    )
    _watch_until_touch(trial)
    return trial


def _problem(reason: str) -> str:
    """Why a trial ended early, for people who don't know Python."""
    if reason.startswith("KeyboardInterrupt"):
        return "somebody ended it with Ctrl-C"
    return reason


def _obstacle_below_tip_mm(about: Mapping[str, Any]) -> float | None:
    below_mm = about.get("obstacle_below_tip_mm")
    obstacle = about.get("obstacle")
    if below_mm is None and isinstance(obstacle, Mapping):
        below_mm = obstacle.get("below_tip_mm")
    return None if below_mm is None else float(below_mm)


def _lowering_contact(log: Log) -> Contact | None:
    for event in log.events("lowering_contact"):
        estimate = event.data.get("contact") or event.data
        descent_mm = float(estimate.get("descent_mm", math.nan))
        start_us = int(estimate.get("time_us", event.time_us)) - 1_000_000
        return _contact(log, estimate, start_us, event.time_us, descent_mm, None)
    return None


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
    alpha_deg: float | None,
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
    if about.get("tip_world_mm") is not None:
        point_mm = np.array(about["tip_world_mm"], dtype=float)
    elif about.get("tip_mm") is not None:
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
        uncertainty_mm=float(about.get("uncertainty_mm", math.nan)),
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


def _motion(log: Log, config: Config) -> Motion | None:
    times = log.times_us("/truth")
    if not times.size:
        return _commanded_motion(log, config)
    order = np.argsort(times, kind="stable")
    arm_mm = log.array("/truth", "arm_mm")[order]
    return Motion(
        measured=True,
        time_us=times[order],
        arm_mm=arm_mm,
        backbone_mm=to_world(log.array("/truth", "backbone_mm")[order], arm_mm[:, None]),
        filament_mm=to_world(log.array("/truth", "filament_mm")[order], arm_mm[:, None]),
    )


def _commanded_motion(log: Log, config: Config) -> Motion | None:
    """Shapes of constant curvature from the pulses, while all servos had one."""
    pulse_us = log.array("/telemetry", "pulse_us")
    times_us = log.times_us("/telemetry")
    attached = np.flatnonzero((pulse_us > 0).all(axis=1)) if pulse_us.size else np.array([], int)
    if not attached.size:
        return None
    times_us = times_us[attached]
    lengths_mm = ServoModel(config).lengths_from_us(pulse_us[attached])
    try:
        arc = kinematics.forward(lengths_mm, config.geometry, model="parallel")
    except InputError:  # pulses of another robot than the configuration's
        return None
    part = np.linspace(0.0, 1.0, BACKBONE_POINTS)
    along = Arc(
        length_mm=np.maximum(arc.length_mm[:, None] * part, 1e-6),
        bend_rad=arc.bend_rad[:, None, :] * part[:, None],
    )
    geometry = config.geometry
    filament_mm = np.stack(
        [
            kinematics.position(arc, tip_offset_mm=offset_mm)
            for offset_mm in (
                geometry.tip_offset_mm - geometry.filament_length_mm,
                geometry.tip_offset_mm,
            )
        ],
        axis=1,
    )
    arm_mm = _arm_path(log, times_us)
    return Motion(
        measured=False,
        time_us=times_us,
        arm_mm=arm_mm,
        backbone_mm=to_world(kinematics.position(along), arm_mm[:, None]),
        filament_mm=to_world(filament_mm, arm_mm[:, None]),
    )


def _arm_path(log: Log, times_us: NDArray[np.int64]) -> Floats:
    known_us = log.times_us("/stage")
    if not known_us.size:
        return np.zeros((len(times_us), 3))
    position = log.array("/stage", "position_mm")
    return np.stack([np.interp(times_us, known_us, axis) for axis in position.T], axis=1)


def _pressure(log: Log) -> Pressure:
    time_us = log.times_us("/pressure")
    order = np.argsort(time_us, kind="stable")
    armed = log.array("/pressure", "armed").astype(bool)
    baseline_hpa = np.where(armed, log.array("/pressure", "baseline_hpa"), np.nan)
    return Pressure(
        time_us=time_us[order],
        pressure_hpa=log.array("/pressure", "pressure_hpa")[order],
        baseline_hpa=baseline_hpa[order],
    )


def _watch_until_touch(trial: Trial) -> None:
    """Count the deciding sample as watched.

    The board says so with its next telemetry, and by then it has stopped watching.
    """
    pressure = trial.pressure
    for contact in trial.contacts:
        last = int(np.searchsorted(pressure.time_us, contact.time_us + 1000)) - 1
        while last >= 0 and contact.time_us - pressure.time_us[last] < 50_000:
            if not np.isnan(pressure.baseline_hpa[last]):
                break
            pressure.baseline_hpa[last] = contact.baseline_hpa
            last -= 1


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
