"""What a tendon model is, and what the models share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from setae.arc import Arc, FloatArray, first_place
from setae.config import Geometry
from setae.errors import InputError

__all__ = ["BoolArray", "Hint", "Layout", "TendonModel", "fitted", "in_blocks", "layout"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]

BLOCK = 2048
"""Poses that are computed at once: their intermediate results stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class TendonModel:
    """A rule for the tendons' lengths.

    Attributes
    ----------
    name
        As in a configuration.
    lengths
        Arc of shape (...) → lengths in mm, shape (..., n).
    derivative
        Arc of shape (...) → derivatives of the lengths by L and Δ, shape (..., n, 3).
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
    derivative: Callable[[Arc, Geometry], FloatArray]
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


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Where the tendons of a geometry are.

    Attributes
    ----------
    u : ndarray, shape (n, 2)
        Unit vectors from the axis to the tendons.
    d_mm : ndarray, shape (n,)
        Their distances from the axis.
    du_mm : ndarray, shape (2, n)
        d u: (L, Δ) has the offset fibres L − Δ @ du_mm.
    points : tuple
        (d, u_x, u_y) of each tendon as plain numbers, for a single pose.
    """

    u: FloatArray
    d_mm: FloatArray
    du_mm: FloatArray
    points: tuple[tuple[float, float, float], ...]


@lru_cache(maxsize=64)
def layout(geometry: Geometry) -> Layout:
    """Find where the tendons of a geometry are."""
    angles = np.array(geometry.tendon_angles_rad)
    u = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    d = np.array(geometry.tendon_radii_mm)
    du = np.ascontiguousarray((d[:, np.newaxis] * u).T)
    for array in (u, d, du):
        array.flags.writeable = False
    points = tuple((float(d[i]), float(u[i, 0]), float(u[i, 1])) for i in range(len(d)))
    return Layout(u, d, du, points)


def in_blocks(
    arc: Arc, shape: Sequence[int], compute: Callable[[FloatArray, FloatArray, FloatArray], None]
) -> FloatArray:
    """Compute something for poses of any shape, a block at a time.

    Parameters
    ----------
    arc
        Of shape (...).
    shape
        Of one pose's result.
    compute
        Takes L (p,), Δ (p, 2), and where to write the results (p, *shape).

    Returns
    -------
    ndarray, shape (..., *shape)
    """
    length, bend = arc.length_mm.reshape(-1), arc.bend_rad.reshape(-1, 2)
    result = np.empty((len(length), *shape))
    for first in range(0, len(length), BLOCK):
        part = slice(first, first + BLOCK)
        compute(length[part], bend[part], result[part])
    return result.reshape(*arc.shape, *shape)


def fitted(length: FloatArray, bend: FloatArray) -> Arc:
    """Make an arc of what a fit found, or say that it found none."""
    bad = ~(length > 0)
    if bad.any():
        raise InputError(
            f"lengths_mm{first_place(bad)}: no arc comes near these tendon lengths.",
            "Check that they are in mm and in the order of tendon_angles_rad.",
        )
    return Arc(length_mm=length, bend_rad=bend)
