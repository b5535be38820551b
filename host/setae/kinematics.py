"""Between positions, arcs and tendon lengths: equations 1 to 11 of the paper.

All in the paper's frames: D at the spring's lower end, z along the straight
spring; C in the arc's centre; U at the spring's upper end; E at the bristle's tip.
The forms used here are equal to the paper's wherever those are defined, and have no
singularity where the spring is straight; docs/theory.md derives them.
"""

from __future__ import annotations

import math
from typing import Any, NoReturn, TypeGuard

import numpy as np
import numpy.typing as npt

from setae import tendons
from setae.arc import Arc, FloatArray, finite_array, first_place, real_array, sinc, sinc_slope
from setae.config import Geometry
from setae.errors import InputError

__all__ = [
    "attachments",
    "forward",
    "inverse",
    "jacobian",
    "position",
    "tendon_jacobian",
    "transform",
    "transform_to_centre",
]

_BLOCK = 4096
"""Positions that are computed at once: they stay in the processor's cache."""


def inverse(position_mm: npt.ArrayLike) -> Arc:
    """Find the arc that ends at a position: equations 5 to 7.

    Parameters
    ----------
    position_mm : array_like, shape (..., 3)
        The spring's top U in frame D; z above 0.

    Returns
    -------
    Arc
        Of shape (...). Its bending angle is below π, and above π/2 where U lies
        farther from the axis than above the base: `setae.workspace.check` tells
        what a robot can take.

    Raises
    ------
    InputError
        NaN, infinite, wrong shape, or z ≤ 0.

    Examples
    --------
    >>> arc = inverse((0, 0, 60))
    >>> float(arc.length_mm), arc.bend_rad.tolist()
    (60.0, [0.0, 0.0])
    >>> round(float(inverse((15, 0, 60)).length_mm), 3)
    62.47
    """
    single = _single(position_mm)
    if single is not None:
        return single
    p = real_array("position_mm", position_mm, last_axis=3, what="x, y, z")
    shape = p.shape[:-1]
    p = p.reshape(-1, 3)
    length, bend = np.empty(len(p)), np.empty((len(p), 2))
    good = True
    with np.errstate(all="ignore"):  # what isn't finite is found below
        for first in range(0, len(p), _BLOCK):
            part = slice(first, first + _BLOCK)
            x, y, z = np.array(p[part].T, dtype=np.float64, order="C")
            rho = np.sqrt(x * x + y * y)
            slope = rho / z
            # Half of equation 5's angle, without its loss of digits near 0, over its tangent. On
            # the axis that is 1; so it is for a tangent of 1e-300, and nothing divides by 0.
            np.maximum(slope, 1e-300, out=slope)
            ratio = np.arctan(slope)
            ratio /= slope
            slope *= rho
            slope += z
            np.multiply(slope, ratio, out=length[part])
            ratio /= z
            ratio *= 2  # θ/ρ
            np.multiply(x, ratio, out=bend[part, 0])
            np.multiply(y, ratio, out=bend[part, 1])
            # Written so that NaN is not good.
            good = good and bool(z.min() > 0) and bool(length[part].max() < math.inf)
    if not good:
        _refuse(p.reshape(*shape, 3))
    return Arc.of_checked(length.reshape(shape), bend.reshape(*shape, 2))


def _single(position_mm: npt.ArrayLike) -> Arc | None:
    """`inverse` of a single good position, without what numpy costs for each."""
    if isinstance(position_mm, np.ndarray):
        if position_mm.shape != (3,) or position_mm.dtype.kind not in "iuf":
            return None
        x, y, z = position_mm.tolist()
    elif isinstance(position_mm, (tuple, list)) and len(position_mm) == 3:
        x, y, z = position_mm
        if not (_is_plain(x) and _is_plain(y) and _is_plain(z)):
            return None
    else:
        return None
    try:
        rho = math.hypot(x, y)
        slope = max(rho / z, 1e-300)
        ratio = math.atan(slope) / slope
        length = (z + rho * slope) * ratio
    except (ArithmeticError, ValueError):
        return None
    if not (z > 0 and length < math.inf):
        return None
    scale = 2 * ratio / z
    return Arc.of_checked(np.array(length), np.array((x * scale, y * scale)))


def _is_plain(value: object) -> TypeGuard[float]:
    return type(value) is float or type(value) is int


def _refuse(p: npt.NDArray[Any]) -> NoReturn:
    """Say what is wrong with positions (..., 3) that `inverse` can't take."""
    p = finite_array("position_mm", p)
    bad = p[..., 2] <= 0
    if bad.any():
        raise InputError(
            f"position_mm{first_place(bad)} has z = {p[..., 2][bad][0]:g} mm.",
            "The spring's top lies above its base: choose z > 0.",
        )
    raise InputError("position_mm is too large, or z too close to 0.", "It is in mm.")


def position(arc: Arc, *, tip_offset_mm: npt.ArrayLike = 0.0) -> FloatArray:
    """Find where an arc ends: equations 4 and 10.

    Parameters
    ----------
    arc
        Of shape (...).
    tip_offset_mm
        Distance l beyond U along its z axis; 0 gives U, the robot's own gives E.

    Returns
    -------
    ndarray, shape (..., 3)
        Position in frame D.

    Examples
    --------
    >>> position(Arc(length_mm=60, bend_rad=(0, 0)), tip_offset_mm=65).tolist()
    [0.0, 0.0, 125.0]
    """
    offset = finite_array("tip_offset_mm", tip_offset_mm)
    theta = arc.theta_rad[..., np.newaxis]
    axis = np.concatenate([sinc(theta) * arc.bend_rad, np.cos(theta)], axis=-1)
    return np.asarray(arc.top_mm + offset[..., np.newaxis] * axis)


def transform(arc: Arc, *, tip_offset_mm: npt.ArrayLike = 0.0) -> FloatArray:
    """Find the homogeneous transformation D→U, or D→E: equations 3 and 9.

    Parameters
    ----------
    arc
        Of shape (...).
    tip_offset_mm
        As in `position`.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Lengths in mm.

    Examples
    --------
    >>> transform(Arc(length_mm=60, bend_rad=(0, 0)))[:3, 3].tolist()
    [0.0, 0.0, 60.0]
    """
    theta = arc.theta_rad
    x, y = arc.bend_rad[..., 0], arc.bend_rad[..., 1]
    a, b = 0.5 * sinc(theta / 2) ** 2, sinc(theta)
    result = np.zeros((*arc.shape, 4, 4))
    # exp of the rotation vector (−Δy, Δx, 0), by Rodrigues.
    result[..., 0, 0] = 1 - a * x * x
    result[..., 0, 1] = result[..., 1, 0] = -a * x * y
    result[..., 1, 1] = 1 - a * y * y
    result[..., 0, 2] = b * x
    result[..., 1, 2] = b * y
    result[..., 2, 0] = -b * x
    result[..., 2, 1] = -b * y
    result[..., 2, 2] = np.cos(theta)
    result[..., :3, 3] = position(arc, tip_offset_mm=tip_offset_mm)
    result[..., 3, 3] = 1
    return result


def transform_to_centre(arc: Arc) -> FloatArray:
    """Find the homogeneous transformation D→C, C in the arc's centre: equation 1.

    Frame C is turned by α about z. Equation 2, C→U, is the inverse of this one before
    `transform`.

    Parameters
    ----------
    arc
        Of shape (...), bent everywhere.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Lengths in mm.

    Raises
    ------
    InputError
        An arc is straight: its centre lies at infinity.

    Examples
    --------
    >>> transform_to_centre(Arc(length_mm=60, bend_rad=(0.5, 0)))[:3, 3].tolist()
    [120.0, 0.0, 0.0]
    """
    theta = arc.theta_rad
    with np.errstate(divide="ignore", over="ignore"):
        radius = arc.length_mm / theta
    straight = ~np.isfinite(radius)
    if straight.any():
        raise InputError(
            f"arc{first_place(straight)} is straight: its centre lies at infinity.",
            "Frame C needs a bent arc.",
        )
    cosine, sine = np.moveaxis(arc.bend_rad / theta[..., np.newaxis], -1, 0)
    result = np.zeros((*arc.shape, 4, 4))
    result[..., 0, 0] = result[..., 1, 1] = cosine
    result[..., 0, 1], result[..., 1, 0] = -sine, sine
    result[..., 0, 3], result[..., 1, 3] = radius * cosine, radius * sine
    result[..., 2, 2] = result[..., 3, 3] = 1
    return result


def attachments(arc: Arc, geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """Find where the tendons enter the spring, and where they end: equation 11.

    Parameters
    ----------
    arc
        Of shape (...).
    geometry
        With n tendons.

    Returns
    -------
    lower : ndarray, shape (n, 3)
        Their holes P_L in the base holder, in frame D.
    upper : ndarray, shape (..., n, 3)
        Their ends P_H in the top holder, in frame D.

    Examples
    --------
    >>> lower, upper = attachments(Arc(length_mm=60, bend_rad=(0, 0)), Geometry())
    >>> upper[0].tolist()
    [8.3, 0.0, 60.0]
    """
    angles = np.array(geometry.tendon_angles_rad)
    radii = np.array(geometry.tendon_radii_mm)
    lower = np.stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros_like(radii)], -1)
    to_top = transform(arc)
    turned = lower @ np.swapaxes(to_top[..., :3, :3], -1, -2)
    return lower, np.asarray(turned + to_top[..., np.newaxis, :3, 3])


def jacobian(arc: Arc, *, tip_offset_mm: npt.ArrayLike = 0.0) -> FloatArray:
    """Compute the derivatives of `position` by the arc's parameters.

    Parameters
    ----------
    arc, tip_offset_mm
        As in `position`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        x, y, z by L in mm/mm, by Δx and Δy in mm/rad.

    Examples
    --------
    >>> jacobian(Arc(length_mm=60, bend_rad=(0.5, 0))).round(3)[:, 0]
    array([0.245, 0.   , 0.959])
    """
    offset = finite_array("tip_offset_mm", tip_offset_mm)
    theta, length, bend = arc.theta_rad, arc.length_mm, arc.bend_rad
    half = sinc(theta / 2)
    a, b = 0.5 * half**2, sinc(theta)
    # Derivatives of a and b by Δ are these, times Δ.
    slope_a, slope_b = half * sinc_slope(theta / 2) / 4, sinc_slope(theta)
    result = np.empty((*np.broadcast_shapes(arc.shape, offset.shape), 3, 3))
    result[..., :2, 0] = a[..., np.newaxis] * bend
    result[..., 2, 0] = b
    outer = bend[..., :, np.newaxis] * bend[..., np.newaxis, :]
    result[..., :2, 1:] = (length * slope_a + offset * slope_b)[..., np.newaxis, np.newaxis] * outer
    result[..., 0, 1] += length * a + offset * b
    result[..., 1, 2] += length * a + offset * b
    result[..., 2, 1:] = (length * slope_b - offset * b)[..., np.newaxis] * bend
    return result


def tendon_jacobian(
    arc: Arc,
    geometry: Geometry,
    model: str = "parallel",
    *,
    tip_offset_mm: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Compute how a position moves with the tendons' lengths.

    Parameters
    ----------
    arc
        Of shape (...).
    geometry
        With n tendons at three different angles or more.
    model
        Tendon model, see `setae.tendons`.
    tip_offset_mm
        As in `position`.

    Returns
    -------
    ndarray, shape (..., 3, n)
        Derivatives of x, y, z by the lengths, in mm/mm. Small changes of length that
        belong to no arc count by their least squares, as in `forward`.

    Raises
    ------
    InputError
        An unknown model, or too few tendons.

    Examples
    --------
    >>> arc = Arc(length_mm=60, bend_rad=(0, 0))
    >>> tendon_jacobian(arc, Geometry()).round(3)[2].tolist()
    [0.25, 0.25, 0.25, 0.25]
    """
    tendons.require_determined(geometry)
    by_arc = tendons.jacobian(arc, geometry, model)
    # Bending in mm of tendon, so that the unknowns have one unit.
    scale = np.array([1.0, *[max(geometry.tendon_radii_mm)] * 2])
    return np.asarray(
        jacobian(arc, tip_offset_mm=tip_offset_mm) / scale @ np.linalg.pinv(by_arc / scale)
    )


def forward(
    lengths_mm: npt.ArrayLike,
    geometry: Geometry,
    model: str = "parallel",
    *,
    near: Arc | None = None,
    tolerance_mm: float = 0.1,
) -> Arc:
    """Find the arc whose tendons come closest to given lengths.

    Parameters
    ----------
    lengths_mm : array_like, shape (..., n)
        Tendon lengths, above 0.
    geometry
        With n tendons at three different angles or more.
    model
        Tendon model, see `setae.tendons`.
    near
        An arc that is expected, such as the commanded one; of shape (...) or ().
        With ``paper``, arcs more than 20 mm apart can have lengths that agree to
        0.1 mm, so rounding alone may choose the wrong one: with lengths that are
        rounded or measured, pass it.
    tolerance_mm
        How far the lengths may be off (root mean square): a fit worse than the best
        by up to this may win for being closer to `near`.

    Returns
    -------
    Arc
        Of shape (...): least squares over the tendons. Exact where the lengths
        belong to an arc.

    Raises
    ------
    InputError
        NaN, infinite, wrong shape, lengths ≤ 0, an unknown model, too few
        tendons, or lengths that no arc comes near.

    Examples
    --------
    >>> geometry = Geometry()
    >>> arc = inverse((15, 5, 60))
    >>> lengths = tendons.lengths(arc, geometry, model="paper")
    >>> position(forward(lengths, geometry, model="paper")).round(9).tolist()
    [15.0, 5.0, 60.0]
    """
    q = finite_array("lengths_mm", lengths_mm, last_axis=geometry.tendon_count, what="one a tendon")
    bad = q <= 0
    if bad.any():
        raise InputError(
            f"lengths_mm{first_place(bad)} is {q[bad][0]:g}.", "A tendon's length is above 0."
        )
    hint = None
    if near is not None:
        tolerance = finite_array("tolerance_mm", tolerance_mm)
        try:
            np.broadcast_to(near.length_mm, q.shape[:-1])
        except ValueError:
            raise InputError(
                f"near has shape {near.shape} and lengths_mm {q.shape}.",
                f"The shape of near must be {q.shape[:-1]} or ().",
            ) from None
        hint = tendons.Hint(near, float(tolerance))
    return tendons.model(model).fit(q, geometry, hint)
