"""Planned motions against Ruckig, which finds the shortest time within the same limits."""

from __future__ import annotations

import numpy as np
import pytest
import ruckig
from hypothesis import given, settings
from hypothesis import strategies as st

from setae import trajectory
from setae.trajectory import Limits
from setae.trajectory.plan import FRAME_S

TENDONS = 4


def optimum(
    start: np.ndarray, end: np.ndarray, speed: float, acceleration: float, jerk: float
) -> ruckig.Trajectory:
    """The fastest motion from rest to rest in a straight line, all tendons in phase."""
    asked = ruckig.InputParameter(TENDONS)
    asked.current_position, asked.target_position = start.tolist(), end.tolist()
    asked.max_velocity = [speed] * TENDONS
    asked.max_acceleration = [acceleration] * TENDONS
    asked.max_jerk = [jerk] * TENDONS
    asked.synchronization = ruckig.Synchronization.Phase
    found = ruckig.Trajectory(TENDONS)
    assert ruckig.Ruckig(TENDONS).calculate(asked, found) == ruckig.Result.Working
    return found


lengths = st.lists(st.floats(20, 70), min_size=TENDONS, max_size=TENDONS).map(np.array)


@settings(max_examples=60, deadline=None)
@given(lengths, lengths, st.floats(20, 160), st.floats(500, 5000), st.floats(2e4, 2e5))
def test_no_line_is_faster_than_the_optimum_or_takes_twice_as_long(
    start: np.ndarray, end: np.ndarray, speed: float, acceleration: float, jerk: float
) -> None:
    limits = Limits(speed_mm_s=speed, acceleration_mm_s2=acceleration, jerk_mm_s3=jerk)
    ours = trajectory.line(start, end, limits=limits)
    best_s = optimum(start, end, speed, acceleration, jerk).duration
    # A motion that is faster than possible would break a limit.
    assert ours.duration_s >= best_s - 1e-9
    # Speed costs a quintic most: its peak is 1.875 times its mean.
    assert ours.duration_s <= trajectory.PEAK * best_s + FRAME_S
    assert (ours.peaks <= limits.table(TENDONS) * (1 + 1e-9)).all()


@pytest.mark.parametrize("way_mm", [0.5, 5.0, 20.0])
def test_where_jerk_rules_a_quintic_takes_a_quarter_longer(way_mm: float) -> None:
    start, end = np.full(TENDONS, 70.0), np.full(TENDONS, 70.0 - way_mm)
    best_s = optimum(start, end, 1e6, 1e6, 1000.0).duration
    assert best_s == pytest.approx((32 * way_mm / 1000) ** (1 / 3), rel=1e-6)
    ours = trajectory.line(start, end, limits=Limits(speed_mm_s=1e6, jerk_mm_s3=1000.0))
    # (60 / 32)^(1/3): a quintic's jerk is 60 ways over the duration cubed.
    assert ours.duration_s == pytest.approx(1.2331 * best_s, abs=FRAME_S)


def test_constant_speed_comes_close_to_the_optimum_on_a_long_way() -> None:
    start, end = np.full(TENDONS, 70.0), np.full(TENDONS, 25.0)
    speed, acceleration, jerk = 30.0, 1000.0, 50_000.0
    best_s = optimum(start, end, speed, acceleration, jerk).duration
    import setae
    from setae.arc import Arc

    ours = trajectory.bend(
        Arc(length_mm=70, bend_rad=(0, 0)),
        Arc(length_mm=25, bend_rad=(0, 0)),
        setae.Geometry(),
        "parallel",
        limits=Limits(speed_mm_s=speed, acceleration_mm_s2=acceleration, jerk_mm_s3=jerk),
        speed_mm_s=speed,
    )
    assert best_s <= ours.duration_s <= best_s + 3 * FRAME_S


def test_tendons_follow_the_same_straight_line_as_the_optimum() -> None:
    start, end = np.array([70.0, 65, 60, 70]), np.array([40.0, 60, 70, 69])
    best = optimum(start, end, 60.0, 2000.0, 50_000.0)
    ours = trajectory.line(start, end, limits=Limits(speed_mm_s=60.0))
    for time_s in np.linspace(0, best.duration, 30):
        there = np.array(best.at_time(float(time_s))[0])
        part = (there[0] - start[0]) / (end[0] - start[0])
        np.testing.assert_allclose(there, start + part * (end - start), atol=1e-9)
    part = (ours.lengths_mm[:, :1] - start[0]) / (end[0] - start[0])
    np.testing.assert_allclose(ours.lengths_mm, start + part * (end - start), atol=1e-9)
