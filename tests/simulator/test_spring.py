"""The spring alone: between any number of tendons, and where it can rest in several ways."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest

from setae.errors import InputError
from setae.sim import Rest, SimulationError, Spring, plants
from setae.sim.spring import Start

if TYPE_CHECKING:
    from tests.simulator.conftest import MakeDriver

Array = npt.NDArray[np.float64]

WEIGHTLESS = {"plant.gravity_m_s2": 0.0}
#: One and a half times as long, as stiff for its length: a compressed spring that buckles.
LONG = {
    **WEIGHTLESS,
    "spring.free_length_mm": 100.0,
    "spring.solid_length_mm": 20.0,
    "spring.axial_rate_n_per_mm": 0.154,
}
EVERY = 60.0


def around(tendons: int) -> list[float]:
    return [360.0 * i / tendons for i in range(tendons)]


def arc_lengths_mm(tendons: int, length_mm: float, bend_mm: float, towards_deg: float) -> Array:
    angles = np.radians(np.array(around(tendons)) - towards_deg)
    return np.asarray(length_mm - bend_mm * np.cos(angles))


@pytest.mark.parametrize("tendons", [3, 4, 6, 8])
def test_equal_tendons_compress_it_straight_and_share_the_load(tendons: int) -> None:
    rest = Spring(around(tendons), WEIGHTLESS).rest([50.0] * tendons)
    assert rest.top_mm[:2] == pytest.approx([0, 0], abs=1e-6)
    assert rest.tension_n == pytest.approx(rest.tension_n[0], abs=1e-6)
    # 20 mm less what the tendons give, at 0.22 N/mm.
    assert rest.tension_n.sum() == pytest.approx(0.22 * (70 - rest.top_mm[2]), rel=1e-5)
    assert rest.stable


@pytest.mark.parametrize("tendons", [3, 6])
def test_turning_the_pulls_by_one_tendon_turns_the_pose(tendons: int) -> None:
    spring = Spring(around(tendons), WEIGHTLESS)
    first = spring.rest(arc_lengths_mm(tendons, 50, 6, 0))
    step = 360.0 / tendons
    for i in range(1, tendons):
        turned = spring.rest(arc_lengths_mm(tendons, 50, 6, i * step))
        c, s = np.cos(np.radians(i * step)), np.sin(np.radians(i * step))
        back = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ turned.top_mm
        assert back == pytest.approx(first.top_mm, abs=1e-3)
        assert np.roll(turned.tension_n, -i) == pytest.approx(first.tension_n, abs=1e-4)


def test_six_tendons_hold_it_as_three_of_them_do_where_the_others_are_slack() -> None:
    lengths_mm = arc_lengths_mm(6, 50, 4, 0)
    loose = lengths_mm.copy()
    loose[1::2] = 200.0
    six = Spring(around(6), WEIGHTLESS).rest(loose)
    three = Spring(around(3), WEIGHTLESS).rest(lengths_mm[::2])
    assert six.top_mm == pytest.approx(three.top_mm, abs=1e-4)
    assert six.tension_n[1::2] == pytest.approx(0)


def test_more_tendons_are_stiffer_against_a_load() -> None:
    pushed = {**WEIGHTLESS, "plant.load_x_n": 0.2, "tendon.stiffness_n_per_mm": 1.0}
    moved_mm = [Spring(around(n), pushed).rest([45.0] * n).top_mm[0] for n in (3, 6)]
    assert moved_mm[1] < moved_mm[0]


@pytest.mark.parametrize("angles_deg", [[0, 180], list(range(0, 360, 40)), [0, 90, np.nan]])
def test_other_numbers_of_tendons_are_refused(angles_deg: list[float]) -> None:
    with pytest.raises(InputError, match="tendon"):
        Spring(angles_deg)


def test_a_length_for_each_tendon() -> None:
    spring = Spring(around(3))
    with pytest.raises(InputError, match="4 lengths for 3"):
        spring.rest([50, 50, 50, 50])
    with pytest.raises(InputError, match="positive"):
        spring.rest([50, -1, 50])


def test_a_spring_that_buckles_rests_in_several_ways_and_tells_each() -> None:
    """Straight, and bent aside, at the same tendon lengths."""
    spring = Spring(parameters=LONG)
    lengths_mm = [60.0] * 4
    rests = spring.rests(lengths_mm)
    assert len(rests) > 1
    assert all(rest.stable and rest.residual < 1e-4 for rest in rests)
    assert [rest.energy_n_mm for rest in rests] == sorted(rest.energy_n_mm for rest in rests)
    straight = [rest for rest in rests if np.hypot(*rest.top_mm[:2]) < 0.1]
    aside = [rest for rest in rests if np.hypot(*rest.top_mm[:2]) > 10]
    assert len(straight) == 1
    assert len(aside) == len(rests) - 1
    # The robot is symmetric: what bends to one side bends to the other.
    for rest in aside:
        assert any(
            other.top_mm == pytest.approx(rest.top_mm * [-1, -1, 1], abs=0.05) for other in aside
        )
    # Each is a rest that it stays in: let go of near it, it comes back.
    again = spring.rest(lengths_mm)
    assert again.same_as(straight[0])


def test_a_start_with_a_tendon_all_around_the_bore_settles() -> None:
    """A tendon's path that had not settled at the start was kept, and the spring never moved."""
    rests = Spring(parameters=plants.parameters("paper_like")).rests((31.3, 62.9, 31.5, 55.3))
    assert len(rests) == 2
    assert rests.unsettled == ()


def test_where_it_was_before_says_where_it_rests() -> None:
    spring = Spring(parameters=LONG)
    left = spring.rest([60.0] * 4, bend_deg=(EVERY, EVERY))
    right = spring.rest([60.0] * 4, bend_deg=(-EVERY, -EVERY))
    assert left.stable
    assert right.stable
    assert not left.same_as(right)
    assert left.energy_n_mm == pytest.approx(right.energy_n_mm, rel=1e-4)


@pytest.mark.parametrize("lengths_mm", [(50.0,) * 4, (25.0,) * 4, (40.0, 52.0, 64.0, 52.0)])
def test_the_robot_rests_in_one_way_where_no_tendon_is_slack(lengths_mm: tuple[float, ...]) -> None:
    assert len(Spring().rests(lengths_mm)) == 1


def test_the_robot_with_two_slack_tendons_rests_where_it_came_from(make_driver: MakeDriver) -> None:
    """Two opposite tendons pull it down between two long ones: it gives way to either side.

    Pulled there from either side it stays there, and each is one of the two that a search finds.
    """
    lengths_mm = (63.0, 34.0, 63.0, 34.0)
    rests = Spring().rests(lengths_mm)
    assert len(rests) == 2
    assert rests[0].top_mm == pytest.approx(rests[1].top_mm * [-1, -1, 1], abs=0.02)
    for before in ((40.0, 48.0, 70.0, 48.0), (70.0, 48.0, 40.0, 48.0)):
        driver = make_driver()
        first = driver.pull(before)
        truth = driver.pull(lengths_mm, rest_s=1.0)
        assert truth.plant_residual < 1e-4
        assert np.sign(truth.backbone_mm[-1][0]) == np.sign(first.backbone_mm[-1][0])
        # The servos' dead band leaves other lengths than were sent.
        there = Spring().rests(truth.servo_length_mm)
        assert min(np.linalg.norm(truth.backbone_mm[-1] - rest.top_mm) for rest in there) < 0.05


@pytest.mark.parametrize(("residual", "stable"), [(1.0, True), (0.0, False)])
def test_a_start_without_a_rest_leaves_the_others_and_is_named(
    monkeypatch: pytest.MonkeyPatch, residual: float, stable: bool
) -> None:
    """One of 21 that did not settle raised, and the rests that the others found were lost.

    One that ended where the energy falls was left out in silence, as the straight one does here:
    between the two ways to give way.
    """
    lost = Start(bend_deg=(60.0, 60.0))
    rest = Spring._rest

    def failing(spring: Spring, lengths_mm: Sequence[float] | Array, start: Start) -> Rest:
        found = rest(spring, lengths_mm, start)
        if start != lost:
            return found
        return dataclasses.replace(found, residual=residual, stable=stable)

    monkeypatch.setattr(Spring, "_rest", failing)
    rests = Spring().rests([63.0, 34.0, 63.0, 34.0])
    assert len(rests) == 2
    assert rests.unsettled == (Start(), lost)
    if residual:
        with pytest.raises(SimulationError, match="no rest"):
            Spring().rest([63.0, 34.0, 63.0, 34.0], bend_deg=lost.bend_deg)


def test_a_hopeless_start_is_numbers_still() -> None:
    """Crushed beyond its coils it had no way to fall, and was pushed to NaN, for 3,000 steps."""
    spring = Spring(parameters=plants.parameters("paper_like"))
    lengths_mm = [40.22759199107641, 29.925652225462766, 24.537652280956095, 49.01661929934254]
    for start in [Start((x, y), (y / 4, -x / 4)) for x in (-60, 60) for y in (-60, 60)]:
        rest = spring._rest(lengths_mm, start)
        assert np.isfinite([rest.residual, *rest.top_mm]).all()
