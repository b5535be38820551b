"""Motions made of parts, each from rest to rest.

A way through arcs is cut where the tendon model jumps on it; a line between tendon
lengths bridges the gap. Then each part gets its time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from setae import tendons
from setae.arc import Arc, FloatArray, finite_array, positive
from setae.config import Geometry
from setae.errors import InputError, TrajectoryError
from setae.trajectory.laws import QUINTIC, Law, cruise_law
from setae.trajectory.paths import Jump, Way, at_constant_speed, between, jumps
from setae.trajectory.plan import (
    FRAME_S,
    FrameTrajectory,
    Limits,
    TooFast,
    check_too_fast,
    frames_of,
    joined,
    sampled,
    shortest,
    too_fast_error,
)

__all__ = ["AtJump", "Part", "at_speed", "cut", "leg", "line_part", "planned"]

AtJump: TypeAlias = Literal["refuse", "bridge"]

_SCRAP = 1e-5
_RAMPS = (0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
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


def leg(start: Arc, end: Arc) -> Way:
    """Make the way straight between two arcs."""
    return lambda s: between(start, end, s)


def line_part(
    start_mm: npt.ArrayLike, end_mm: npt.ArrayLike, shift: float = 0.0, jump: Jump | None = None
) -> Part:
    """Make a part in a line between tendon lengths; all of the way, or a bridge at `shift`."""
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

    return Part(path, None, shift, 0.0 if jump else 1.0, jump)


def cut(
    way: Way,
    geometry: Geometry,
    model: str,
    at_jump: AtJump,
    samples: int,
    *,
    shift: float = 0.0,
    scale: float = 1.0,
) -> list[Part]:
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

    def stretch(low: float, high: float) -> Part:
        def part_way(s: FloatArray) -> Arc:
            return way(np.minimum(np.maximum(low + s * (high - low), low), high))

        def path(s: FloatArray) -> FloatArray:
            return tendons.lengths(part_way(s), geometry, model)

        return Part(path, part_way, shift + scale * low, scale * (high - low))

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
        parts.append(line_part(ends[0], ends[1], here.after, here))
        low = after
    if low < 1.0:
        parts.append(stretch(low, 1.0))
    return parts


def _motion(part: Part, law: Law, frames: int) -> FrameTrajectory:
    lengths, phase = sampled(part.path, law, frames)
    return FrameTrajectory(part.path(np.zeros(1))[0], lengths, part.shift + part.scale * phase)


def _together(parts: list[Part], laws: list[Law], frames: list[int]) -> FrameTrajectory:
    whole = joined(
        [_motion(part, law, count) for part, law, count in zip(parts, laws, frames, strict=True)],
        tuple(part.jump for part in parts if part.jump is not None),
    )
    # Shift and scale may miss the very end by a rounding.
    whole.phase[-1] = 1.0
    return whole


def planned(
    parts: list[Part],
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


def _fastest(part: Part, limits: Limits) -> tuple[Law, int]:
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


def at_speed(
    parts: list[Part],
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
        evened.append(Part(path, even, part.shift, part.scale))
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
    """Find the shortest ramps, and the frames, for a path of some length at some speed."""
    lengths = path(np.linspace(0.0, 1.0, 257))
    fastest = np.abs(np.diff(lengths, axis=0)).max(axis=0) * 256 / length_mm * speed_mm_s
    speed, acceleration, jerk = limits.table(lengths.shape[1])
    excess = float((fastest / speed).max())
    if excess > 1 + 1e-6:
        if too_fast == "raise":
            tendon = int(np.argmax(fastest / speed))
            raise TrajectoryError(
                f"Tendon {tendon} would move at {fastest[tendon]:.1f} mm/s, and at most "
                f"{speed[tendon]:.1f} mm/s are allowed.",
                f"Ask for {speed_mm_s / excess:.1f} mm/s of the spring's top or less.",
            )
        fastest, speed_mm_s = fastest / excess, speed_mm_s / excess
    cruise_s = length_mm / speed_mm_s
    ramp_s = float(np.maximum(1.5 * fastest / acceleration, np.sqrt(6 * fastest / jerk)).max())
    ramp_s = max(ramp_s, FRAME_S)
    while True:
        # A way too short for the ramps never gets to the speed.
        ramp_s = min(ramp_s, cruise_s)
        frames = frames_of(cruise_s + ramp_s)
        law = cruise_law(ramp_s / (cruise_s + ramp_s))
        fewest = shortest(path, law, limits, fewest=frames)
        if fewest == frames or ramp_s == cruise_s:
            return law, fewest
        ramp_s *= 1.1
