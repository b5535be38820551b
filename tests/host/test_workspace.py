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
        servo=dataclasses.replace(
            CONFIG.servo, pulse_max_us=(1500.0,) * 4, stall_torque_n_m=0.1, torque_part=0.35
        ),
    )
    reach = workspace.check(Arc(length_mm=30, bend_rad=(0.5, 0)), weak)
    assert Reason(int(reach.reasons)) == Reason.TENDON_TOO_SHORT | Reason.TOO_TENSE
    short, tense = reach.explain()
    assert "Tendon 0 would be 25.85 mm long, and its servo can wind it to 34.26 mm" in short
    assert "Tendon 0 would need 2." in tense
    assert "and its servo holds 1.0 N for long" in tense


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


# ------------------------------------------------------------------------- nearest


def test_the_nearest_pose_that_can_be_held_is_nearer_than_any_other_found() -> None:
    random = np.random.default_rng(11)
    targets = paper_targets(0.3)
    reach = workspace.check(targets, CONFIG, "parallel")
    lost = targets[reach.reachable & ~reach.holdable]
    assert lost.shape[0] > 3
    nearest = workspace.nearest_holdable(lost, CONFIG, "parallel")
    found = workspace.check(nearest, CONFIG, "parallel")
    assert (found.reachable & found.holdable).all()
    away = np.linalg.norm(nearest.top_mm - lost.top_mm, axis=-1)
    assert (away > 0.01).all()
    # Thousands of poses around: none that can be held is nearer by more than rounding.
    for i in range(lost.shape[0]):
        around = Arc(
            length_mm=nearest.length_mm[i] + random.normal(0, 1.0, 20_000),
            bend_rad=nearest.bend_rad[i] + random.normal(0, 0.03, (20_000, 2)),
        )
        other = workspace.check(around, CONFIG, "parallel")
        held = other.reachable & other.holdable
        assert held.any()
        distance = np.linalg.norm(around.top_mm[held] - lost.top_mm[i], axis=-1)
        assert distance.min() >= away[i] - 1e-6


@pytest.mark.parametrize("model", ["paper", "parallel"])
def test_anything_has_a_nearest_pose_and_what_can_be_held_is_its_own(model: str) -> None:
    random = np.random.default_rng(4)
    arc = Arc.from_angles(
        length_mm=random.uniform(10, 95, (7, 3)),
        theta_rad=random.uniform(0, 2.5, (7, 3)),
        alpha_rad=random.uniform(-math.pi, math.pi, (7, 3)),
    )
    nearest = workspace.nearest_holdable(arc, CONFIG, model)
    assert nearest.shape == (7, 3)
    found = workspace.check(nearest, CONFIG, model)
    assert (found.reachable & found.holdable).all()
    before = workspace.check(arc, CONFIG, model)
    kept = before.reachable & before.holdable
    np.testing.assert_array_equal(nearest.top_mm[kept], arc.top_mm[kept])
    single = workspace.nearest_holdable(arc[3, 2], CONFIG, model)
    assert single.shape == ()
    np.testing.assert_allclose(single.top_mm, nearest.top_mm[3, 2], atol=1e-6)


def test_a_robot_that_can_hold_nothing_says_so() -> None:
    weak = dataclasses.replace(
        CONFIG,
        servo=dataclasses.replace(CONFIG.servo, stall_torque_n_m=0.35, min_tension_n=2.9),
        spring=dataclasses.replace(CONFIG.spring, axial_rate_n_per_mm=0.01),
    )
    with pytest.raises(UnreachableError, match="No straight pose can be held"):
        workspace.nearest_holdable(Arc(length_mm=60, bend_rad=(0.5, 0)), weak)
