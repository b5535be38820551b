"""Motions: where they end, how fast they go, that all tendons move as one, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from setae import config, kinematics, tendons, trajectory
from setae.arc import Arc
from setae.errors import InputError, TrajectoryError
from setae.servo import ServoModel
from setae.trajectory import Limits
from setae_protocol import messages

CONFIG = config.load()
GEOMETRY = CONFIG.geometry
SERVOS = ServoModel(CONFIG)
FRAME_S = messages.SERVO_FRAME_US * 1e-6

tendon_lengths = st.lists(st.floats(10, 70), min_size=4, max_size=4).map(np.array)


@settings(max_examples=60)
@given(tendon_lengths, tendon_lengths, st.floats(0.02, 3), st.floats(5, 150))
def test_a_line_ends_exactly_keeps_its_speed_and_moves_all_tendons_as_one(
    start: np.ndarray, end: np.ndarray, duration_s: float, speed: float
) -> None:
    motion = trajectory.line(
        start, end, duration_s=duration_s, limits=Limits(speed_mm_s=speed), too_fast="stretch"
    )
    assert motion.lengths_mm[-1].tolist() == end.tolist()
    assert motion.start_mm.tolist() == start.tolist()
    assert motion.duration_s >= duration_s - 1e-6
    assert motion.duration_s == pytest.approx(motion.frames * FRAME_S)
    assert motion.speed_mm_s.max() <= speed * (1 + 1e-9)
    # One phase for all tendons, and it never goes back.
    expected = start + motion.phase[:, None] * (end - start)
    np.testing.assert_allclose(motion.lengths_mm, expected, atol=1e-9)
    assert (np.diff(motion.phase, prepend=0.0) >= 0).all()
    assert motion.phase[-1] == 1.0
    path = np.concatenate([start[None], motion.lengths_mm])
    assert (np.diff(path, axis=0) * np.sign(end - start) >= -1e-12).all()


def test_without_a_duration_a_line_takes_the_shortest() -> None:
    motion = trajectory.line([70.0] * 4, [50, 60, 70, 65], limits=Limits(speed_mm_s=60))
    assert motion.speed_mm_s.max() <= 60
    with pytest.raises(TrajectoryError):
        trajectory.line(
            [70.0] * 4,
            [50, 60, 70, 65],
            limits=Limits(speed_mm_s=60),
            duration_s=motion.duration_s - 2 * FRAME_S,
        )


def test_a_motion_starts_and_ends_at_rest_without_a_jerk() -> None:
    motion = trajectory.line([70.0] * 4, [50.0] * 4, duration_s=2.0, limits=Limits(speed_mm_s=60))
    speed = motion.speed_mm_s[:, 0]
    assert speed.max() == pytest.approx(trajectory.PEAK * 10, rel=1e-3)
    assert speed[0] < 0.01
    assert speed[-1] < 0.01
    acceleration = np.diff(speed, prepend=0.0, append=0.0) / FRAME_S
    # Peak of the quintic's acceleration: 5.77 times distance over duration squared.
    assert np.abs(acceleration).max() <= 5.78 * 20 / 2.0**2
    np.testing.assert_allclose(speed, speed[::-1], atol=1e-9)


def test_too_fast_names_the_tendon_and_the_time_it_takes() -> None:
    with pytest.raises(TrajectoryError) as raised:
        trajectory.line([70.0] * 4, [70, 70, 50, 70], duration_s=0.2, limits=Limits(speed_mm_s=60))
    assert "Tendon 2 would move at 187.5 mm/s" in str(raised.value)
    assert "at most 60.0 mm/s" in str(raised.value)
    assert "Give the motion 0.64 s or more" in str(raised.value)
    stretched = trajectory.line(
        [70.0] * 4,
        [70, 70, 50, 70],
        duration_s=0.2,
        limits=Limits(speed_mm_s=60),
        too_fast="stretch",
    )
    assert stretched.duration_s == pytest.approx(0.64)
    slower = trajectory.line(
        [70.0] * 4, [70, 70, 50, 70], duration_s=0.64, limits=Limits(speed_mm_s=60)
    )
    assert slower.frames == 32


def test_each_tendon_has_its_own_speed_limit() -> None:
    limit = np.array([100.0, 100, 10, 100])
    motion = trajectory.line([70.0] * 4, [60.0] * 4, limits=Limits(speed_mm_s=limit))
    assert (motion.speed_mm_s <= limit + 1e-6).all()
    assert motion.speed_mm_s[:, 2].max() > 9.5


def test_the_fastest_motion_stays_within_the_boards_slew_limit_after_rounding() -> None:
    random = np.random.default_rng(7)
    for _ in range(50):
        start, end = random.uniform(10, 70, (2, 4))
        motion = trajectory.line(start, end, limits=Limits(speed_mm_s=SERVOS.max_speed_mm_s))
        ticks = SERVOS.ticks(np.concatenate([start[None], motion.lengths_mm]))
        assert np.abs(np.diff(ticks, axis=0)).max() <= SERVOS.slew_ticks


def test_a_motion_becomes_one_segment_a_frame() -> None:
    motion = trajectory.line([70.0] * 4, [60.0] * 4, duration_s=1.0, limits=Limits(speed_mm_s=60))
    segments = SERVOS.segments(motion.lengths_mm, max_frames=1)
    assert len(segments) == 50
    assert list(segments[-1].target_ticks) == SERVOS.ticks([60.0] * 4).tolist()


def test_a_rest_is_a_motion_too() -> None:
    motion = trajectory.hold([60.0, 61, 62, 63], duration_s=0.1)
    assert motion.lengths_mm.tolist() == [[60.0, 61, 62, 63]] * 5
    assert trajectory.line([60.0] * 4, [60.0] * 4, limits=Limits(speed_mm_s=60)).frames == 1


# --------------------------------------------------------------------------- bends


def arc(x: float, y: float, z: float) -> Arc:
    return kinematics.inverse((x, y, z))


def test_a_bend_follows_the_arcs_in_between() -> None:
    start, end = arc(0, 0, 50), arc(12, 7, 58)
    motion = trajectory.bend(
        start, end, GEOMETRY, "parallel", duration_s=1.0, limits=Limits(speed_mm_s=60)
    )
    expected = tendons.lengths(trajectory.between(start, end, motion.phase), GEOMETRY, "parallel")
    np.testing.assert_allclose(motion.lengths_mm, expected, atol=1e-12)
    np.testing.assert_array_equal(motion.lengths_mm[-1], tendons.lengths(end, GEOMETRY, "parallel"))


@pytest.mark.parametrize(("x", "y"), [(15, 0), (0, -15), (10, 10)])
def test_the_paper_rule_may_bend_from_straight_to_any_direction(x: float, y: float) -> None:
    for start, end in ((arc(0, 0, 45), arc(x, y, 60)), (arc(x, y, 60), arc(0, 0, 45))):
        motion = trajectory.bend(start, end, GEOMETRY, "paper", limits=Limits(speed_mm_s=60))
        assert np.abs(np.diff(motion.lengths_mm, axis=0)).max() <= 60 * FRAME_S + 1e-9


def test_the_paper_rule_may_bend_through_the_straight_pose() -> None:
    jump, _, _ = trajectory.largest_jump_mm(arc(15, 0, 60), arc(-15, 0, 60), GEOMETRY, "paper")
    assert jump < 1e-6
    assert trajectory.bend(
        arc(15, 0, 60), arc(-15, 0, 60), GEOMETRY, "paper", limits=Limits(speed_mm_s=60)
    ).frames


@pytest.mark.parametrize(
    ("start", "end", "jump_mm", "place"),
    [
        # Leaving the boundary, reaching it, and crossing it.
        ((15, 0, 60), (12, 9, 60), 0.76, "0%"),
        ((12, 9, 60), (15, 0, 60), 0.76, "100%"),
        ((15, 3, 60), (15, -3, 60), 0.75, "50%"),
    ],
)
def test_the_paper_rules_jump_is_refused_with_its_size(
    start: tuple[float, float, float], end: tuple[float, float, float], jump_mm: float, place: str
) -> None:
    with pytest.raises(TrajectoryError) as raised:
        trajectory.bend(arc(*start), arc(*end), GEOMETRY, "paper", limits=Limits(speed_mm_s=60))
    assert f"jumps by {jump_mm:.2f} mm at {place} of the path" in str(raised.value)
    assert "'parallel'" in str(raised.value)
    smooth = trajectory.bend(
        arc(*start), arc(*end), GEOMETRY, "parallel", limits=Limits(speed_mm_s=60)
    )
    assert smooth.frames > 1
    # Between the same ends, a line between tendon lengths is always possible.
    q = (tendons.lengths(arc(*p), GEOMETRY, "paper") for p in (start, end))
    assert trajectory.line(*q, limits=Limits(speed_mm_s=60)).frames > 1


def test_a_jump_is_found_however_close_to_an_end_it_lies() -> None:
    for alpha in (1e-5, 1e-3, 0.1, 0.7):
        start = Arc.from_angles(length_mm=60, theta_rad=0.8, alpha_rad=-1e-5)
        end = Arc.from_angles(length_mm=60, theta_rad=0.8, alpha_rad=alpha)
        jump, tendon, place = trajectory.largest_jump_mm(start, end, GEOMETRY, "paper")
        expected = math.hypot(60, 8.3 * 0.8) - 60 * math.sin(0.4) / 0.4
        assert jump == pytest.approx(expected, abs=0.05)
        assert tendon in (1, 3)
        assert 0 < place < 1


def test_small_steps_below_the_dead_band_pass() -> None:
    start = Arc.from_angles(length_mm=60, theta_rad=0.1, alpha_rad=-0.1)
    end = Arc.from_angles(length_mm=60, theta_rad=0.1, alpha_rad=0.1)
    jump, _, _ = trajectory.largest_jump_mm(start, end, GEOMETRY, "paper")
    assert 0.01 < jump < trajectory.JUMP_MM
    assert trajectory.bend(start, end, GEOMETRY, "paper", limits=Limits(speed_mm_s=60)).frames > 1


# ----------------------------------------------------------------------- durations


@pytest.mark.parametrize("offset", [0.0, 65.0])
def test_the_tip_reaches_the_asked_speed_and_not_more(offset: float) -> None:
    start, end = arc(0, 0, 45), arc(15, 0, 60)
    duration_s = trajectory.duration_for_speed(start, end, 20.0, tip_offset_mm=offset)
    phase = trajectory.quintic(np.linspace(0, 1, 5001))
    tip = kinematics.position(trajectory.between(start, end, phase), tip_offset_mm=offset)
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=-1) * 5000 / duration_s
    assert speed.max() == pytest.approx(20.0, rel=2e-3)


def test_a_tip_that_stays_takes_a_servo_frame() -> None:
    assert trajectory.duration_for_speed(arc(0, 0, 45), arc(0, 0, 45), 20.0) == FRAME_S


# ----------------------------------------------------------------------- bad input


def test_bad_input_says_what_is_wrong() -> None:
    q = [60.0] * 4
    with pytest.raises(InputError, match=r"end_mm\[1\] is nan"):
        trajectory.line(q, [60, math.nan, 60, 60], limits=Limits(speed_mm_s=60))
    with pytest.raises(InputError, match=r"start_mm has shape \(4,\) and end_mm \(3,\)"):
        trajectory.line(q, [60.0] * 3, limits=Limits(speed_mm_s=60))
    with pytest.raises(InputError, match="duration_s is 0"):
        trajectory.line(q, q, limits=Limits(speed_mm_s=60), duration_s=0)
    with pytest.raises(InputError, match=r"speed_mm_s\[2\] is -1"):
        trajectory.line(q, q, limits=Limits(speed_mm_s=[60, 60, -1, 60]))
    with pytest.raises(InputError, match=r"speed_mm_s has shape \(3,\)"):
        trajectory.line(q, q, limits=Limits(speed_mm_s=[60, 60, 60]))
    with pytest.raises(InputError, match="too_fast is 'maybe'"):
        trajectory.line(q, q, limits=Limits(speed_mm_s=60), too_fast="maybe")  # type: ignore[arg-type]  # the test
    with pytest.raises(InputError, match="start holds arcs of shape"):
        trajectory.bend(
            kinematics.inverse([(0, 0, 60)]), arc(0, 0, 50), GEOMETRY, limits=Limits(speed_mm_s=60)
        )
    with pytest.raises(TrajectoryError, match="more than 600 s"):
        trajectory.line(q, q, limits=Limits(speed_mm_s=60), duration_s=1000)
    with pytest.raises(TrajectoryError, match="more than 600 s"):
        trajectory.line(q, [50.0] * 4, limits=Limits(speed_mm_s=1e-3))
