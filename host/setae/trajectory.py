"""Smooth motions, sampled on the board's servo frames.

All tendons follow one phase s(t), a quintic from 0 to 1 that starts and ends at
rest and without acceleration: they start, pass each point of the path and arrive
together. The path is either straight between tendon lengths (`line`, the paper's
"interpolating tendon length changes") or straight between arcs (`bend`), where the
tendon model decides the lengths in between.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray, finite_array, first_place
from setae.config import Geometry
from setae.errors import InputError, TrajectoryError
from setae_protocol.messages import SERVO_FRAME_US

__all__ = [
    "JUMP_MM",
    "PEAK",
    "FrameTrajectory",
    "bend",
    "between",
    "duration_for_speed",
    "hold",
    "largest_jump_mm",
    "line",
    "quintic",
]

TooFast: TypeAlias = Literal["raise", "stretch"]

FRAME_S = SERVO_FRAME_US * 1e-6

PEAK = 1.875
"""Highest speed of the quintic over its mean speed."""

JUMP_MM = 0.05
"""Steps of a tendon up to this pass as continuous: they are below a servo's dead band."""

FRAMES_MAX = 30_000
"""Ten minutes: a longer motion is a mistake in a unit."""


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
    """

    start_mm: FloatArray
    lengths_mm: FloatArray
    phase: FloatArray

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
        return _speed(self.start_mm, self.lengths_mm)


def quintic(part: npt.ArrayLike) -> FloatArray:
    """Compute the phase s for a part 0…1 of the duration.

    Examples
    --------
    >>> quintic([0, 0.5, 1]).tolist()
    [0.0, 0.5, 1.0]
    """
    t = np.clip(np.asarray(part, dtype=np.float64), 0.0, 1.0)
    # The upper half by symmetry: it loses no digits near 1, and never falls.
    lower = np.minimum(t, 1 - t)
    s = lower**3 * (10 + lower * (6 * lower - 15))
    return np.asarray(np.where(t <= 0.5, s, 1 - s))


def _quintic_rate(part: FloatArray) -> FloatArray:
    return np.asarray(30 * part**2 * (1 - part) ** 2)


def line(
    start_mm: npt.ArrayLike,
    end_mm: npt.ArrayLike,
    *,
    max_speed_mm_s: npt.ArrayLike,
    duration_s: float | None = None,
    too_fast: TooFast = "raise",
) -> FrameTrajectory:
    """Plan a straight line between tendon lengths. Never jumps.

    Parameters
    ----------
    start_mm, end_mm : array_like, shape (n,)
        Tendon lengths.
    max_speed_mm_s
        Fastest that a tendon may move: one number, or one a tendon, such as
        `ServoModel.max_speed_mm_s`.
    duration_s
        Time for the motion, rounded up to servo frames. None: the shortest.
    too_fast
        What to do if a tendon would exceed its speed: ``raise``, or ``stretch``
        the motion.

    Returns
    -------
    FrameTrajectory
        From rest to rest; ends exactly at `end_mm`.

    Raises
    ------
    InputError
        NaN, infinite, wrong shape, a duration that is not above 0.
    TrajectoryError
        Too fast; says how long it would take.

    Examples
    --------
    >>> motion = line([70] * 4, [60] * 4, duration_s=1.0, max_speed_mm_s=60)
    >>> motion.frames, motion.lengths_mm[-1].tolist()
    (50, [60.0, 60.0, 60.0, 60.0])
    """
    start = finite_array("start_mm", start_mm)
    end = finite_array("end_mm", end_mm)
    if start.ndim != 1 or start.shape != end.shape or not len(start):
        raise InputError(
            f"start_mm has shape {start.shape} and end_mm {end.shape}.",
            "Both must be (n,), one length a tendon.",
        )

    def path(s: FloatArray) -> FloatArray:
        lengths = start + s[:, np.newaxis] * (end - start)
        # start + 1·(end − start) may miss the end by a rounding.
        lengths[s == 1.0] = end
        return lengths

    return _plan(path, max_speed_mm_s, duration_s, too_fast)


def bend(
    start: Arc,
    end: Arc,
    geometry: Geometry,
    model: str = "paper",
    *,
    max_speed_mm_s: npt.ArrayLike,
    duration_s: float | None = None,
    too_fast: TooFast = "raise",
) -> FrameTrajectory:
    """Plan a straight line between arcs, in length and bending vector.

    Parameters
    ----------
    start, end
        Single arcs, shape ().
    geometry, model
        As in `setae.tendons.lengths`.
    max_speed_mm_s, duration_s, too_fast
        As in `line`.

    Returns
    -------
    FrameTrajectory
        From rest to rest; ends exactly at the lengths of `end`.

    Raises
    ------
    InputError
        As in `line`; arcs that are not single.
    TrajectoryError
        Too fast, or the lengths jump on the way: with the model ``paper`` where a
        tendon crosses the neutral plane while the spring is bent.

    Examples
    --------
    >>> import setae
    >>> x, y = (kinematics.inverse(p) for p in ((15, 0, 60), (0, 15, 60)))
    >>> bend(x, y, setae.Geometry(), "parallel", max_speed_mm_s=60).frames
    7
    >>> bend(x, y, setae.Geometry(), "paper", max_speed_mm_s=60)
    Traceback (most recent call last):
    ...
    setae.errors.TrajectoryError: Tendon ... jumps by 0.76 mm at ...
    """
    _require_single("start", start)
    _require_single("end", end)
    jump, tendon, place = largest_jump_mm(start, end, geometry, model)
    if jump > JUMP_MM:
        raise TrajectoryError(
            f"Tendon {tendon} jumps by {jump:.2f} mm at {place:.0%} of the path: the model "
            f"{model!r} switches between arc and chord there.",
            "Go through a straight pose, move along a line between tendon lengths, or use the "
            "model 'parallel'.",
        )

    def path(s: FloatArray) -> FloatArray:
        return tendons.lengths(between(start, end, s), geometry, model)

    return _plan(path, max_speed_mm_s, duration_s, too_fast)


def hold(lengths_mm: npt.ArrayLike, *, duration_s: float) -> FrameTrajectory:
    """Plan a rest.

    Parameters
    ----------
    lengths_mm : array_like, shape (n,)
        Tendon lengths.
    duration_s
        Rounded up to servo frames.

    Examples
    --------
    >>> hold([70] * 4, duration_s=0.05).frames
    3
    """
    return line(lengths_mm, lengths_mm, duration_s=duration_s, max_speed_mm_s=1.0)


def between(start: Arc, end: Arc, phase: npt.ArrayLike) -> Arc:
    """Find arcs on the straight line between two, in length and bending vector.

    Parameters
    ----------
    start, end
        Single arcs.
    phase : array_like, shape (...)
        0 at the start, 1 at the end.

    Returns
    -------
    Arc
        Of shape (...).

    Examples
    --------
    >>> a, b = Arc(length_mm=40, bend_rad=(0, 0)), Arc(length_mm=60, bend_rad=(1, 0))
    >>> between(a, b, 0.5).bend_rad.tolist()
    [0.5, 0.0]
    """
    s = finite_array("phase", phase)
    # This form meets both ends exactly.
    rest = 1 - s
    return Arc(
        length_mm=rest * start.length_mm + s * end.length_mm,
        bend_rad=rest[..., np.newaxis] * start.bend_rad + s[..., np.newaxis] * end.bend_rad,
    )


def largest_jump_mm(
    start: Arc, end: Arc, geometry: Geometry, model: str
) -> tuple[float, int, float]:
    """Find the largest step of a tendon on the straight line between two arcs.

    Returns
    -------
    jump_mm : float
        0.0 where the lengths are continuous.
    tendon : int
        The tendon that jumps.
    phase : float
        Where on the path, 0…1.

    Examples
    --------
    >>> import setae
    >>> a, b = (Arc.from_angles(length_mm=50, theta_rad=1.5, alpha_rad=x) for x in (-0.1, 0.1))
    >>> jump, tendon, place = largest_jump_mm(a, b, setae.Geometry(), "paper")
    >>> round(jump, 2), round(place, 2)
    (6.02, 0.5)
    """
    rule = tendons.model(model)

    def pieces(s: FloatArray) -> npt.NDArray[np.bool_]:
        return rule.pieces(between(start, end, s), geometry)

    # Only where a tendon changes its piece can the length jump: close in on each change.
    s = np.linspace(0.0, 1.0, 257)
    changed = np.flatnonzero((pieces(s)[1:] != pieces(s)[:-1]).any(axis=-1))
    if not len(changed):
        return 0.0, 0, 0.0
    low, high = s[changed], s[changed + 1]
    before = pieces(low)
    for _ in range(48):
        middle = (low + high) / 2
        same = (pieces(middle) == before).all(axis=-1)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    step = np.abs(
        rule.lengths(between(start, end, high), geometry)
        - rule.lengths(between(start, end, low), geometry)
    )
    place, tendon = np.unravel_index(int(np.argmax(step)), step.shape)
    return float(step[place, tendon]), int(tendon), float(high[place])


def duration_for_speed(
    start: Arc, end: Arc, speed_mm_s: float, *, tip_offset_mm: float = 0.0
) -> float:
    """Find the duration for which the tip's highest speed is as asked.

    Parameters
    ----------
    start, end
        Single arcs; the tip follows the straight line between them.
    speed_mm_s
        Highest speed of the tip, above 0.
    tip_offset_mm
        As in `setae.kinematics.position`: 0 for U, the robot's own for E.

    Returns
    -------
    float
        Seconds; at least one servo frame.

    Examples
    --------
    >>> a, b = Arc(length_mm=45, bend_rad=(0, 0)), Arc(length_mm=65, bend_rad=(0, 0))
    >>> round(duration_for_speed(a, b, 20.0), 3)
    1.875
    """
    _require_single("start", start)
    _require_single("end", end)
    speed = float(_positive("speed_mm_s", speed_mm_s))
    part = np.linspace(0.0, 1.0, 401)
    tip = kinematics.position(between(start, end, part), tip_offset_mm=tip_offset_mm)
    slope = np.linalg.norm(np.gradient(tip, part, axis=0, edge_order=2), axis=-1)
    # |dE/dt| = |dE/ds| · s'(t/T) / T; at time t the phase is quintic(t/T).
    peak = np.interp(quintic(part), part, slope) * _quintic_rate(part)
    return max(float(peak.max()) / speed, FRAME_S)


# ----------------------------------------------------------------------- planning


def _speed(start: FloatArray, lengths: FloatArray) -> FloatArray:
    return np.abs(np.diff(lengths, axis=0, prepend=start[np.newaxis])) / FRAME_S


def _plan(
    path: Callable[[FloatArray], FloatArray],
    max_speed_mm_s: npt.ArrayLike,
    duration_s: float | None,
    too_fast: TooFast,
) -> FrameTrajectory:
    """Sample a path so that no tendon exceeds its speed."""
    if too_fast not in ("raise", "stretch"):
        raise InputError(f"too_fast is {too_fast!r}.", "It must be 'raise' or 'stretch'.")
    limit = _positive("max_speed_mm_s", max_speed_mm_s)
    start = path(np.zeros(1))[0]
    if limit.ndim > 1 or (limit.ndim == 1 and limit.shape != start.shape):
        raise InputError(
            f"max_speed_mm_s has shape {limit.shape}.",
            f"It must be one number, or {len(start)}, one a tendon.",
        )

    # Highest speed in the continuous motion, for a duration of one second.
    part = np.linspace(0.0, 1.0, 257)
    lengths = path(quintic(part))
    excess = float((np.abs(np.diff(lengths, axis=0)) * 256 / limit).max())
    fewest = max(1, _frames(excess))
    asked = 1 if duration_s is None else max(1, _frames(float(_positive("duration_s", duration_s))))
    if duration_s is None or too_fast == "stretch":
        asked = max(asked, fewest)

    while True:
        if asked > FRAMES_MAX:
            raise TrajectoryError(
                f"The motion would take more than {FRAMES_MAX * FRAME_S:.0f} s.",
                "Check duration and speed, in s and mm/s.",
            )
        phase = quintic(np.arange(1, asked + 1) / asked)
        lengths = path(phase)
        ratio = float((_speed(start, lengths) / limit).max())
        if ratio <= 1 + 1e-9:
            return FrameTrajectory(start, lengths, phase)
        if duration_s is not None and too_fast == "raise":
            speed = _speed(start, lengths)
            frame, tendon = np.unravel_index(int(np.argmax(speed / limit)), speed.shape)
            allowed = float(np.broadcast_to(limit, start.shape)[tendon])
            raise TrajectoryError(
                f"Tendon {tendon} would move at {speed[frame, tendon]:.1f} mm/s, and at most "
                f"{allowed:.1f} mm/s are allowed.",
                f"Give the motion {fewest * FRAME_S:.2f} s or more.",
            )
        # Between the samples that `fewest` rests on, the motion may be a little faster.
        asked += 1 + asked // 100


def _frames(duration_s: float) -> int:
    """Servo frames for a duration, rounded up but for what is rounding itself."""
    return math.ceil(duration_s / FRAME_S - 1e-6)


def _positive(name: str, value: npt.ArrayLike) -> FloatArray:
    array = finite_array(name, value)
    bad = array <= 0
    if bad.any():
        raise InputError(f"{name}{first_place(bad)} is {array[bad][0]:g}.", "It must be above 0.")
    return array


def _require_single(name: str, arc: Arc) -> None:
    if arc.shape != ():
        raise InputError(f"{name} holds arcs of shape {arc.shape}.", "Pass a single arc.")
