"""As few straight lines as possible through pulses, as the board plays them.

The board goes straight from the end of one segment to the end of the next, rounds
each servo frame to the nearest tick, and the ends are whole ticks themselves. So
no line is closer than half a tick, and a tolerance says how much more is allowed:
everything played lies within ``0.5 + tolerance`` ticks of what was planned. The
default, 10 µm or 0.36 ticks, thus less than doubles what rounding costs anyway, and is a
thirtieth of a servo's dead band.

The servos share the times at which segments end, but not the ticks there. Shortest
path over (frame, ticks): each step is a segment whose every frame was checked in
the board's own integer arithmetic.
"""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from setae.arc import FloatArray
from setae.errors import InputError, TrajectoryError

__all__ = ["LONGEST_FRAMES", "pack", "played"]

IntArray = npt.NDArray[np.int64]

LONGEST_FRAMES = 25
"""Longest segment, half a second: what is queued goes on without the host."""

_TIE = 1e-9


def pack(
    ticks: FloatArray,
    *,
    start_ticks: IntArray | None,
    tolerance_ticks: FloatArray,
    slew_ticks: int,
    max_frames: int = LONGEST_FRAMES,
) -> tuple[IntArray, IntArray]:
    """Find the fewest segments through pulses.

    Fewest of all for tolerances up to half a tick. For larger ones the ends are
    sought on the lowest, the nearest and the highest tick allowed.

    Parameters
    ----------
    ticks : ndarray, shape (n, servos)
        Planned pulses at the end of each servo frame, not rounded.
    start_ticks : ndarray, shape (servos,)
        Pulses before the first frame. None: unknown; the first segment then takes a
        frame.
    tolerance_ticks : ndarray, shape (servos,)
        Allowed besides the half tick of rounding.
    slew_ticks
        The board's limit, ticks a frame.
    max_frames
        Longest segment. The work grows with its square.

    Returns
    -------
    ends : ndarray, shape (m,)
        Frame at which each segment ends; the last is n.
    targets : ndarray, shape (m, servos)
        Ticks there. The last are the planned ones, rounded.

    Raises
    ------
    InputError
        A tolerance below 0, or `max_frames` below 1.
    TrajectoryError
        No segments come that close: the pulses change faster than the board allows.

    Examples
    --------
    >>> ramp = np.linspace(1700, 1760, 21)[1:, np.newaxis]
    >>> start, none = np.array([1700]), np.zeros(1)
    >>> pack(ramp, start_ticks=start, tolerance_ticks=none, slew_ticks=100)[0]
    array([20])
    """
    if not 1 <= max_frames <= 0xFFFF:
        raise InputError(f"max_frames is {max_frames}.", "It must be from 1 to 65535.")
    if not (tolerance_ticks >= 0).all():
        raise InputError(f"The tolerance is {tolerance_ticks.min():g} ticks.", "Give 0 or more.")
    start = None if start_ticks is None else tuple(int(tick) for tick in start_ticks)
    planned = np.ascontiguousarray(ticks, dtype=np.float64).tobytes()
    ends, targets = _pack(planned, start, tuple(tolerance_ticks.tolist()), slew_ticks, max_frames)
    return ends.copy(), targets.copy()


# An experiment repeats a few motions, tick for tick.
@lru_cache(maxsize=64)
def _pack(
    planned: bytes,
    start_ticks: tuple[int, ...] | None,
    tolerance_ticks: tuple[float, ...],
    slew_ticks: int,
    max_frames: int,
) -> tuple[IntArray, IntArray]:
    servos = len(tolerance_ticks)
    ticks = np.frombuffer(planned).reshape(-1, servos)
    count = len(ticks)
    # Frame 0 is the start. Every number below is exact, or this slack is small against it.
    slack = 0.5 + np.array(tolerance_ticks) + 1e-9
    nearest = np.rint(ticks)
    low = np.minimum(np.ceil(ticks - slack), nearest).astype(np.int64)
    high = np.maximum(np.floor(ticks + slack), nearest).astype(np.int64)
    low[-1] = high[-1] = nearest[-1]
    first = nearest[0] if start_ticks is None else start_ticks
    low = np.concatenate([np.asarray(first, dtype=np.int64)[np.newaxis], low])
    high = np.concatenate([low[:1], high])
    options, allowed = _options(low, high, np.concatenate([low[:1], nearest]))
    reach = _reach(low, high, min(max_frames, count))

    # Axes of a state: one for each servo, its option.
    states = (options.shape[-1],) * servos
    size = options.shape[-1] ** servos
    cost = np.full((count + 1, *states), np.inf)
    origin = np.full((count + 1, *states), -1, dtype=np.int64)
    away = np.abs(options[1:] - ticks[..., np.newaxis]) / slack[:, np.newaxis]
    fares = np.ones((count, *states))
    for servo in range(servos):
        fares += _TIE * _along(away[:, servo], servo, servos)
    if start_ticks is None:
        usable = np.ones(states, dtype=bool)
        for servo in range(servos):
            usable &= _along(allowed[1:2, servo], servo, servos)[0]
        cost[1] = np.where(usable, fares[0], np.inf)
        origin[1] = 0
    else:
        cost[0].flat[0] = 0.0

    for frame in range(count):
        before = cost[frame].ravel()
        alive = np.flatnonzero(before < np.inf)
        if not len(alive):
            continue
        most = int(reach[frame])
        fits = _fits(options, allowed, low, high, frame, most, slew_ticks)
        possible = np.ones((1,) * (servos + 2), dtype=bool)
        for servo, option in enumerate(np.unravel_index(alive, states)):
            # Axes: alive state, frames less one, and this servo's option at the end.
            step = np.swapaxes(fits[servo][:, option], 0, 1)
            step = step.reshape(
                len(alive), most, *(1,) * servo, states[servo], *(1,) * (servos - 1 - servo)
            )
            possible = possible & step
        offers = np.where(possible, before[alive].reshape(-1, *(1,) * (servos + 1)), np.inf)
        best = np.argmin(offers, axis=0)
        offer = offers.min(axis=0) + fares[frame : frame + most]
        window = slice(frame + 1, frame + 1 + most)
        better = offer < cost[window]
        cost[window] = np.where(better, offer, cost[window])
        origin[window] = np.where(better, frame * size + alive[best], origin[window])

    state = int(np.argmin(cost[count]))
    if not np.isfinite(cost[count].flat[state]):
        raise TrajectoryError(
            "The pulses change faster than the board's slew limit.", "Give the motion more time."
        )
    ends, targets = [], []
    frame = count
    while frame > 0:
        choice = np.unravel_index(state, states)
        ends.append(frame)
        targets.append([options[frame, s, choice[s]] for s in range(servos)])
        frame, state = divmod(int(origin[frame].flat[state]), size)
    return np.array(ends[::-1]), np.array(targets[::-1], dtype=np.int64)


def played(start_ticks: npt.ArrayLike, ends: npt.ArrayLike, targets: npt.ArrayLike) -> IntArray:
    """Compute what the board plays in each servo frame, to the tick.

    Parameters
    ----------
    start_ticks : array_like, shape (servos,)
        Pulses before the first frame.
    ends, targets
        As `pack` returns them.

    Returns
    -------
    ndarray, shape (n, servos)
        Pulses at the end of each frame.

    Examples
    --------
    >>> played([0], [4], [[10]]).ravel().tolist()
    [3, 5, 8, 10]
    """
    pulse = np.asarray(start_ticks, dtype=np.int64)
    frames = []
    starts = itertools.chain([0], np.asarray(ends)[:-1])
    for start, end, target in zip(starts, np.asarray(ends), np.asarray(targets), strict=True):
        length = int(end - start)
        way = target - pulse
        done = np.arange(1, length + 1)[:, np.newaxis]
        frames.append(pulse + np.sign(way) * ((np.abs(way) * done + length // 2) // length))
        pulse = target
    return np.concatenate(frames)


def _options(
    low: IntArray, high: IntArray, nearest: FloatArray
) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """Ticks at which a segment may end, (n, servos, options), and which of them to use."""
    if (high - low <= 1).all():
        return np.stack([low, high], axis=-1), np.stack(
            [np.ones_like(low, dtype=bool), low < high], axis=-1
        )
    middle = nearest.astype(np.int64)
    return np.stack([middle, low, high], axis=-1), np.stack(
        [np.ones_like(low, dtype=bool), low < middle, high > middle], axis=-1
    )


def _along(values: npt.NDArray[Any], servo: int, servos: int) -> npt.NDArray[Any]:
    """Values (n, options) of one servo, shaped for the states' axes."""
    rows, options = values.shape
    return values.reshape(rows, *(1,) * servo, options, *(1,) * (servos - 1 - servo))


def _reach(low: IntArray, high: IntArray, most: int) -> IntArray:
    """How many frames a straight line from each frame can at most stay within bounds, (n,).

    A cone of slopes for each servo, which every frame on the way narrows; the bounds
    are those that rounding leaves to the line itself.
    """
    count = len(low) - 1
    steps = np.arange(1, most + 1)
    ahead = np.minimum(np.arange(count)[:, np.newaxis] + steps, count)
    span = steps[:, np.newaxis]
    least = (low[ahead] - 0.5 - high[:count, np.newaxis]) / span
    greatest = (high[ahead] + 0.5 - low[:count, np.newaxis]) / span
    floor, ceiling = np.maximum.accumulate(least, axis=1), np.minimum.accumulate(greatest, axis=1)
    empty = np.any(floor > ceiling + 1e-9, axis=-1)
    first = np.where(empty.any(axis=1), np.argmax(empty, axis=1), most)
    return np.maximum(np.minimum(first, count - np.arange(count)), 1)


def _fits(
    options: IntArray,
    allowed: npt.NDArray[np.bool_],
    low: IntArray,
    high: IntArray,
    frame: int,
    most: int,
    slew_ticks: int,
) -> npt.NDArray[np.bool_]:
    """Whether servos may go straight from an option at a frame to one 1…most frames later.

    Returns
    -------
    ndarray, shape (servos, most, options, options)
        Servo, frames less one, from, to.
    """
    window = slice(frame + 1, frame + 1 + most)
    ends = np.swapaxes(options[window], 0, 1)
    way = ends[:, :, np.newaxis, :] - options[frame][:, np.newaxis, :, np.newaxis]
    size = np.abs(way)
    # One more axis: frame on the way. As the board's line: round(size · done / span).
    done = np.arange(1, most + 1)
    span = done[:, np.newaxis, np.newaxis, np.newaxis]
    gone = (size[..., np.newaxis] * done + span // 2) // span
    pulse = options[frame][:, np.newaxis, :, np.newaxis, np.newaxis]
    pulse = pulse + np.sign(way)[..., np.newaxis] * gone
    least, greatest = (
        bound[window].T[:, np.newaxis, np.newaxis, np.newaxis] for bound in (low, high)
    )
    inside = (pulse >= least) & (pulse <= greatest)
    inside |= done >= span  # its end is an option, and beyond it is another segment
    fits = inside.all(axis=-1) & (size <= slew_ticks * span[..., 0])
    return np.asarray(fits & np.swapaxes(allowed[window], 0, 1)[:, :, np.newaxis, :])
