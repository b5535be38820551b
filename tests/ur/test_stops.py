"""Who stopped the arm's program: somebody, or the watchdog; neither starts it again."""

from __future__ import annotations

import pytest
from tests.ur.controller import FakeController
from tests.ur.driving import NEAR_MM, connected, far_on_its_way, poll_until, wait_until

from setae.errors import ArmStoppedError
from setae.ur import UrStage


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("stop_program", r"stopped or paused at the controller, \d+\.\d mm before its target"),
        ("slider 0", "speed slider"),
    ],
)
def test_an_arm_that_was_stopped_by_someone_says_so(
    fake: FakeController, line: str, says: str
) -> None:
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        fake.tell(line)
        with pytest.raises(ArmStoppedError, match=says):
            poll_until(stage, lambda: False)
        with pytest.raises(ArmStoppedError):
            stage.move_to((0, 0, 0))


@pytest.mark.parametrize("polled", [True, False], ids=["polled", "idle"])
def test_a_stop_that_was_pressed_while_the_arm_rested_is_for_good(
    fake: FakeController, polled: bool
) -> None:
    """It passed for a watchdog that had expired: the next move started the program again."""
    with connected(fake) as stage:
        stage.move_to((0, 0, -5))
        poll_until(stage, lambda: not stage.moving)
        before = fake.told()
        fake.tell("stop_program")
        wait_until(lambda: not stage._process.state.program_runs)
        says = r"stopped or paused at the controller\."
        if polled:
            with pytest.raises(ArmStoppedError, match=says):
                stage.poll(0)
            stage.poll(0)  # told once
        else:
            with pytest.raises(ArmStoppedError, match=says):
                stage.move_to((0, 0, -10))
        with pytest.raises(ArmStoppedError):
            stage.move_to((0, 0, -10))
        stage.stop()
    after = fake.told()
    assert not after["playing"]
    assert (after["move"], after["flange"]) == (before["move"], before["flange"])


def test_a_move_just_after_a_stop_does_not_start_the_program_again(fake: FakeController) -> None:
    """The host learns of the stop a few reports later; the process must not take the move."""
    with connected(fake) as stage:
        fake.tell("stop_program")
        fake.told()

        def move() -> None:  # which tells it itself where the reports were quicker
            stage.move_to((0, 0, -10))
            poll_until(stage, lambda: False)

        with pytest.raises(ArmStoppedError):
            move()
    assert not fake.told()["playing"]
    assert not fake.told()["move"]


def test_the_controllers_watchdog_stops_the_arm_of_a_host_that_hangs(
    fake: FakeController,
) -> None:
    with connected(fake, watchdog_hz=1.0) as stage:
        stage.move_to((0, 0, -300), speed_mm_s=20)
        poll_until(stage, lambda: far_on_its_way(stage))

        def at_rest() -> bool:
            # Two connections tell of it: one may be a report behind the other.
            state = stage._process.state
            return not state.program_runs and state.speed_mm_s == 0

        wait_until(at_rest)  # the host hangs: nobody polls, and after a second the controller acts
        with pytest.raises(ArmStoppedError, match="watchdog stopped the arm: for"):
            stage.poll(0)
        assert stage.position_mm[2] > -100
    assert not fake.told()["playing"]


def idle(stage: UrStage) -> None:
    """Nobody polls, until the controller's watchdog would have expired twice."""
    told_s = stage._process.state.timestamp_s
    end_s = told_s + 2 / stage._settings.watchdog_hz
    wait_until(lambda: stage._process.state.timestamp_s >= end_s)


def test_a_pause_of_the_host_at_rest_costs_nothing(fake: FakeController) -> None:
    """A trajectory that was computed for long, or a researcher who thought, let the watchdog end
    the arm's program: the next move was refused.
    """
    with connected(fake, watchdog_hz=1.0) as stage:
        idle(stage)
        stage.move_to((0, 0, -5))
        poll_until(stage, lambda: not stage.moving)
        idle(stage)
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        stage.stop()
        idle(stage)  # it brakes, and then nobody looks
        poll_until(stage, lambda: not stage.moving)
        z_mm = stage.position_mm[2] + 1
        stage.move_to((0, 0, z_mm))
        poll_until(stage, lambda: not stage.moving)
        assert stage.position_mm == pytest.approx((0, 0, z_mm), abs=NEAR_MM)
