"""The robot over the simulator: it stops when it must, and nothing restarts it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.system.robots import WALL_AHEAD, Bench, bench, compressed, run_world

from setae import kinematics
from setae.config import loads
from setae.errors import (
    BoardResetError,
    FaultError,
    InputError,
    LinkLostError,
    PoseUnknownError,
    RefusedError,
    StoppedError,
    TrajectoryError,
    TrippedError,
    UnreachableError,
)
from setae.link.events import Refused, Tripped
from setae.link.lossy import Faults
from setae.robot import Robot
from setae.scene import Obstacle
from setae.servo import segment_messages
from setae_protocol.messages import SERVO_FRAME_US, Refusal, Segment, State

TARGET_MM = (15.0, 0.0, 60.0)

LINES = {
    "clean": Faults(),
    "losing": Faults(lose=0.3),
    "doubling and late": Faults(double=0.3, delay=0.3),
    "damaging": Faults(damage=0.3),
}


@pytest.mark.parametrize("name", LINES)
def test_a_stop_in_mid_move_holds_whatever_the_line_does_until_resume(name: str) -> None:
    faults = LINES[name]
    with compressed(seed=3, down=faults, up=faults) as made:
        robot = made.robot
        made.at(robot.now_us + 400_000, robot.session.send_stop)
        with pytest.raises(StoppedError):
            robot.move_to(TARGET_MM, duration_s=2.0)
        made.run(0.2)
        held = made.pulses_us()
        assert robot.state is State.STOPPED
        # Retransmissions, stale segments and all: longer than the move would have lasted.
        made.run(3.0)
        assert made.pulses_us() == pytest.approx(held)
        with pytest.raises(StoppedError):
            robot.move_to(TARGET_MM)
        robot.resume()
        made.run(1.0)
        assert made.pulses_us() == pytest.approx(held)
        robot.move_to(TARGET_MM)
        assert robot.position_mm == pytest.approx(TARGET_MM, abs=0.1)


def test_a_stop_freezes_the_pulses_within_two_frames_on_a_clean_line() -> None:
    with compressed() as made:
        robot = made.robot
        sent_us = robot.now_us + 400_000
        made.at(sent_us, robot.session.send_stop)
        with pytest.raises(StoppedError):
            robot.move_to(TARGET_MM, duration_s=2.0)
        made.run(0.5)
        held = made.robot.telemetry.pulse_ticks
        late = [
            report
            for report in made.reports
            if robot.host_time_us(report.telemetry.frame, 0) > sent_us + 2 * SERVO_FRAME_US
        ]
        assert late
        assert all(report.telemetry.pulse_ticks == held for report in late)


def test_a_contact_in_mid_extension_freezes_within_a_frame_of_its_sample() -> None:
    with compressed(obstacle=WALL_AHEAD) as made:
        robot = made.robot
        start = np.array(robot.telemetry.pulse_ticks)
        contact = robot.probe(TARGET_MM, duration_s=1.0)
        assert contact is not None
        record = next(event.record for event in made.events if isinstance(event, Tripped))
        frozen = np.array(record.pulse_ticks[-1])

        def progress(ticks: object) -> float:
            return float((np.asarray(ticks) - start) @ (frozen - start))

        seen = [
            report.telemetry
            for report in made.reports
            if report.telemetry.frame >= record.sample_frame + 1
        ]
        assert max(progress(telemetry.pulse_ticks) for telemetry in seen) <= progress(frozen)
        assert np.abs(frozen - start).max() > 100
        # The reflex brought it back, and it is ready for more.
        assert robot.state is State.HOLDING
        assert robot.telemetry.pulse_ticks == tuple(start)


def test_the_place_of_a_contact_is_known_within_its_stated_uncertainty() -> None:
    with compressed(obstacle=WALL_AHEAD) as made:
        truths = []
        made.robot.session.subscribe(lambda _: truths.append(made.world.truth()))
        contact = made.robot.probe(TARGET_MM, duration_s=1.0)
        assert contact is not None
        touching = next(truth for truth in truths if truth.contact_depth_mm > 0)
        error_mm = np.linalg.norm(touching.backbone_mm[-1] - np.array(contact.position_mm))
        assert error_mm < contact.uncertainty_mm
        assert abs(contact.pressure_change_hpa) >= 15.0
        # From the side the filament only bends: a few millimetres until the pressure is there.
        assert abs(contact.time_us - touching.time_us) < 100_000
        threshold_hpa = contact.baseline_hpa + made.robot.config.bristle.threshold_hpa
        pressed = next(truth for truth in truths if truth.pressure_hpa > threshold_hpa)
        assert abs(contact.time_us - pressed.time_us) < 40_000


def test_the_robot_tells_the_pose_that_was_commanded() -> None:
    """Under the paper's model the lengths fit other poses too, and (-2.2, 15.6, 29.9) was told."""
    with compressed() as made:
        robot = made.robot
        robot.move_to((2.3, 15.6, 29.9))
        assert robot.position_mm == pytest.approx((2.3, 15.6, 29.9), abs=0.1)
        robot.move_to((20.0, 5.0, 55.0), model="taut")
        assert robot.position_mm == pytest.approx((20.0, 5.0, 55.0), abs=0.1)
        robot.circle(15.0, 60.0, turns=0.25, model="parallel")
        assert robot.position_mm == pytest.approx((0.0, 15.0, 60.0), abs=0.1)


def test_the_pose_is_told_anew_where_only_the_motion_s_meaning_changed() -> None:
    with compressed() as made:
        robot = made.robot
        robot.move_to((20.0, 5.0, 55.0), model="taut")
        assert robot.position_mm == pytest.approx((20.0, 5.0, 55.0), abs=0.1)
        before = robot.telemetry.pulse_ticks
        robot.move_lengths(robot.lengths_mm)
        assert robot.telemetry.pulse_ticks == before
        lengths_mm, config = robot.lengths_mm, robot.config
        arc = kinematics.forward(lengths_mm, config.geometry, model=config.motion.model)
        assert robot.position_mm.tolist() == kinematics.position(arc).tolist()
        assert robot.position_mm != pytest.approx((20.0, 5.0, 55.0), abs=0.5)


def test_a_probe_into_free_space_ends_at_its_target() -> None:
    with compressed() as made:
        assert made.robot.probe(TARGET_MM, duration_s=1.0) is None
        assert made.robot.position_mm == pytest.approx(TARGET_MM, abs=0.1)


def test_a_short_probe_takes_the_time_that_its_jerk_asks_for() -> None:
    # A scan's last two millimetres at 60 mm/s ended it: the motion was refused as jerky.
    with compressed() as made:
        made.robot.compress(68.0, duration_s=1.0)
        assert made.robot.probe((0.0, 0.0, 70.0), speed_mm_s=60.0) is None
        assert made.robot.pose.length_mm == pytest.approx(70.0, abs=0.1)


def test_an_unguarded_move_into_something_trips_too() -> None:
    with compressed(obstacle=Obstacle(below_tip_mm=1.0, edge_mm=50.0)) as made:
        robot, stage = made.robot, made.stage
        stage.move_to((0.0, 0.0, -30.0))
        robot.wait(lambda: not stage.moving, timeout_s=5.0, what="the arm")
        with pytest.raises(TrippedError, match="resume"):
            robot.move_to(TARGET_MM, speed_mm_s=100)
        assert robot.state is State.TRIPPED
        with pytest.raises(TrippedError):
            robot.move_to(TARGET_MM)


@pytest.mark.parametrize(
    "target",
    [
        (math.nan, 0, 60),
        (0, math.inf, 60),
        (0, 0),
        (0, 0, 60, 0),
        [[0, 0, 60], [0, 0, 50]],
        "far",
        (0, 0, 0),
        (0, 0, -60),
        (0, 0, 71),
        (0, 0, 19),
        (60, 0, 10),
    ],
)
def test_a_bad_target_is_refused_and_nothing_moves(target: Any, holding: Bench) -> None:
    before = holding.pulses_us()
    for act in (holding.robot.move_to, holding.robot.probe):
        with pytest.raises(InputError):
            act(target)
    holding.run(0.1)
    assert holding.pulses_us() == pytest.approx(before)
    assert holding.robot.state is State.HOLDING


@pytest.fixture(scope="module")
def holding() -> Iterator[Bench]:
    with compressed() as made:
        yield made


def test_bad_lengths_durations_and_speeds_are_refused(holding: Bench) -> None:
    robot = holding.robot
    with pytest.raises(UnreachableError):
        robot.move_lengths([10, 10, 10, 10])
    with pytest.raises(InputError):
        robot.move_lengths([50, 50, 50])
    with pytest.raises(InputError):
        robot.move_to(TARGET_MM, duration_s=-1)
    with pytest.raises(InputError):
        robot.move_to(TARGET_MM, speed_mm_s=math.nan)
    # A move to where the robot is took any duration.
    with pytest.raises(InputError, match="duration_s"):
        robot.move_lengths(robot.lengths_mm, duration_s=math.nan)
    with pytest.raises(TrajectoryError):
        robot.move_to(TARGET_MM, duration_s=0.05)
    with pytest.raises(TrajectoryError):
        robot.move_to(TARGET_MM, speed_mm_s=1000)
    # These two came as errors of Python's own.
    with pytest.raises(InputError, match="radius_mm"):
        robot.circle("15", 60)  # type: ignore[arg-type]  # that is the mistake
    with pytest.raises(InputError, match="timeout_s is nan"):
        robot.hold_guarded(int, bool, int, timeout_s=math.nan)
    assert robot.state is State.HOLDING


@pytest.mark.parametrize(
    ("ticks", "frames", "reason"),
    [
        ((999, 1700, 1700, 1700), 500, Refusal.OUT_OF_LIMITS),
        ((65535, 1700, 1700, 1700), 500, Refusal.OUT_OF_LIMITS),
        ((3650, 1700, 3650, 1700), 500, Refusal.PAIR_LIMIT),
        ((3500, 2600, 1700, 2600), 500, Refusal.PAIR_LIMIT),
        ((2100, 2100, 2100, 2100), 1, Refusal.TOO_FAST),
    ],
)
def test_the_board_itself_refuses_what_breaks_its_limits(
    ticks: tuple[int, int, int, int], frames: int, reason: Refusal
) -> None:
    """A host that doesn't check, or lies, can't hurt the robot."""
    with compressed() as made:
        session = made.robot.session
        before = made.pulses_us()
        segment = Segment(duration_frames=frames, target_ticks=ticks)
        ticket = session.send(*segment_messages([segment], epoch=session.epoch))
        made.run(1.0)
        assert ticket.refusal is not None
        assert ticket.refusal.reason is reason
        assert any(isinstance(event, Refused) for event in made.events)
        assert made.pulses_us() == pytest.approx(before)


def test_a_sensor_that_falls_silent_under_guard_is_a_fault_not_a_blind_move() -> None:
    with compressed() as made:
        robot = made.robot
        start_us = robot.now_us
        made.at(start_us + 700_000, made.silence_sensor)
        with pytest.raises(FaultError, match="sensor") as failure:
            robot.probe(TARGET_MM, duration_s=2.0)
        assert failure.value.remedy.endswith("Then call resume(), or give `setae enable`.")
        made.run(0.05)
        held = made.pulses_us()
        made.run(1.0)
        assert made.pulses_us() == pytest.approx(held)
        with pytest.raises(RefusedError):
            robot.resume()
        made.silence_sensor(False)
        made.run(0.3)
        robot.resume()
        robot.compress(45.0)
        assert robot.state is State.HOLDING


def test_a_robot_left_stopped_can_be_connected_to_and_resumed() -> None:
    """Connecting raised StoppedError, whose advice was to call resume()."""
    with compressed() as made:
        made.robot.stop()
        robot = Robot(made.robot.session, made.robot.config)
        robot.prepare()
        assert robot.state is State.STOPPED
        with pytest.raises(StoppedError):
            robot.enable()
        robot.resume()
        robot.enable()
        robot.move_to(TARGET_MM)


def test_an_unknown_pose_needs_a_decision_before_the_first_pulse() -> None:
    with bench(parameters={"board.pose_known": 0}) as made:
        with pytest.raises(PoseUnknownError, match="accept_jump"):
            made.robot.enable()
        made.run(0.5)
        assert made.world.truth().attached == (False,) * 4
        made.robot.enable(accept_jump=True)
        assert made.world.truth().attached == (True,) * 4


NARROW = {
    "Servo 0": "[geometry]\nmin_length_mm = 64\n[explore]\ncompressed_length_mm = 65",
    "Tendons 0 and 2": "[geometry]\nmax_bend_deg = 10",
}


@pytest.mark.parametrize("which", NARROW)
def test_a_pose_left_outside_of_the_limits_is_told_with_a_way_out(which: str) -> None:
    """The board refused enable() with out_of_limits, whatever the user tried after it."""
    left_mm = (15.0, 0.0, 60.0) if which.startswith("Tendons") else (0.0, 0.0, 45.0)
    with compressed() as made:
        made.robot.move_to(left_mm)
        made.robot.limp()
        left = made.robot.telemetry.pulse_ticks
        narrow = loads(NARROW[which])
        robot = Robot(made.robot.session, narrow)
        robot.prepare()
        with pytest.raises(UnreachableError, match=f"{which} .*accept_jump") as failure:
            robot.enable()
        assert "configuration" in failure.value.remedy
        made.run(0.5)
        assert made.world.truth().attached == (False,) * 4
        assert robot.telemetry.pulse_ticks == left

        # Servo by servo, over so far that the bristle swings: the board asks before it goes on.
        with pytest.raises(TrippedError, match="resume"):
            robot.enable(accept_jump=True)
        robot.resume()
        assert made.world.truth().attached == (True,) * 4
        assert robot.position_mm == pytest.approx((0, 0, narrow.geometry.free_length_mm), abs=0.1)
        robot.compress(66.0)


def test_a_known_pose_inside_the_limits_is_kept_even_where_a_jump_is_accepted() -> None:
    with compressed() as made:
        made.robot.limp()
        left = made.robot.telemetry.pulse_ticks
        made.robot.enable(accept_jump=True)
        assert made.robot.telemetry.pulse_ticks == left


def test_lengths_that_one_servo_may_not_take_are_refused_before_anything_is_sent() -> None:
    """The board refused them, and told its own ticks; the host checked pairs alone."""
    narrow = loads(NARROW["Servo 0"])
    with bench() as made:
        robot = Robot(made.robot.session, narrow)
        robot.prepare()
        robot.enable(accept_jump=True)
        with pytest.raises(UnreachableError, match="Servo 1"):
            robot.move_lengths([70, 48, 70, 70])
        assert robot.state is State.HOLDING


def test_a_dead_line_is_told_and_the_board_plays_its_queue_to_the_end_and_holds() -> None:
    with compressed() as made:

        def cut() -> None:
            made.line.down_faults = made.line.up_faults = Faults(lose=1.0)

        made.at(made.robot.now_us + 300_000, cut)
        with pytest.raises(LinkLostError, match="cable"):
            made.robot.move_to((0.0, 0.0, 65.0), duration_s=3.0)
        held = made.pulses_us()
        run_world(made.world, 2)
        assert made.pulses_us() == pytest.approx(held)
        assert made.world.truth().attached == (True,) * 4


def test_a_board_that_resets_in_mid_move_is_noticed_and_never_goes_on() -> None:
    with compressed() as made:
        made.at(made.robot.now_us + 300_000, made.reset_board)
        with pytest.raises(BoardResetError):
            made.robot.move_to((0.0, 0.0, 65.0), duration_s=3.0)
        made.run_without_host(2)
        assert made.world.truth().attached == (False,) * 4


def test_leaving_the_with_block_relaxes() -> None:
    with compressed() as made:
        with made.robot:
            pass
        made.run_without_host(0.04)
        assert made.world.truth().attached == (False,) * 4
        assert made.world.truth().backbone_mm[-1, 2] > 65.0


def test_an_error_in_the_with_block_stops_and_holds() -> None:
    with compressed() as made:
        made.at(made.robot.now_us + 400_000, _interrupt)
        with pytest.raises(KeyboardInterrupt), made.robot as robot:
            robot.move_to(TARGET_MM, duration_s=2.0)
        held = made.pulses_us()
        run_world(made.world, 2)
        assert made.pulses_us() == pytest.approx(held)
        assert made.robot.state is State.STOPPED
        assert made.world.truth().attached == (True,) * 4


def _interrupt() -> None:
    raise KeyboardInterrupt
