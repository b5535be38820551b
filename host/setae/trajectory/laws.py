"""How far along its path a motion is.

Phases that start and end at rest, without a step in speed or acceleration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from setae.arc import FloatArray

__all__ = ["PEAK", "QUINTIC", "Law", "cruise", "cruise_law", "quintic", "quintic_rate"]

PEAK = 1.875
"""Highest speed of the quintic over its mean speed."""


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """A phase from 0 to 1.

    Attributes
    ----------
    phase
        Part of the duration (...) → phase (...).
    peaks
        Highest speed, acceleration and jerk of a path of length 1 in a duration of 1.
    """

    phase: Callable[[FloatArray], FloatArray]
    peaks: tuple[float, float, float]


def quintic(part: npt.ArrayLike) -> FloatArray:
    """Compute the phase s = 10τ³ − 15τ⁴ + 6τ⁵ for a part 0…1 of the duration.

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


def quintic_rate(part: FloatArray) -> FloatArray:
    """Compute the quintic's derivative."""
    return np.asarray(30 * part**2 * (1 - part) ** 2)


# 10/√3 at (3 ± √3)/6, and 60 at both ends.
QUINTIC = Law(quintic, (PEAK, 10 / 3**0.5, 60.0))


def cruise(part: npt.ArrayLike, ramp: float) -> FloatArray:
    """Compute a phase of constant speed between smooth ramps.

    The speed rises as 3x² − 2x³ over the first part of the duration, and falls alike.

    Parameters
    ----------
    part : array_like
        Part 0…1 of the duration.
    ramp
        Part of the duration that each ramp takes, above 0, at most ½.

    Examples
    --------
    >>> cruise([0, 0.25, 0.5, 0.75, 1], ramp=0.25).round(4).tolist()
    [0.0, 0.1667, 0.5, 0.8333, 1.0]
    """
    t = np.clip(np.asarray(part, dtype=np.float64), 0.0, 1.0)
    lower = np.minimum(t, 1 - t)
    x = np.minimum(lower / ramp, 1.0)
    s = (ramp * x**3 * (1 - x / 2) + np.maximum(lower - ramp, 0.0)) / (1 - ramp)
    return np.asarray(np.where(t <= 0.5, s, 1 - s))


def cruise_law(ramp: float) -> Law:
    """Make a `Law` of `cruise`."""
    speed = 1 / (1 - ramp)
    return Law(lambda part: cruise(part, ramp), (speed, 1.5 * speed / ramp, 6 * speed / ramp**2))
