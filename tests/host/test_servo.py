"""Lengths and pulses, segments, and the limits that the board gets."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from setae import config, pulley, tendons, workspace
from setae.arc import Arc
from setae.config import TENDON_MODELS, Config
from setae.errors import ConfigError, InputError, TrajectoryError, UnreachableError
from setae.servo import ServoModel, board_limits, segment_messages
from setae_protocol import messages

CONFIG = config.load()
SERVOS = ServoModel(CONFIG)


def changed(section: str, **values: Any) -> Config:
    part = dataclasses.replace(getattr(CONFIG, section), **values)
    return dataclasses.replace(CONFIG, **{section: part})


MIRRORED = changed(
    "servo",
    direction=(1, -1, -1, 1),
    pulse_free_us=(850.0, 2130.0, 2140.0, 860.0),
    us_per_degree=(11.0, 11.5, 10.9, 11.2),
)


@pytest.mark.parametrize("robot", [CONFIG, MIRRORED])
@given(st.lists(st.floats(8, 70), min_size=4, max_size=4))
def test_there_and_back_within_half_a_tick(robot: Config, lengths: list[float]) -> None:
    servos = ServoModel(robot)
    error = np.abs(servos.lengths_mm(servos.ticks(lengths)) - lengths)
    half_tick_mm = 0.25 / pulley.us_per_mm(robot)
    assert (error <= half_tick_mm + 1e-9).all()
    assert half_tick_mm.max() < 0.015


@given(st.lists(st.integers(1700, 4000), min_size=4, max_size=4))
def test_ticks_come_back_exactly(ticks: list[int]) -> None:
    assert SERVOS.ticks(SERVOS.lengths_mm(ticks)).tolist() == ticks


def test_a_microsecond_is_0_055_mm_and_winding_lengthens_the_pulse() -> None:
    pulses = SERVOS.pulses_us([[70.0] * 4, [69.0] * 4])
    np.testing.assert_allclose(pulses[0], 850)
    np.testing.assert_allclose(1 / (pulses[1] - pulses[0]), 0.055, atol=5e-5)


def test_directions_turn_the_pulse() -> None:
    pulses = ServoModel(MIRRORED).pulses_us([60.0] * 4)
    assert (np.sign(pulses - [850, 2130, 2140, 860]) == [1, -1, -1, 1]).all()


def test_shapes() -> None:
    lengths = np.full((3, 5, 4), 50.0)
    assert SERVOS.ticks(lengths).shape == (3, 5, 4)
    with pytest.raises(InputError, match=r"lengths_mm has shape \(3,\)"):
        SERVOS.ticks([50, 50, 50])
    with pytest.raises(InputError, match=r"lengths_mm\[1\] is nan"):
        SERVOS.ticks([50, math.nan, 50, 50])


def test_end_stops_name_the_servo_and_the_length() -> None:
    with pytest.raises(UnreachableError) as raised:
        SERVOS.ticks([70, 70, 75, 70])
    assert str(raised.value) == (
        "Servo 2 can't give a tendon of 75.00 mm: it would need a pulse of 759 µs, and its travel "
        "is 830 to 2150 µs. Keep tendon 2 from -1.47 to 71.10 mm."
    )
    with pytest.raises(UnreachableError, match=r"Servo 1 .*\(lengths_mm\[3, 1\]\)"):
        SERVOS.ticks(np.where(np.arange(20).reshape(5, 4) == 13, 80.0, 60.0))


def test_segments_reach_every_length_in_its_frame() -> None:
    lengths = np.linspace([70.0] * 4, [60.0, 65, 70, 68], 23)
    segments = SERVOS.segments(lengths, max_frames=1)
    assert [segment.duration_frames for segment in segments] == [1] * 23
    assert [list(segment.target_ticks) for segment in segments] == SERVOS.ticks(lengths).tolist()


def test_fewer_segments_end_at_the_same_place_and_time() -> None:
    lengths = np.linspace([70.0] * 4, [60.0, 65, 70, 68], 24)
    segments = SERVOS.segments(lengths[1:], start_ticks=SERVOS.ticks(lengths[0]))
    assert [segment.duration_frames for segment in segments] == [23]
    assert list(segments[-1].target_ticks) == SERVOS.ticks(lengths[-1]).tolist()


def test_segments_refuse_nothing_and_nonsense() -> None:
    with pytest.raises(InputError, match=r"n_frames ≥ 1"):
        SERVOS.segments(np.zeros((0, 4)))
    with pytest.raises(InputError, match="max_frames is 0"):
        SERVOS.segments([[70.0] * 4], max_frames=0)
    with pytest.raises(InputError, match=r"tolerance is -0\.\d+ ticks"):
        SERVOS.segments([[70.0] * 4], tolerance_um=-1)
    with pytest.raises(TrajectoryError, match="slew limit"):
        SERVOS.segments([[70.0] * 4, [50.0] * 4])


def test_messages_hold_all_segments_in_order_and_can_be_packed() -> None:
    segments = SERVOS.segments(np.linspace([70.0] * 4, [60.0] * 4, 13), max_frames=1)
    packed = segment_messages(segments, epoch=7)
    assert [message.count for message in packed] == [5, 5, 3]
    assert tuple(s for message in packed for s in message.segments[: message.count]) == segments
    for message in packed:
        assert message.epoch == 7
        assert messages.Segments.unpack(message.pack()) == message
    small = segment_messages(segments, epoch=7, max_frames=3)
    assert [message.count for message in small] == [3, 3, 3, 3, 1]


# ------------------------------------------------------------------------- limits


def breaks(limits: messages.SetLimits, ticks: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Which poses the board would refuse; the inequalities of the protocol."""
    bad = (ticks < np.array(limits.pulse_min_ticks)) | (ticks > np.array(limits.pulse_max_ticks))
    result = np.asarray(bad.any(axis=-1))
    for pair, (a, b) in enumerate(((0, 2), (1, 3))):
        total, difference = ticks[..., a] + ticks[..., b], ticks[..., a] - ticks[..., b]
        result = result | (total < limits.pair_sum_min_ticks[pair])
        result = result | (total > limits.pair_sum_max_ticks[pair])
        result = result | (difference < limits.pair_difference_min_ticks[pair])
        result = result | (difference > limits.pair_difference_max_ticks[pair])
    return result


@pytest.mark.parametrize("robot", [CONFIG, MIRRORED])
@pytest.mark.parametrize("model", TENDON_MODELS)
def test_the_board_accepts_every_reachable_target(robot: Config, model: str) -> None:
    random = np.random.default_rng(5)
    theta = random.uniform(0, math.pi / 2, 20_000)
    theta[:4000] = math.pi / 2
    length = random.uniform(20, 70, theta.shape)
    length[2000:6000] = 20
    alpha = random.uniform(-math.pi, math.pi, theta.shape)
    alpha[::3] = np.round(alpha[::3] / (math.pi / 2)) * math.pi / 2
    reach = workspace.check(
        Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha), robot, model
    )
    assert reach.reachable.mean() > 0.5
    ticks = ServoModel(robot).ticks(reach.lengths_mm[reach.reachable])
    assert not breaks(board_limits(robot), ticks).any()


@pytest.mark.parametrize("robot", [CONFIG, MIRRORED])
def test_the_board_refuses_to_crush_or_over_bend_the_spring(robot: Config) -> None:
    servos, limits = ServoModel(robot), board_limits(robot)
    # Each servo is within its travel here; only the pairs tell.
    crushed = [(12.0, 12.0, 12.0, 12.0), (16.0, 40.0, 16.0, 40.0), (40.0, 15.0, 40.0, 15.0)]
    bent = [
        tendons.lengths(Arc(length_mm=45, bend_rad=bend), robot.geometry, "parallel")
        for bend in ((2.9, 0), (0, -2.9), (1.8, 0))
    ]
    ticks = servos.ticks(np.array([*crushed, *bent]))
    assert (ticks >= np.array(limits.pulse_min_ticks)).all()
    assert (ticks <= np.array(limits.pulse_max_ticks)).all()
    assert breaks(limits, ticks).all()


def test_the_board_accepts_slack_at_the_servos_ends() -> None:
    slack = np.array(CONFIG.servo.pulse_min_us) * messages.PULSE_TICKS_PER_US
    assert not breaks(board_limits(CONFIG), slack)
    assert not breaks(board_limits(CONFIG), SERVOS.free_ticks())


@pytest.mark.parametrize("robot", [CONFIG, MIRRORED])
def test_limits_fit_the_message_and_the_compiled_in_bounds(robot: Config) -> None:
    limits = board_limits(robot)
    assert messages.SetLimits.unpack(limits.pack()) == limits
    assert min(limits.pulse_min_ticks) >= messages.PULSE_TICKS_ABSOLUTE_MIN
    assert max(limits.pulse_max_ticks) <= messages.PULSE_TICKS_ABSOLUTE_MAX
    assert (np.array(limits.pulse_min_ticks) < limits.pulse_max_ticks).all()


def test_limits_carry_slew_threshold_and_timeout() -> None:
    limits = board_limits(changed("motion", hold_timeout_s=90))
    ticks_per_mm = 2 * float(pulley.us_per_mm(CONFIG)[0])
    assert limits.slew_ticks == math.floor(160 * 0.02 * ticks_per_mm)
    assert limits.coarse_threshold_raw == 60 * 4096
    assert limits.hold_timeout_s == 90


def test_speeds_in_ticks_never_exceed_the_slew_limit() -> None:
    assert SERVOS.speed_ticks(1e6) == SERVOS.slew_ticks
    assert SERVOS.speed_ticks(1e-6) == 1
    assert (SERVOS.max_speed_mm_s < 160).all()


def test_tendons_that_are_not_opposite_get_no_limits() -> None:
    skewed = changed("geometry", tendon_angles_rad=(0.0, 1.6, 2.0, 4.7))
    with pytest.raises(ConfigError, match="tendons 0 and 2 are not opposite"):
        board_limits(skewed)


def test_a_slew_limit_below_the_resolution_is_refused() -> None:
    slow = changed(
        "motion", slew_mm_s=1.0, move_speed_mm_s=0.5, retract_speed_mm_s=0.5, relax_speed_mm_s=0.5
    )
    with pytest.raises(ConfigError, match="less than two pulse ticks"):
        ServoModel(slow)


# --------------------------------------------------------------- a pulley that grows

GROWING = changed("servo", growth_mm_per_turn=(1.5, 0.0, 3.0, 0.7))
GROWING_MIRRORED = changed(
    "servo",
    growth_mm_per_turn=(1.5, 0.0, 3.0, 0.7),
    direction=(1, -1, -1, 1),
    pulse_free_us=(850.0, 2130.0, 2140.0, 860.0),
)


@pytest.mark.parametrize("robot", [GROWING, GROWING_MIRRORED])
@given(st.lists(st.floats(8, 70), min_size=4, max_size=4))
def test_a_growing_pulley_comes_back_within_half_a_tick(
    robot: Config, lengths: list[float]
) -> None:
    servos = ServoModel(robot)
    error = np.abs(servos.lengths_mm(servos.ticks(lengths)) - lengths)
    assert (error <= servos.resolution_mm / 2 + 1e-9).all()
    exact = servos.lengths_from_us(servos.pulses_us(lengths))
    np.testing.assert_allclose(exact, lengths, atol=1e-9)


def test_a_growing_pulley_winds_more_with_every_turn() -> None:
    # A spiral: from R to R + g in a turn, so a turn winds 2π (R + g/2).
    wound = pulley.wound_mm(np.full(4, 2 * math.pi), GROWING)
    np.testing.assert_allclose(wound, 2 * math.pi * (35 + np.array([1.5, 0, 3.0, 0.7]) / 2))
    np.testing.assert_allclose(pulley.angle_rad(wound, GROWING), 2 * math.pi, rtol=1e-12)
    np.testing.assert_allclose(pulley.radius_mm(wound, GROWING), 35 + np.array([1.5, 0, 3.0, 0.7]))
    shorter = ServoModel(GROWING).pulses_us([30.0] * 4)
    assert shorter[1] == SERVOS.pulses_us([30.0] * 4)[1]
    # 40 mm of tendon: 1.14 rad, on which the radius grows by 0.54 mm, half of that on average.
    assert shorter[1] - shorter[2] == pytest.approx(5.5, abs=0.3)


def test_without_growth_the_pulses_are_linear() -> None:
    lengths = np.linspace([70.0] * 4, [10.0] * 4, 61)
    expected = 850 + (70 - lengths) * 180 / math.pi / 35 * (2000 / 180)
    np.testing.assert_allclose(SERVOS.pulses_us(lengths), expected, atol=1e-9)


def test_a_tick_is_0_0275_mm_and_more_where_the_pulley_has_grown() -> None:
    np.testing.assert_allclose(SERVOS.resolution_mm, 0.02749, atol=5e-6)
    servos = ServoModel(GROWING)
    grown = servos.resolution_mm / SERVOS.resolution_mm
    assert grown[1] == 1
    assert 1.01 < grown[2] < 1.05
    # Over the whole travel a tick never winds more.
    ticks = np.arange(1660, 4300)[:, np.newaxis] + np.zeros(4, dtype=int)
    steps = -np.diff(servos.lengths_mm(ticks), axis=0)
    assert (steps <= servos.resolution_mm + 1e-12).all()
    np.testing.assert_allclose(steps.max(axis=0), servos.resolution_mm, rtol=1e-4)


@pytest.mark.parametrize("robot", [GROWING, GROWING_MIRRORED])
def test_the_boards_limits_are_right_for_growing_pulleys(robot: Config) -> None:
    servos, limits = ServoModel(robot), board_limits(robot)
    random = np.random.default_rng(8)
    arc = Arc.from_angles(
        length_mm=random.uniform(20, 70, 20_000),
        theta_rad=random.uniform(0, math.pi / 2, 20_000),
        alpha_rad=random.uniform(-math.pi, math.pi, 20_000),
    )
    for model in TENDON_MODELS:
        lengths = workspace.reachable_lengths_mm(arc, robot, model)
        assert not breaks(limits, servos.ticks(lengths)).any()
    crushed = servos.ticks([(12.0, 12.0, 12.0, 12.0), (16.0, 40.0, 16.0, 40.0)])
    bent = servos.ticks(
        tendons.lengths(
            Arc(length_mm=45, bend_rad=[(2.9, 0), (0, -2.9)]), robot.geometry, "parallel"
        )
    )
    assert breaks(limits, np.concatenate([crushed, bent])).all()
    slack = np.array(robot.servo.pulse_min_us if robot is GROWING else [830, 2150, 2150, 830])
    assert not breaks(limits, (slack * 2).astype(int))


def test_the_fastest_motion_keeps_the_slew_limit_on_grown_pulleys() -> None:
    servos = ServoModel(GROWING)
    ends = np.array([70.0, 70, 20, 40]), np.array([20.0, 30, 70, 70])
    lengths = np.linspace(*ends, 30)
    step_s = np.abs(np.diff(lengths, axis=0)).max(axis=0) / servos.max_speed_mm_s
    lengths = np.linspace(*ends, math.ceil(30 * float(step_s.max()) / 0.02) + 1)
    assert np.abs(np.diff(servos.ticks(lengths), axis=0)).max() <= servos.slew_ticks
