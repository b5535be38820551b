"""Turns as unit quaternions (w, x, y, z): the fake must not share the host's arithmetic."""

from __future__ import annotations

import math
from collections.abc import Sequence

Turn = tuple[float, float, float, float]


def turn_of(vector_rad: Sequence[float]) -> Turn:
    """From axis times angle, as UR's poses have it."""
    angle = math.hypot(*vector_rad)
    part = math.sin(angle / 2) / angle if angle else 0.5
    x, y, z = (part * value for value in vector_rad)
    return math.cos(angle / 2), x, y, z


def vector_of(turn: Turn) -> list[float]:
    w, *axis = turn if turn[0] >= 0 else [-value for value in turn]
    size = math.hypot(*axis)
    part = 2 * math.atan2(size, w) / size if size else 2.0
    return [part * value for value in axis]


def after(second: Turn, first: Turn) -> Turn:
    """The turn that the two make together."""
    a, b, c, d = second
    e, f, g, h = first
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def back(turn: Turn) -> Turn:
    w, x, y, z = turn
    return w, -x, -y, -z


def turned(turn: Turn, vector: Sequence[float]) -> list[float]:
    """A vector, turned."""
    x, y, z = vector
    return list(after(after(turn, (0.0, x, y, z)), back(turn))[1:])
