"""Equation 12 of the paper to the letter: an arc on the inner half, a chord on the outer half.

A tendon that crosses from one half to the other *jumps*, by 8 mm at θ = 90° and
full length.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from setae.arc import Arc, FloatArray, sinc, sinc_slope
from setae.config import Geometry
from setae.tendons import parallel
from setae.tendons.rule import BoolArray, Hint, TendonModel, fitted, in_blocks, layout

__all__ = ["BOUNDARY_TOLERANCE", "MODEL"]

BOUNDARY_TOLERANCE = 1e-6
"""Cosine between bending and tendon below which a tendon counts as outer.

Every ±X and ±Y target has two tendons exactly on the boundary of equation 12,
and rounding would send some to either side. The tolerance is large enough for
positions in float32; it decides towards the chord, the equation's ≥.
"""


def _towards(arc: Arc, geometry: Geometry) -> FloatArray:
    """Δ·u: the bending towards each tendon in radians, shape (..., n)."""
    return np.asarray(arc.bend_rad @ layout(geometry).u.T)


def _inner(arc: Arc, geometry: Geometry) -> BoolArray:
    """Tendons on the inner half: ‖P_L − C‖ < √(r² + d²), which is cos(φ − α) > 0."""
    theta = arc.theta_rad[..., np.newaxis]
    return np.asarray(_towards(arc, geometry) > BOUNDARY_TOLERANCE * theta)


def _lengths(arc: Arc, geometry: Geometry) -> FloatArray:
    """Equation 12, with the radius r = L/θ cancelled, so without a singularity.

    With the fibre m = L − d Δ·u, its arc is ‖P_L − C‖·θ = √(m² + d²|Δ×u|²), which is
    √(L² + d²θ² − 2 L d Δ·u), and its chord ‖P_L − P_H‖ = m·sinc(θ/2).
    """
    tendons = layout(geometry)
    if arc.shape == ():
        x, y = arc.bend_rad.tolist()
        return np.array(_one(float(arc.length_mm), x, y, tendons.points))
    square_mm2 = tendons.d_mm**2

    def compute(length: FloatArray, bend: FloatArray, result: FloatArray) -> None:
        square = bend[:, 0] * bend[:, 0] + bend[:, 1] * bend[:, 1]
        theta = np.sqrt(square)
        half = np.maximum(0.5 * theta, 1e-150)
        towards = bend @ tendons.u.T
        inner = towards > (BOUNDARY_TOLERANCE * theta)[:, np.newaxis]
        towards *= tendons.d_mm
        np.subtract(length[:, np.newaxis], towards, out=result)
        result *= (np.sin(half) / half)[:, np.newaxis]
        towards *= (-2 * length)[:, np.newaxis]
        towards += square[:, np.newaxis] * square_mm2
        towards += (length * length)[:, np.newaxis]
        # Below 0 by rounding alone, where the arc has no length.
        np.maximum(towards, 0.0, out=towards)
        np.sqrt(towards, out=result, where=inner)

    return in_blocks(arc, (len(tendons.d_mm),), compute)


def _one(
    length: float, x: float, y: float, points: tuple[tuple[float, float, float], ...]
) -> list[float]:
    """`_lengths` of a single pose, without what numpy costs for each."""
    theta = math.hypot(x, y)
    shrink = math.sin(theta / 2) / (theta / 2) if theta > 1e-150 else 1.0
    result = []
    for d, ux, uy in points:
        towards = x * ux + y * uy
        fibre = length - d * towards
        if towards > BOUNDARY_TOLERANCE * theta:
            result.append(math.hypot(fibre, d * (y * ux - x * uy)))
        else:
            result.append(fibre * shrink)
    return result


def _cases(
    length: FloatArray, bend: FloatArray, inner: BoolArray, d: FloatArray, u: FloatArray
) -> FloatArray:
    """Equation 12 with the case of each tendon given, shape (..., n)."""
    fibre = length[..., np.newaxis] - d * (bend @ u.T)
    across = d * (bend @ np.stack([-u[:, 1], u[:, 0]]))
    half = np.hypot(bend[..., 0], bend[..., 1])[..., np.newaxis] / 2
    return np.asarray(np.where(inner, np.hypot(fibre, across), fibre * sinc(half)))


def _derivative(
    length: FloatArray, bend: FloatArray, inner: BoolArray, d: FloatArray, u: FloatArray
) -> FloatArray:
    """Derivatives of `_cases` by (L, Δ), shape (..., n, 3)."""
    along = d[:, np.newaxis]
    fibre = length[..., np.newaxis] - d * (bend @ u.T)
    across = d * (bend @ np.stack([-u[:, 1], u[:, 0]]))
    arc = np.hypot(fibre, across)
    half = np.hypot(bend[..., 0], bend[..., 1])[..., np.newaxis] / 2
    shrink = sinc(half)
    slope = sinc_slope(half) / 4  # d sinc(θ/2) / dΔ = slope·Δ
    with np.errstate(divide="ignore", invalid="ignore"):
        by_length = np.where(inner, fibre / arc, shrink)
    bend = bend[..., np.newaxis, :]
    by_bend = np.where(
        inner[..., np.newaxis],
        (along**2 * bend - along * length[..., np.newaxis, np.newaxis] * u) / arc[..., np.newaxis],
        -along * u * shrink[..., np.newaxis] + (fibre * slope)[..., np.newaxis] * bend,
    )
    return np.concatenate([by_length[..., np.newaxis], by_bend], axis=-1)


def _derivatives(arc: Arc, geometry: Geometry) -> FloatArray:
    tendons = layout(geometry)
    inner = _inner(arc, geometry)
    return _derivative(arc.length_mm, arc.bend_rad, inner, tendons.d_mm, tendons.u)


def _fit(q: FloatArray, geometry: Geometry, hint: Hint | None) -> Arc:
    """Least squares over all pieces of equation 12.

    The rule is smooth while no tendon changes sides, so the direction α is cut
    where one does. Each piece is fitted three times: free, and held to each of its
    ends, just inside. The ends, where tendons lie on the boundary, are narrow pieces
    of their own, fitted free and held. The candidate whose true lengths come closest
    wins.
    """
    shape = q.shape[:-1]
    q = q.reshape(-1, geometry.tendon_count)
    expected: FloatArray | None = None
    tolerance_mm = 0.0
    if hint is not None:
        tolerance_mm = hint.tolerance_mm
        expected = np.broadcast_to(hint.arc.top_mm, (*shape, 3)).reshape(-1, 3)
    # In blocks: each candidate of each pose holds some hundred bytes.
    blocks = []
    for first in range(0, max(len(q), 1), 2048):
        part = slice(first, first + 2048)
        target = None if expected is None else expected[part]
        blocks.append(_fit_block(q[part], geometry, target, tolerance_mm))
    return fitted(
        np.concatenate([length for length, _ in blocks]).reshape(shape),
        np.concatenate([bend for _, bend in blocks]).reshape(*shape, 2),
    )


def _fit_block(
    q: FloatArray, geometry: Geometry, expected_mm: FloatArray | None, tolerance_mm: float
) -> tuple[FloatArray, FloatArray]:
    """`_fit` for q of shape (p, n): L (p,) and Δ (p, 2)."""
    length, bend = parallel.solution(q, geometry)
    inner, basis, free = _pieces(geometry)
    # Axes: candidate, pose.
    count = (len(inner), len(q))
    every = np.newaxis
    length, along = _newton(
        q,
        np.broadcast_to(length, count),
        np.einsum("pi,cij->cpj", bend, basis),
        np.broadcast_to(inner[:, every], (*count, geometry.tendon_count)),
        np.broadcast_to(basis[:, every], (*count, 2, 2)),
        np.broadcast_to(free[:, every], count),
        geometry,
        rounds=6,
    )
    candidates = Arc(length_mm=length, bend_rad=np.einsum("cpj,cij->cpi", along, basis))
    value = _candidates(candidates, inner[:, every], geometry)
    error = np.sqrt(np.mean((value - q) ** 2, axis=-1))
    if expected_mm is not None:
        top = candidates.top_mm
        distance = np.linalg.norm(top - expected_mm, axis=-1)
        distance[error > error.min(axis=0) + tolerance_mm] = np.inf
        nearest = np.take_along_axis(top, np.argmin(distance, axis=0)[every, :, every], axis=0)
        # Neighbouring pieces give almost the same arc: of those the best fit counts.
        far = np.linalg.norm(top - nearest, axis=-1) > 2.0
        error = np.where(far | np.isinf(distance), np.inf, error)
    best, pose = np.argmin(error, axis=0), np.arange(len(q))
    length, along = _newton(
        q,
        length[best, pose],
        along[best, pose],
        inner[best],
        basis[best],
        free[best],
        geometry,
        rounds=30,
    )
    return length, np.einsum("pj,pij->pi", along, basis[best])


def _candidates(arc: Arc, inner: BoolArray, geometry: Geometry) -> FloatArray:
    """Lengths of candidates: by the rule, but a case that rounding alone contradicts stands."""
    slack = 1e-10
    theta = arc.theta_rad[..., np.newaxis]
    beyond = _towards(arc, geometry) - BOUNDARY_TOLERANCE * theta
    wrong = np.where(inner, beyond < -slack * theta, beyond > slack * theta)
    contradicted = np.any(wrong, axis=-1, keepdims=True)
    cases = np.where(contradicted, _inner(arc, geometry), inner)
    tendons = layout(geometry)
    return _cases(arc.length_mm, arc.bend_rad, cases, tendons.d_mm, tendons.u)


def _newton(
    q: FloatArray,
    length: FloatArray,
    along: FloatArray,
    inner: BoolArray,
    basis: FloatArray,
    free: BoolArray,
    geometry: Geometry,
    *,
    rounds: int,
) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton for L (...) and the components (..., 2) of Δ along a basis (..., 2, 2)."""
    d, u = layout(geometry).d_mm, layout(geometry).u
    scale = float(np.max(d))
    # A candidate held to a direction has one unknown less; this keeps its equations solvable.
    blank = np.zeros((*free.shape, 3, 3))
    blank[..., 2, 2] = ~free
    # Half a spring at most in one go: far-off candidates must not run away.
    limit = np.broadcast_to(0.5 * np.mean(q, axis=-1), length.shape)
    for _ in range(rounds):
        bend = np.einsum("...j,...ij->...i", along, basis)
        value = _cases(length, bend, inner, d, u)
        derivative = _derivative(length, bend, inner, d, u)
        # Unknowns L and scale·along: both in mm.
        derivative[..., 1:] = derivative[..., 1:] @ basis / scale
        transposed = np.swapaxes(derivative, -1, -2)
        right = transposed @ (q - value)[..., np.newaxis]
        step = np.linalg.solve(transposed @ derivative + blank, right)[..., 0]
        size = np.max(np.abs(step), axis=-1)
        step *= np.minimum(1.0, limit / np.maximum(size, 1e-300))[..., np.newaxis]
        length = np.maximum(length + step[..., 0], 1e-3 * limit)
        along = along + step[..., 1:] / scale
        if (size <= 1e-14 * length).all():
            break
    return length, along


@lru_cache(maxsize=64)
def _pieces(geometry: Geometry) -> tuple[BoolArray, FloatArray, BoolArray]:
    """Candidates for `_fit`.

    Returns
    -------
    inner : (c, n)
        The tendons on the inner side.
    basis : (c, 2, 2)
        Columns that span the bending; the second is zero where α is held.
    free : (c,)
        Whether α is free.
    """
    angles = np.array(geometry.tendon_angles_rad)
    cuts = np.sort(np.concatenate([angles - math.pi / 2, angles + math.pi / 2]) % (2 * math.pi))
    gaps = np.diff(cuts, append=cuts[0] + 2 * math.pi)
    cuts, gaps = cuts[gaps > 1e-5], gaps[gaps > 1e-5]
    # The ends of a gap, from one cut to the next.
    starts = cuts
    ends = np.roll(cuts, -1)
    widths = np.roll(gaps, -1)
    nudge = 4 * BOUNDARY_TOLERANCE

    def held(alpha: FloatArray) -> FloatArray:
        basis = np.zeros((len(alpha), 2, 2))
        basis[:, 0, 0], basis[:, 1, 0] = np.cos(alpha), np.sin(alpha)
        return basis

    def sides(alpha: FloatArray) -> BoolArray:
        cosine = np.cos(angles - alpha[:, np.newaxis])
        return np.asarray(cosine > BOUNDARY_TOLERANCE)

    whole = np.broadcast_to(np.eye(2), (len(starts), 2, 2))
    middle, edge = sides(starts + widths / 2), sides(starts)
    candidates = (
        (middle, whole),
        (edge, whole),
        (edge, held(starts)),
        (middle, held(starts + nudge)),
        (middle, held(ends - nudge)),
    )
    inner = np.concatenate([inner for inner, _ in candidates])
    basis = np.concatenate([basis for _, basis in candidates])
    free = np.asarray(basis[:, 1, 1] == 1.0)
    for array in (inner, basis, free):
        array.flags.writeable = False
    return inner, basis, free


MODEL: Final = TendonModel("paper", _lengths, _derivatives, _fit, _inner)
