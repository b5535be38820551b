"""The shortest path of a tendon inside the spring's bore.

The bore of an arc is a piece of a torus: radius r = L/θ of the axis, radius b of
the tube. A tendon runs between two holes at the same place of both ends, at the
distance d < b from the axis and the angle ψ from the bending direction. If its
chord touches nothing it is the path. Otherwise the path is straight, then a
geodesic on the inner wall, then straight again, each joining the next without a
kink, and it is symmetric about the plane half-way.

On the wall let χ be the angle from the point nearest to the torus's axis, and R the
distance from that axis, R = r − b cos χ = r − b + 2 b y² with y = sin(χ/2). Clairaut: along a
geodesic R cos(slope) is constant, and equal to R_m at the plane half-way. With y = y_m cosh u
its length and its angle φ about the torus's axis are

    s = ∫ R k du      φ = R_m ∫ k/R du      k = √(2 b / ((1 − y²)(R + R_m)))

without a singularity: nine points of Gauss do. What is left are two unknowns, where
the tendon leaves the wall (u and y there), and two equations: from there straight on
it must meet the hole.
"""

from __future__ import annotations

import numpy as np

from setae.arc import FloatArray

__all__ = ["LEAST_RADIUS", "depth", "detour", "touching_radius"]

ROUNDS = 100
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(9)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
LEAST_GAP = 1e-3
"""Of the bore's radius: a hole nearer to the wall counts as this far from it.

Touching it from the very start, the tendon would have two ways to begin. The gap
makes a length differ by less than 0.01 mm in the paper's robot.
"""
LEAST_RADIUS = 1.05
"""Of the bore's radius, for r: an arc bent more has coils that would cut into each other."""


def touching_radius(d_mm: float, bore_mm: float) -> float:
    """Find the distance of the holes from the axis that the computation uses."""
    return min(d_mm, (1 - LEAST_GAP) * bore_mm)


def depth(
    length: FloatArray, theta: FloatArray, cosine: FloatArray, d: float, bore: float
) -> FloatArray:
    """Compute how deep the middle of the chord would lie in the wall, in mm.

    Parameters
    ----------
    length, theta
        The arc; θ above 0, and L at least `LEAST_RADIUS` b θ.
    cosine
        cos ψ, the cosine between bending direction and tendon.
    d, bore
        Radii in mm of the holes' circle and of the bore.
    """
    towards = d * cosine
    wall = np.sqrt(bore * bore - d * d + towards * towards)
    sagitta = length * 2 * np.sin(theta / 4) ** 2 / theta
    return np.asarray(sagitta + towards * np.cos(theta / 2) - wall)


def detour(
    length: FloatArray, theta: FloatArray, cosine: FloatArray, d: float, bore: float
) -> FloatArray:
    """Compute by how much the path in the bore is longer than the chord, in mm.

    Parameters
    ----------
    length, theta, cosine, d, bore
        As in `depth`, all of one shape (p,).

    Returns
    -------
    ndarray, shape (p,)
        0 where the chord is free.
    """
    result = np.zeros(length.shape)
    rest = np.flatnonzero(depth(length, theta, cosine, d, bore) > 0)
    radius, half = length[rest] / theta[rest], theta[rest] / 2
    hole = radius - d * cosine[rest]
    height = d * np.sqrt(np.maximum(1 - cosine[rest] ** 2, 0.0))
    chord = 2 * hole * np.sin(half)

    # From where the chord first touches, a single point of the wall: from there Newton's way
    # leads to the right solution. There is another one, with a longer stretch on the wall.
    leave = np.sqrt((1 - np.sqrt(bore * bore - height * height) / bore) / 2)
    u = np.zeros(len(rest))
    for _ in range(ROUNDS):
        if not len(rest):
            break
        f, g, path = _straight_on(leave, u, radius, half, hole, height, bore)
        step = 1e-7
        f_leave, g_leave, _ = _straight_on(leave + step, u, radius, half, hole, height, bore)
        f_u, g_u, _ = _straight_on(leave, u + step, radius, half, hole, height, bore)
        f_leave, g_leave = (f_leave - f) / step, (g_leave - g) / step
        f_u, g_u = (f_u - f) / step, (g_u - g) / step
        determinant = f_leave * g_u - f_u * g_leave
        by_leave = (f_u * g - g_u * f) / determinant
        by_u = (g_leave * f - f_leave * g) / determinant
        size = np.maximum(np.abs(by_leave) / 0.1, np.abs(by_u) / 0.3)
        shorten = 1 / np.maximum(size, 1.0)
        leave, u = leave + shorten * by_leave, u + shorten * by_u

        result[rest] = np.maximum(path - chord, 0.0)
        more = ~(size < 1e-9)
        rest, leave, u = rest[more], leave[more], u[more]
        radius, half, hole, height = radius[more], half[more], hole[more], height[more]
        chord = chord[more]
    return result


def _straight_on(
    leave: FloatArray,
    u: FloatArray,
    radius: FloatArray,
    half: FloatArray,
    hole: FloatArray,
    height: FloatArray,
    bore: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far the tangent where the tendon leaves the wall misses the hole, twice; the length.

    leave is y = sin(χ/2) there; hole and height are the hole's distance from the
    torus's axis and above the bending plane.
    """
    inner = radius - bore
    lowest = leave / np.cosh(u)
    nearest = inner + 2 * bore * lowest * lowest

    y = lowest * np.cosh(_NODES[:, np.newaxis] * u)
    square = np.minimum(y * y, 0.999)
    distance = inner + 2 * bore * square
    k = np.sqrt(2 * bore / ((1 - square) * (distance + nearest)))
    s = u * (_WEIGHTS @ (distance * k))
    phi = u * nearest * (_WEIGHTS @ (k / distance))

    y = np.clip(leave, -0.999, 0.999)
    distance = inner + 2 * bore * y * y
    sine, cosine = 2 * y * np.sqrt(1 - y * y), 1 - 2 * y * y
    # The unit tangent: away from the torus's axis, up, and about the axis.
    slope = np.sqrt(2 * bore * (distance + nearest)) * lowest * np.sinh(u) / distance
    out, up, about = sine * slope, cosine * slope, nearest / distance
    # From there to the hole.
    to_out = hole * np.cos(half - phi) - distance
    to_up = height - bore * sine
    to_about = hole * np.sin(half - phi)
    return (
        to_out * about - to_about * out,
        to_up * about - to_about * up,
        2 * (s + to_out * out + to_up * up + to_about * about),
    )
