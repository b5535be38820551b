"""What the tendons must pull to hold a pose, and where the spring rests if they can't.

The spring as a linear beam, its stiffnesses constant per free length L₀, without
weight, contact or friction; its energy over compression c = L₀ − L and bending Δ is::

    E = ½ k c² + ½ (B / L₀) |Δ|²        B = k L₀ D² (1 + ν) / (2 (2 + ν))

times the configuration's `bending_factor`. Tendons at their distances d from the
axis (``parallel``) shorten by c + d Δ·u, so the tensions balance it where::

    Σ T = k c        Σ T d u = (B / L₀) Δ        T ≥ 0

Tendons only pull. Together they compress, so bending costs compression, and some
poses that geometry allows can't be held.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from setae import pulley
from setae.arc import Arc, FloatArray, finite_array
from setae.config import Config, Geometry
from setae.errors import InputError

__all__ = ["Settled", "bounds", "max_tension_n", "settle", "tensions_n"]

_TOLERANCE = 1e-9
"""Of the spring's force when fully compressed: below it a tension counts as none."""


def max_tension_n(config: Config) -> FloatArray:
    """Find the tension that each servo holds for long, shape (n,).

    That is `torque_part` of the stall torque, at the radius that the pulley has with
    its tendon fully wound up.

    Examples
    --------
    >>> from setae import config
    >>> max_tension_n(config.load()).round(2)
    array([7.89, 7.89, 7.89, 7.89])
    """
    servo, geometry = config.servo, config.geometry
    if len(servo.growth_mm_per_turn) == geometry.tendon_count:
        radius = pulley.radius_mm(pulley.travel_mm(config)[1], config)
    else:
        radius = np.full(geometry.tendon_count, geometry.pulley_radius_mm)
    torque_n_mm = servo.stall_torque_n_m * 1e3 * servo.torque_part
    return np.asarray(torque_n_mm / radius)


def tensions_n(arc: Arc, config: Config, *, preload_n: float | None = None) -> FloatArray:
    """Compute the least tensions that hold poses, shape (..., n); NaN where none do.

    Of all that balance the spring with no tendon below the preload, those with the
    least sum of squares. Where that asks more of a servo than it holds, and other
    tensions don't, those.

    Parameters
    ----------
    arc
        Of shape (...).
    config
        The robot.
    preload_n
        Least tension of every tendon; 0 allows slack ones. None takes the
        configuration's `min_tension_n`.

    Raises
    ------
    InputError
        A preload that isn't a number from 0.

    Examples
    --------
    >>> from setae import config
    >>> robot = config.load()
    >>> tensions_n(Arc(length_mm=50, bend_rad=(0, 0)), robot).round(6)
    array([1.1, 1.1, 1.1, 1.1])
    >>> bent = Arc(length_mm=50, bend_rad=(1.2, 0))
    >>> tensions_n(bent, robot).round(2), tensions_n(bent, robot, preload_n=0.2).round(2)
    (array([3.42, 0.49, 0.  , 0.49]), array([3.62, 0.29, 0.2 , 0.29]))
    """
    preload = _preload(config, preload_n)
    geometry = config.geometry
    matrix = _matrix(geometry)
    # What is left once every tendon has its least tension.
    load = _load_n(arc, config) - matrix.sum(axis=1) * preload
    tolerance = _TOLERANCE * config.spring.axial_rate_n_per_mm * geometry.free_length_mm

    best = np.full((*arc.shape, geometry.tendon_count), np.nan)
    best_square = np.full(arc.shape, np.inf)
    for inverse, fit in _supports(geometry):
        candidate = load @ inverse.T
        miss = np.abs(load @ fit.T - load).max(axis=-1)
        square = np.sum(candidate**2, axis=-1)
        better = (
            (miss <= tolerance) & (candidate >= -tolerance).all(axis=-1) & (square < best_square)
        )
        best_square = np.where(better, square, best_square)
        best = np.where(better[..., np.newaxis], np.maximum(candidate, 0.0), best)
    best += preload

    most = max_tension_n(config)
    with np.errstate(invalid="ignore"):
        tense = (best > most).any(axis=-1)
    if tense.any() and geometry.tendon_count > 3:
        normals, reach = _zonotope(config, preload)
        whole = _load_n(arc, config)[tense]
        spared = (whole @ normals.T <= reach - tolerance).all(axis=-1)
        if spared.any():
            shared = best[tense]
            shared[spared] = _boxed(whole[spared], matrix, preload, most)
            best[tense] = shared
    return best


def bounds(config: Config, *, preload_n: float | None = None) -> tuple[FloatArray, FloatArray]:
    """Describe all poses that the tendons can hold, as linear inequalities.

    A pose can be held, within the preload and the servos' torque, just where
    ``A @ (L, Δx, Δy) <= b`` in every row: the set is convex.

    Parameters
    ----------
    config
        The robot.
    preload_n
        As in `tensions_n`.

    Returns
    -------
    A : ndarray, shape (m, 3)
        Scaled so that each row is in N.
    b : ndarray, shape (m,)
        In N.

    Raises
    ------
    InputError
        As in `tensions_n`, or the tendons have fewer than three different angles.
    """
    normals, reach = _zonotope(config, _preload(config, preload_n))
    spring, geometry = config.spring, config.geometry
    scale = np.array([-spring.axial_rate_n_per_mm, *[_moment_n(config)] * 2])
    offset = normals[:, 0] * spring.axial_rate_n_per_mm * geometry.free_length_mm
    return normals * scale, reach - offset


# ------------------------------------------------------------------------- settling


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """Where the spring comes to rest with given tendons; poses of shape (...).

    Attributes
    ----------
    arc : Arc
        The shape it takes.
    tensions_n : ndarray, shape (..., n)
        What each tendon pulls.
    slack_mm : ndarray, shape (..., n)
        How much longer each tendon is than its way through the spring; 0 where taut.
    """

    arc: Arc
    tensions_n: FloatArray
    slack_mm: FloatArray


def settle(lengths_mm: npt.ArrayLike, config: Config) -> Settled:
    """Find the shape that the spring takes with tendons of given lengths.

    The one of least energy in which no tendon is longer than its length: a convex
    problem with a single answer. For a pose that can be held that is the pose
    itself, with ``parallel`` lengths; for one that can't, a tendon hangs slack.

    Parameters
    ----------
    lengths_mm : array_like, shape (..., n)
        Commanded tendon lengths.
    config
        The robot.

    Raises
    ------
    InputError
        NaN, infinite, wrong shape, or lengths that would turn the spring inside out.

    Examples
    --------
    >>> from setae import config, tendons
    >>> robot = config.load()
    >>> pose = Arc(length_mm=66, bend_rad=(0.6, 0))
    >>> settled = settle(tendons.lengths(pose, robot.geometry, "parallel"), robot)
    >>> settled.slack_mm.round(2), float(settled.arc.length_mm.round(2))
    (array([0.  , 1.47, 2.94, 1.47]), 64.53)
    """
    geometry, spring = config.geometry, config.spring
    q = finite_array("lengths_mm", lengths_mm, last_axis=geometry.tendon_count, what="one a tendon")
    wound = geometry.free_length_mm - q
    # In c and Δ times a radius every tendon's shortening is a row of the same matrix.
    radius = _radius_mm(geometry)
    rows = _matrix(geometry).T
    stiffness = np.array([spring.axial_rate_n_per_mm, *[_moment_n(config) / radius] * 2])
    shape = q.shape[:-1]
    best = np.zeros((*shape, 3))
    tensions = np.zeros_like(q)
    worst = np.maximum(wound, 0.0).max(axis=-1)  # by how much the free spring is too long
    for count in (1, 2, 3):
        for members in itertools.combinations(range(geometry.tendon_count), count):
            part = rows[list(members)]
            gram = (part / stiffness) @ part.T
            if np.linalg.cond(gram) > 1e9:
                continue
            pull = wound[..., list(members)] @ np.linalg.inv(gram)
            pose = (pull @ part) / stiffness
            lack = np.maximum(wound - pose @ rows.T, 0.0).max(axis=-1)
            # A tendon can't push: what it would push counts as missed too, in mm.
            push = np.maximum(-pull, 0.0).max(axis=-1) / spring.axial_rate_n_per_mm
            miss = np.maximum(lack, push)
            better = miss < worst - 1e-12
            worst = np.where(better, miss, worst)
            best = np.where(better[..., np.newaxis], pose, best)
            every = np.zeros_like(q)
            every[..., list(members)] = np.maximum(pull, 0.0)
            tensions = np.where(better[..., np.newaxis], every, tensions)
    length = geometry.free_length_mm - best[..., 0]
    if (length <= 0).any():
        raise InputError(
            "These tendon lengths would turn the spring inside out.",
            "Check that they are in mm.",
        )
    arc = Arc(length_mm=length, bend_rad=best[..., 1:] / radius)
    slack = np.maximum(best @ rows.T - wound, 0.0)
    slack[slack < 1e-9 * geometry.free_length_mm] = 0.0
    # With all tendons taut the tensions aren't unique; the least ones then.
    taut = (slack == 0).all(axis=-1)
    if taut.any():
        least = tensions_n(arc, config, preload_n=0.0)
        usable = taut & ~np.isnan(least).any(axis=-1)
        tensions = np.where(usable[..., np.newaxis], least, tensions)
    return Settled(arc, tensions, slack)


# -------------------------------------------------------------------------- details


def _preload(config: Config, preload_n: float | None) -> float:
    if preload_n is None:
        return config.servo.min_tension_n
    preload = float(finite_array("preload_n", preload_n))
    if preload < 0:
        raise InputError(f"preload_n is {preload:g}.", "It must be 0 or more.")
    return preload


def _moment_n(config: Config) -> float:
    """Moment per radian of bending over `_radius_mm`, in N."""
    spring, geometry = config.spring, config.geometry
    nu = spring.poisson_ratio
    rate_n = spring.axial_rate_n_per_mm * geometry.free_length_mm
    bending_n_mm2 = (
        spring.bending_factor * rate_n * spring.mean_diameter_mm**2 * (1 + nu) / (2 * (2 + nu))
    )
    return bending_n_mm2 / geometry.free_length_mm / _radius_mm(geometry)


def _load_n(arc: Arc, config: Config) -> FloatArray:
    """What the tensions must add up to: sum, and moment over a radius, shape (..., 3)."""
    compression = config.geometry.free_length_mm - arc.length_mm
    force = config.spring.axial_rate_n_per_mm * compression
    return np.concatenate([force[..., np.newaxis], _moment_n(config) * arc.bend_rad], axis=-1)


def _radius_mm(geometry: Geometry) -> float:
    """Mean distance of the tendons from the axis: moments over it are in N, as forces are."""
    return float(np.mean(geometry.tendon_radii_mm))


def _matrix(geometry: Geometry) -> FloatArray:
    """Rows: sum of the tensions, and their moment over `_radius_mm`, shape (3, n)."""
    angles = np.array(geometry.tendon_angles_rad)
    part = np.array(geometry.tendon_radii_mm) / _radius_mm(geometry)
    return np.stack([np.ones_like(angles), part * np.cos(angles), part * np.sin(angles)])


def _zonotope(config: Config, preload_n: float) -> tuple[FloatArray, FloatArray]:
    """All loads that tensions from the preload to the servos' limit make up.

    A sum of n line segments in three dimensions: each facet is spanned by two of them.
    """
    matrix = _matrix(config.geometry)
    normals = []
    for a, b in itertools.combinations(range(matrix.shape[1]), 2):
        normal = np.cross(matrix[:, a], matrix[:, b])
        size = np.linalg.norm(normal)
        if size > 1e-6:
            normals += [normal / size, -normal / size]
    if len(normals) < 6:
        raise InputError(
            "The tendons don't span the bending.",
            "It takes tendons at three different angles or more.",
        )
    facets = np.array(normals)
    along = facets @ matrix
    reach = np.maximum(along * preload_n, along * max_tension_n(config)).sum(axis=1)
    return facets, reach


def _boxed(load: FloatArray, matrix: FloatArray, low: float, high: FloatArray) -> FloatArray:
    """Tensions of least squares within [low, high], for loads that have some, shape (p, n).

    They have the form T = clip(λ·g): three unknowns a load, by Newton's method on the
    dual, with a step length that never lets it grow.
    """
    most = np.broadcast_to(high, (len(load), matrix.shape[1]))

    def dual(factor: FloatArray) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        free = factor @ matrix
        pull = np.clip(free, low, most)
        value = np.sum(pull * free - pull**2 / 2, axis=-1) - np.sum(factor * load, axis=-1)
        return np.asarray(value), pull, (free > low) & (free < most)

    factor = np.asarray(np.linalg.lstsq(matrix @ matrix.T, load.T, rcond=None)[0].T, dtype=float)
    value, pull, loose = dual(factor)
    for _ in range(60):
        slope = pull @ matrix.T - load
        if np.abs(slope).max() <= 1e-12 * np.abs(load).max():
            break
        curved = np.einsum("pn,an,bn->pab", loose.astype(float), matrix, matrix)
        curved += 1e-6 * np.eye(3)
        step = -np.linalg.solve(curved, slope[..., np.newaxis])[..., 0]
        length = np.ones(len(load))
        for _ in range(30):
            moved, moved_pull, moved_loose = dual(factor + length[:, np.newaxis] * step)
            worse = moved > value + 1e-14 * np.abs(value)
            if not worse.any():
                break
            length = np.where(worse, length / 2, length)
        factor = factor + length[:, np.newaxis] * step
        value, pull, loose = moved, moved_pull, moved_loose
    return np.asarray(pull)


@lru_cache(maxsize=16)
def _supports(geometry: Geometry) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """The sets of tendons that may carry load alone, for the solution of least squares.

    For each, the matrix (n, 3) from load to tensions, and the one (3, 3) from load to
    the load that these tensions carry.
    """
    matrix = _matrix(geometry)
    n = matrix.shape[1]
    supports = []
    for members in _candidates(matrix):
        index = list(members)
        inverse = np.zeros((n, 3))
        inverse[index] = np.linalg.pinv(matrix[:, index], rcond=1e-9)
        supports.append((inverse, matrix[:, index] @ inverse[index]))
    return tuple(supports)


def _candidates(matrix: FloatArray) -> list[tuple[int, ...]]:
    n = matrix.shape[1]
    if n <= 6:
        everyone = range(n)
        return [s for k in range(1, n + 1) for s in itertools.combinations(everyone, k)]
    # The solution has the form T = max(0, λ·g): the loaded tendons are those on one side of
    # a line across the section. Each such line can be moved until it meets two tendons.
    sets = {tuple(range(n)), *((i,) for i in range(n))}
    point = matrix[1:].T
    for a, b in itertools.combinations(range(n), 2):
        along = point[b] - point[a]
        side = along[0] * (point[:, 1] - point[a, 1]) - along[1] * (point[:, 0] - point[a, 0])
        for sign in (1, -1):
            inside = {int(i) for i in np.flatnonzero(sign * side > 1e-9)} - {a, b}
            for ends in ((), (a,), (b,), (a, b)):
                sets.add(tuple(sorted(inside | set(ends))))
    return sorted((s for s in sets if s), key=lambda s: (len(s), s))
