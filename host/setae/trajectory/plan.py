"""A path's time, stretched until no tendon exceeds a limit, and sampled on servo frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from setae.arc import FloatArray, first_place
from setae.errors import InputError, TrajectoryError
from setae.trajectory.laws import Law
from setae.trajectory.paths import Jump
from setae_protocol.messages import SERVO_FRAME_US

__all__ = [
    "FRAME_S",
    "FrameTrajectory",
    "Limits",
    "TooFast",
    "check_too_fast",
    "frames_of",
    "joined",
    "sampled",
    "shortest",
    "too_fast_error",
]

Path: TypeAlias = Callable[[FloatArray], FloatArray]
TooFast: TypeAlias = Literal["raise", "stretch"]

FRAME_S = SERVO_FRAME_US * 1e-6

FRAMES_MAX = 30_000
"""Ten minutes: a longer motion is a mistake in a unit."""

_ROUNDING = 1 + 1e-9
_FINE = 512
_NAMES = (
    ("move at", "mm/s"),
    ("be accelerated by", "mm/s²"),
    ("be jerked by", "mm/s³"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """What no tendon may exceed; each one number, or one a tendon.

    Attributes
    ----------
    speed_mm_s
        Such as `ServoModel.max_speed_mm_s`.
    acceleration_mm_s2, jerk_mm_s3
        Infinite unless given.

    Raises
    ------
    InputError
        NaN, or not above 0.

    Examples
    --------
    >>> Limits(speed_mm_s=60).jerk_mm_s3
    array(inf)
    """

    speed_mm_s: npt.ArrayLike
    acceleration_mm_s2: npt.ArrayLike = math.inf
    jerk_mm_s3: npt.ArrayLike = math.inf

    def __post_init__(self) -> None:
        for name in ("speed_mm_s", "acceleration_mm_s2", "jerk_mm_s3"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            bad = ~(value > 0)
            if bad.any():
                raise InputError(
                    f"{name}{first_place(bad)} is {value[bad][0]:g}.", "It must be above 0."
                )
            object.__setattr__(self, name, value)

    def table(self, count: int) -> FloatArray:
        """Speed, acceleration and jerk of each tendon, shape (3, count).

        Raises
        ------
        InputError
            A limit has another number of tendons.
        """
        rows = []
        for name in ("speed_mm_s", "acceleration_mm_s2", "jerk_mm_s3"):
            value = np.asarray(getattr(self, name))
            if value.ndim > 1 or (value.ndim == 1 and value.shape != (count,)):
                raise InputError(
                    f"{name} has shape {value.shape}.",
                    f"It must be one number, or {count}, one a tendon.",
                )
            rows.append(np.broadcast_to(value, (count,)))
        return np.stack(rows)


@dataclass(frozen=True, slots=True, eq=False)
class FrameTrajectory:
    """Tendon lengths, frame by frame.

    Attributes
    ----------
    start_mm : ndarray, shape (n,)
        Lengths before the first frame.
    lengths_mm : ndarray, shape (n_frames, n)
        Lengths at the end of each servo frame.
    phase : ndarray, shape (n_frames,)
        Part of the path that is done by then; the last is 1.
    bridges : tuple of Jump
        Jumps of the tendon model on the path. At each the motion comes to rest, the
        tendons go in a line to their lengths on the other side, and it goes on.
    """

    start_mm: FloatArray
    lengths_mm: FloatArray
    phase: FloatArray
    bridges: tuple[Jump, ...] = field(default=())

    @property
    def frames(self) -> int:
        """Number of servo frames."""
        return len(self.lengths_mm)

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return self.frames * FRAME_S

    @property
    def speed_mm_s(self) -> FloatArray:
        """Speed of each tendon in each frame, shape (n_frames, n)."""
        lengths = np.concatenate([self.start_mm[np.newaxis], self.lengths_mm])
        return np.abs(np.diff(lengths, axis=0)) / FRAME_S

    @property
    def peaks(self) -> FloatArray:
        """Highest speed, acceleration and jerk of each tendon, shape (3, n).

        Differences of the lengths in successive frames, from rest to rest: what the
        servos are asked for. In mm/s, mm/s², mm/s³.
        """
        return _peaks(self.start_mm, self.lengths_mm)


def shortest(path: Path, law: Law, limits: Limits, *, fewest: int = 1) -> int:
    """Find the fewest servo frames, `fewest` or more, in which a path keeps all limits.

    A line never exceeds them between the frames either. On a curved path they hold
    for the differences between frames, which is all that the servos get.

    Raises
    ------
    TrajectoryError
        It would take more than ten minutes.
    """
    ends = path(np.array([0.0, 1.0]))
    table = limits.table(ends.shape[1])
    frames = max(fewest, frames_of(_excess(_least(path, law, ends), table)))
    while True:
        if frames > FRAMES_MAX:
            raise TrajectoryError(
                f"The motion would take more than {FRAMES_MAX * FRAME_S:.0f} s.",
                "Check duration and speed, in s and mm/s.",
            )
        lengths, _ = sampled(path, law, frames)
        excess = _excess(_peaks(ends[0], lengths), table)
        if excess <= _ROUNDING:
            return frames
        # Time scaling is exact for a motion as a whole; sampling it on frames isn't.
        frames = max(frames + 1, math.floor(frames * min(excess, 2.0)))


def sampled(path: Path, law: Law, frames: int) -> tuple[FloatArray, FloatArray]:
    """Sample a path on servo frames: lengths (frames, n), phase (frames,)."""
    phase = law.phase(np.arange(1, frames + 1) / frames)
    return path(phase), phase


def too_fast_error(
    path: Path, law: Law, limits: Limits, asked: int, fewest: int
) -> TrajectoryError:
    """Say which tendon exceeds what in a motion of so many frames."""
    ends = path(np.array([0.0, 1.0]))
    table = limits.table(ends.shape[1])
    lengths, _ = sampled(path, law, asked)
    duration_s = asked * FRAME_S
    whole = _least(path, law, ends) / duration_s ** np.arange(1, 4)[:, np.newaxis]
    peaks = np.maximum(_peaks(ends[0], lengths), whole)
    kind, tendon = np.unravel_index(int(np.argmax(peaks / table)), peaks.shape)
    verb, unit = _NAMES[kind]
    return TrajectoryError(
        f"Tendon {tendon} would {verb} {peaks[kind, tendon]:.1f} {unit}, and at most "
        f"{table[kind, tendon]:.1f} {unit} are allowed.",
        f"Give the motion {fewest * FRAME_S:.2f} s or more.",
    )


def joined(parts: list[FrameTrajectory], bridges: tuple[Jump, ...] = ()) -> FrameTrajectory:
    """Put motions one after the other; each starts where the one before ends."""
    return FrameTrajectory(
        parts[0].start_mm,
        np.concatenate([part.lengths_mm for part in parts]),
        np.concatenate([part.phase for part in parts]),
        bridges,
    )


def frames_of(duration_s: float) -> int:
    """Servo frames for a duration, rounded up but for what is rounding itself; 1 or more."""
    return max(1, math.ceil(duration_s / FRAME_S - 1e-6))


def check_too_fast(too_fast: TooFast) -> None:
    """Raise InputError for anything but the two answers."""
    if too_fast not in ("raise", "stretch"):
        raise InputError(f"too_fast is {too_fast!r}.", "It must be 'raise' or 'stretch'.")


def _least(path: Path, law: Law, ends: FloatArray) -> FloatArray:
    """Peaks in a duration of 1 s that sampling on frames must not hide, shape (3, n).

    Exact for a line; for a curve its speed, and what a line between its ends needs.
    """
    least = np.array(law.peaks)[:, np.newaxis] * np.abs(ends[1] - ends[0])
    part = np.linspace(0.0, 1.0, _FINE + 1)
    speed = np.abs(np.diff(path(law.phase(part)), axis=0)).max(axis=0) * _FINE
    least[0] = np.maximum(least[0], speed)
    return np.asarray(least)


def _peaks(start: FloatArray, lengths: FloatArray) -> FloatArray:
    # At rest long before and after.
    path = np.concatenate([[start] * 3, lengths, [lengths[-1]] * 3])
    return np.stack([np.abs(np.diff(path, n, axis=0)).max(axis=0) / FRAME_S**n for n in (1, 2, 3)])


def _excess(peaks: FloatArray, table: FloatArray) -> float:
    """By what factor a motion must be slower: speed goes with 1/T, jerk with 1/T³."""
    ratio = (peaks / table).max(axis=1)
    return float(max(ratio[0], ratio[1] ** (1 / 2), ratio[2] ** (1 / 3)))
