"""The motions that a caller asks for: lines, bends, waypoints, circles, rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray, finite_array
from setae.config import Geometry
from setae.errors import InputError, TrajectoryError
from setae.trajectory.laws import QUINTIC, Law, cruise_law, quintic, quintic_rate
from setae.trajectory.paths import Jump, Way, at_constant_speed, between, blended, circular, jumps
from setae.trajectory.plan import (
    FRAME_S,
    FrameTrajectory,
    Limits,
    TooFast,
    check_too_fast,
    frames_of,
    joined,
    positive,
    sampled,
    shortest,
    too_fast_error,
)

__all__ = ["AtJump", "along", "bend", "circle", "duration_for_speed", "hold", "line"]

AtJump: TypeAlias = Literal["refuse", "bridge"]

_SCRAP = 1e-5
_RAMPS = (0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05)


def line(
    start_mm: npt.ArrayLike,
    end_mm: npt.ArrayLike,
    *,
    limits: Limits,
    duration_s: float | None = None,
    too_fast: TooFast = "raise",
) -> FrameTrajectory:
    """Plan a straight line between tendon lengths. Never jumps.

    Parameters
    ----------
    start_mm, end_mm : array_like, shape (n,)
        Tendon lengths.
    limits
        Of speed, acceleration and jerk.
    duration_s
        Time for the motion, rounded up to servo frames. None: the shortest.
    too_fast
        What to do if a tendon would exceed a limit: ``raise``, or ``stretch``
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
    >>> motion = line([70] * 4, [60] * 4, duration_s=1.0, limits=Limits(speed_mm_s=60))
    >>> motion.frames, motion.lengths_mm[-1].tolist()
    (50, [60.0, 60.0, 60.0, 60.0])
    """
    return _planned([_line_part(start_mm, end_mm)], limits, duration_s, too_fast)


def bend(
    start: Arc,
    end: Arc,
    geometry: Geometry,
    model: str = "paper",
    *,
    limits: Limits,
    duration_s: float | None = None,
    speed_mm_s: float | None = None,
    too_fast: TooFast = "raise",
    at_jump: AtJump = "refuse",
) -> FrameTrajectory:
    """Plan a straight line between arcs, in length and bending vector.

    Parameters
    ----------
    start, end
        Single arcs, shape ().
    geometry, model
        As in `setae.tendons.lengths`.
    limits, duration_s, speed_mm_s, too_fast, at_jump
        As in `along`.

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
    >>> slow = Limits(speed_mm_s=60)
    >>> bend(x, y, setae.Geometry(), "parallel", limits=slow).frames
    7
    >>> bend(x, y, setae.Geometry(), "paper", limits=slow)
    Traceback (most recent call last):
    ...
    setae.errors.TrajectoryError: Tendon ... jumps by 0.76 mm at ...
    """
    _require_single("start", start)
    _require_single("end", end)
    parts = _parts(lambda s: between(start, end, s), geometry, model, at_jump, 257)
    if speed_mm_s is not None:
        return _at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return _planned(parts, limits, duration_s, too_fast)


def along(
    waypoints: Arc,
    geometry: Geometry,
    model: str = "paper",
    *,
    limits: Limits,
    blend_mm: float = 0.0,
    duration_s: float | None = None,
    speed_mm_s: float | None = None,
    too_fast: TooFast = "raise",
    at_jump: AtJump = "refuse",
) -> FrameTrajectory:
    """Plan a way along waypoints, straight between arcs.

    Parameters
    ----------
    waypoints
        Arcs of shape (m,), the first is where the motion starts. Of equal neighbours
        one counts.
    geometry, model
        As in `setae.tendons.lengths`.
    limits
        Of every tendon's speed, acceleration and jerk.
    blend_mm
        How far before a waypoint the motion may leave the straight line, as a distance
        of the spring's top, at most half of either line; it then passes without a
        stop, about a fifth of that beside a right-angled corner. 0: it stops at each
        waypoint.
    duration_s
        Time for all of it, rounded up to servo frames. None: the shortest.
    speed_mm_s
        Constant speed of the spring's top between smooth ramps, instead of a
        duration.
    too_fast
        As in `line`.
    at_jump
        Where the tendon model jumps: ``refuse`` the way, or ``bridge`` the jump: come
        to rest before it, move the tendons in a line to the lengths behind it, and
        go on.

    Returns
    -------
    FrameTrajectory
        From rest to rest; `bridges` names the jumps.

    Raises
    ------
    InputError
        Fewer than two different waypoints, or numbers that mean nothing.
    TrajectoryError
        Too fast, or a jump; says which tendon, how far and where.

    Examples
    --------
    >>> import setae
    >>> points = kinematics.inverse([(0, 0, 45), (15, 0, 60), (10, 11, 60)])
    >>> fast = Limits(speed_mm_s=150, acceleration_mm_s2=3000, jerk_mm_s3=60000)
    >>> stops = along(points, setae.Geometry(), "parallel", limits=fast)
    >>> rounded = along(points, setae.Geometry(), "parallel", limits=fast, blend_mm=5)
    >>> rounded.frames < stops.frames
    True
    """
    if len(waypoints.shape) != 1:
        raise InputError(
            f"waypoints has shape {waypoints.shape}.", "Pass arcs of shape (m,), m at least 2."
        )
    top = waypoints.top_mm
    keep = np.ones(len(top), dtype=bool)
    keep[1:] = np.linalg.norm(np.diff(top, axis=0), axis=-1) > 1e-9
    points = waypoints[keep]
    if points.shape[0] < 2:
        raise InputError("waypoints holds fewer than two different arcs.", "Pass two or more.")
    if not (np.isfinite(blend_mm) and blend_mm >= 0):
        raise InputError(f"blend_mm is {blend_mm}.", "It must be a number from 0.")
    if blend_mm > 0:
        # A corner needs enough samples to find its jumps.
        samples = 128 * points.shape[0] + 1
        parts = _parts(blended(points, blend_mm), geometry, model, at_jump, samples)
    else:
        parts = []
        legs = points.shape[0] - 1
        for i in range(legs):
            start, end = points[i], points[i + 1]
            way = _leg(start, end)
            parts += _parts(way, geometry, model, at_jump, 257, shift=i / legs, scale=1 / legs)
    if speed_mm_s is not None:
        return _at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return _planned(parts, limits, duration_s, too_fast, steady=blend_mm > 0)


def circle(
    length_mm: float,
    theta_rad: float,
    geometry: Geometry,
    model: str = "paper",
    *,
    limits: Limits,
    start_rad: float = 0.0,
    turns: float = 1.0,
    duration_s: float | None = None,
    speed_mm_s: float | None = None,
    too_fast: TooFast = "raise",
    at_jump: AtJump = "refuse",
) -> FrameTrajectory:
    """Plan a circle: the bending direction α turns, at constant length and bending.

    Parameters
    ----------
    length_mm, theta_rad
        Of every arc on it.
    geometry, model
        As in `setae.tendons.lengths`.
    start_rad
        Direction α in which it starts.
    turns
        How often round, positive from x towards y; whole or not.
    limits, duration_s, speed_mm_s, too_fast, at_jump
        As in `along`.

    Returns
    -------
    FrameTrajectory
        From rest to rest.

    Raises
    ------
    InputError
        Numbers that mean nothing.
    TrajectoryError
        As in `along`. Under ``paper`` every circle jumps, at each quarter.

    Examples
    --------
    >>> import setae
    >>> slow = Limits(speed_mm_s=30)
    >>> circle(60, 0.5, setae.Geometry(), "parallel", limits=slow).frames
    82
    >>> motion = circle(60, 0.5, setae.Geometry(), "paper", limits=slow, at_jump="bridge")
    >>> len(motion.bridges), round(motion.bridges[0].size_mm, 2)
    (5, 0.77)
    """
    length = positive("length_mm", length_mm)
    theta = positive("theta_rad", theta_rad)
    start = float(finite_array("start_rad", start_rad))
    count = float(finite_array("turns", turns))
    if count == 0:
        raise InputError("turns is 0.", "Give how often to go round.")
    samples = math.ceil(512 * max(abs(count), 0.5)) + 1
    parts = _parts(circular(length, theta, start, count), geometry, model, at_jump, samples)
    if speed_mm_s is not None:
        return _at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return _planned(parts, limits, duration_s, too_fast)


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
    return line(lengths_mm, lengths_mm, duration_s=duration_s, limits=Limits(speed_mm_s=1.0))


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
    speed = positive("speed_mm_s", speed_mm_s)
    part = np.linspace(0.0, 1.0, 401)
    tip = kinematics.position(between(start, end, part), tip_offset_mm=tip_offset_mm)
    slope = np.linalg.norm(np.gradient(tip, part, axis=0, edge_order=2), axis=-1)
    # |dE/dt| = |dE/ds| · s'(t/T) / T; at time t the phase is quintic(t/T).
    peak = np.interp(quintic(part), part, slope) * quintic_rate(part)
    return max(float(peak.max()) / speed, FRAME_S)


# -------------------------------------------------------------------------- parts


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A stretch from rest to rest.

    Attributes
    ----------
    path
        Phase of the part (p,) → tendon lengths (p, n).
    way
        Phase of the part → arcs; None for a line between tendon lengths.
    shift, scale
        From the part's phase to the whole motion's.
    jump
        What the part bridges.
    """

    path: Callable[[FloatArray], FloatArray]
    way: Way | None = None
    shift: float = 0.0
    scale: float = 1.0
    jump: Jump | None = None


def _leg(start: Arc, end: Arc) -> Way:
    return lambda s: between(start, end, s)


def _line_part(
    start_mm: npt.ArrayLike, end_mm: npt.ArrayLike, shift: float = 0.0, jump: Jump | None = None
) -> _Part:
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

    return _Part(path, None, shift, 0.0 if jump else 1.0, jump)


def _parts(
    way: Way,
    geometry: Geometry,
    model: str,
    at_jump: AtJump,
    samples: int,
    *,
    shift: float = 0.0,
    scale: float = 1.0,
) -> list[_Part]:
    """Cut a way where the model jumps, and put bridges there."""
    if at_jump not in ("refuse", "bridge"):
        raise InputError(f"at_jump is {at_jump!r}.", "It must be 'refuse' or 'bridge'.")
    found = jumps(way, geometry, model, samples=samples)
    if found and at_jump == "refuse":
        worst = max(found, key=lambda jump: jump.size_mm)
        others = f", the largest of {len(found)} jumps" if len(found) > 1 else ""
        raise TrajectoryError(
            f"Tendon {worst.tendon} jumps by {worst.size_mm:.2f} mm at "
            f"{shift + scale * worst.after:.0%} of the path{others}: the model {model!r} switches "
            "between arc and chord there.",
            "Bridge it with at_jump='bridge', go through a straight pose, move in a line between "
            "tendon lengths, or use the model 'parallel'.",
        )

    def stretch(low: float, high: float) -> _Part:
        def part_way(s: FloatArray) -> Arc:
            return way(np.minimum(np.maximum(low + s * (high - low), low), high))

        def path(s: FloatArray) -> FloatArray:
            return tendons.lengths(part_way(s), geometry, model)

        return _Part(path, part_way, shift + scale * low, scale * (high - low))

    parts = []
    low = 0.0
    for jump in found:
        # What is left of the way before and behind a jump may be too little to be a motion.
        before = low if jump.before - low < _SCRAP else jump.before
        after = 1.0 if 1.0 - jump.after < _SCRAP else jump.after
        if before > low:
            parts.append(stretch(low, before))
        ends = tendons.lengths(way(np.array([before, after])), geometry, model)
        here = Jump(shift + scale * before, shift + scale * after, jump.tendon, jump.size_mm)
        parts.append(_line_part(ends[0], ends[1], here.after, here))
        low = after
    if low < 1.0:
        parts.append(stretch(low, 1.0))
    return parts


def _motion(part: _Part, law: Law, frames: int) -> FrameTrajectory:
    lengths, phase = sampled(part.path, law, frames)
    return FrameTrajectory(part.path(np.zeros(1))[0], lengths, part.shift + part.scale * phase)


def _together(parts: list[_Part], laws: list[Law], frames: list[int]) -> FrameTrajectory:
    whole = joined(
        [_motion(part, law, count) for part, law, count in zip(parts, laws, frames, strict=True)],
        tuple(part.jump for part in parts if part.jump is not None),
    )
    # Shift and scale may miss the very end by a rounding.
    whole.phase[-1] = 1.0
    return whole


def _planned(
    parts: list[_Part],
    limits: Limits,
    duration_s: float | None,
    too_fast: TooFast,
    *,
    steady: bool = False,
) -> FrameTrajectory:
    """All parts one after the other, in the asked or the shortest time.

    `steady`: the shortest time may keep a constant speed between its ramps.
    """
    check_too_fast(too_fast)
    if steady and duration_s is None:
        choices = [_fastest(part, limits) for part in parts]
        return _together(parts, [law for law, _ in choices], [count for _, count in choices])
    laws = [QUINTIC] * len(parts)
    asked = None if duration_s is None else frames_of(positive("duration_s", duration_s))
    if len(parts) == 1:
        least = asked or 1
        if asked is not None and too_fast == "raise":
            fewest = [shortest(parts[0].path, QUINTIC, limits, fewest=least)]
            if fewest[0] > asked:
                # Sampling may let a shorter one pass than this one.
                true_fewest = shortest(parts[0].path, QUINTIC, limits)
                raise too_fast_error(
                    parts[0].path, QUINTIC, limits, asked, max(true_fewest, asked + 1)
                )
            return _together(parts, laws, fewest)
        return _together(parts, laws, [shortest(parts[0].path, QUINTIC, limits, fewest=least)])
    fewest = [shortest(part.path, QUINTIC, limits) for part in parts]
    total = sum(fewest)
    if asked is None or asked <= total:
        if asked is not None and asked < total and too_fast == "raise":
            raise _too_short(asked, total, len(parts))
        return _together(parts, laws, fewest)
    # What is over goes to all parts alike; rounding goes down, and what is left to the first.
    counts = [asked * count // total for count in fewest]
    counts[0] += asked - sum(counts)
    counts = [
        shortest(part.path, QUINTIC, limits, fewest=count)
        for part, count in zip(parts, counts, strict=True)
    ]
    return _together(parts, laws, counts)


def _fastest(part: _Part, limits: Limits) -> tuple[Law, int]:
    """The phase with the shortest time, of the quintic and some with other ramps."""
    laws = [QUINTIC, *map(cruise_law, _RAMPS)]
    counts = [shortest(part.path, law, limits) for law in laws]
    best = int(np.argmin(counts))
    return laws[best], counts[best]


def _too_short(asked: int, total: int, parts: int) -> TrajectoryError:
    return TrajectoryError(
        f"{asked * FRAME_S:.2f} s are too short for {parts} parts, each from rest to rest.",
        f"Give the motion {total * FRAME_S:.2f} s or more.",
    )


def _at_speed(
    parts: list[_Part],
    geometry: Geometry,
    model: str,
    limits: Limits,
    speed_mm_s: float,
    duration_s: float | None,
    too_fast: TooFast,
) -> FrameTrajectory:
    """All parts at constant speed of the spring's top, bridges as fast as allowed."""
    check_too_fast(too_fast)
    if duration_s is not None:
        raise InputError("Both duration_s and speed_mm_s are given.", "Give one of them.")
    speed = positive("speed_mm_s", speed_mm_s)
    laws, counts, evened = [], [], []
    for part in parts:
        if part.way is None:
            evened.append(part)
            laws.append(QUINTIC)
            counts.append(shortest(part.path, QUINTIC, limits))
            continue
        even, length_mm = at_constant_speed(part.way)

        def path(s: FloatArray, even: Way = even) -> FloatArray:
            return tendons.lengths(even(s), geometry, model)

        law, frames = _cruise(path, length_mm, speed, limits, too_fast)
        evened.append(_Part(path, even, part.shift, part.scale))
        laws.append(law)
        counts.append(frames)
    return _together(evened, laws, counts)


def _cruise(
    path: Callable[[FloatArray], FloatArray],
    length_mm: float,
    speed_mm_s: float,
    limits: Limits,
    too_fast: TooFast,
) -> tuple[Law, int]:
    """Shortest ramps, then the time, for a path of some length at some speed."""
    s = np.linspace(0.0, 1.0, 257)
    lengths = path(s)
    fastest = np.abs(np.diff(lengths, axis=0)).max(axis=0) * 256 / length_mm * speed_mm_s
    _, acceleration, jerk = limits.table(lengths.shape[1])
    cruise_s = length_mm / speed_mm_s
    ramp_s = float(np.maximum(1.5 * fastest / acceleration, np.sqrt(6 * fastest / jerk)).max())
    ramp_s = max(ramp_s, FRAME_S)
    while True:
        # A way too short for the ramps never gets to the speed.
        ramp_s = min(ramp_s, cruise_s)
        frames = frames_of(cruise_s + ramp_s)
        law = cruise_law(ramp_s / (cruise_s + ramp_s))
        fewest = shortest(path, law, limits, fewest=frames)
        if fewest == frames:
            return law, frames
        if ramp_s == cruise_s:
            break
        ramp_s *= 1.1
    longest = shortest(path, law, limits)
    if too_fast == "raise" and np.any(fastest > limits.table(lengths.shape[1])[0]):
        raise too_fast_error(path, law, limits, frames, max(longest, frames + 1))
    return law, fewest


def _require_single(name: str, arc: Arc) -> None:
    if arc.shape != ():
        raise InputError(f"{name} holds arcs of shape {arc.shape}.", "Pass a single arc.")
