"""The shape of the spring as an arc of a circle, without a singularity.

The paper's (α, θ, r) break where the spring is straight: α means nothing there
and r is infinite. An `Arc` holds the length L and the bending as a vector
Δ = θ(cos α, sin α) instead, which is zero where the spring is straight (Della
Santina et al. 2020, Allen et al. 2020; with four tendons these are the Clarke
coordinates).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from setae.errors import InputError

__all__ = ["Arc", "FloatArray", "finite_array", "real_array", "sinc", "sinc_slope"]

FloatArray: TypeAlias = npt.NDArray[np.float64]


def finite_array(
    name: str, value: npt.ArrayLike, *, last_axis: int | None = None, what: str = ""
) -> FloatArray:
    """Turn an argument into an array of float64, or say what is wrong with it.

    Parameters
    ----------
    name
        The argument's name, for the message.
    value
        Numbers of any real type.
    last_axis
        Length that the last axis must have. None: any shape.
    what
        What the last axis holds, for the message.

    Returns
    -------
    array
        The values; shape as given.

    Raises
    ------
    InputError
        Not real numbers, NaN or infinite, or the wrong shape.

    Examples
    --------
    >>> finite_array("position_mm", [1, 2, 3], last_axis=3)
    array([1., 2., 3.])
    >>> finite_array("position_mm", [1, 2], last_axis=3, what="x, y, z")
    Traceback (most recent call last):
    ...
    setae.errors.InputError: position_mm has shape (2,). Its last axis must have 3 entries: x, y, z.
    """
    array = real_array(name, value, last_axis=last_axis, what=what).astype(np.float64)
    bad = ~np.isfinite(array)
    if bad.any():
        raise InputError(f"{name}{first_place(bad)} is {array[bad][0]}.", "Pass finite numbers.")
    return array


def real_array(
    name: str, value: npt.ArrayLike, *, last_axis: int | None = None, what: str = ""
) -> npt.NDArray[Any]:
    """Like `finite_array`, but in the type that the numbers have, and not a copy if need be."""
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "iuf":
            raise TypeError
    except (TypeError, ValueError):
        raise InputError(
            f"{name} is not an array of real numbers: {_short(value)}.",
            "Pass numbers, all rows of the same length.",
        ) from None
    if last_axis is not None and (raw.ndim == 0 or raw.shape[-1] != last_axis):
        entries = f"{last_axis} entries" if last_axis != 1 else "one entry"
        raise InputError(
            f"{name} has shape {raw.shape}.",
            f"Its last axis must have {entries}{': ' + what if what else ''}.",
        )
    return raw


def positive(name: str, value: npt.ArrayLike) -> float:
    """Turn an argument into one number above 0, or raise InputError.

    Examples
    --------
    >>> positive("speed_mm_s", 20)
    20.0
    """
    array = finite_array(name, value)
    if array.ndim or not array > 0:
        raise InputError(f"{name} is {value!r}.", "It must be a number above 0.")
    return float(array)


def first_place(bad: npt.NDArray[np.bool_]) -> str:
    """Where the first bad entry is, as an index to put behind a name; empty for a scalar."""
    if bad.ndim == 0:
        return ""
    return f"[{', '.join(str(i) for i in np.argwhere(bad)[0])}]"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def sinc(angle_rad: npt.ArrayLike) -> FloatArray:
    """sin(x)/x, with its limit 1 at 0.

    Examples
    --------
    >>> sinc([0.0, 1e-12])
    array([1., 1.])
    """
    return np.asarray(np.sinc(np.asarray(angle_rad, dtype=np.float64) / math.pi))


def sinc_slope(angle_rad: npt.ArrayLike) -> FloatArray:
    """Derivative of `sinc` over its argument, with its limit -1/3 at 0.

    So sinc(c|Δ|) has the derivative c² · slope · Δ by a vector Δ.

    Examples
    --------
    >>> sinc_slope([0.0, 1e-9])
    array([-0.33333333, -0.33333333])
    """
    x = np.asarray(angle_rad, dtype=np.float64)
    square = x * x
    # The quotient loses its digits near 0, the series doesn't.
    near = square < 0.01
    quotient = (np.cos(x) - sinc(x)) / np.where(near, 1.0, square)
    series = -1 / 3 + square * (1 / 30 - square * (1 / 840 - square * (1 / 45360)))
    return np.asarray(np.where(near, series, quotient))


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Arc:
    """An arc of a circle from D, where it leaves along z, to U.

    Attributes
    ----------
    length_mm : ndarray, shape (...)
        Length L, above 0.
    bend_rad : ndarray, shape (..., 2)
        Δ = θ(cos α, sin α): bending angle θ towards the direction α about z.

    Raises
    ------
    InputError
        NaN or infinite values, lengths not above 0, shapes that don't belong
        together. The two are broadcast to one shape (...).

    Examples
    --------
    >>> import math
    >>> arc = Arc(length_mm=60, bend_rad=(0, math.pi / 3))
    >>> round(float(arc.theta_rad), 6), round(float(arc.alpha_rad), 6)
    (1.047198, 1.570796)
    """

    length_mm: FloatArray
    bend_rad: FloatArray

    def __init__(self, *, length_mm: npt.ArrayLike, bend_rad: npt.ArrayLike) -> None:
        length = finite_array("length_mm", length_mm)
        bend = finite_array("bend_rad", bend_rad, last_axis=2, what="θ cos α, θ sin α")
        if (length <= 0).any():
            bad = length <= 0
            raise InputError(
                f"length_mm{first_place(bad)} is {length[bad][0]:g}.",
                "The length of an arc is above 0.",
            )
        try:
            shape = np.broadcast_shapes(length.shape, bend.shape[:-1])
        except ValueError:
            raise InputError(
                f"length_mm has shape {length.shape} and bend_rad {bend.shape}.",
                "The shape of bend_rad must be that of length_mm, and (2,).",
            ) from None
        self._keep(
            np.array(np.broadcast_to(length, shape)), np.array(np.broadcast_to(bend, (*shape, 2)))
        )

    def _keep(self, length: FloatArray, bend: FloatArray) -> None:
        length.flags.writeable = False
        bend.flags.writeable = False
        object.__setattr__(self, "length_mm", length)
        object.__setattr__(self, "bend_rad", bend)

    @classmethod
    def of_checked(cls, length_mm: FloatArray, bend_rad: FloatArray) -> Arc:
        """An arc of arrays that fulfil all that `Arc` asks for, and that nobody else holds."""
        arc = cls.__new__(cls)
        arc._keep(length_mm, bend_rad)
        return arc

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape (...) of the poses."""
        return self.length_mm.shape

    @property
    def theta_rad(self) -> FloatArray:
        """Bending angle θ ≥ 0, shape (...)."""
        return np.asarray(np.hypot(self.bend_rad[..., 0], self.bend_rad[..., 1]))

    @property
    def alpha_rad(self) -> FloatArray:
        """Direction α of the bending, shape (...); 0 where the spring is straight."""
        return np.asarray(np.arctan2(self.bend_rad[..., 1], self.bend_rad[..., 0]))

    @property
    def top_mm(self) -> FloatArray:
        """Where the arc ends, the position of U in frame D, shape (..., 3): equation 4."""
        theta = self.theta_rad
        # r(1 − cos θ) = L θ·½ sinc²(θ/2), and r sin θ = L sinc θ.
        lateral = self.length_mm * 0.5 * sinc(theta / 2) ** 2
        return np.concatenate(
            [
                lateral[..., np.newaxis] * self.bend_rad,
                (self.length_mm * sinc(theta))[..., np.newaxis],
            ],
            axis=-1,
        )

    def __getitem__(self, index: object) -> Arc:
        """Some of the poses, by an index into (...)."""
        key = index if isinstance(index, tuple) else (index,)
        return Arc.of_checked(
            np.array(self.length_mm[key]), np.array(self.bend_rad[(*key, slice(None))])
        )

    @classmethod
    def from_angles(
        cls, *, length_mm: npt.ArrayLike, theta_rad: npt.ArrayLike, alpha_rad: npt.ArrayLike
    ) -> Arc:
        """An arc from the paper's angles, all of shape (...).

        Examples
        --------
        >>> Arc.from_angles(length_mm=60, theta_rad=0.5, alpha_rad=0).bend_rad
        array([0.5, 0. ])
        """
        theta, alpha = np.broadcast_arrays(
            finite_array("theta_rad", theta_rad), finite_array("alpha_rad", alpha_rad)
        )
        bend = theta[..., np.newaxis] * np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
        return cls(length_mm=length_mm, bend_rad=bend)
