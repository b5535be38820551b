"""A smooth function of three variables, kept as a table: cubic B-splines.

Interpolates with two continuous derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from setae.arc import FloatArray

__all__ = ["Axis", "Table"]


@dataclass(frozen=True, slots=True)
class Axis:
    """Equally spaced places of one variable.

    Attributes
    ----------
    low, high
        The first and the last place.
    count
        How many; at least 5.
    """

    low: float
    high: float
    count: int

    @property
    def places(self) -> FloatArray:
        """The places, shape (count,)."""
        return np.linspace(self.low, self.high, self.count)

    @property
    def per_step(self) -> float:
        """Steps for one unit of the variable."""
        return (self.count - 1) / (self.high - self.low)


class Table:
    """Interpolates between values on a grid.

    Parameters
    ----------
    axes
        Of the three variables.
    values
        At the grid's points, shape (count, count, count).
    """

    def __init__(self, axes: tuple[Axis, Axis, Axis], values: FloatArray) -> None:
        self.axes = axes
        for axis in range(3):
            weights = _interpolation(values.shape[axis])
            values = np.moveaxis(np.tensordot(weights, values, axes=(1, axis)), 0, axis)
        self._flat = np.ascontiguousarray(values).reshape(-1)
        self._plain: list[float] = self._flat.tolist()
        _, rows, columns = values.shape
        self._strides = (rows * columns, columns, 1)
        steps = np.arange(4)
        # From a cell's first coefficient to its 4 × 4 × 4.
        self._offsets: npt.NDArray[np.intp] = (
            steps[:, None, None] * self._strides[0] + steps[:, None] * columns + steps
        ).reshape(-1, 1)

    def __call__(self, *variables: FloatArray) -> FloatArray:
        """Interpolate at places (p,) inside the grid."""
        grid, weights = self._around(variables)
        for weight in reversed(weights):
            grid = _weighted(grid, weight(0))
        return grid

    def with_gradient(self, *variables: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Interpolate, and derive by the variables: shapes (p,) and (3, p)."""
        grid, weights = self._around(variables)
        value = grid
        for weight in reversed(weights):
            value = _weighted(value, weight(0))
        gradient = np.empty((3, value.shape[-1]))
        for by in range(3):
            slope = grid
            for axis in (2, 1, 0):
                slope = _weighted(slope, weights[axis](int(axis == by)))
            gradient[by] = slope * self.axes[by].per_step
        return value, gradient

    def one(self, *variables: float) -> float:
        """Interpolate at one place, without what numpy costs for each."""
        first, weights = 0, []
        for variable, axis, stride in zip(variables, self.axes, self._strides, strict=True):
            place = (variable - axis.low) * axis.per_step
            cell = min(max(int(place), 0), axis.count - 2)
            first += cell * stride
            t = place - cell
            s = 1 - t
            third = t * t * t / 6
            square = t * t / 2
            weights.append((s * s * s / 6, 2 / 3 - 2 * square + 3 * third,
                            1 / 6 + t / 2 + square - 3 * third, third))  # fmt: skip
        plain, (row, column, _) = self._plain, self._strides
        w, x, y, z = weights[2]
        total = 0.0
        for a in weights[0]:
            at, part = first, 0.0
            for b in weights[1]:
                part += b * (
                    w * plain[at] + x * plain[at + 1] + y * plain[at + 2] + z * plain[at + 3]
                )
                at += column
            total += a * part
            first += row
        return total

    def _around(self, variables: Sequence[FloatArray]) -> tuple[FloatArray, list[_Weights]]:
        """The coefficients around each place, shape (4, 4, 4, p), and their weights."""
        first: npt.NDArray[np.intp] = np.zeros(variables[0].shape, dtype=np.intp)
        weights = []
        for variable, axis, stride in zip(variables, self.axes, self._strides, strict=True):
            place = (variable - axis.low) * axis.per_step
            cell = place.astype(np.intp)
            np.clip(cell, 0, axis.count - 2, out=cell)
            weights.append(_Weights(place - cell))
            first += cell * stride
        # In range by construction; "clip" saves the check.
        grid = np.take(self._flat, first + self._offsets, mode="clip")
        return grid.reshape(4, 4, 4, -1), weights


class _Weights:
    """Weights of four neighbouring B-splines, by the place t in the cell between the middle two."""

    def __init__(self, t: FloatArray) -> None:
        self._t = t

    def __call__(self, derivative: int) -> FloatArray:
        """Shape (4, p)."""
        t = self._t
        result = np.empty((4, len(t)))
        s = 1 - t
        square = t * t
        if derivative:
            result[0] = -0.5 * s * s
            result[1] = 1.5 * square - 2 * t
            result[2] = 0.5 + t - 1.5 * square
            result[3] = 0.5 * square
            return result
        cube = square * t
        result[0] = s * s * s / 6
        result[1] = 2 / 3 - square + cube / 2
        result[3] = cube / 6
        # The four add up to 1.
        result[2] = 1 - result[0] - result[1] - result[3]
        return result


def _weighted(grid: FloatArray, weights: FloatArray) -> FloatArray:
    """Sum over the last axis but one: (..., 4, p) and (4, p) → (..., p)."""
    total: FloatArray = grid[..., 0, :] * weights[0]
    for k in range(1, 4):
        total += grid[..., k, :] * weights[k]
    return total


def _interpolation(count: int) -> FloatArray:
    """Matrix (count + 2, count) from values to coefficients.

    At the grid's points 1/6, 4/6, 1/6 of three neighbours give the value; at both ends the
    fourth difference of the coefficients vanishes, so that cubics are exact.
    """
    matrix = np.zeros((count + 2, count + 2))
    for i in range(count):
        matrix[i + 1, i : i + 3] = 1 / 6, 4 / 6, 1 / 6
    matrix[0, :5] = matrix[-1, -5:] = 1, -4, 6, -4, 1
    return np.asarray(np.linalg.inv(matrix)[:, 1:-1])
