"""The paper's validation: send the robot to known targets, and measure where it comes to.

As on the paper's rig: the robot is straight at its free length, goes to a target in one
move, comes to rest, is measured, and goes back. So every target is approached from the
same side, and a run that ended early can be taken up again at the next target.

Robot and measurement may be real or simulated; nothing here can tell.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import setae
from setae.arc import FloatArray
from setae.config import Config
from setae.errors import InputError, SetaeError
from setae.experiments.accuracy import Pose
from setae.experiments.events import Event, OnEvent
from setae.experiments.targets import Target, commanded_lengths_mm
from setae.record import Recorder
from setae.robot import Robot
from setae.stopping import stop_all

__all__ = ["Measure", "Noise", "measured", "validate"]

Measure = Callable[[Target], FloatArray | None]
"""Called with the robot at rest at a target; position of the spring's top in frame D, (3,),
or None where it is measured later."""

_SETTLE_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """What a camera adds to true positions: normal, of its own seed.

    Attributes
    ----------
    sd_mm
        Standard deviation along each axis.
    seed
        Of the noise alone.
    """

    sd_mm: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.sd_mm) and self.sd_mm >= 0):
            raise InputError(f"The noise is {self.sd_mm} mm.", "Give 0 or a positive number.")

    def on(self, target: Target) -> FloatArray:
        """The noise at a target, (3,): the same again for the same target and seed."""
        draw = np.random.default_rng([self.seed, *target.label.encode()])
        return np.asarray(draw.normal(0.0, self.sd_mm, 3)) if self.sd_mm else np.zeros(3)


def validate(
    robot: Robot,
    targets: Sequence[Target],
    measure: Measure,
    *,
    model: str | None = None,
    settle_s: float = _SETTLE_S,
    on_event: OnEvent | None = None,
) -> list[Pose]:
    """Go to each target and measure.

    The robot must be enabled. Whatever goes wrong, Ctrl-C included, it is stopped
    before the exception leaves; what was measured until then is in the events.

    Parameters
    ----------
    robot
        Enabled robot.
    targets
        Where to, in this order.
    measure
        Says where the spring's top is.
    model
        Tendon model; None takes the configured one.
    settle_s
        Time between the end of a move and the measurement.
    on_event
        Called with each event: validate_start, target, validate_end, validate_aborted.

    Returns
    -------
    list of Pose
        Those that were measured.
    """
    model = model or robot.config.motion.model
    lengths_mm, cut_mm = commanded_lengths_mm(targets, robot.config, model)
    straight = np.full(lengths_mm.shape[-1], robot.config.geometry.free_length_mm)
    poses: list[Pose] = []

    def emit(name: str, **data: object) -> None:
        if on_event is not None:
            on_event(Event(time_us=robot.now_us, name=name, data=data))

    emit("validate_start", model=model, targets=len(targets), settle_s=settle_s)
    try:
        robot.move_lengths(straight)
        for target, lengths, cut in zip(targets, lengths_mm, cut_mm, strict=True):
            robot.move_lengths(lengths)
            _pause(robot, settle_s)
            position = measure(target)
            emit(
                "target",
                label=target.label,
                target_mm=list(target.position_mm),
                lengths_mm=[float(value) for value in lengths],
                cut_mm=float(cut.max()),
                position_mm=None if position is None else [float(value) for value in position],
            )
            if position is not None:
                poses.append(Pose(target, np.asarray(position, dtype=float)))
            robot.move_lengths(straight)
    except BaseException as error:
        stop_all(error, robot.stop)
        # If the log is what failed, it can't be told there.
        with contextlib.suppress(SetaeError):
            emit("validate_aborted", reason=f"{type(error).__name__}: {error}".strip(": "))
        raise
    emit("validate_end", measured=len(poses))
    return poses


def _pause(robot: Robot, duration_s: float) -> None:
    until_us = robot.now_us + round(duration_s * 1e6)
    robot.wait(
        lambda: robot.now_us >= until_us, timeout_s=duration_s + 1.0, what="the robot to settle"
    )


def measured(
    path: Path, poses: Sequence[Pose], config: Config, *, model: str, files: Sequence[str]
) -> None:
    """Write positions that were measured elsewhere as a log, like that of a run.

    Parameters
    ----------
    path
        The log to make.
    poses
        What was measured.
    config, model
        Robot and tendon model of the commands.
    files
        Names of the files that they come from.

    Raises
    ------
    LogError
        The log is there already, or can't be written.
    """
    lengths_mm, cut_mm = commanded_lengths_mm([pose.target for pose in poses], config, model)
    metadata = {
        "simulated": False,
        "experiment": "validate",
        "model": model,
        "positions": list(files),
        "config": config.to_toml(),
        "versions": {"setae": setae.__version__},
    }
    with Recorder(path, metadata=metadata) as recorder:
        recorder.experiment(0, "validate_start", {"model": model, "targets": len(poses)})
        for pose, lengths, cut in zip(poses, lengths_mm, cut_mm, strict=True):
            recorder.experiment(
                0,
                "target",
                {
                    "label": pose.target.label,
                    "target_mm": list(pose.target.position_mm),
                    "lengths_mm": lengths,
                    "cut_mm": float(cut.max()),
                    "position_mm": pose.position_mm,
                },
            )
        recorder.experiment(0, "validate_end", {"measured": len(poses)})
