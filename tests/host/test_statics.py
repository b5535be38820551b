"""What tendons must pull, and where the spring rests where they can't."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from setae import config, statics, tendons, workspace
from setae.arc import Arc
from setae.errors import InputError
from setae.workspace import Reason

CONFIG = config.load()


def changed(section: str, **values: Any) -> config.Config:
    part = dataclasses.replace(getattr(CONFIG, section), **values)
    return dataclasses.replace(CONFIG, **{section: part})


def some_poses(count: int, seed: int, longest_mm: float = 70.0) -> Arc:
    random = np.random.default_rng(seed)
    return Arc.from_angles(
        length_mm=random.uniform(20, longest_mm, count),
        theta_rad=random.uniform(0, math.pi / 2, count),
        alpha_rad=random.uniform(-math.pi, math.pi, count),
    )


def test_tensions_balance_the_spring_with_the_least_squares() -> None:
    random = np.random.default_rng(2)
    arc = Arc.from_angles(
        length_mm=random.uniform(20, 70, 400),
        theta_rad=random.uniform(0, math.pi / 2, 400),
        alpha_rad=random.uniform(-math.pi, math.pi, 400),
    )
    tensions = statics.tensions_n(arc, CONFIG)
    held = ~np.isnan(tensions).any(axis=-1)
    assert 0.3 < held.mean() < 0.95
    T, bend, length = tensions[held], arc.bend_rad[held], arc.length_mm[held]
    assert T.min() >= 0
    np.testing.assert_allclose(T.sum(axis=-1), 0.22 * (70 - length), atol=1e-6)
    bending = 15.4 * 19.5**2 * 1.3 / (2 * 2.3)
    moment = np.stack([T[:, 0] - T[:, 2], T[:, 1] - T[:, 3]], axis=-1) * 8.3
    np.testing.assert_allclose(moment, bending * bend / 70, atol=1e-5)
    # With four tendons every other solution differs by a multiple of (1, −1, 1, −1). None with
    # a smaller sum of squares may be without a push.
    other = np.array([1.0, -1, 1, -1])
    for step in (-1e-3, 1e-3):
        moved = T + step * other
        allowed = (moved >= 0).all(axis=-1)
        assert ((moved**2).sum(axis=-1) >= (T**2).sum(axis=-1) - 1e-9)[allowed].all()


def test_where_no_tensions_are_given_there_are_none() -> None:
    """Of the pull-only solutions along (1, −1, 1, −1), search the whole line."""
    random = np.random.default_rng(3)
    arc = Arc.from_angles(
        length_mm=random.uniform(50, 70, 200),
        theta_rad=random.uniform(0.1, math.pi / 2, 200),
        alpha_rad=random.uniform(-math.pi, math.pi, 200),
    )
    tensions = statics.tensions_n(arc, CONFIG)
    total = 0.22 * (70 - arc.length_mm)
    moment = 15.4 * 19.5**2 * 1.3 / (2 * 2.3) / 70 / 8.3 * arc.bend_rad
    # T0 + T2 = a, T1 + T3 = total − a, and both differences are given.
    possible = np.abs(moment).sum(axis=-1) <= total
    np.testing.assert_array_equal(np.isnan(tensions).any(axis=-1), ~possible)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_statics_with_other_numbers_of_tendons(count: int) -> None:
    geometry = config.Geometry(
        tendon_angles_rad=tuple(0.3 + 2 * math.pi * i / count for i in range(count))
    )
    robot = object.__new__(config.Config)  # a board drives four; statics doesn't mind
    for field in dataclasses.fields(CONFIG):
        object.__setattr__(robot, field.name, getattr(CONFIG, field.name))
    object.__setattr__(robot, "geometry", geometry)
    angles = np.array(geometry.tendon_angles_rad)
    # Loads made from tensions of neighbours, which are therefore possible.
    for size in range(1, count + 1):
        T = np.zeros(count)
        T[:size] = np.linspace(0.3, 0.6, size)
        moment = 8.3 * np.array([T @ np.cos(angles), T @ np.sin(angles)])
        bend = moment * 70 / (15.4 * 19.5**2 * 1.3 / (2 * 2.3))
        arc = Arc(length_mm=70 - T.sum() / 0.22, bend_rad=bend)
        found = statics.tensions_n(arc, robot)
        assert found.sum() == pytest.approx(T.sum(), abs=1e-6)
        assert (found**2).sum() <= (T**2).sum() + 1e-9


def test_a_least_tension_keeps_tendons_taut() -> None:
    taut = dataclasses.replace(CONFIG, servo=dataclasses.replace(CONFIG.servo, min_tension_n=0.2))
    arc = Arc(length_mm=55, bend_rad=(0.4, 0.1))
    assert statics.tensions_n(arc, taut).min() >= 0.2
    free = workspace.check(Arc(length_mm=70, bend_rad=(0, 0)), taut)
    assert Reason.NEEDS_PUSH in Reason(int(free.reasons))


def test_a_servo_holds_a_third_of_its_stall_torque_at_its_pulley() -> None:
    # MG996R: 9.4 kgf cm at 4.8 V.
    np.testing.assert_allclose(statics.max_tension_n(CONFIG), 0.3 * 0.92 / 0.035, rtol=1e-12)
    thick = changed("servo", growth_mm_per_turn=(2.0, 0.0, 0.0, 0.0))
    most = statics.max_tension_n(thick)
    assert most[0] < most[1]


def test_a_preload_shifts_tensions_and_takes_poses_away() -> None:
    arc = some_poses(500, 6)
    least, loaded = (statics.tensions_n(arc, CONFIG, preload_n=p) for p in (0.0, 0.2))
    held = ~np.isnan(loaded).any(axis=-1)
    assert loaded[held].min() >= 0.2 - 1e-12
    assert 0 < held.sum() < (~np.isnan(least).any(axis=-1)).sum()
    np.testing.assert_allclose(loaded[held].sum(axis=-1), least[held].sum(axis=-1), atol=1e-9)
    with pytest.raises(InputError, match="preload_n is -1"):
        statics.tensions_n(arc, CONFIG, preload_n=-1)


@pytest.mark.parametrize("preload_n", [0.0, 0.2])
@pytest.mark.parametrize("torque_n_m", [0.92, 0.3])
def test_the_bounds_say_the_same_as_the_tensions(preload_n: float, torque_n_m: float) -> None:
    robot = changed("servo", stall_torque_n_m=torque_n_m)
    arc = some_poses(4000, 8)
    A, b = statics.bounds(robot, preload_n=preload_n)
    point = np.concatenate([arc.length_mm[:, None], arc.bend_rad], axis=-1)
    inside = (point @ A.T <= b + 1e-9).all(axis=-1)
    tensions = statics.tensions_n(arc, robot, preload_n=preload_n)
    with np.errstate(invalid="ignore"):
        held = (tensions <= statics.max_tension_n(robot) + 1e-6).all(axis=-1)
    np.testing.assert_array_equal(inside, held)
    assert 0.05 < inside.mean() < 0.95


def test_where_the_least_tensions_are_too_much_others_are_found() -> None:
    # Eight weak servos: the least squares lean on the nearest ones.
    angles = tuple(2 * math.pi * i / 8 for i in range(8))
    geometry = config.Geometry(tendon_angles_rad=angles)
    robot = object.__new__(config.Config)  # a board drives four; statics doesn't mind
    for field in dataclasses.fields(CONFIG):
        object.__setattr__(robot, field.name, getattr(CONFIG, field.name))
    object.__setattr__(robot, "geometry", geometry)
    servo = dataclasses.replace(CONFIG.servo, stall_torque_n_m=0.11)
    object.__setattr__(robot, "servo", servo)
    arc = some_poses(2000, 9)
    most = statics.max_tension_n(robot)
    tensions = statics.tensions_n(arc, robot)
    object.__setattr__(robot, "servo", CONFIG.servo)
    unlimited = statics.tensions_n(arc, robot)
    with np.errstate(invalid="ignore"):
        spared = (tensions <= most + 1e-9).all(axis=-1) & (unlimited > most + 1e-6).any(axis=-1)
    assert spared.sum() > 20
    # The same load, shared differently.
    u = np.stack([np.ones(8), np.cos(angles), np.sin(angles)], axis=-1)
    np.testing.assert_allclose(tensions[spared] @ u, unlimited[spared] @ u, atol=1e-8)
    assert tensions[spared].min() >= 0


def test_tendons_at_different_radii_balance_the_spring() -> None:
    geometry = dataclasses.replace(CONFIG.geometry, tendon_radius_mm=(8.0, 7.0, 8.5, 7.5))
    robot = dataclasses.replace(CONFIG, geometry=geometry)
    arc = some_poses(500, 10, 55.0)
    T = statics.tensions_n(arc, robot)
    held = ~np.isnan(T).any(axis=-1)
    assert held.mean() > 0.5
    moment = np.stack([T[:, 0] * 8.0 - T[:, 2] * 8.5, T[:, 1] * 7.0 - T[:, 3] * 7.5], axis=-1)
    bending = 15.4 * 19.5**2 * 1.3 / (2 * 2.3)
    np.testing.assert_allclose(moment[held], (bending * arc.bend_rad / 70)[held], atol=1e-5)
    np.testing.assert_allclose(T.sum(axis=-1)[held], (0.22 * (70 - arc.length_mm))[held], atol=1e-6)


# ------------------------------------------------------------------------ settling


def energy_n_mm(arc: Arc) -> np.ndarray:
    bending = 15.4 * 19.5**2 * 1.3 / (2 * 2.3) / 70
    return np.asarray(
        0.5 * 0.22 * (70 - arc.length_mm) ** 2 + 0.5 * bending * (arc.bend_rad**2).sum(axis=-1)
    )


def test_a_pose_that_can_be_held_is_where_the_spring_settles() -> None:
    arc = some_poses(1000, 12)
    least = statics.tensions_n(arc, CONFIG, preload_n=0.0)
    held = ~np.isnan(least).any(axis=-1)
    arc, least = arc[held], least[held]
    settled = statics.settle(tendons.lengths(arc, CONFIG.geometry, "parallel"), CONFIG)
    np.testing.assert_allclose(settled.arc.top_mm, arc.top_mm, atol=1e-9)
    assert (settled.slack_mm == 0).all()
    np.testing.assert_allclose(settled.tensions_n, least, atol=1e-9)


def test_elsewhere_a_tendon_hangs_slack_and_no_shape_costs_less() -> None:
    random = np.random.default_rng(13)
    arc = some_poses(300, 14)
    lengths = tendons.lengths(arc, CONFIG.geometry, "parallel")
    lost = np.isnan(statics.tensions_n(arc, CONFIG, preload_n=0.0)).any(axis=-1)
    lengths = lengths[lost]
    settled = statics.settle(lengths, CONFIG)
    way = tendons.lengths(settled.arc, CONFIG.geometry, "parallel")
    # Taut tendons are as long as their way, slack ones longer, and those pull nothing.
    np.testing.assert_allclose(lengths - way, settled.slack_mm, atol=1e-8)
    assert (settled.slack_mm.max(axis=-1) > 0).all()
    assert settled.tensions_n[settled.slack_mm > 1e-6].max() == 0
    assert settled.tensions_n.min() >= 0
    T, u = settled.tensions_n, np.array(CONFIG.geometry.tendon_angles_rad)
    np.testing.assert_allclose(T.sum(axis=-1), 0.22 * (70 - settled.arc.length_mm), atol=1e-9)
    moment = 8.3 * np.stack([T @ np.cos(u), T @ np.sin(u)], axis=-1)
    bending = 15.4 * 19.5**2 * 1.3 / (2 * 2.3) / 70
    np.testing.assert_allclose(moment, bending * settled.arc.bend_rad, atol=1e-8)
    least = energy_n_mm(settled.arc)
    for _ in range(200):
        other = Arc(
            length_mm=settled.arc.length_mm + random.normal(0, 0.5, len(lengths)),
            bend_rad=settled.arc.bend_rad + random.normal(0, 0.05, (len(lengths), 2)),
        )
        fits = (tendons.lengths(other, CONFIG.geometry, "parallel") <= lengths).all(axis=-1)
        assert (energy_n_mm(other) >= least)[fits].all()


def test_the_papers_eight_targets_rest_millimetres_away() -> None:
    z, theta = np.meshgrid(np.arange(40.0, 71, 5), np.radians(np.arange(10, 91, 10)), indexing="ij")
    arc = Arc.from_angles(length_mm=z * theta / np.sin(theta), theta_rad=theta, alpha_rad=0.0)
    reach = workspace.check(arc, CONFIG, "parallel")
    lost = workspace.check(arc, CONFIG, "paper").reachable & ~reach.holdable
    assert lost.sum() == 8
    away = np.linalg.norm(reach.settled.arc.top_mm - arc.top_mm, axis=-1)
    assert away[reach.holdable].max() < 1e-9
    assert away[lost].min() > 0.3
    assert 5 < away[lost].mean() < 10
    assert reach.settled.slack_mm.shape == (7, 9, 4)


def test_free_and_loose_tendons_leave_the_spring_free() -> None:
    settled = statics.settle([[70.0] * 4, [71.0, 72, 73, 74]], CONFIG)
    np.testing.assert_allclose(settled.arc.top_mm, [[0, 0, 70]] * 2)
    np.testing.assert_allclose(settled.slack_mm, [[0] * 4, [1, 2, 3, 4]])
    with pytest.raises(InputError, match="inside out"):
        statics.settle([-5.0] * 4, CONFIG)
