"""Pressure: what contact gives, and what must not be taken for contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from tests.simulator.conftest import Driver, MakeDriver

from setae.sim import World

THRESHOLD_HPA = 15.0  # the paper's
NOISY = {"sensor.noise_hpa": 0.02, "sensor.drift_hpa_per_sqrt_s": 0.02}
EDGE_MM = 60.0


def target(direction: int) -> tuple[float, float, float]:
    """Targets of the paper's scan of a tube."""
    angle = direction * np.pi / 4
    return (15 * float(np.cos(angle)), 15 * float(np.sin(angle)), 60.0)


def floor_below_tip(gap_mm: float) -> object:
    """A box whose top is below the tip of the hanging, free robot."""

    def setup(world: World) -> None:
        top_mm = -(70.0 + 65.0) - gap_mm
        world.add_box((0.0, 0.0, top_mm - EDGE_MM / 2), (EDGE_MM,) * 3)

    return setup


def lower(driver: Driver, depth_mm: float) -> None:
    driver.world.arm_move((0.0, 0.0, -depth_mm), 20.0, 100.0)
    driver.wait(3.0)


def test_normal_moves_stay_far_below_the_paper_s_threshold(make_driver: MakeDriver) -> None:
    """Measured: 3.2 to 4.9 hPa in moves of 1 s."""
    driver = make_driver(NOISY)
    driver.pull(45.0, duration_s=1.0)
    for direction in range(8):
        rest_hpa = driver.pressures_hpa()[-5:].mean()
        first = len(driver.samples)
        driver.reach(target(direction), duration_s=1.0)
        change_hpa = np.abs(driver.pressures_hpa(first) - rest_hpa).max()
        assert 1.0 < change_hpa < 0.5 * THRESHOLD_HPA
        driver.pull(45.0, duration_s=0.6)


def test_the_arm_s_moves_do_not_look_like_contact(make_driver: MakeDriver) -> None:
    driver = make_driver(NOISY)
    rest_hpa = driver.pressures_hpa().mean()
    first = len(driver.samples)
    driver.world.arm_move((0.0, 0.0, -20.0), 50.0, 200.0)
    driver.wait(1.0)
    assert np.abs(driver.pressures_hpa(first) - rest_hpa).max() < 0.3 * THRESHOLD_HPA


def test_firm_contact_is_far_above_the_threshold(make_driver: MakeDriver) -> None:
    """Measured at 1, 2, 5 and 10 mm: 11, 20, 43 and 62 hPa, a sixth more at once."""
    held = {}
    for depth_mm in (1.0, 2.0, 5.0, 10.0):
        driver = make_driver(setup=floor_below_tip(2.0))
        rest_hpa = driver.pressures_hpa().mean()
        lower(driver, 2.0 + depth_mm)
        assert driver.world.truth().contact_depth_mm == pytest.approx(depth_mm, abs=0.1)
        held[depth_mm] = driver.pressures_hpa()[-1] - rest_hpa
    assert list(held.values()) == sorted(held.values())
    assert held[5.0] > 1.5 * THRESHOLD_HPA
    assert held[1.0] < THRESHOLD_HPA
    assert held[10.0] < 80  # the gel gives way


def test_held_contact_relaxes_and_undershoots_when_released(make_driver: MakeDriver) -> None:
    driver = make_driver({"bristle.relaxation_time_s": 2.0}, setup=floor_below_tip(2.0))
    rest_hpa = driver.pressures_hpa().mean()
    driver.world.arm_move((0.0, 0.0, -7.0), 40.0, 400.0)
    driver.wait(0.6)
    fresh_hpa = driver.pressures_hpa()[-1] - rest_hpa
    driver.wait(6.0)
    held_hpa = driver.pressures_hpa()[-1] - rest_hpa
    assert 0.8 < held_hpa / fresh_hpa < 0.97
    driver.world.arm_move((0.0, 0.0, 0.0), 40.0, 400.0)
    driver.wait(0.6)
    assert driver.pressures_hpa()[-1] - rest_hpa < -1.0
    driver.wait(15.0)
    assert driver.pressures_hpa()[-1] == pytest.approx(rest_hpa, abs=0.05)


def test_a_cube_is_touched_from_the_side_and_says_where(make_driver: MakeDriver) -> None:
    def cube(world: World) -> None:
        world.add_tube((-104.0, 0.0, 0.0), 174.0)
        world.add_box((50.0, 0.0, -130.0), (40.0, 40.0, 80.0))

    driver = make_driver(setup=cube)
    driver.pull(45.0, duration_s=1.0)
    assert driver.world.truth().contact_depth_mm == 0
    assert driver.world.truth().contact_point_mm is None
    truth = driver.reach(target(0))
    assert truth.contact_depth_mm > 5
    assert truth.contact_point_mm is not None
    tip = truth.arm_mm + truth.filament_mm[1] * [1, -1, -1]
    root = truth.arm_mm + truth.filament_mm[0] * [1, -1, -1]
    assert np.linalg.norm(tip - root) == pytest.approx(53.0)
    along = (truth.contact_point_mm - root) @ (tip - root) / 53.0**2
    assert 0 <= along <= 1 + 1e-9
    on_line = root + along * (tip - root)
    assert truth.contact_point_mm == pytest.approx(on_line, abs=1e-9)
    # The face that is touched is 30 mm from the robot's axis.
    assert truth.contact_point_mm[0] - 30 == pytest.approx(truth.contact_depth_mm)
    # In the opposite direction the tube's wall is far away.
    driver.pull(45.0)
    assert driver.reach(target(4)).contact_depth_mm == 0


def test_a_turned_box_is_turned(make_driver: MakeDriver) -> None:
    def setup(world: World) -> None:
        world.add_box((27.0, 0.0, -135.0), (40.0, 40.0, 40.0), np.pi / 4)

    # Its edge reaches over the robot's axis; a box that is not turned would not.
    assert make_driver(setup=setup).world.truth().contact_depth_mm > 0.5


def test_noise_and_drift_are_as_asked(make_driver: MakeDriver) -> None:
    white = make_driver({"sensor.noise_hpa": 0.5})
    white.wait(40.0)
    samples = white.pressures_hpa(50)
    assert samples.std() == pytest.approx(0.5, rel=0.1)
    assert abs(np.corrcoef(samples[:-1], samples[1:])[0, 1]) < 0.1
    drifting = make_driver({"sensor.drift_hpa_per_sqrt_s": 0.5})
    drifting.wait(40.0)
    steps = np.diff(drifting.pressures_hpa(50))
    assert steps.std() == pytest.approx(0.5 / np.sqrt(75), rel=0.1)


def test_a_bristle_with_little_damping_rings_after_a_move(make_driver: MakeDriver) -> None:
    swing_hpa = {}
    for ratio in (0.1, 0.5, 1.5):
        driver = make_driver({"bristle.damping_ratio": ratio})
        driver.pull(60.0, duration_s=0.1, rest_s=0.1)
        first = len(driver.samples)
        driver.wait(0.2)
        swing_hpa[ratio] = np.ptp(driver.pressures_hpa(first))
    assert swing_hpa[0.1] > 3 * swing_hpa[0.5] > 0
    assert swing_hpa[0.1] > 3 * swing_hpa[1.5]


def test_the_air_s_own_pressure_is_in_every_sample(make_driver: MakeDriver) -> None:
    # As on a mountain. What counts is only the change.
    sea_hpa, hill_hpa = (
        make_driver({"sensor.ambient_hpa": ambient_hpa}).pressures_hpa()
        for ambient_hpa in (1013.25, 700.0)
    )
    assert sea_hpa == pytest.approx(1013.25, abs=0.01)
    assert sea_hpa - hill_hpa == pytest.approx(313.25, abs=0.001)


@pytest.mark.parametrize("rate_hz", [25.0, 50.0])
def test_a_sensor_may_sample_at_another_rate(make_driver: MakeDriver, rate_hz: float) -> None:
    driver = make_driver({"sensor.rate_hz": rate_hz})
    driver.wait(4.0)
    times_us = np.array([time for time, _ in driver.samples])
    assert 1e6 / np.diff(times_us).mean() == pytest.approx(rate_hz, rel=0.002)


@pytest.mark.parametrize("rate_error", [-0.03, 0.0, 0.03])
def test_samples_come_at_the_sensor_s_own_rate(make_driver: MakeDriver, rate_error: float) -> None:
    driver = make_driver({"sensor.rate_error": rate_error})
    driver.wait(10.0)
    times = np.array([time for time, _ in driver.samples])
    rate = (len(times) - 1) / (times[-1] - times[0]) * 1e6
    assert rate == pytest.approx(75 * (1 + rate_error), rel=0.002)
