"""The shortest path inside the spring's bore, as a tendon under tension takes it.

A tendon is as long as its chord and the detour that the wall forces on it
(`setae.tendons.bore`). For one geometry the detour depends on L, θ and the angle ψ
between tendon and bending direction. Over the square of the depth to which the
chord would cut into the wall it is smooth and never far from constant; a table of
that is made once per geometry, in a fraction of a second, and kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from setae.arc import Arc, FloatArray, sinc, sinc_slope
from setae.config import Geometry
from setae.tendons import bore, parallel
from setae.tendons.rule import Hint, TendonModel, fitted, in_blocks, layout
from setae.tendons.table import Axis, Table

__all__ = ["MODEL"]

TOLERANCE = 5e-5
"""Largest error of a table, of the longest length: 0.0035 mm for the paper's robot."""
_SIZES = ((14, 20, 30), (20, 30, 46), (28, 44, 68))
"""Places in L, θ and cos ψ: the first that suffices."""
_TINY = 1e-150


class _Detour:
    """How much longer than their chord tendons at one distance from the axis are.

    Parameters
    ----------
    d_mm, bore_mm
        Distances from the axis, of the holes and of the wall.
    lengths_mm, max_theta_rad
        Where it must be fast: the workspace. Elsewhere it is computed without the table.
    """

    def __init__(
        self, d_mm: float, bore_mm: float, lengths_mm: tuple[float, float], max_theta_rad: float
    ) -> None:
        self.d_mm, self.bore_mm = d_mm, bore_mm
        self.shortest_mm, self.longest_mm = 0.98 * lengths_mm[0], 1.02 * lengths_mm[1]
        self.most_bent_rad = 1.02 * max_theta_rad
        self.table = self._make()

    def _make(self) -> Table | None:
        random = np.random.default_rng(0)
        # Closer together where it is hardest: short, bent, near the bending plane.
        a, b, c = random.uniform(0.0, 1.0, (3, 400))
        length = self.shortest_mm + (self.longest_mm - self.shortest_mm) * a**2
        theta = self.most_bent_rad * (1 - b**2)
        cosine = 1 - 2 * c**2
        length = self.at_least(length, theta)
        depth = bore.depth(length, theta, cosine, self.d_mm, self.bore_mm)
        touching = depth > 0
        places = length[touching], theta[touching], cosine[touching]
        expected = self._exact(*places)
        for size in _SIZES:
            table = self._filled(size)
            error = np.abs(depth[touching] ** 2 * table(*places) - expected)
            if error.max(initial=0.0) <= TOLERANCE * self.longest_mm:
                return table
        return None

    def _filled(self, size: tuple[int, int, int]) -> Table:
        """Tabulate detour / depth²."""
        axes = (
            Axis(self.shortest_mm, self.longest_mm, size[0]),
            Axis(0.02 * self.most_bent_rad, self.most_bent_rad, size[1]),
            Axis(-1.0, 1.0, size[2]),
        )
        grid = np.meshgrid(*(axis.places for axis in axes), indexing="ij")
        length, theta, cosine = (values.reshape(-1) for values in grid)
        length = self.at_least(length, theta)
        depth = bore.depth(length, theta, cosine, self.d_mm, self.bore_mm)
        values = np.full(length.shape, np.nan)
        touching = np.flatnonzero(depth > 1e-4 * self.bore_mm)
        places = length[touching], theta[touching], cosine[touching]
        values[touching] = self._exact(*places) / depth[touching] ** 2
        return Table(axes, _extended(values.reshape(size)))

    def at_least(self, length: FloatArray, theta: FloatArray) -> FloatArray:
        """Lengths that leave the coils apart; below, the detour stays as it is there."""
        return np.maximum(length, bore.LEAST_RADIUS * self.bore_mm * theta)

    def tabulated(self, length: FloatArray, theta: FloatArray) -> bool:
        """Whether the table serves for all of these poses."""
        return (
            self.table is not None
            and length.min() >= self.shortest_mm
            and length.max() <= self.longest_mm
            and theta.max() <= self.most_bent_rad
        )

    def __call__(
        self, length: FloatArray, theta: FloatArray, cosine: FloatArray, depth: FloatArray
    ) -> FloatArray:
        """Compute the detour of tendons (p,) whose depth is above 0, in mm."""
        if self.table is not None and self.tabulated(length, theta):
            return depth * depth * self.table(length, theta, cosine)
        result = np.empty(length.shape)
        inside = self._inside(length, theta)
        if self.table is not None and inside.any():
            places = (length[inside], theta[inside], cosine[inside])
            result[inside] = depth[inside] ** 2 * self.table(*places)
        outside = ~inside
        result[outside] = self._exact(length[outside], theta[outside], cosine[outside])
        return result

    def with_gradient(
        self, length: FloatArray, theta: FloatArray, cosine: FloatArray, depth: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the detour, and derive it by L, θ and cos ψ: shapes (p,) and (3, p)."""
        value, gradient = np.empty(length.shape), np.empty((3, len(length)))
        inside = self._inside(length, theta)
        if self.table is not None and inside.any():
            L, t, c, deep = length[inside], theta[inside], cosine[inside], depth[inside]
            factor, slope = self.table.with_gradient(L, t, c)
            value[inside] = deep * deep * factor
            towards = self.d_mm * c
            wall = np.sqrt(self.bore_mm**2 - self.d_mm**2 + towards**2)
            sine, cosine_half = np.sin(t / 2), np.cos(t / 2)
            by_length = (1 - cosine_half) / t
            by_theta = L * (sine / 2 - by_length) / t - towards * sine / 2
            by_cosine = self.d_mm * (cosine_half - towards / wall)
            slope *= deep * deep
            slope += 2 * deep * factor * np.stack([by_length, by_theta, by_cosine])
            gradient[:, inside] = slope
        outside = ~inside
        if outside.any():
            L, t, c = length[outside], theta[outside], cosine[outside]
            value[outside] = self._exact(L, t, c)
            step_mm, step = 1e-4 * self.bore_mm, 1e-5
            gradient[0, outside] = self._exact(L + step_mm, t, c) - self._exact(L - step_mm, t, c)
            gradient[0, outside] /= 2 * step_mm
            gradient[1, outside] = self._exact(L, t + step, c) - self._exact(L, t - step, c)
            gradient[1, outside] /= 2 * step
            # A cosine ends at 1: there one-sided.
            low, high = np.maximum(c - step, -1.0), np.minimum(c + step, 1.0)
            gradient[2, outside] = self._exact(L, t, high) - self._exact(L, t, low)
            gradient[2, outside] /= high - low
        return value, gradient

    def _exact(self, length: FloatArray, theta: FloatArray, cosine: FloatArray) -> FloatArray:
        return bore.detour(length, theta, cosine, self.d_mm, self.bore_mm)

    def _inside(self, length: FloatArray, theta: FloatArray) -> npt.NDArray[np.bool_]:
        if self.table is None:
            return np.zeros(length.shape, dtype=bool)
        return np.asarray(
            (length >= self.shortest_mm)
            & (length <= self.longest_mm)
            & (theta <= self.most_bent_rad)
        )

    def of_arc(self, length: float, theta: float) -> Callable[[float, float], float]:
        """For one arc: compute a tendon's detour from its cos ψ and depth (above 0), in mm."""
        table = self.table
        if (
            table is not None
            and self.shortest_mm <= length <= self.longest_mm
            and theta <= self.most_bent_rad
        ):
            row, on_row = table.row(length, theta), table.on_row
            return lambda cosine, depth: depth * depth * on_row(row, cosine)
        arc = np.array([length]), np.array([theta])

        def exact(cosine: float, depth: float) -> float:
            del depth  # it is found again
            return float(self._exact(*arc, np.array([cosine]))[0])

        return exact


@lru_cache(maxsize=16)
def _detour(
    d_mm: float, bore_mm: float, shortest_mm: float, longest_mm: float, max_theta_rad: float
) -> _Detour:
    return _Detour(d_mm, bore_mm, (shortest_mm, longest_mm), max_theta_rad)


@dataclass(frozen=True, slots=True, eq=False)
class _Bore:
    """What a geometry's tendons share.

    Attributes
    ----------
    radius_mm
        Where a tendon's centre touches the wall.
    detours
        One for each distance from the axis that occurs.
    of_tendons
        Each tendon's.
    kinds : ndarray of int, shape (n,)
        Which of `detours` that is.
    holes_mm : ndarray, shape (n,)
        Each tendon's distance from the axis, with a gap to the wall.
    """

    radius_mm: float
    detours: tuple[_Detour, ...]
    of_tendons: tuple[_Detour, ...]
    kinds: npt.NDArray[np.intp]
    holes_mm: FloatArray


@lru_cache(maxsize=16)
def _bore(geometry: Geometry) -> _Bore:
    radius = geometry.lumen_radius_mm
    holes = [bore.touching_radius(d, radius) for d in geometry.tendon_radii_mm]
    distinct = sorted(set(holes))
    detours = tuple(
        _detour(d, radius, geometry.min_length_mm, geometry.free_length_mm, geometry.max_bend_rad)
        for d in distinct
    )
    kinds = [distinct.index(d) for d in holes]
    of_tendons = tuple(detours[kind] for kind in kinds)
    return _Bore(radius, detours, of_tendons, np.array(kinds), np.array(holes))


def _lengths(arc: Arc, geometry: Geometry) -> FloatArray:
    tendons, wall = layout(geometry), _bore(geometry)
    if arc.shape == ():
        x, y = arc.bend_rad.tolist()
        return np.array(_one(float(arc.length_mm), x, y, geometry))
    count = len(tendons.d_mm)
    beside_mm2 = wall.radius_mm**2 - wall.holes_mm**2

    def compute(length: FloatArray, bend: FloatArray, result: FloatArray) -> None:
        theta = np.sqrt(bend[:, 0] * bend[:, 0] + bend[:, 1] * bend[:, 1])
        np.maximum(theta, _TINY, out=theta)
        quarter = np.sin(0.25 * theta)
        versine = 2 * quarter * quarter  # 1 − cos(θ/2)
        np.matmul(bend, tendons.du_mm, out=result)
        np.subtract(length[:, np.newaxis], result, out=result)
        result *= (np.sin(0.5 * theta) / (0.5 * theta))[:, np.newaxis]

        # Where the chord would cut into the wall, and how deep: `bore.depth`.
        cosine = bend @ tendons.u.T
        cosine /= theta[:, np.newaxis]
        towards = cosine * wall.holes_mm
        depth = towards * towards
        depth += beside_mm2
        np.sqrt(depth, out=depth)
        towards *= (1 - versine)[:, np.newaxis]
        np.subtract(towards, depth, out=depth)
        apart = wall.detours[0].at_least(length, theta)
        depth += (apart * versine / theta)[:, np.newaxis]
        touching = np.flatnonzero(depth > 0)
        for kind, detour in enumerate(wall.detours):
            at = touching
            if len(wall.detours) > 1:
                at = touching[wall.kinds[touching % count] == kind]
            if len(at):
                pose = at // count
                places = apart[pose], theta[pose], cosine.reshape(-1)[at]
                result.reshape(-1)[at] += detour(*places, depth.reshape(-1)[at])

    return in_blocks(arc, (count,), compute)


def _one(length: float, x: float, y: float, geometry: Geometry) -> list[float]:
    """`_lengths` of a single pose, without what numpy costs for each."""
    wall = _bore(geometry)
    theta = max(math.hypot(x, y), _TINY)
    shrink = math.sin(theta / 2) / (theta / 2)
    versine = 2 * math.sin(theta / 4) ** 2
    apart = max(length, bore.LEAST_RADIUS * wall.radius_mm * theta)
    sagitta = apart * versine / theta
    square = wall.radius_mm**2
    of_arc: dict[float, Callable[[float, float], float]] = {}
    result = []
    for (d, ux, uy), detour in zip(layout(geometry).points, wall.of_tendons, strict=True):
        towards = x * ux + y * uy
        tendon = (length - d * towards) * shrink
        cosine = towards / theta
        d = detour.d_mm
        hole = d * cosine
        depth = sagitta + hole * (1 - versine) - math.sqrt(square - d * d + hole * hole)
        if depth > 0:
            if d not in of_arc:
                of_arc[d] = detour.of_arc(apart, theta)
            tendon += of_arc[d](cosine, depth)
        result.append(tendon)
    return result


def _derivative(arc: Arc, geometry: Geometry) -> FloatArray:
    def compute(length: FloatArray, bend: FloatArray, result: FloatArray) -> None:
        _with_derivative(length, bend, geometry, result)

    return in_blocks(arc, (geometry.tendon_count, 3), compute)


def _with_derivative(
    length: FloatArray, bend: FloatArray, geometry: Geometry, derivative: FloatArray
) -> FloatArray:
    """Lengths (p, n), and into `derivative` (p, n, 3) those by L and Δ."""
    tendons, wall = layout(geometry), _bore(geometry)
    theta = np.maximum(np.hypot(bend[:, 0], bend[:, 1]), _TINY)
    shrink = sinc(theta / 2)
    slope = sinc_slope(theta / 2) / 4  # d sinc(θ/2) / dΔ = slope·Δ
    fibre = length[:, np.newaxis] - bend @ tendons.du_mm
    value = fibre * shrink[:, np.newaxis]
    derivative[..., 0] = shrink[:, np.newaxis]
    derivative[..., 1:] = -shrink[:, np.newaxis, np.newaxis] * tendons.du_mm.T
    derivative[..., 1:] += (fibre * slope[:, np.newaxis])[..., np.newaxis] * bend[:, np.newaxis]

    cosine = bend @ tendons.u.T / theta[:, np.newaxis]
    apart = wall.detours[0].at_least(length, theta)
    limited = apart > length
    for kind, detour in enumerate(wall.detours):
        columns = np.flatnonzero(wall.kinds == kind)
        part = cosine[:, columns]
        depth = bore.depth(
            apart[:, np.newaxis], theta[:, np.newaxis], part, detour.d_mm, detour.bore_mm
        )
        pose, column = np.nonzero(depth > 0)
        if not len(pose):
            continue
        tendon = columns[column]
        value_mm, gradient = detour.with_gradient(
            apart[pose], theta[pose], cosine[pose, tendon], depth[pose, column]
        )
        value[pose, tendon] += value_mm
        by_length, by_theta, by_cosine = gradient
        # Where the coils are kept apart, the length used is a multiple of θ.
        held = limited[pose]
        by_theta += np.where(held, by_length * bore.LEAST_RADIUS * wall.radius_mm, 0.0)
        derivative[pose, tendon, 0] += np.where(held, 0.0, by_length)
        direction = bend[pose] / theta[pose, np.newaxis]
        across = tendons.u[tendon] - cosine[pose, tendon, np.newaxis] * direction
        derivative[pose, tendon, 1:] += by_theta[:, np.newaxis] * direction
        derivative[pose, tendon, 1:] += (by_cosine / theta[pose])[:, np.newaxis] * across
    return value


def _fit(q: FloatArray, geometry: Geometry, hint: Hint | None) -> Arc:
    """Gauss and Newton from the arc that fits offset fibres."""
    del hint  # there is only one solution
    shape = q.shape[:-1]
    q = q.reshape(-1, geometry.tendon_count)
    length, bend = parallel.solution(q, geometry)
    scale = float(np.max(layout(geometry).d_mm))
    rest = np.arange(len(q))
    # Half a spring and about a radian at most in one go: far-off lengths must not run away.
    limit = 0.5 * np.mean(q, axis=-1)
    length, bend = np.maximum(length, 1e-3 * limit), bend.copy()
    for _ in range(30):
        derivative = np.empty((len(rest), geometry.tendon_count, 3))
        value = _with_derivative(length[rest], bend[rest], geometry, derivative)
        # Unknowns L and scale·Δ: all in mm.
        derivative[..., 1:] /= scale
        transposed = np.swapaxes(derivative, -1, -2)
        right = transposed @ (q[rest] - value)[..., np.newaxis]
        # Far-off lengths may lead to where the matrix is singular; elsewhere this is nothing.
        step = np.linalg.solve(transposed @ derivative + 1e-14 * np.eye(3), right)[..., 0]
        size = np.max(np.abs(step), axis=-1)
        most = np.minimum(limit[rest], scale)
        step *= np.minimum(1.0, most / np.maximum(size, 1e-300))[:, np.newaxis]
        length[rest] = np.maximum(length[rest] + step[:, 0], 1e-3 * limit[rest])
        bend[rest] += step[:, 1:] / scale
        rest = rest[size > 1e-14 * length[rest]]
        if not len(rest):
            break
    return fitted(length.reshape(shape), bend.reshape(*shape, 2))


def _extended(values: FloatArray) -> FloatArray:
    """Give places without a value that of a neighbour: there the table counts for little."""
    if np.isnan(values).all():
        return np.zeros_like(values)
    ways = ((1, True), (2, True), (2, False), (0, True), (0, False), (1, False))
    for axis, towards_start in ways:
        rows = np.moveaxis(values, axis, 0)
        if towards_start:
            rows = rows[::-1]
        for before, row in itertools.pairwise(rows):
            np.copyto(row, before, where=np.isnan(row))
    return values


MODEL: Final = TendonModel("taut", _lengths, _derivative, _fit, parallel.one_piece)
