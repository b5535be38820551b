"""A smooth function of three variables, kept as a table: cubic B-splines.

Interpolates with two continuous derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from setae.arc import FloatArray

__all__ = ["Axis", "Table"]

_BLOCK = 512
"""Places that are computed at once: the 64 coefficients of each stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class Axis:
    """Equally spaced places of one variable.

    Attributes
    ----------
    low, high
        The first and the last place.
    count
        How many; at least 5.
    per_step
        Steps for one unit of the variable.
    """

    low: float
    high: float
    count: int
    per_step: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "per_step", (self.count - 1) / (self.high - self.low))

    @property
    def places(self) -> FloatArray:
        """The places, shape (count,)."""
        return np.linspace(self.low, self.high, self.count)


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
        self._grid = np.ascontiguousarray(values)
        self._flat = self._grid.reshape(-1)
        _, rows, columns = values.shape
        steps = np.arange(4)
        # From a cell's first coefficient to its 4 × 4 × 4.
        self._offsets: npt.NDArray[np.intp] = (
            (steps[:, None, None] * rows + steps[:, None]) * columns + steps
        ).reshape(-1, 1)
        self._strides = np.array([rows * columns, columns, 1])
        self._lows = np.array([[axis.low] for axis in axes])
        self._per_step = np.array([[axis.per_step] for axis in axes])
        self._last_cells = np.array([[axis.count - 2] for axis in axes])

    def __call__(self, *variables: FloatArray) -> FloatArray:
        """Interpolate at places (p,) inside the grid."""
        places = np.stack(variables)
        value = np.empty(places.shape[1])
        for first in range(0, len(value), _BLOCK):
            part = slice(first, first + _BLOCK)
            grid, t = self._around(places[:, part])
            value[part] = _weighted(grid, _weights(t))
        return value

    def with_gradient(self, *variables: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Interpolate, and derive by the variables: shapes (p,) and (3, p)."""
        grid, t = self._around(np.stack(variables))
        weights, slopes = _weights(t), _slopes(t)
        gradient = np.empty(t.shape)
        for by, axis in enumerate(self.axes):
            mixed = weights.copy()
            mixed[:, by] = slopes[:, by]
            gradient[by] = _weighted(grid, mixed) * axis.per_step
        return _weighted(grid, weights), gradient

    def row(self, first: float, second: float) -> list[float]:
        """Interpolate by the first two variables: what `on_row` takes."""
        i, a = _plain_weights(first, self.axes[0])
        j, b = _plain_weights(second, self.axes[1])
        weights = np.array([x * y for x in a for y in b])
        row: list[float] = (weights @ self._grid[i : i + 4, j : j + 4].reshape(16, -1)).tolist()
        return row

    def on_row(self, row: list[float], third: float) -> float:
        """Interpolate by the third variable, without what numpy costs for a single place."""
        k, (a, b, c, d) = _plain_weights(third, self.axes[2])
        return a * row[k] + b * row[k + 1] + c * row[k + 2] + d * row[k + 3]

    def _around(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients around places (3, p), shape (4, 4, 4, p); t in their cells (3, p)."""
        t = (places - self._lows) * self._per_step
        cell = t.astype(np.intp)
        np.clip(cell, 0, self._last_cells, out=cell)
        t -= cell
        first = self._strides @ cell
        # In range by construction; "clip" saves the check.
        grid = np.take(self._flat, first + self._offsets, mode="clip")
        return grid.reshape(4, 4, 4, -1), t


def _weights(t: FloatArray) -> FloatArray:
    """Weights of four neighbouring B-splines, t behind the second's middle: (3, p) → (4, 3, p)."""
    s, square = 1 - t, t * t
    result = np.empty((4, *t.shape))
    result[0] = s * s * s / 6
    result[3] = square * t / 6
    result[1] = 2 / 3 - square + 3 * result[3]
    # The four add up to 1.
    result[2] = 1 - result[0] - result[1] - result[3]
    return result


def _slopes(t: FloatArray) -> FloatArray:
    """Derivatives of `_weights` by t."""
    s, square = 1 - t, t * t
    return np.stack([-s * s / 2, 1.5 * square - 2 * t, 0.5 + t - 1.5 * square, square / 2])


def _plain_weights(variable: float, axis: Axis) -> tuple[int, tuple[float, float, float, float]]:
    """Like `_weights`, for one place and one variable: its cell and the four weights."""
    place = (variable - axis.low) * axis.per_step
    cell = min(max(int(place), 0), axis.count - 2)
    t = place - cell
    s = 1 - t
    square = t * t
    first, last = s * s * s / 6, square * t / 6
    second = 2 / 3 - square + 3 * last
    return cell, (first, second, 1 - first - second - last, last)


def _weighted(grid: FloatArray, weights: FloatArray) -> FloatArray:
    """Sum coefficients (4, 4, 4, p) with weights (4, 3, p): (p,)."""
    planes = np.einsum("abcp,cp->abp", grid, weights[:, 2])
    rows = np.einsum("abp,bp->ap", planes, weights[:, 1])
    return np.asarray(np.einsum("ap,ap->p", rows, weights[:, 0]))


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
