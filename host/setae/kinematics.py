"""Between positions, arcs and tendon lengths: equations 1 to 9 of the paper.

All in the paper's frames: D at the spring's lower end, z along the straight
spring; U at its upper end; E at the bristle's tip. The forms used here are
equal to the paper's wherever those are defined, and have no singularity where
the spring is straight; docs/theory.md derives them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from setae import tendons
from setae.arc import Arc, FloatArray, finite_array, first_place, sinc
from setae.config import Geometry
from setae.errors import InputError

__all__ = ["forward", "inverse", "position", "transform"]


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
    p = finite_array("position_mm", position_mm, last_axis=3, what="x, y, z")
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    bad = z <= 0
    if bad.any():
        raise InputError(
            f"position_mm{first_place(bad)} has z = {z[bad][0]:g} mm.",
            "The spring's top lies above its base: choose z > 0.",
        )
    rho = np.hypot(x, y)
    # Half of equation 5's angle, without its loss of digits near 0.
    half_theta = np.arctan2(rho, z)
    theta = 2 * half_theta
    # θ/ρ. On the axis x = y = 0, and any factor gives Δ = 0.
    scale = np.divide(theta, rho, out=np.zeros_like(theta), where=rho > 0)
    bend = np.stack([x * scale, y * scale], axis=-1)
    return Arc(length_mm=np.hypot(rho, z) / sinc(half_theta), bend_rad=bend)


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
