"""How long the tendons are for a given arc.

Two models behind one interface, chosen by name:

``parallel``
    Each tendon keeps its distance from the spring's axis: the textbook's offset
    arcs, q = L − d (Δ·u). Linear, and smooth everywhere.
``paper``
    Equation 12 to the letter: an arc on the inner half, a chord on the outer
    half. A tendon that crosses from one half to the other *jumps*, by 8 mm
    at θ = 90° and full length.

Here u is the unit vector from the axis to the tendon and Δ the bending vector.
A further model is one more entry in `MODELS`, and its name in
`setae.config.TENDON_MODELS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from setae.arc import Arc, FloatArray, first_place, sinc
from setae.config import Geometry
from setae.errors import InputError

__all__ = ["BOUNDARY_TOLERANCE", "MODELS", "Hint", "TendonModel", "lengths", "model"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]

BOUNDARY_TOLERANCE = 1e-6
"""Cosine between bending and tendon below which a tendon counts as outer.

Every ±X and ±Y target has two tendons exactly on the boundary of equation 12,
and rounding would send some to either side. The tolerance is large enough for
positions in float32; it decides towards the chord, the equation's ≥.
"""


@dataclass(frozen=True, slots=True)
class TendonModel:
    """A rule for the tendons' lengths.

    Attributes
    ----------
    name
        As in a configuration.
    lengths
        Arc of shape (...) → lengths in mm, shape (..., n).
    fit
        Lengths in mm, shape (..., n), and a hint → the arc of least squares, shape
        (...). A rule for which several arcs fit almost equally well follows the hint.
    pieces
        Arc of shape (...) → which piece of the rule each tendon is in, bool of
        shape (..., n). Only where two neighbouring arcs differ in it may the
        lengths jump.
    """

    name: str
    lengths: Callable[[Arc, Geometry], FloatArray]
    fit: Callable[[FloatArray, Geometry, Hint | None], Arc]
    pieces: Callable[[Arc, Geometry], BoolArray]


@dataclass(frozen=True, slots=True, eq=False)
class Hint:
    """Where an arc is expected.

    Attributes
    ----------
    arc
        The expectation; its shape must broadcast to that of the lengths.
    tolerance_mm
        An arc that fits worse than the best by up to this (root mean square over the
        tendons) may win for being closer to the expectation.
    """

    arc: Arc
    tolerance_mm: float


def lengths(arc: Arc, geometry: Geometry, model: str = "paper") -> FloatArray:
    """Compute the tendons' lengths.

    Parameters
    ----------
    arc
        Of shape (...).
    geometry
        With n tendons, at any angles.
    model
        ``paper`` or ``parallel``.

    Returns
    -------
    ndarray, shape (..., n)
        Lengths in mm.

    Raises
    ------
    InputError
        An unknown model, or an arc so short and bent that a tendon's length
        would not be above 0.

    Examples
    --------
    >>> arc = Arc(length_mm=60, bend_rad=(0.5, 0))
    >>> lengths(arc, Geometry(), model="parallel").round(3)
    array([55.85, 60.  , 64.15, 60.  ])
    >>> lengths(arc, Geometry(), model="paper").round(3)
    array([55.85 , 59.377, 63.484, 59.377])
    """
    result = _find(model).lengths(arc, geometry)
    bad = result <= 0
    if bad.any():
        raise InputError(
            f"The {model} length of tendon{first_place(bad)} would be {result[bad][0]:.3g} mm.",
            "Choose a longer or less bent arc.",
        )
    return result


def model(name: str) -> TendonModel:
    """Look a model up by its name.

    Raises
    ------
    InputError
        There is no such model.

    Examples
    --------
    >>> model("parallel").name
    'parallel'
    """
    return _find(name)


def _find(name: str) -> TendonModel:
    try:
        return MODELS[name]
    except KeyError:
        raise InputError(
            f"There is no tendon model {name!r}.", f"There are: {', '.join(MODELS)}."
        ) from None


def _directions(geometry: Geometry) -> FloatArray:
    """Unit vectors u from the axis to the tendons, shape (n, 2)."""
    angles = np.array(geometry.tendon_angles_rad)
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _towards(arc: Arc, geometry: Geometry) -> FloatArray:
    """Δ·u: the bending towards each tendon in radians, shape (..., n)."""
    return np.asarray(arc.bend_rad @ _directions(geometry).T)


# ----------------------------------------------------------------------- parallel


def _parallel_lengths(arc: Arc, geometry: Geometry) -> FloatArray:
    towards = _towards(arc, geometry)
    return np.asarray(arc.length_mm[..., np.newaxis] - geometry.tendon_radius_mm * towards)


def _parallel_solution(q: FloatArray, geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """Least squares for L and Δ; the equations are linear."""
    u = _directions(geometry)
    matrix = np.concatenate([np.ones((len(u), 1)), -geometry.tendon_radius_mm * u], axis=1)
    singular = np.linalg.svd(matrix, compute_uv=False)
    if len(u) < 3 or singular[-1] < 1e-6 * singular[0]:
        raise InputError(
            "The tendons don't determine the arc.",
            "It takes tendons at three different angles or more.",
        )
    solution = q @ np.linalg.pinv(matrix).T
    return solution[..., 0], solution[..., 1:]


def _fitted(length: FloatArray, bend: FloatArray) -> Arc:
    bad = ~(length > 0)
    if bad.any():
        raise InputError(
            f"lengths_mm{first_place(bad)}: no arc comes near these tendon lengths.",
            "Check that they are in mm and in the order of tendon_angles_rad.",
        )
    return Arc(length_mm=length, bend_rad=bend)


def _parallel_fit(q: FloatArray, geometry: Geometry, hint: Hint | None) -> Arc:
    del hint  # there is only one solution
    return _fitted(*_parallel_solution(q, geometry))


def _one_piece(arc: Arc, geometry: Geometry) -> BoolArray:
    return np.zeros((*arc.shape, geometry.tendon_count), dtype=bool)


# -------------------------------------------------------------------------- paper


def _inner(arc: Arc, geometry: Geometry) -> BoolArray:
    """Tendons on the inner half: ‖P_L − C‖ < √(r² + d²), which is cos(φ − α) > 0."""
    theta = arc.theta_rad[..., np.newaxis]
    return np.asarray(_towards(arc, geometry) > BOUNDARY_TOLERANCE * theta)


def _paper_lengths(arc: Arc, geometry: Geometry) -> FloatArray:
    return _paper_cases(
        arc.length_mm,
        arc.bend_rad,
        _inner(arc, geometry),
        geometry.tendon_radius_mm,
        _directions(geometry),
    )


def _paper_cases(
    length: FloatArray, bend: FloatArray, inner: BoolArray, d: float, u: FloatArray
) -> FloatArray:
    """Equation 12 with the case of each tendon given, shape (..., n).

    With r = L/θ the two cases are ‖P_L − C‖·θ = √((L − d Δ·u)² + d²|Δ×u|²) and
    ‖P_L − P_H‖ = (L − d Δ·u)·sinc(θ/2): no radius, so no singularity.
    """
    parallel = length[..., np.newaxis] - d * (bend @ u.T)
    across = d * (bend @ np.stack([-u[:, 1], u[:, 0]]))
    half = np.hypot(bend[..., 0], bend[..., 1])[..., np.newaxis] / 2
    return np.asarray(np.where(inner, np.hypot(parallel, across), parallel * sinc(half)))


def _paper_derivative(
    length: FloatArray, bend: FloatArray, inner: BoolArray, d: float, u: FloatArray
) -> FloatArray:
    """Derivatives of `_paper_cases` by (L, Δ), shape (..., n, 3)."""
    parallel = length[..., np.newaxis] - d * (bend @ u.T)
    across = d * (bend @ np.stack([-u[:, 1], u[:, 0]]))
    arc = np.hypot(parallel, across)
    half = np.hypot(bend[..., 0], bend[..., 1])[..., np.newaxis] / 2
    shrink = sinc(half)
    with np.errstate(divide="ignore", invalid="ignore"):
        # d sinc(θ/2) / dΔ = slope·Δ; the quotient loses its digits near 0, the series doesn't.
        slope = np.where(
            half < 1e-2,
            -1 / 12 + half**2 / 120,
            (np.cos(half) - shrink) / (4 * half**2),
        )
        by_length = np.where(inner, parallel / arc, shrink)
    bend = bend[..., np.newaxis, :]
    by_bend = np.where(
        inner[..., np.newaxis],
        (d * d * bend - d * length[..., np.newaxis, np.newaxis] * u) / arc[..., np.newaxis],
        -d * u * shrink[..., np.newaxis] + (parallel * slope)[..., np.newaxis] * bend,
    )
    return np.concatenate([by_length[..., np.newaxis], by_bend], axis=-1)


def _paper_fit(q: FloatArray, geometry: Geometry, hint: Hint | None) -> Arc:
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
        blocks.append(_paper_fit_block(q[part], geometry, target, tolerance_mm))
    return _fitted(
        np.concatenate([length for length, _ in blocks]).reshape(shape),
        np.concatenate([bend for _, bend in blocks]).reshape(*shape, 2),
    )


def _paper_fit_block(
    q: FloatArray, geometry: Geometry, expected_mm: FloatArray | None, tolerance_mm: float
) -> tuple[FloatArray, FloatArray]:
    """`_paper_fit` for q of shape (p, n): L (p,) and Δ (p, 2)."""
    length, bend = _parallel_solution(q, geometry)
    inner, basis, free = _paper_pieces(geometry)
    # Axes: candidate, pose.
    count = (len(inner), len(q))
    every = np.newaxis
    length, along = _paper_newton(
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
    value = _paper_candidates(candidates, inner[:, every], geometry)
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
    length, along = _paper_newton(
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


def _paper_candidates(arc: Arc, inner: BoolArray, geometry: Geometry) -> FloatArray:
    """Lengths of candidates: by the rule, but a case that rounding alone contradicts stands."""
    slack = 1e-10
    theta = arc.theta_rad[..., np.newaxis]
    beyond = _towards(arc, geometry) - BOUNDARY_TOLERANCE * theta
    wrong = np.where(inner, beyond < -slack * theta, beyond > slack * theta)
    contradicted = np.any(wrong, axis=-1, keepdims=True)
    cases = np.where(contradicted, _inner(arc, geometry), inner)
    return _paper_cases(
        arc.length_mm, arc.bend_rad, cases, geometry.tendon_radius_mm, _directions(geometry)
    )


def _paper_newton(
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
    d, u = geometry.tendon_radius_mm, _directions(geometry)
    # A candidate held to a direction has one unknown less; this keeps its equations solvable.
    blank = np.zeros((*free.shape, 3, 3))
    blank[..., 2, 2] = ~free
    # Half a spring at most in one go: far-off candidates must not run away.
    limit = np.broadcast_to(0.5 * np.mean(q, axis=-1), length.shape)
    for _ in range(rounds):
        bend = np.einsum("...j,...ij->...i", along, basis)
        value = _paper_cases(length, bend, inner, d, u)
        derivative = _paper_derivative(length, bend, inner, d, u)
        # Unknowns L and d·along: both in mm.
        derivative[..., 1:] = derivative[..., 1:] @ basis / d
        transposed = np.swapaxes(derivative, -1, -2)
        right = transposed @ (q - value)[..., np.newaxis]
        step = np.linalg.solve(transposed @ derivative + blank, right)[..., 0]
        size = np.max(np.abs(step), axis=-1)
        step *= np.minimum(1.0, limit / np.maximum(size, 1e-300))[..., np.newaxis]
        length = np.maximum(length + step[..., 0], 1e-3 * limit)
        along = along + step[..., 1:] / d
        if (size <= 1e-14 * length).all():
            break
    return length, along


def _paper_pieces(geometry: Geometry) -> tuple[BoolArray, FloatArray, BoolArray]:
    """Candidates for `_paper_fit`.

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
    return inner, basis, np.asarray(basis[:, 1, 1] == 1.0)


MODELS: Mapping[str, TendonModel] = MappingProxyType(
    {
        "paper": TendonModel("paper", _paper_lengths, _paper_fit, _inner),
        "parallel": TendonModel("parallel", _parallel_lengths, _parallel_fit, _one_piece),
    }
)
