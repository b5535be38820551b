"""Ways through arcs, and where a tendon model jumps on them.

A way is a function from the phase 0…1 to arcs, with two continuous derivatives, so
that a phase without a step in acceleration gives a motion without one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from setae import tendons
from setae.arc import Arc, FloatArray, finite_array
from setae.config import Geometry
from setae.errors import InputError

__all__ = [
    "JUMP_MM",
    "Jump",
    "Way",
    "at_constant_speed",
    "between",
    "blended",
    "circular",
    "jumps",
    "largest_jump_mm",
]

Way: TypeAlias = Callable[[FloatArray], Arc]

JUMP_MM = 0.05
"""Steps of a tendon up to this pass as continuous: they are below a servo's dead band."""


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


def circular(length_mm: float, theta_rad: float, start_rad: float, turns: float) -> Way:
    """Make a way of constant length and bending, its direction α turning about z."""

    def way(phase: FloatArray) -> Arc:
        return Arc.from_angles(
            length_mm=length_mm,
            theta_rad=theta_rad,
            alpha_rad=start_rad + 2 * math.pi * turns * phase,
        )

    return way


def blended(points: Arc, blend_mm: float) -> Way:
    """Make a way along straight lines between arcs that rounds its corners.

    Distances along it are those between the spring's tops at the points. From
    `blend_mm` before a corner to as far after it, but at most half of either line,
    the way leaves the lines: |u| in the corner's formula becomes a polynomial that
    meets it with two derivatives.

    Parameters
    ----------
    points
        Arcs of shape (m,), m ≥ 2, neighbours different.
    blend_mm
        Above 0.
    """
    node = np.concatenate([points.length_mm[:, np.newaxis], points.bend_rad], axis=-1)
    leg = np.linalg.norm(np.diff(points.top_mm, axis=0), axis=-1)
    knot = np.concatenate([[0.0], np.cumsum(leg)])
    slope = np.diff(node, axis=0) / leg[:, np.newaxis]
    # Half the change of direction at each inner point, and how far it is rounded.
    turn = np.diff(slope, axis=0) / 2
    reach = np.minimum(blend_mm, np.minimum(leg[:-1], leg[1:]) / 2)

    def way(phase: FloatArray) -> Arc:
        u = np.asarray(phase) * knot[-1]
        index = np.clip(np.searchsorted(knot, u, side="right") - 1, 0, len(leg) - 1)
        point = node[index] + (u - knot[index])[..., np.newaxis] * slope[index]
        for corner, at in enumerate(knot[1:-1]):
            x = np.clip(np.abs(u - at) / reach[corner], 0.0, 1.0)
            lift = reach[corner] * (3 / 8 + x * x * (3 / 4 - x * x / 8) - x)
            point = point + lift[..., np.newaxis] * turn[corner]
        point = np.where((u >= knot[-1])[..., np.newaxis], node[-1], point)
        return Arc(length_mm=point[..., 0], bend_rad=point[..., 1:])

    return way


def at_constant_speed(way: Way, *, samples: int = 1025) -> tuple[Way, float]:
    """Make the phase of a way proportional to the way of the spring's top.

    Returns
    -------
    way
        The same arcs in the same order.
    length_mm
        How far the top goes.

    Raises
    ------
    InputError
        The top stands still somewhere.
    """
    part = np.linspace(0.0, 1.0, samples)
    step = 1e-5
    inner = np.clip(part, step, 1 - step)
    rate = np.linalg.norm(way(inner + step).top_mm - way(inner - step).top_mm, axis=-1) / (2 * step)
    middle = (part[1:] + part[:-1]) / 2
    rate_middle = (
        np.linalg.norm(way(middle + step).top_mm - way(middle - step).top_mm, axis=-1) / 2 / step
    )
    if min(rate.min(), rate_middle.min()) < 1e-3:
        raise InputError(
            "The spring's top stands still on the way.", "Without a speed, such a way is possible."
        )
    gone = np.concatenate([[0.0], np.cumsum((rate[1:] + 4 * rate_middle + rate[:-1]) / 6)])
    gone /= samples - 1
    total = float(gone[-1])

    def even(phase: FloatArray) -> Arc:
        # Hermite's cubic through the inverse: its slopes are known.
        distance = np.asarray(phase) * total
        i = np.clip(np.searchsorted(gone, distance, side="right") - 1, 0, samples - 2)
        width = gone[i + 1] - gone[i]
        x = np.clip((distance - gone[i]) / width, 0.0, 1.0)
        value = (
            part[i] * (1 - x) ** 2 * (1 + 2 * x)
            + part[i + 1] * x**2 * (3 - 2 * x)
            + width * x * (1 - x) * ((1 - x) / rate[i] - x / rate[i + 1])
        )
        return way(np.clip(value, 0.0, 1.0))

    return even, total


# -------------------------------------------------------------------------- jumps


@dataclass(frozen=True, slots=True)
class Jump:
    """A place where tendon lengths are not continuous.

    Attributes
    ----------
    before, after
        Phases on either side, as close as float64 tells them apart.
    tendon
        The tendon that jumps farthest.
    size_mm
        By how much.
    """

    before: float
    after: float
    tendon: int
    size_mm: float


def jumps(
    way: Way, geometry: Geometry, model: str, *, samples: int = 257, least_mm: float = JUMP_MM
) -> tuple[Jump, ...]:
    """Find the steps of tendon lengths on a way, in order.

    Parameters
    ----------
    way
        Phase 0…1 of shape (p,) → arcs of shape (p,).
    geometry, model
        As in `setae.tendons.lengths`.
    samples
        Phases to look at; of several changes of side between two of them, an even
        number of one tendon's would be missed.
    least_mm
        Smaller steps aren't told.

    Examples
    --------
    >>> import setae
    >>> turn = circular(60.0, 0.5, 0.1, 1.0)
    >>> found = jumps(turn, setae.Geometry(), "paper")
    >>> [round(jump.after, 3) for jump in found], round(found[0].size_mm, 2)
    ([0.234, 0.484, 0.734, 0.984], 0.77)
    >>> jumps(turn, setae.Geometry(), "parallel")
    ()
    """
    rule = tendons.model(model)

    def pieces(phase: FloatArray) -> npt.NDArray[np.bool_]:
        return rule.pieces(way(phase), geometry)

    # Only where a tendon changes its piece can the length jump: close in on each change.
    s = np.linspace(0.0, 1.0, samples)
    side = pieces(s)
    changed = np.flatnonzero((side[1:] != side[:-1]).any(axis=-1))
    places: list[tuple[float, float]] = []
    low, high, before = s[changed], s[changed + 1], side[changed]
    end, last = high.copy(), side[changed + 1]
    while len(low):
        first = low.copy()
        for _ in range(52):
            middle = (first + high) / 2
            same = (pieces(middle) == before).all(axis=-1)
            first, high = np.where(same, middle, first), np.where(same, high, middle)
        places += zip(first.tolist(), high.tolist(), strict=True)
        # Past this change there may be another one, before the same sample.
        now = pieces(high)
        more = (now != last).any(axis=-1) & (high < end)
        low, before, last = high[more], now[more], last[more]
        high = end = end[more]
    found: list[Jump] = []
    for start, stop in _merged(sorted(places)):
        ends = rule.lengths(way(np.array([start, stop])), geometry)
        step = np.abs(ends[1] - ends[0])
        tendon = int(np.argmax(step))
        if step[tendon] > least_mm:
            found.append(Jump(start, stop, tendon, float(step[tendon])))
    return tuple(found)


def _merged(places: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Join changes that are one: a tendon on the boundary itself is a piece of its own."""
    joined: list[tuple[float, float]] = []
    for low, high in places:
        if joined and low - joined[-1][1] < 1e-4:
            joined[-1] = (joined[-1][0], high)
        else:
            joined.append((low, high))
    return joined


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
    found = jumps(lambda s: between(start, end, s), geometry, model, least_mm=0.0)
    if not found:
        return 0.0, 0, 0.0
    worst = max(found, key=lambda jump: jump.size_mm)
    return worst.size_mm, worst.tendon, worst.after
