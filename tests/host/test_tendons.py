"""Tendon models: their relation, the paper's jump, other numbers of tendons."""

from __future__ import annotations

import math

import numpy as np
import pytest

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray
from setae.config import TENDON_MODELS, Geometry
from setae.errors import InputError

GEOMETRY = Geometry()


def test_configurations_can_name_exactly_the_models_there_are() -> None:
    assert tuple(tendons.MODELS) == TENDON_MODELS


@pytest.mark.parametrize("model", TENDON_MODELS)
def test_straight_tendons_are_as_long_as_the_spring(model: str) -> None:
    arc = Arc(length_mm=[20.0, 45.0, 70.0], bend_rad=(0, 0))
    np.testing.assert_array_equal(
        tendons.lengths(arc, GEOMETRY, model), np.repeat(arc.length_mm[:, None], 4, axis=1)
    )


@pytest.mark.parametrize("model", TENDON_MODELS)
def test_lengths_stay_smooth_while_the_bending_vanishes(model: str) -> None:
    theta = 10.0 ** np.arange(-15.0, 0.0)
    arc = Arc.from_angles(length_mm=60, theta_rad=theta, alpha_rad=0.3)
    difference = np.abs(tendons.lengths(arc, GEOMETRY, model) - 60)
    # No more than the fibre's share and the chord's, 60·θ²/24.
    assert (difference <= (8.3 * theta + 60 * theta**2 / 24)[:, None] + 1e-13).all()


def test_models_agree_on_the_inner_tendon_in_the_bending_plane() -> None:
    arc = Arc(length_mm=50, bend_rad=(1.2, 0))
    paper, parallel = (tendons.lengths(arc, GEOMETRY, model) for model in ("paper", "parallel"))
    assert paper[0] == pytest.approx(parallel[0], abs=1e-12)
    assert paper[2] < parallel[2]  # a chord is shorter than its arc


def jump_mm(length: float, theta: float, d: float) -> float:
    """The step of a tendon that crosses the neutral plane, worked out by hand."""
    r = length / theta
    return math.hypot(r, d) * theta - 2 * r * math.sin(theta / 2)


def test_the_paper_rule_jumps_by_its_closed_form() -> None:
    geometry = Geometry(tendon_radius_mm=8.5)
    for z, theta in ((40, math.pi / 2), (60, 0.49)):
        length = z * theta / math.sin(theta)
        either = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=[-1e-5, 1e-5])
        step = np.abs(np.diff(tendons.lengths(either, geometry, "paper"), axis=0))[0]
        expected = jump_mm(length, theta, 8.5)
        # Two tendons change sides at α = 0, one each way.
        np.testing.assert_allclose(step[[1, 3]], expected, atol=1e-3)
        assert step[[0, 2]].max() < 1e-3


def test_the_jump_has_the_size_that_the_documentation_says() -> None:
    d = 8.5
    jumps = [
        jump_mm(z * theta / math.sin(theta), theta, d)
        for z in range(40, 71, 5)
        for theta in np.radians(range(10, 91, 10))
        if z * theta / math.sin(theta) <= 70
        and (z * theta / math.sin(theta) + d * theta) * math.sin(theta / 2) / (theta / 2) <= 70
    ]
    assert len(jumps) == 34
    assert np.mean(jumps) == pytest.approx(1.8, abs=0.05)
    assert jump_mm(40 * math.pi / 2, math.pi / 2, d) == pytest.approx(7.7, abs=0.05)
    theta, length = 2 * math.atan(15 / 60), float(kinematics.inverse((15, 0, 60)).length_mm)
    assert jump_mm(length, theta, d) == pytest.approx(0.76, abs=0.01)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_tendons_on_the_boundary_are_chords_whatever_rounding_says(dtype: type) -> None:
    # x = ρ cos α, as an experiment would compute it: with equation 12 as printed, rounding puts
    # some of the 272 tendons on the boundary to the inner side.
    z, theta, alpha = np.meshgrid(
        np.arange(40.0, 71, 5),
        np.radians(np.arange(10, 91, 10)),
        np.array([0, math.pi / 2, math.pi, 1.5 * math.pi]),
        indexing="ij",
    )
    rho = z * np.tan(theta / 2)
    targets: FloatArray = np.stack([rho * np.cos(alpha), rho * np.sin(alpha), z], axis=-1).astype(
        dtype
    )
    arc = kinematics.inverse(targets)
    q = tendons.lengths(arc, GEOMETRY, "paper")
    chord = arc.length_mm * np.sin(arc.theta_rad / 2) / (arc.theta_rad / 2)
    tolerance = 1e-9 if dtype is np.float64 else 1e-4
    for direction in range(4):
        for tendon in ((direction + 1) % 4, (direction + 3) % 4):
            np.testing.assert_allclose(
                q[..., direction, tendon], chord[..., direction], atol=tolerance
            )


def test_three_tendons_at_any_angles() -> None:
    geometry = Geometry(tendon_angles_rad=(0.2, 2.4, 4.0))
    arc = Arc(length_mm=60, bend_rad=(0.5, -0.3))
    q = tendons.lengths(arc, geometry, "parallel")
    expected = [60 - 8.3 * (0.5 * math.cos(a) - 0.3 * math.sin(a)) for a in (0.2, 2.4, 4.0)]
    np.testing.assert_allclose(q, expected, atol=1e-12)
    assert tendons.lengths(arc, geometry, "paper").shape == (3,)


@pytest.mark.parametrize("model", TENDON_MODELS)
def test_each_tendon_may_have_a_distance_of_its_own(model: str) -> None:
    radii = (8.3, 6.0, 8.9, 6.0, 7.0)
    angles = (0.0, 1.0, 2.5, 4.0, 5.0)
    arc = Arc.from_angles(
        length_mm=[[30, 50, 70]], theta_rad=1.3, alpha_rad=[[-2.0], [0.4], [1.3], [2.2]]
    )
    geometry = Geometry(tendon_radius_mm=radii, tendon_angles_rad=angles)
    q = tendons.lengths(arc, geometry, model)
    assert q.shape == (4, 3, 5)
    for i, (radius, angle) in enumerate(zip(radii, angles, strict=True)):
        alone = Geometry(tendon_radius_mm=radius, tendon_angles_rad=(angle,))
        np.testing.assert_allclose(
            q[..., i], tendons.lengths(arc, alone, model)[..., 0], atol=1e-12
        )
        one = tendons.lengths(arc[2, 1], geometry, model)
        np.testing.assert_allclose(one, q[2, 1], atol=1e-12)
    back = kinematics.forward(q, geometry, model, near=arc)
    np.testing.assert_allclose(back.top_mm, arc.top_mm, atol=1e-9)


def test_turning_the_robot_by_a_tendon_turns_the_lengths() -> None:
    alpha = np.linspace(0.1, 6.2, 40)
    one = Arc.from_angles(length_mm=55, theta_rad=1.0, alpha_rad=alpha)
    turned = Arc.from_angles(length_mm=55, theta_rad=1.0, alpha_rad=alpha + math.pi / 2)
    for model in TENDON_MODELS:
        np.testing.assert_allclose(
            tendons.lengths(turned, GEOMETRY, model),
            np.roll(tendons.lengths(one, GEOMETRY, model), 1, axis=-1),
            atol=1e-9,
        )


def test_a_tendon_without_length_is_refused() -> None:
    with pytest.raises(InputError, match=r"length of tendon\[0\] would be -2.45 mm"):
        tendons.lengths(Arc(length_mm=10, bend_rad=(1.5, 0)), GEOMETRY, "parallel")
