"""From where the pulses are and where the tendons shall be to what the board plays.

Nothing here knows a session: the same question gets the same answer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from setae import kinematics, servo, trajectory, workspace
from setae.arc import Arc, FloatArray, finite_array, positive
from setae.config import Config
from setae.errors import InputError, TrajectoryError, UnreachableError
from setae.servo import Ticks
from setae.trajectory.plan import TooFast
from setae_protocol.messages import SERVO_FRAME_US, Segment, SetLimits

Begun = tuple[FloatArray, trajectory.FrameTrajectory]

# Questions of one kind; a plan of many segments takes some kilobytes.
_REMEMBERED = 64


@dataclass(frozen=True, slots=True)
class Planned:
    """What the board plays: segments, the pulses at their end, and how long they take."""

    segments: tuple[Segment, ...]
    final_ticks: Ticks
    duration_s: float


class Planner:
    """Plans a robot's motions.

    Parameters
    ----------
    config
        The robot.

    Attributes
    ----------
    servos
        Its servos.
    """

    def __init__(self, config: Config) -> None:
        self.servos = servo.ServoModel(config)
        self._config = config
        # A scan goes between a few lengths hundreds of times.
        self._reach = lru_cache(maxsize=_REMEMBERED)(self._reach_anew)
        self._line = lru_cache(maxsize=_REMEMBERED)(self._line_anew)

    @property
    def limits(self) -> SetLimits:
        """What the board checks by itself."""
        return servo.board_limits(self._config)

    @property
    def free_ticks(self) -> Ticks:
        """Pulses at the free length."""
        return _four(self.servos.free_ticks())

    def ticks(self, lengths_mm: npt.ArrayLike) -> Ticks:
        """Pulses for four tendon lengths."""
        return _four(self.servos.ticks(lengths_mm))

    def reach(self, position_mm: npt.ArrayLike, model: str | None) -> FloatArray:
        """Tendon lengths, (4,), that bring the spring's top to a position in frame D, (3,)."""
        position = finite_array("position_mm", position_mm, last_axis=3, what="x, y, z")
        if position.shape != (3,):
            raise InputError(f"position_mm has shape {position.shape}.", "Give one x, y, z.")
        x_mm, y_mm, z_mm = position.tolist()
        return self._reach(x_mm, y_mm, z_mm, model)

    def _reach_anew(self, x_mm: float, y_mm: float, z_mm: float, model: str | None) -> FloatArray:
        lengths_mm = workspace.require(kinematics.inverse((x_mm, y_mm, z_mm)), self._config, model)
        lengths_mm.flags.writeable = False
        return lengths_mm

    # ---------------------------------------------------------------- the board's limits

    def excluded(self, ticks: Ticks) -> str:
        """Why the board refuses to hold at pulses, as a sentence; empty if it doesn't."""
        limits = self.limits
        ends = zip(limits.pulse_min_ticks, limits.pulse_max_ticks, strict=True)
        for index, (tick, (low, high)) in enumerate(zip(ticks, ends, strict=True)):
            if not low <= tick <= high:
                at_us, low_us, high_us = (part / servo.TICKS_PER_US for part in (tick, low, high))
                return (
                    f"Servo {index} would be at a pulse of {at_us:g} µs; the spring allows it "
                    f"{low_us:g} to {high_us:g} µs."
                )
        for pair, (a, b) in enumerate(((0, 2), (1, 3))):
            total, difference = ticks[a] + ticks[b], ticks[a] - ticks[b]
            low, high = limits.pair_sum_min_ticks[pair], limits.pair_sum_max_ticks[pair]
            least = limits.pair_difference_min_ticks[pair]
            most = limits.pair_difference_max_ticks[pair]
            if not (low <= total <= high and least <= difference <= most):
                return f"Tendons {a} and {b} at these lengths would crush or over-bend the spring."
        return ""

    def require_allowed(self, ticks: Ticks) -> None:
        """Refuse here what the board would refuse."""
        if why := self.excluded(ticks):
            raise UnreachableError(
                why, "Choose lengths that belong to a pose inside the workspace."
            )

    # ------------------------------------------------------------------------- motions

    def line(
        self,
        start_ticks: Ticks,
        lengths_mm: FloatArray,
        *,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
        too_fast: TooFast = "raise",
    ) -> Planned:
        """From pulses straight to tendon lengths, in a time or at the fastest tendon's speed."""
        require_one(duration_s, speed_mm_s)
        if duration_s is not None:
            duration_s = positive("duration_s", duration_s)
        else:
            speed = self._config.motion.move_speed_mm_s if speed_mm_s is None else speed_mm_s
            speed_mm_s = positive("speed_mm_s", speed)
        lengths = tuple(lengths_mm.tolist())
        return self._line(start_ticks, lengths, duration_s, speed_mm_s, too_fast)

    def _line_anew(
        self,
        start_ticks: Ticks,
        lengths_mm: tuple[float, ...],
        duration_s: float | None,
        speed_mm_s: float | None,
        too_fast: TooFast,
    ) -> Planned:
        limit = self.servos.max_speed_mm_s
        if speed_mm_s is not None:
            if speed_mm_s > limit.min():
                raise TrajectoryError(
                    f"{speed_mm_s:g} mm/s is faster than the servos' {limit.min():.0f} mm/s.",
                    "Give a lower speed.",
                )
            limit = np.minimum(limit, speed_mm_s)
        if self.ticks(lengths_mm) == start_ticks:
            return Planned((), start_ticks, 0.0)
        motion = trajectory.line(
            self.servos.lengths_mm(start_ticks),
            lengths_mm,
            limits=self._limits(limit),
            duration_s=duration_s,
            too_fast=too_fast,
        )
        return self._packed(motion, start_ticks)

    def along(
        self,
        points_mm: FloatArray,
        *,
        blend_mm: float,
        duration_s: float | None,
        speed_mm_s: float | None,
        model: str | None,
        at_jump: Literal["refuse", "bridge"],
    ) -> Begun:
        """Tendon lengths at the first of some positions, and the motion from there on."""
        if points_mm.ndim != 2 or len(points_mm) < 2:
            raise InputError(
                f"waypoints_mm has shape {points_mm.shape}.", "Give two x, y, z or more."
            )
        arcs = kinematics.inverse(points_mm)
        lengths_mm = workspace.require(arcs, self._config, model)
        motion = trajectory.along(
            arcs,
            self._config.geometry,
            model or self._config.motion.model,
            limits=self._limits(self._path_speed(speed_mm_s, duration_s)),
            blend_mm=blend_mm,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            at_jump=at_jump,
        )
        return lengths_mm[0], motion

    def circle(
        self,
        radius_mm: float,
        height_mm: float,
        *,
        start_deg: float,
        turns: float,
        duration_s: float | None,
        speed_mm_s: float | None,
        model: str | None,
        at_jump: Literal["refuse", "bridge"],
    ) -> Begun:
        """Tendon lengths where a circle begins, and the motion round it."""
        start_rad = math.radians(float(finite_array("start_deg", start_deg)))
        radius = positive("radius_mm", radius_mm)
        arc = kinematics.inverse(
            (radius * math.cos(start_rad), radius * math.sin(start_rad), height_mm)
        )
        lengths_mm = workspace.require(arc, self._config, model)
        motion = trajectory.circle(
            float(arc.length_mm),
            float(arc.theta_rad),
            self._config.geometry,
            model or self._config.motion.model,
            limits=self._limits(self._path_speed(speed_mm_s, duration_s)),
            start_rad=start_rad,
            turns=turns,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            at_jump=at_jump,
        )
        return lengths_mm, motion

    def pack(self, motion: trajectory.FrameTrajectory, start_ticks: Ticks) -> Planned:
        """A motion from pulses through poses, each of which the board would take."""
        planned = self._packed(motion, start_ticks)
        for segment in planned.segments:
            self.require_allowed(segment.target_ticks)
        return planned

    def extension_s(self, pose: Arc, position_mm: npt.ArrayLike, speed_mm_s: float | None) -> float:
        """Time for an extension whose tip is at most so fast; None: the probe speed."""
        if speed_mm_s is None:
            speed_mm_s = self._config.motion.probe_speed_mm_s
        duration_s = trajectory.duration_for_speed(
            pose,
            kinematics.inverse(position_mm),
            speed_mm_s,
            tip_offset_mm=self._config.geometry.tip_offset_mm,
        )
        return max(SERVO_FRAME_US / 1e6, duration_s)

    def _path_speed(self, speed_mm_s: float | None, duration_s: float | None) -> FloatArray:
        """What limits the tendons on a way: the configured speed, unless time or speed is given."""
        limit = self.servos.max_speed_mm_s
        if speed_mm_s is None and duration_s is None:
            limit = np.minimum(limit, self._config.motion.move_speed_mm_s)
        return np.asarray(limit)

    def _limits(self, speed_mm_s: npt.ArrayLike) -> trajectory.Limits:
        motion = self._config.motion
        return trajectory.Limits(
            speed_mm_s=speed_mm_s,
            acceleration_mm_s2=motion.acceleration_mm_s2,
            jerk_mm_s3=motion.jerk_mm_s3,
        )

    def _packed(self, motion: trajectory.FrameTrajectory, start_ticks: Ticks) -> Planned:
        segments = self.servos.segments(motion.lengths_mm, start_ticks=start_ticks)
        final = segments[-1].target_ticks if segments else start_ticks
        return Planned(segments, final, motion.duration_s)


def require_one(duration_s: float | None, speed_mm_s: float | None) -> None:
    """Refuse a time and a speed at once."""
    if duration_s is not None and speed_mm_s is not None:
        raise InputError("Both duration_s and speed_mm_s are given.", "Give one of them.")


def _four(ticks: npt.NDArray[np.int64]) -> Ticks:
    a, b, c, d = (int(tick) for tick in ticks)
    return a, b, c, d
