"""What can be reached and held, and the reasons given where not."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from setae import config, kinematics, workspace
from setae.arc import Arc
from setae.errors import UnreachableError
from setae.workspace import Reason

CONFIG = config.load()


def paper_targets(alpha: float) -> Arc:
    """The paper's 63 combinations of z (rows) and θ (columns)."""
    z, theta = np.meshgrid(
        np.arange(40.0, 71.0, 5.0), np.radians(np.arange(10, 91, 10)), indexing="ij"
    )
    return Arc.from_angles(length_mm=z * theta / np.sin(theta), theta_rad=theta, alpha_rad=alpha)


def with_radius(d: float) -> config.Config:
    return dataclasses.replace(
        CONFIG, geometry=dataclasses.replace(CONFIG.geometry, tendon_radius_mm=d)
    )


@pytest.mark.parametrize("alpha", [0, math.pi / 2, math.pi, -math.pi / 2])
def test_34_of_the_papers_63_targets_are_reachable(alpha: float) -> None:
    reachable = workspace.check(paper_targets(alpha), CONFIG, "paper").reachable
    assert reachable.sum(axis=1).tolist() == [9, 8, 6, 5, 4, 2, 0]


@pytest.mark.parametrize(("d", "count"), [(7.80, 35), (7.83, 34), (8.74, 34), (8.76, 33)])
def test_34_holds_for_a_range_of_tendon_radii(d: float, count: int) -> None:
    assert workspace.check(paper_targets(0), with_radius(d), "paper").reachable.sum() == count


@pytest.mark.parametrize(("factor", "count"), [(1.0, 8), (0.65, 3)])
def test_some_reachable_targets_can_not_be_held_by_tendons_that_only_pull(
    factor: float, count: int
) -> None:
    softer = dataclasses.replace(
        CONFIG, spring=dataclasses.replace(CONFIG.spring, bending_factor=factor)
    )
    reach = workspace.check(paper_targets(0), softer, "paper")
    assert (reach.reachable & ~reach.holdable).sum() == count


def test_bending_costs_13_mm_of_compression_per_radian() -> None:
    theta = 1.0
    for compression, held in ((12.90, False), (13.00, True)):
        arc = Arc(length_mm=70 - compression, bend_rad=(theta, 0))
        assert bool(workspace.check(arc, CONFIG).holdable) is held


def test_tensions_balance_the_spring_with_the_least_squares() -> None:
    random = np.random.default_rng(2)
    arc = Arc.from_angles(
        length_mm=random.uniform(20, 70, 400),
        theta_rad=random.uniform(0, math.pi / 2, 400),
        alpha_rad=random.uniform(-math.pi, math.pi, 400),
    )
    tensions = workspace.tensions_n(arc, CONFIG)
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
    tensions = workspace.tensions_n(arc, CONFIG)
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
        found = workspace.tensions_n(arc, robot)
        assert found.sum() == pytest.approx(T.sum(), abs=1e-6)
        assert (found**2).sum() <= (T**2).sum() + 1e-9


def test_a_least_tension_keeps_tendons_taut() -> None:
    taut = dataclasses.replace(CONFIG, servo=dataclasses.replace(CONFIG.servo, min_tension_n=0.2))
    arc = Arc(length_mm=55, bend_rad=(0.4, 0.1))
    assert workspace.tensions_n(arc, taut).min() >= 0.2
    free = workspace.check(Arc(length_mm=70, bend_rad=(0, 0)), taut)
    assert Reason.NEEDS_PUSH in Reason(int(free.reasons))


@pytest.mark.parametrize(
    ("length", "theta", "reason", "sentence"),
    [
        (19.0, 0.0, Reason.TOO_SHORT, "19.00 mm long, and its shortest length is 20 mm"),
        (70.5, 0.0, Reason.TOO_LONG, "70.50 mm long, and it is 70 mm long when free"),
        (50.0, 1.6, Reason.OVER_BENT, "bent by 91.7°, and at most 90°"),
        (69.0, 0.8, Reason.TENDON_TOO_LONG, "Tendon 2 would be 73.64 mm long, and at most 70.00"),
        (69.0, 0.8, Reason.NEEDS_PUSH, "only a tendon that pushes"),
    ],
)
def test_reasons_come_with_figures(
    length: float, theta: float, reason: Reason, sentence: str
) -> None:
    reach = workspace.check(Arc(length_mm=length, bend_rad=(theta, 0)), CONFIG)
    assert reason in Reason(int(reach.reasons))
    assert any(sentence in text for text in reach.explain()), reach.explain()


def test_travel_and_tension_limit_the_workspace_too() -> None:
    weak = dataclasses.replace(
        CONFIG,
        servo=dataclasses.replace(CONFIG.servo, pulse_max_us=(1500.0,) * 4, max_tension_n=1.0),
    )
    reach = workspace.check(Arc(length_mm=30, bend_rad=(0.5, 0)), weak)
    assert Reason(int(reach.reasons)) == Reason.TENDON_TOO_SHORT | Reason.TOO_TENSE
    short, tense = reach.explain()
    assert "Tendon 0 would be 25.85 mm long, and its servo can wind it to 34.26 mm" in short
    assert "and its servo holds 1 N" in tense


def test_targets_on_the_border_are_inside_in_single_precision_too() -> None:
    inside = [(0, 0, 70), (0, 0, 20)]
    for dtype in (np.float64, np.float32):
        arc = kinematics.inverse(np.array(inside, dtype=dtype))
        assert workspace.check(arc, CONFIG).reachable.all()
    right_angle = 40 * 2 / math.pi
    arc = kinematics.inverse(np.array([right_angle, 0, right_angle], dtype=np.float32))
    assert bool(workspace.check(arc, CONFIG).reachable)


def test_answers_have_the_shape_of_the_poses() -> None:
    reach = workspace.check(paper_targets(0), CONFIG)
    assert reach.reachable.shape == reach.holdable.shape == (7, 9)
    assert reach.lengths_mm.shape == reach.tensions_n.shape == (7, 9, 4)
    for index in itertools.product(range(7), range(9)):
        assert bool(reach.explain(index)) == (reach.reasons[index] != 0)


def test_require_names_the_first_bad_target_and_only_what_was_asked() -> None:
    positions = [(15.0, 0, 60), (0, 0, 71), (0, 0, 10)]
    with pytest.raises(UnreachableError, match=r"^Target 1: The spring would be 71.00 mm"):
        workspace.require(kinematics.inverse(positions), CONFIG)
    diagonal = kinematics.inverse((15 / math.sqrt(2), 15 / math.sqrt(2), 60))
    assert workspace.require(diagonal, CONFIG).shape == (4,)
    with pytest.raises(UnreachableError, match=r"^Bending by 28.1°.*only a tendon that pushes"):
        workspace.require(diagonal, CONFIG, holdable=True)
    both = Arc(length_mm=71, bend_rad=(0.5, 0))
    with pytest.raises(UnreachableError) as raised:
        workspace.require(both, CONFIG)
    assert "pushes" not in str(raised.value)
