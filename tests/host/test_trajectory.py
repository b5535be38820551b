"""Motions: where they end, how fast they go, that all tendons move as one, and what is refused."""

from __future__ import annotations

import math
from typing import Any

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


# ---------------------------------------------------------------------------- limits

LIMITS = Limits(speed_mm_s=60, acceleration_mm_s2=800, jerk_mm_s3=20_000)


def within(motion: trajectory.FrameTrajectory, limits: Limits) -> bool:
    return bool((motion.peaks <= limits.table(4) * (1 + 1e-9)).all())


@settings(max_examples=40)
@given(tendon_lengths, tendon_lengths)
def test_a_line_keeps_speed_acceleration_and_jerk_and_wastes_no_time(
    start: np.ndarray, end: np.ndarray
) -> None:
    motion = trajectory.line(start, end, limits=LIMITS)
    assert within(motion, LIMITS)
    # Between the frames too: the continuous quintic's own peaks.
    way, T = np.abs(end - start).max(), motion.duration_s
    assert 1.875 * way / T <= 60 * (1 + 1e-9)
    assert 10 / math.sqrt(3) * way / T**2 <= 800 * (1 + 1e-9)
    assert 60 * way / T**3 <= 20_000 * (1 + 1e-9)
    if motion.frames > 1:
        shorter = T - FRAME_S
        worst = max(1.875 * way / shorter / 60, 10 / 3**0.5 * way / shorter**2 / 800,
                    60 * way / shorter**3 / 20_000)  # fmt: skip
        assert worst > 1 - 1e-6


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(speed_mm_s=1e3, acceleration_mm_s2=100), "be accelerated by 461.9 mm/s²"),
        (Limits(speed_mm_s=1e3, jerk_mm_s3=1000), "be jerked by 9600.0 mm/s³"),
    ],
)
def test_what_is_exceeded_is_named(limits: Limits, words: str) -> None:
    with pytest.raises(TrajectoryError) as raised:
        trajectory.line([70.0] * 4, [70, 70, 50, 70], duration_s=0.5, limits=limits)
    assert f"Tendon 2 would {words}" in str(raised.value)


# -------------------------------------------------------------------------- waypoints

CORNERS = [(-14.0, 0.0, 55.0), (0.0, 12.0, 60.0), (14.0, 0.0, 55.0), (14.0, -12.0, 52.0)]


def way(model: str = "parallel", **options: Any) -> trajectory.FrameTrajectory:
    points = kinematics.inverse(CORNERS)
    return trajectory.along(points, GEOMETRY, model, **{"limits": LIMITS, **options})


def distance_mm(motion: trajectory.FrameTrajectory, point: tuple[float, ...]) -> float:
    top = kinematics.forward(motion.lengths_mm, GEOMETRY, "parallel").top_mm
    return float(np.linalg.norm(top - point, axis=-1).min())


def test_without_blending_the_motion_stops_at_each_waypoint() -> None:
    motion = way()
    for corner in CORNERS[1:]:
        assert distance_mm(motion, corner) < 1e-9
    q = tendons.lengths(kinematics.inverse(CORNERS), GEOMETRY, "parallel")
    for corner in q[1:-1]:
        frame = int(np.flatnonzero((np.abs(motion.lengths_mm - corner) < 1e-9).all(axis=1))[0])
        assert motion.speed_mm_s[frame : frame + 2].max() < 15
    assert within(motion, LIMITS)


def test_blending_cuts_corners_by_no_more_than_asked_and_never_stops() -> None:
    motion = way(blend_mm=6.0, duration_s=3.0)
    assert motion.duration_s == pytest.approx(3.0)
    for corner in CORNERS[1:-1]:
        assert 0.1 < distance_mm(motion, corner) < 6.0 * 3 / 8
    assert distance_mm(motion, CORNERS[-1]) < 1e-9
    middle = motion.speed_mm_s.max(axis=1)[20:-20]
    assert middle.min() > 2
    assert within(motion, LIMITS)
    closer = way(blend_mm=2.0, duration_s=3.0)
    for corner in CORNERS[1:-1]:
        assert distance_mm(closer, corner) < distance_mm(motion, corner)


def test_a_blended_way_is_smooth_where_the_blend_begins() -> None:
    # 1000 frames: a step in acceleration would stand out in the third difference.
    loose = Limits(speed_mm_s=1e3)
    fine = way(blend_mm=6.0, duration_s=40.0, limits=loose).peaks[2].max()
    coarse = way(blend_mm=6.0, duration_s=20.0, limits=loose).peaks[2].max()
    assert fine * 8 == pytest.approx(coarse, rel=0.05)


def test_the_shortest_blended_way_keeps_its_limits() -> None:
    for blend_mm in (1.0, 4.0, 50.0):
        motion = way(blend_mm=blend_mm)
        assert within(motion, LIMITS)
    assert way(blend_mm=50.0).frames < way().frames


@pytest.mark.parametrize("blend_mm", [0.0, 5.0])
def test_at_constant_speed_the_top_keeps_it_between_the_ramps(blend_mm: float) -> None:
    motion = way(blend_mm=blend_mm, speed_mm_s=15.0)
    top = kinematics.forward(motion.lengths_mm, GEOMETRY, "parallel").top_mm
    speed = np.linalg.norm(np.diff(top, axis=0), axis=-1) / FRAME_S
    assert speed.max() <= 15.0 * (1 + 1e-3)
    assert (speed > 14.7).mean() > 0.75
    if blend_mm:
        assert (speed[10:-10] > 14.7).all()
    assert within(motion, LIMITS)


def test_a_speed_that_a_tendon_can_not_follow_is_refused() -> None:
    with pytest.raises(TrajectoryError, match=r"Tendon \d would move at"):
        way(blend_mm=5.0, speed_mm_s=500.0)
    stretched = way(blend_mm=5.0, speed_mm_s=500.0, too_fast="stretch")
    assert within(stretched, LIMITS)


def test_equal_waypoints_count_once_and_one_is_none() -> None:
    points = kinematics.inverse([CORNERS[0], CORNERS[0], CORNERS[1], CORNERS[1]])
    twice = trajectory.along(points, GEOMETRY, "parallel", limits=LIMITS)
    once = trajectory.along(points[1:3], GEOMETRY, "parallel", limits=LIMITS)
    np.testing.assert_array_equal(twice.lengths_mm, once.lengths_mm)
    with pytest.raises(InputError, match="fewer than two different"):
        trajectory.along(points[:2], GEOMETRY, limits=LIMITS)
    with pytest.raises(InputError, match=r"waypoints has shape \(\)"):
        trajectory.along(points[0], GEOMETRY, limits=LIMITS)
    with pytest.raises(InputError, match="blend_mm is -1"):
        way(blend_mm=-1.0)
    with pytest.raises(InputError, match="Both duration_s and speed_mm_s"):
        way(duration_s=1.0, speed_mm_s=10.0)


def test_a_duration_too_short_for_all_stops_says_what_it_takes() -> None:
    shortest = way()
    with pytest.raises(TrajectoryError, match=rf"Give the motion {shortest.duration_s:.2f} s"):
        way(duration_s=0.2)
    assert way(duration_s=0.2, too_fast="stretch").frames == shortest.frames
    longer = way(duration_s=2 * shortest.duration_s)
    assert longer.frames == 2 * shortest.frames
    assert within(longer, LIMITS)


# ---------------------------------------------------------------------------- circles


@pytest.mark.parametrize("model", ["parallel", "taut"])
def test_a_circle_keeps_length_and_bending(model: str) -> None:
    motion = trajectory.circle(60, 0.5, GEOMETRY, model, limits=LIMITS, start_rad=0.3, turns=-1.5)
    arcs = kinematics.forward(motion.lengths_mm, GEOMETRY, model)
    np.testing.assert_allclose(arcs.length_mm, 60, atol=1e-6)
    np.testing.assert_allclose(arcs.theta_rad, 0.5, atol=1e-7)
    turned = np.unwrap(arcs.alpha_rad)
    assert (np.diff(turned) < 0).all()
    assert turned[-1] - 0.3 == pytest.approx(-3 * math.pi, abs=1e-6)
    assert within(motion, LIMITS)
    assert not motion.bridges


def test_a_circle_ends_where_it_began_though_its_ends_are_one() -> None:
    motion = trajectory.circle(60, 0.5, GEOMETRY, "parallel", limits=LIMITS)
    np.testing.assert_allclose(motion.lengths_mm[-1], motion.start_mm, atol=1e-9)
    assert motion.frames > 30
    with pytest.raises(InputError, match="turns is 0"):
        trajectory.circle(60, 0.5, GEOMETRY, limits=LIMITS, turns=0)
    with pytest.raises(InputError, match="theta_rad is 0"):
        trajectory.circle(60, 0, GEOMETRY, limits=LIMITS)


def test_under_paper_a_circle_is_refused_with_its_largest_jump() -> None:
    with pytest.raises(TrajectoryError) as raised:
        trajectory.circle(60, 0.5, GEOMETRY, "paper", limits=LIMITS, start_rad=0.3)
    jump = math.hypot(60, 8.3 * 0.5) - 60 * math.sin(0.25) / 0.25
    assert f"jumps by {jump:.2f} mm" in str(raised.value)
    assert "the largest of 4 jumps" in str(raised.value)
    assert "at_jump='bridge'" in str(raised.value)


@pytest.mark.parametrize("options", [{}, {"duration_s": 6.0}, {"speed_mm_s": 25.0}])
def test_a_bridge_joins_both_sides_of_a_jump_at_rest(options: dict[str, Any]) -> None:
    motion = trajectory.circle(
        60, 0.5, GEOMETRY, "paper", limits=LIMITS, start_rad=0.3, at_jump="bridge", **options
    )
    assert len(motion.bridges) == 4
    assert within(motion, LIMITS)  # no step is left
    path = np.concatenate([motion.start_mm[None], motion.lengths_mm])
    for jump in motion.bridges:
        assert jump.size_mm == pytest.approx(0.77, abs=0.01)
        # α is a multiple of 90° there, and both sides are passed.
        assert (0.3 + 2 * math.pi * jump.after) % (math.pi / 2) == pytest.approx(0, abs=1e-5) or (
            0.3 + 2 * math.pi * jump.after
        ) % (math.pi / 2) == pytest.approx(math.pi / 2, abs=1e-5)
        for phase in (jump.before, jump.after):
            arc = Arc.from_angles(length_mm=60, theta_rad=0.5, alpha_rad=0.3 + 2 * math.pi * phase)
            there = tendons.lengths(arc, GEOMETRY, "paper")
            assert np.abs(path - there).max(axis=1).min() < 1e-6
    assert motion.phase[-1] == 1.0
    assert (np.diff(motion.phase) >= 0).all()


def test_a_bend_through_a_jump_is_bridged_when_asked() -> None:
    start, end = arc(15, 3, 60), arc(15, -3, 60)
    motion = trajectory.bend(start, end, GEOMETRY, "paper", limits=LIMITS, at_jump="bridge")
    assert [round(jump.size_mm, 2) for jump in motion.bridges] == [0.75]
    np.testing.assert_array_equal(motion.lengths_mm[-1], tendons.lengths(end, GEOMETRY, "paper"))
    assert within(motion, LIMITS)
    # From the boundary itself: the jump is at the very start, and nothing lies before it.
    leaving = trajectory.bend(
        arc(15, 0, 60), arc(12, 9, 60), GEOMETRY, "paper", limits=LIMITS, at_jump="bridge"
    )
    assert leaving.bridges[0].before == 0.0
    np.testing.assert_allclose(
        leaving.start_mm, tendons.lengths(arc(15, 0, 60), GEOMETRY, "paper"), atol=1e-9
    )


def test_every_jump_of_several_tendons_is_found() -> None:
    # Five tendons: ten places in a turn, none of them opposite another.
    five = config.Geometry(tendon_angles_rad=tuple(2 * math.pi * i / 5 for i in range(5)))
    found = trajectory.jumps(
        lambda s: Arc.from_angles(length_mm=60, theta_rad=0.6, alpha_rad=0.1 + 2 * math.pi * s),
        five,
        "paper",
    )
    assert len(found) == 10
    coarse = trajectory.jumps(
        lambda s: Arc.from_angles(length_mm=60, theta_rad=0.6, alpha_rad=0.1 + 2 * math.pi * s),
        five,
        "paper",
        samples=7,
    )
    assert [round(j.after, 9) for j in coarse] == [round(j.after, 9) for j in found]
