"""What lies between the board's pulses and the tendon's length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from tests.simulator.conftest import Driver, MakeDriver

MM_PER_US = np.pi / 180 * 35 / (2000 / 180)
FREE = 1700  # ticks


def pulse(tendon: int, ticks: int) -> tuple[int, int, int, int]:
    a, b, c, d = (ticks if i == tendon else FREE for i in range(4))
    return (a, b, c, d)


def test_no_faster_than_its_speed_limit(driver: Driver) -> None:
    driver.play([pulse(0, FREE + 1200)], frames_each=1)  # 600 us: 33 mm at once
    start = driver.world.now_us
    lengths, times = [], []
    while driver.world.now_us < start + 60_000:
        driver.wait(0.005)
        lengths.append(driver.world.truth().servo_length_mm[0])
        times.append(driver.world.now_us * 1e-6)
    speed = -np.diff(lengths) / np.diff(times)
    assert speed == pytest.approx(np.full(len(speed), 190.0), rel=0.01)


def test_it_nears_its_end_with_its_time_constant(make_driver: MakeDriver) -> None:
    driver = make_driver({"servo.time_constant_s": 0.1, "servo.dead_band_us": 0.0})
    driver.play([pulse(0, FREE + 40)])
    left_mm = []
    for _ in range(2):
        left_mm.append(driver.world.truth().servo_length_mm[0] - (70.0 - 20 * MM_PER_US))
        driver.wait(0.1)
    assert left_mm[1] / left_mm[0] == pytest.approx(np.exp(-1), rel=0.15)


def test_a_change_inside_the_dead_band_moves_nothing(driver: Driver) -> None:
    driver.play([pulse(1, FREE + 8)])  # 4 us
    driver.wait(0.3)
    assert driver.world.truth().servo_length_mm[1] == 70.0
    driver.play([pulse(1, FREE + 40)])  # 20 us
    driver.wait(0.3)
    left_us = 20 - (70.0 - driver.world.truth().servo_length_mm[1]) / MM_PER_US
    assert left_us == pytest.approx(5.0, abs=0.01)


def test_pulse_in_microseconds_is_wound_tendon(make_driver: MakeDriver) -> None:
    driver = make_driver({"servo.dead_band_us": 0.0})
    driver.play([pulse(2, FREE + 400)], frames_each=20)
    driver.wait(0.3)
    assert driver.world.truth().servo_length_mm[2] == pytest.approx(70 - 200 * MM_PER_US, abs=0.01)


def test_a_servo_built_the_other_way_round_unwinds(make_driver: MakeDriver) -> None:
    driver = make_driver({"servo.direction_0": -1.0, "servo.dead_band_us": 0.0})
    driver.play([pulse(0, FREE - 400)], frames_each=20)
    driver.wait(0.3)
    assert driver.world.truth().servo_length_mm[0] == pytest.approx(70 - 200 * MM_PER_US, abs=0.01)


def test_without_pulses_the_gears_hold(driver: Driver) -> None:
    held = driver.pull(50.0)
    driver.world.reset_board()
    driver.world.run(driver.world.now_us + 100_000)
    left = driver.world.truth()
    assert left.attached == (False, False, False, False)
    assert left.pulse_us == pytest.approx(np.zeros(4))
    assert left.servo_length_mm == pytest.approx(held.servo_length_mm, abs=0.01)
    assert left.backbone_mm[-1] == pytest.approx(held.backbone_mm[-1], abs=0.05)


def test_a_fast_board_clock_makes_short_pulses(make_driver: MakeDriver) -> None:
    """The UNO's resonator may be 0.5 % off, and the servo measures with its own clock."""
    driver = make_driver({"board.clock_rate_ppm": 5000.0, "servo.dead_band_us": 0.0})
    driver.play([pulse(0, FREE + 1000)], frames_each=20)
    driver.wait(0.3)
    expected_us = 1350 / 1.005 - 850
    wound_mm = 70 - driver.world.truth().servo_length_mm[0]
    assert wound_mm == pytest.approx(expected_us * MM_PER_US, abs=0.01)
