"""Offset arcs: each tendon keeps its distance from the spring's axis. q = L − d (Δ·u)."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from setae.arc import Arc, FloatArray
from setae.config import Geometry
from setae.errors import InputError
from setae.tendons.rule import BoolArray, Hint, TendonModel, fitted, in_blocks, layout

__all__ = ["MODEL", "one_piece", "require_determined", "solution"]


def _lengths(arc: Arc, geometry: Geometry) -> FloatArray:
    tendons = layout(geometry)
    if arc.shape == ():
        x, y = arc.bend_rad.tolist()
        length = float(arc.length_mm)
        return np.array([length - d * (x * ux + y * uy) for d, ux, uy in tendons.points])

    def compute(length: FloatArray, bend: FloatArray, result: FloatArray) -> None:
        np.matmul(bend, tendons.du_mm, out=result)
        np.subtract(length[:, np.newaxis], result, out=result)

    return in_blocks(arc, (len(tendons.d_mm),), compute)


def _derivative(arc: Arc, geometry: Geometry) -> FloatArray:
    return np.array(np.broadcast_to(_matrix(geometry), (*arc.shape, geometry.tendon_count, 3)))


def _matrix(geometry: Geometry) -> FloatArray:
    """The linear rule itself: lengths = matrix @ (L, Δ), shape (n, 3)."""
    du = layout(geometry).du_mm.T
    return np.concatenate([np.ones((len(du), 1)), -du], axis=1)


@lru_cache(maxsize=64)
def _inverse(geometry: Geometry) -> FloatArray:
    """Least squares for (L, Δ), shape (3, n)."""
    require_determined(geometry)
    return np.asarray(np.linalg.pinv(_matrix(geometry)), dtype=np.float64)


def require_determined(geometry: Geometry) -> None:
    """Make sure that the tendons' lengths determine an arc.

    Raises
    ------
    InputError
        They don't: too few tendons, or all at one or two angles.
    """
    # Bending in mm of tendon, so that the unknowns have one unit.
    matrix = _matrix(geometry) / [1.0, *[max(geometry.tendon_radii_mm)] * 2]
    singular = np.linalg.svd(matrix, compute_uv=False)
    if len(matrix) < 3 or singular[-1] < 1e-6 * singular[0]:
        raise InputError(
            "The tendons don't determine the arc.",
            "It takes tendons at three different angles or more.",
        )


def solution(q: FloatArray, geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """Find L (...) and Δ (..., 2) of least squares; the equations are linear."""
    unknowns = q @ _inverse(geometry).T
    return unknowns[..., 0], unknowns[..., 1:]


def _fit(q: FloatArray, geometry: Geometry, hint: Hint | None) -> Arc:
    del hint  # there is only one solution
    return fitted(*solution(q, geometry))


def one_piece(arc: Arc, geometry: Geometry) -> BoolArray:
    """`TendonModel.pieces` of a rule that never jumps."""
    return np.zeros((*arc.shape, geometry.tendon_count), dtype=bool)


MODEL: Final = TendonModel("parallel", _lengths, _derivative, _fit, one_piece)
