"""The motions that a caller asks for: lines, bends, waypoints, circles, rests."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from setae import kinematics
from setae.arc import Arc, finite_array, positive
from setae.config import Geometry
from setae.errors import InputError
from setae.trajectory.laws import quintic, quintic_rate
from setae.trajectory.parts import AtJump, at_speed, cut, leg, line_part, planned
from setae.trajectory.paths import between, blended, circular
from setae.trajectory.plan import FRAME_S, FrameTrajectory, Limits, TooFast

__all__ = ["along", "bend", "circle", "duration_for_speed", "hold", "line"]


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
    return planned([line_part(start_mm, end_mm)], limits, duration_s, too_fast)


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
    parts = cut(lambda s: between(start, end, s), geometry, model, at_jump, 257)
    if speed_mm_s is not None:
        return at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return planned(parts, limits, duration_s, too_fast)


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
        parts = cut(blended(points, blend_mm), geometry, model, at_jump, samples)
    else:
        parts = []
        legs = points.shape[0] - 1
        for i in range(legs):
            start, end = points[i], points[i + 1]
            way = leg(start, end)
            parts += cut(way, geometry, model, at_jump, 257, shift=i / legs, scale=1 / legs)
    if speed_mm_s is not None:
        return at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return planned(parts, limits, duration_s, too_fast, steady=blend_mm > 0)


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
    parts = cut(circular(length, theta, start, count), geometry, model, at_jump, samples)
    if speed_mm_s is not None:
        return at_speed(parts, geometry, model, limits, speed_mm_s, duration_s, too_fast)
    return planned(parts, limits, duration_s, too_fast)


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


def _require_single(name: str, arc: Arc) -> None:
    if arc.shape != ():
        raise InputError(f"{name} holds arcs of shape {arc.shape}.", "Pass a single arc.")
