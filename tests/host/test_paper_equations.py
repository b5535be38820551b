"""The paper's equations 1 to 12, written out as printed, against this package's forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray
from setae.config import Geometry

# Where the paper's own forms keep their digits: not nearly straight.
thetas = st.floats(0.05, math.pi / 2)
alphas = st.floats(-math.pi, math.pi)
lengths = st.floats(20, 70)
tip_offsets = st.floats(0, 100)

D = Geometry().tendon_radii_mm[0]


def close(actual: object, expected: object) -> None:
    np.testing.assert_allclose(
        np.asarray(actual, float), np.asarray(expected, float), rtol=0, atol=1e-9
    )


def arc_of(length: float, theta: float, alpha: float) -> tuple[Arc, float]:
    """The arc, and the paper's radius r."""
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    return arc, length / theta


def rotate(axis: str, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.eye(4)
    if axis == "z":
        matrix[:2, :2] = [[c, -s], [s, c]]
    else:
        matrix[0, 0], matrix[0, 2], matrix[2, 0], matrix[2, 2] = c, s, -s, c
    return matrix


def shift(x: float = 0.0, z: float = 0.0) -> FloatArray:
    matrix = np.eye(4)
    matrix[0, 3], matrix[2, 3] = x, z
    return matrix


def equation_3(theta: float, alpha: float, r: float) -> FloatArray:
    ca, sa, ct, sn = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
    return np.array(
        [
            [ca**2 * ct + sa**2, sa * ca * ct - sa * ca, ca * sn, -r * ca * ct + r * ca],
            [sa * ca * ct - sa * ca, sa**2 * ct + ca**2, sa * sn, -r * sa * ct + r * sa],
            [-ca * sn, -sa * sn, ct, r * sn],
            [0, 0, 0, 1],
        ]
    )


@given(lengths, thetas, alphas)
def test_equations_1_to_3_transform_from_base_to_top(
    length: float, theta: float, alpha: float
) -> None:
    arc, r = arc_of(length, theta, alpha)
    d_t_c = rotate("z", alpha) @ shift(x=r)  # 1
    c_t_u = rotate("y", theta) @ shift(x=-r) @ rotate("z", -alpha)  # 2
    close(kinematics.transform_to_centre(arc), d_t_c)
    close(np.linalg.inv(kinematics.transform_to_centre(arc)) @ kinematics.transform(arc), c_t_u)
    close(kinematics.transform(arc), d_t_c @ c_t_u)
    close(kinematics.transform(arc), equation_3(theta, alpha, r))


@given(lengths, thetas, alphas)
def test_equation_4_position_of_the_top(length: float, theta: float, alpha: float) -> None:
    arc, r = arc_of(length, theta, alpha)
    close(
        kinematics.position(arc),
        [
            -r * math.cos(alpha) * math.cos(theta) + r * math.cos(alpha),
            -r * math.sin(alpha) * math.cos(theta) + r * math.sin(alpha),
            r * math.sin(theta),
        ],
    )


@given(lengths, thetas, alphas)
def test_equations_5_to_7_inverse(length: float, theta: float, alpha: float) -> None:
    _, r = arc_of(length, theta, alpha)
    x, y, z, _ = equation_3(theta, alpha, r)[:, 3]
    arc = kinematics.inverse((x, y, z))
    square = x**2 + y**2 + z**2
    close(arc.theta_rad, math.acos((z**2 - x**2 - y**2) / square))  # 5
    # 6; the paper gives the quadrant by sin α and cos α.
    close(np.sin(arc.alpha_rad), y / math.hypot(x, y))
    close(np.cos(arc.alpha_rad), x / math.hypot(x, y))
    radius = arc.length_mm / arc.theta_rad
    assert float(radius) == pytest.approx(square / (2 * math.hypot(x, y)), rel=1e-11)  # 7


@given(lengths, thetas, alphas, tip_offsets)
def test_equations_8_to_10_tip(length: float, theta: float, alpha: float, offset: float) -> None:
    arc, r = arc_of(length, theta, alpha)
    d_t_u = equation_3(theta, alpha, r)
    close(kinematics.transform(arc, tip_offset_mm=offset), d_t_u @ shift(z=offset))  # 8, 9
    x, y, z, _ = d_t_u[:, 3]
    tip = [
        offset * math.cos(alpha) * math.sin(theta) + x,
        offset * math.sin(alpha) * math.sin(theta) + y,
        offset * math.cos(theta) + z,
    ]
    close(kinematics.position(arc, tip_offset_mm=offset), tip)  # 10


def attachments(theta: float, alpha: float, r: float) -> tuple[FloatArray, FloatArray]:
    """Equation 11 and the one after it: lower and upper ends of the tendons, (4, 3)."""
    ca, sa, ct, sn = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
    x, y, z, _ = equation_3(theta, alpha, r)[:, 3]
    d = D
    low = np.array([(d, 0, 0), (0, d, 0), (-d, 0, 0), (0, -d, 0)])
    # The terms that the four have in common.
    xx, yy = d * ca**2 * ct + d * sa**2, d * sa**2 * ct + d * ca**2
    xy = d * sa * ca * ct - d * sa * ca
    high = np.array(
        [
            (xx + x, xy + y, -d * ca * sn + z),
            (xy + x, yy + y, -d * sa * sn + z),
            (-xx + x, -xy + y, d * ca * sn + z),
            (-xy + x, -yy + y, d * sa * sn + z),
        ]
    )
    return low, high


@given(lengths, thetas, alphas)
def test_equation_11_attachments_move_with_the_top(
    length: float, theta: float, alpha: float
) -> None:
    arc, r = arc_of(length, theta, alpha)
    low, high = attachments(theta, alpha, r)
    lower, upper = kinematics.attachments(arc, Geometry())
    close(lower, low)
    close(upper, high)


@given(lengths, thetas, alphas)
def test_equation_12_tendon_lengths(length: float, theta: float, alpha: float) -> None:
    arc, r = arc_of(length, theta, alpha)
    low, high = attachments(theta, alpha, r)
    centre = np.array([r * math.cos(alpha), r * math.sin(alpha), 0])
    expected = []
    for one, (lower, upper) in enumerate(zip(low, high, strict=True)):
        radius = float(np.linalg.norm(lower - centre))
        cosine = math.cos(alpha - one * math.pi / 2)
        # At the boundary itself rounding decides in the printed form, a tolerance here.
        inner = radius < math.hypot(r, D) and cosine > tendons.BOUNDARY_TOLERANCE
        expected.append(radius * theta if inner else float(np.linalg.norm(lower - upper)))
    close(tendons.lengths(arc, Geometry(), "paper"), expected)
