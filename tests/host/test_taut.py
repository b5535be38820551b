"""The shortest path in the bore, against another way to find it and what is known of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray
from setae.config import Geometry
from setae.tendons import bore

GEOMETRY = Geometry()
D, B = 8.3, GEOMETRY.bore_radius_mm

lengths = st.floats(20, 70)
thetas = st.floats(0, math.pi / 2) | st.sampled_from([0.0, 1e-9, 1e-3, math.pi / 2])
alphas = st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 4, math.pi / 2, math.pi])


def string_through_discs(
    length: FloatArray, theta: FloatArray, psi: FloatArray, d: float, bore_mm: float, discs: int
) -> FloatArray:
    """The shortest string through discs across the bore, by Newton's method with a barrier.

    It knows nothing of geodesics. Strings through discs are a little too short, by
    about L (θ / discs)² / 24. All arguments of one shape (p,).
    """
    count, inner = len(length), discs - 1
    r = length / theta
    phi = theta[:, None] * np.linspace(0, 1, discs + 1)
    # A point of disc j lies at r − a towards the torus's axis and at h beside the plane.
    a = np.repeat((d * np.cos(psi))[:, None], discs + 1, axis=1)
    h = np.repeat((d * np.sin(psi))[:, None], discs + 1, axis=1)
    # Derivatives of a point by a and h.
    by_a = np.stack([-np.cos(phi), np.zeros_like(phi), -np.sin(phi)], axis=-1)
    by = np.stack([by_a, np.broadcast_to([0.0, 1.0, 0.0], by_a.shape)], axis=-1)
    even = np.arange(inner) * 2

    def points() -> FloatArray:
        return np.asarray(
            np.stack([(r[:, None] - a) * np.cos(phi), h, (r[:, None] - a) * np.sin(phi)], axis=-1)
        )

    weight = 1.0
    while weight > 2e-6:
        weight *= 0.2
        for _ in range(8):
            step = np.diff(points(), axis=1)
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            unit = step / size
            bend = (np.eye(3) - unit[..., :, None] * unit[..., None, :]) / size[..., None]
            E = by[:, 1:-1]
            x = np.stack([a, h], axis=-1)[:, 1:-1]
            room = bore_mm**2 - np.sum(x**2, axis=-1)[..., None]
            gradient = np.einsum("pjki,pjk->pji", E, unit[:, :-1] - unit[:, 1:])
            gradient += weight * 2 * x / room
            blocks = np.swapaxes(E, -1, -2) @ (bend[:, :-1] + bend[:, 1:]) @ E
            blocks += weight * 2 * np.eye(2) / room[..., None]
            blocks += weight * 4 * x[..., :, None] * x[..., None, :] / room[..., None] ** 2
            beside = -np.swapaxes(E[:, :-1], -1, -2) @ bend[:, 1:-1] @ E[:, 1:]
            hessian = np.zeros((count, 2 * inner, 2 * inner))
            for i in (0, 1):
                for k in (0, 1):
                    hessian[:, even + i, even + k] = blocks[..., i, k]
                    hessian[:, even[:-1] + i, even[1:] + k] = beside[..., i, k]
                    hessian[:, even[1:] + k, even[:-1] + i] = beside[..., i, k]
            move = -np.linalg.solve(hessian, gradient.reshape(count, -1, 1)).reshape(count, -1, 2)
            scale = np.ones((count, 1, 1))
            for _ in range(40):  # stay inside
                outside = (np.sum((x + scale * move) ** 2, axis=-1) >= bore_mm**2).any(axis=1)
                if not outside.any():
                    break
                scale[outside] *= 0.6
            a[:, 1:-1] += (scale * move)[..., 0]
            h[:, 1:-1] += (scale * move)[..., 1]
    return np.asarray(np.linalg.norm(np.diff(points(), axis=1), axis=-1).sum(axis=1))


@pytest.mark.parametrize(("d", "bore_mm"), [(8.3, 9.0), (8.9, 9.0), (5.0, 9.0)])
def test_it_is_the_shortest_string_through_discs(d: float, bore_mm: float) -> None:
    random = np.random.default_rng(3)
    length = np.concatenate([random.uniform(20, 70, 30), [70.0] * 7, [20.0, 20.0, 20.0]])
    theta = np.concatenate([random.uniform(0.05, math.pi / 2, 30), [math.pi / 2] * 10])
    psi = np.concatenate(
        [random.uniform(0, math.pi, 30), np.radians([0, 45, 70, 85, 90, 120, 180, 0, 45, 85])]
    )
    geometry = Geometry(tendon_radius_mm=d, bore_radius_mm=bore_mm, tendon_angles_rad=(0.0,))
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=psi)
    found = tendons.lengths(arc, geometry, "taut")[:, 0]
    coarse, fine = (
        string_through_discs(length, theta, psi, d, bore_mm, discs) for discs in (20, 40)
    )
    expected = (4 * fine - coarse) / 3  # what is missing goes with the square of their distance
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.01)
    chord = (length - d * theta * np.cos(psi)) * np.sinc(theta / 2 / math.pi)
    assert (expected - chord).max() > 1  # the wall mattered


def in_plane(length: FloatArray, theta: FloatArray, d: float) -> FloatArray:
    """The inner tendon in the bending plane: an arc on the wall between two tangents."""
    r = length / theta
    beta = np.arccos((r - B) / (r - d))
    touching = (r - B) * (theta - 2 * beta) + 2 * np.sqrt((r - d) ** 2 - (r - B) ** 2)
    return np.where(theta > 2 * beta, touching, 2 * (r - d) * np.sin(theta / 2))


def test_in_the_bending_plane_it_has_a_closed_form() -> None:
    length, theta = np.meshgrid(np.linspace(20, 70, 30), np.linspace(0.02, math.pi / 2, 40))
    expected = in_plane(length, theta, D)
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=0)
    np.testing.assert_allclose(
        tendons.lengths(arc, GEOMETRY, "taut")[..., 0], expected, rtol=0, atol=0.003
    )
    chord = (length - D * theta) * np.sinc(theta / 2 / math.pi)
    exact = bore.detour(length.ravel(), theta.ravel(), np.ones(length.size), D, B)
    np.testing.assert_allclose(chord + exact.reshape(length.shape), expected, rtol=0, atol=1e-9)


@given(lengths, thetas, alphas)
def test_it_lies_between_the_chord_and_the_offset_arc(
    length: float, theta: float, alpha: float
) -> None:
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    q = tendons.lengths(arc, GEOMETRY, "taut")
    fibre = tendons.lengths(arc, GEOMETRY, "parallel")
    assert (q >= fibre * np.sinc(theta / 2 / math.pi) - 1e-9).all()
    assert (q <= fibre + 0.003).all()


@pytest.mark.parametrize("model", ["taut", "parallel"])
def test_no_step_while_the_bending_direction_turns(model: str) -> None:
    alpha = np.radians(np.arange(0, 360, 0.05))
    for length in (20.0, 35.0, 53.3, 70.0):
        for theta in (0.02, 0.3, 0.7, 1.1, math.pi / 2):
            arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
            q = tendons.lengths(arc, GEOMETRY, model)
            assert np.abs(np.diff(q, axis=0, append=q[:1])).max() < 0.02


@given(lengths, st.floats(0.01, math.pi / 2), alphas)
def test_no_step_at_any_pose(length: float, theta: float, alpha: float) -> None:
    turned = alpha + np.radians(0.05) * np.arange(3)
    for model in ("taut", "parallel"):
        q = tendons.lengths(
            Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=turned), GEOMETRY, model
        )
        assert np.abs(np.diff(q, axis=0)).max() < 0.02
        # Nor a kink: the step hardly changes from one to the next.
        assert np.abs(np.diff(q, n=2, axis=0)).max() < 1e-4


@pytest.mark.parametrize("d", [0.5, 4.0, 8.0, 8.7, 8.95, 9.0])
def test_the_table_agrees_with_what_it_was_made_of(d: float) -> None:
    geometry = Geometry(tendon_radius_mm=d, tendon_angles_rad=(0.0,))
    random = np.random.default_rng(4)
    # Up to the very ends of the workspace, and beyond, where no table serves.
    length = np.concatenate([random.uniform(15, 90, 400), [20.0, 70.0, 20.0, 70.0]])
    theta = np.concatenate([random.uniform(0.01, 1.9, 400), [math.pi / 2] * 4])
    psi = np.concatenate([random.uniform(0, math.pi, 400), [0.0, 0.0, 1.5, 1.5]])
    fits = length > 1.1 * B * theta
    length, theta, psi = length[fits], theta[fits], psi[fits]
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=psi)
    hole = bore.touching_radius(d, B)
    chord = (length - d * theta * np.cos(psi)) * np.sinc(theta / 2 / math.pi)
    expected = chord + bore.detour(length, theta, np.cos(psi), hole, B)
    found = tendons.lengths(arc, geometry, "taut")[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.005)


def test_beyond_the_workspace_lengths_and_derivatives_go_on() -> None:
    theta = np.linspace(1.5, 2.5, 2001)
    arc = Arc.from_angles(length_mm=40, theta_rad=theta, alpha_rad=0.4)
    q = tendons.model("taut").lengths(arc, GEOMETRY)
    assert np.abs(np.diff(q, axis=0)).max() < 0.02
    slope = np.einsum("pni,i->pn", tendons.jacobian(arc, GEOMETRY, "taut"), [0, 1, 0])
    slope = slope * math.cos(0.4) + math.sin(0.4) * np.einsum(
        "pni,i->pn", tendons.jacobian(arc, GEOMETRY, "taut"), [0, 0, 1]
    )
    measured = (q[2:] - q[:-2]) / (theta[2:] - theta[:-2])[:, None]
    # But for the one place where the table ends.
    assert np.sort(np.abs(measured - slope[1:-1]), axis=0)[-4].max() < 0.01


def test_coils_that_would_cut_into_each_other_give_no_surprise() -> None:
    arc = Arc.from_angles(length_mm=np.linspace(5, 40, 400), theta_rad=2.5, alpha_rad=0.3)
    q = tendons.model("taut").lengths(arc, GEOMETRY)
    assert np.isfinite(q).all()
    assert np.abs(np.diff(q, axis=0)).max() < 0.2
    derivative = tendons.jacobian(arc, GEOMETRY, "taut")[..., 0]
    measured = (q[2:] - q[:-2]) / (arc.length_mm[2:] - arc.length_mm[:-2])[:, None]
    assert np.sort(np.abs(measured - derivative[1:-1]), axis=0)[-4].max() < 0.01


def test_a_thicker_tendon_stays_nearer_to_its_arc() -> None:
    arc = Arc(length_mm=60, bend_rad=(1.2, 0))
    q = [
        float(tendons.lengths(arc, Geometry(tendon_diameter_mm=diameter), "taut")[0])
        for diameter in (0.0, 0.3, 0.6, 1.2, 1.4)
    ]
    fibre = float(tendons.lengths(arc, GEOMETRY, "parallel")[0])
    assert sorted(q) == q
    assert q[-1] == pytest.approx(fibre, abs=0.02)


def test_the_hole_at_the_wall_itself() -> None:
    geometry = Geometry(tendon_radius_mm=9.0)
    arc = Arc.from_angles(
        length_mm=55, theta_rad=np.linspace(0, math.pi / 2, 20), alpha_rad=np.linspace(0, 3, 20)
    )
    q = tendons.lengths(arc, geometry, "taut")
    assert (q <= tendons.lengths(arc, geometry, "parallel") + 0.01).all()
    back = kinematics.forward(q, geometry, "taut")
    np.testing.assert_allclose(back.top_mm, arc.top_mm, atol=1e-9)


def test_measured_lengths_get_their_arc_of_least_squares() -> None:
    random = np.random.default_rng(8)
    arc = Arc.from_angles(
        length_mm=random.uniform(25, 68, 300),
        theta_rad=random.uniform(0, 1.5, 300),
        alpha_rad=random.uniform(-3, 3, 300),
    )
    q = tendons.lengths(arc, GEOMETRY, "taut") + random.normal(scale=0.3, size=(300, 4))
    back = kinematics.forward(q, GEOMETRY, "taut")
    miss = q - tendons.lengths(back, GEOMETRY, "taut")
    slope = np.einsum("pni,pn->pi", tendons.jacobian(back, GEOMETRY, "taut"), miss)
    np.testing.assert_allclose(slope, 0, atol=1e-9)


def test_lengths_far_from_any_arc_are_answered_too() -> None:
    q = np.random.default_rng(9).uniform(10, 200, (40, 4))
    back = kinematics.forward(q, GEOMETRY, "taut")
    assert np.isfinite(back.bend_rad).all()
    assert (back.length_mm > 0).all()


def test_a_spring_of_other_proportions() -> None:
    geometry = Geometry(
        free_length_mm=300, min_length_mm=60, tendon_radius_mm=[8.5, 8.0, 7.0], max_bend_rad=1.5,
        tendon_angles_rad=(0.1, 2.0, 4.0),
    )  # fmt: skip
    random = np.random.default_rng(5)
    arc = Arc.from_angles(
        length_mm=random.uniform(60, 300, 200),
        theta_rad=random.uniform(0.01, 1.5, 200),
        alpha_rad=random.uniform(-3, 3, 200),
    )
    q = tendons.lengths(arc, geometry, "taut")
    cosine = np.cos(arc.alpha_rad[:, None] - np.array(geometry.tendon_angles_rad))
    for i, d in enumerate(geometry.tendon_radii_mm):
        chord = (arc.length_mm - d * arc.theta_rad * cosine[:, i]) * np.sinc(
            arc.theta_rad / 2 / math.pi
        )
        detour = bore.detour(arc.length_mm, arc.theta_rad, cosine[:, i], d, B)
        np.testing.assert_allclose(q[:, i], chord + detour, rtol=0, atol=0.015)
    back = kinematics.forward(q, geometry, "taut")
    np.testing.assert_allclose(back.top_mm, arc.top_mm, atol=1e-8)
