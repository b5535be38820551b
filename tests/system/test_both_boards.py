"""The same robot on the simulator of every day, and on the built firmware in the simulated UNO."""

from __future__ import annotations

import numpy as np
import pytest
from tests.avr.built import require_built
from tests.system.robots import WALL_AHEAD, Bench, bench, compressed

from setae.arc import FloatArray
from setae.config import loads
from setae.errors import BoardResetError, FaultError, RefusedError, StoppedError
from setae.experiments.events import Event
from setae.experiments.explore import explore
from setae.experiments.targets import Target, choose, paper_targets
from setae.experiments.validate import validate
from setae.link.lossy import Faults
from setae.link.session import Session
from setae.scene import Obstacle, open_scene
from setae_protocol.messages import State

TARGET_MM = (15.0, 0.0, 60.0)
BAD_LINE = Faults(lose=0.1, double=0.1, damage=0.1, delay=0.1)


@pytest.fixture(params=["sim", "avr"])
def back_end(request: pytest.FixtureRequest) -> str:
    if request.param == "avr":
        require_built()
    return str(request.param)


def test_it_moves_where_it_is_told_and_relaxes(back_end: str) -> None:
    with compressed(back_end=back_end) as made:
        made.robot.move_to(TARGET_MM, duration_s=0.6)
        made.run(0.1)
        assert made.robot.position_mm == pytest.approx(TARGET_MM, abs=0.1)
        assert made.pulses_us() == pytest.approx(np.array(made.robot.telemetry.pulse_ticks) / 2)
        made.robot.relax()
        made.run(0.1)
        assert made.robot.state is State.RELAXED
        assert made.world.truth().attached == (False,) * 4
        assert made.world.truth().backbone_mm[-1, 2] > 65.0


def test_a_touch_stops_it_and_it_comes_back(back_end: str) -> None:
    with compressed(back_end=back_end, obstacle=WALL_AHEAD) as made:
        start = made.robot.telemetry.pulse_ticks
        truths = []
        made.robot.session.subscribe(lambda _: truths.append(made.world.truth()))
        contact = made.robot.probe(TARGET_MM, duration_s=1.0)
        assert contact is not None
        threshold_hpa = contact.baseline_hpa + made.robot.config.bristle.threshold_hpa
        pressed = next(truth for truth in truths if truth.pressure_hpa > threshold_hpa)
        assert abs(contact.time_us - pressed.time_us) < 40_000
        assert made.robot.state is State.HOLDING
        assert made.robot.telemetry.pulse_ticks == start


def test_a_stop_holds_on_a_bad_line_until_resume(back_end: str) -> None:
    with compressed(back_end=back_end, seed=3, down=BAD_LINE, up=BAD_LINE) as made:
        robot = made.robot
        made.at(robot.now_us + 300_000, robot.session.send_stop)
        with pytest.raises(StoppedError):
            robot.move_to(TARGET_MM, duration_s=1.5)
        made.run(0.2)
        held = made.pulses_us()
        made.run(1.5)
        assert robot.state is State.STOPPED
        assert made.pulses_us() == pytest.approx(held)
        robot.resume()
        robot.move_to(TARGET_MM, duration_s=0.6)
        assert robot.position_mm == pytest.approx(TARGET_MM, abs=0.1)


def test_a_silent_sensor_under_guard_is_a_fault(back_end: str) -> None:
    with compressed(back_end=back_end) as made:
        made.at(made.robot.now_us + 600_000, made.silence_sensor)
        with pytest.raises(FaultError, match="sensor"):
            made.robot.probe(TARGET_MM, duration_s=1.5)
        made.silence_sensor(False)
        made.run(0.5)
        made.robot.resume()
        assert made.robot.state is State.HOLDING


def test_an_open_stop_switch_stops_it_until_it_is_closed_and_resumed(back_end: str) -> None:
    config = loads("[motion]\nstop_switch = 1")
    with bench(config=config, back_end=back_end) as made:
        robot = made.robot
        with pytest.raises(RefusedError, match="switch"):
            robot.resume()
        made.open_stop_switch(False)
        made.run(0.1)
        robot.resume()
        robot.enable(accept_jump=True)
        opened_us = robot.now_us + 300_000
        made.at(opened_us, made.open_stop_switch)
        with pytest.raises(StoppedError):
            robot.move_to((0.0, 0.0, 60.0), duration_s=1.5)
        assert robot.now_us < opened_us + 60_000
        made.run(0.06)
        held = made.pulses_us()
        made.run(0.3)
        assert made.pulses_us() == pytest.approx(held)
        with pytest.raises(RefusedError, match="switch"):
            robot.resume()
        made.open_stop_switch(False)
        made.run(0.1)
        robot.resume()
        assert robot.state is State.HOLDING


def test_stored_limits_are_in_force_after_a_reset(back_end: str) -> None:
    with bench(back_end=back_end) as made:
        made.robot.store_limits()
        assert made.robot.limits_stored
        stored = made.robot.status.stored_crc
        made.reset_board()
        with pytest.raises(BoardResetError):
            made.run(5.0)
        assert Session(made.line, session_id=8).open().limits_crc == stored


def test_a_reset_in_mid_move_is_noticed_and_nothing_goes_on(back_end: str) -> None:
    with compressed(back_end=back_end) as made:
        made.at(made.robot.now_us + 300_000, made.reset_board)
        with pytest.raises(BoardResetError):
            made.robot.move_to((0.0, 0.0, 65.0), duration_s=2.0)
        made.run_without_host(0.5)
        assert made.world.truth().attached == (False,) * 4


def test_a_validation_measures_the_same_on_both() -> None:
    require_built()
    config = loads("[motion]\nmove_speed_mm_s = 150.0")
    targets = choose(paper_targets(config), 5)
    tops_mm = []
    for back_end in ("sim", "avr"):
        with bench(back_end=back_end, config=config, scene=open_scene()) as made:
            made.robot.enable(accept_jump=True)

            def top_mm(_: Target, made: Bench = made) -> FloatArray:
                return np.array(made.world.truth().backbone_mm[-1])

            poses = validate(made.robot, targets, top_mm, settle_s=0.2)
            tops_mm.append([pose.position_mm for pose in poses])
            made.robot.relax()
    assert np.shape(tops_mm) == (2, len(targets), 3)
    assert tops_mm[1] == pytest.approx(np.array(tops_mm[0]), abs=0.02)
    assert np.ptp(tops_mm[1], axis=0).max() > 20.0


def test_it_finds_what_is_in_the_tube(back_end: str) -> None:
    config = loads("[explore]\nsteps = 1\ndirections = 2\nextend_duration_s = 0.6")
    with bench(back_end=back_end, config=config, obstacle=Obstacle(below_tip_mm=15.0)) as made:
        made.robot.enable(accept_jump=True)
        events: list[Event] = []
        explore(made.robot, made.stage, on_event=events.append)
        levels = [event.data for event in events if event.name == "level_end"]
        assert [level["touched_deg"] for level in levels] == [[0.0]]
