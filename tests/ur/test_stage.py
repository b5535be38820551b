"""The unmodified ur-rtde and the stage on it, against a stand-in for the controller."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.ur.controller import FakeController
from tests.ur.driving import NEAR_MM, connected, far_on_its_way, poll_until, wait_until, with_ur
from tests.ur.turns import after, back, turn_of, turned, vector_of

from setae.config import load
from setae.errors import (
    ArmBoxError,
    ArmFrozenError,
    ArmModeError,
    ArmRemoteError,
    ArmSafetyError,
    ArmUnreachableError,
    InputError,
    StageError,
)
from setae.experiments.reach import require_reachable
from setae.ur import UrStage
from setae.ur.pose import WorldFrame, rotation
from setae.ur.process import Job, Method
from setae.ur.watch import Watch


def test_it_moves_to_where_it_was_sent_in_the_world_that_began_at_its_start(
    fake: FakeController,
) -> None:
    with connected(fake) as stage:
        assert stage.position_mm == pytest.approx((0, 0, 0), abs=1e-6)
        stage.move_to((10, 5, -20))
        assert stage.moving
        poll_until(stage, lambda: not stage.moving)
        assert stage.position_mm == pytest.approx((10, 5, -20), abs=NEAR_MM)
        # The fake's flange looks down: down is down in its base frame, y points away.
        x_mm, y_mm, z_mm = stage.base_mm((10, 5, -20))
        assert (x_mm, y_mm, z_mm) == pytest.approx((410, 105, 480), abs=NEAR_MM)


def test_frame_d_is_turned_on_the_flange_by_a_rotation_vector(fake: FakeController) -> None:
    """Nothing looked at frame_d_rotation_deg: with its sign or its convention wrong (roll, pitch
    and yaw are others), the stand-in would have told the same.
    """
    d_mm, d_rotation_deg = (12.0, -7.0, 100.0), (20.0, -35.0, 60.0)
    on_flange = turn_of([math.radians(angle) for angle in d_rotation_deg])
    # Frame D hangs straight down, its x axis 25° off the base's.
    yaw, down = turn_of([0, 0, math.radians(25)]), turn_of([math.pi, 0, 0])
    flange_rad = vector_of(after(after(yaw, down), back(on_flange)))
    fake.tell("flange {} {} {}".format(*flange_rad))
    with connected(fake, frame_d_mm=d_mm, frame_d_rotation_deg=d_rotation_deg) as stage:
        before = fake.told()["flange"]
        stage.move_to((30, 5, -20))
        poll_until(stage, lambda: not stage.moving)
        now = fake.told()["flange"]
    way_mm = 1000 * (np.array(now[:3]) - before[:3])
    # The world's x axis is D's, its z axis points up.
    assert way_mm == pytest.approx(turned(yaw, (30, 5, -20)), abs=NEAR_MM)
    assert now[3:] == pytest.approx(flange_rad, abs=1e-6), "the flange turned on the way"


def test_the_controller_is_told_what_the_configuration_says(fake: FakeController) -> None:
    """The stand-in ignored the payload, and any speed would do."""
    with connected(
        fake, payload_kg=2.5, payload_centre_mm=(3.0, -4.0, 50.0), watchdog_hz=4.0
    ) as stage:
        stage.move_to((0, 0, -1))
        poll_until(stage, lambda: not stage.moving)
        told = fake.told()
        assert told["payload"] == pytest.approx([2.5, 0.003, -0.004, 0.05])
        assert told["tcp"] == pytest.approx([0, 0, 0.1, 0, 0, 0])
        assert told["watchdog_hz"] == 4.0
        assert told["move"][6:] == pytest.approx([0.05, 0.2]), "the configured speed"
        stage.move_to((0, 0, -40), speed_mm_s=20, acceleration_mm_s2=70)
        poll_until(stage, lambda: far_on_its_way(stage))
        stage.stop()
        poll_until(stage, lambda: not stage.moving)
        told = fake.told()
        assert told["move"][6:] == pytest.approx([0.02, 0.07])
        assert told["brake"] == pytest.approx(0.2)


def test_a_stop_ends_the_move_where_it_is(fake: FakeController) -> None:
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        stage.stop()
        assert stage.moving, "it brakes"
        poll_until(stage, lambda: not stage.moving)
        z_mm = stage.position_mm[2]
        assert -30 < z_mm < -5
        stage.move_to((0, 0, z_mm - 1))
        poll_until(stage, lambda: not stage.moving)


def test_targets_outside_the_box_are_refused_before_anything_moves(fake: FakeController) -> None:
    with connected(fake, box_min_mm=(-900.0, -900.0, 450.0)) as stage:
        with pytest.raises(ArmBoxError, match=r"z = 440\.0 mm in the arm's base frame"):
            stage.move_to((0, 0, -60))
        assert not stage.moving
        stage.move_to((0, 0, -40))
        poll_until(stage, lambda: not stage.moving)


def test_the_targets_of_an_experiment_count_from_where_the_arm_stands(fake: FakeController) -> None:
    """A scan's corners were checked from the world's origin, and gone to from the arm's start."""
    with connected(fake, box_min_mm=(-850.0, -850.0, 450.0)) as stage:
        require_reachable(stage, [(0, 0, -40)])
        stage.move_to((0, 0, -20))
        poll_until(stage, lambda: not stage.moving)
        with pytest.raises(ArmBoxError, match=r"z = 4[34]\d\.\d mm"):
            require_reachable(stage, [(0, 0, 0), (0, 0, -40)])


def test_a_start_outside_the_box_is_refused(fake: FakeController) -> None:
    with pytest.raises(ArmBoxError, match="Frame D is at z"):
        UrStage(fake.url, with_ur(box_min_mm=(-900.0, -900.0, 800.0)))


def test_a_flange_that_does_not_look_down_is_refused(fake: FakeController) -> None:
    fake.tell(f"flange {math.pi - 0.2} 0 0")
    with pytest.raises(StageError, match=r"11\.5° off straight down"):
        UrStage(fake.url, with_ur())


@pytest.mark.parametrize(
    ("line", "kind", "says"),
    [
        ("local", ArmRemoteError, "local control"),
        ("mode 3", ArmModeError, "switched off"),
        ("mode 5", ArmModeError, "brakes"),
        ("safety 3", ArmSafetyError, "protective stop"),
        ("safety 6", ArmSafetyError, "emergency stop"),
    ],
)
def test_an_arm_that_cannot_be_driven_says_why_and_what_to_do(
    fake: FakeController, line: str, kind: type[StageError], says: str
) -> None:
    fake.tell(line)
    with pytest.raises(kind, match=says) as caught:
        UrStage(fake.url, with_ur())
    assert caught.value.remedy


def test_a_refused_connection_is_told_at_once() -> None:
    with pytest.raises(ArmUnreachableError, match=r"No UR controller answers at 127\.0\.0\.250"):
        UrStage("ur://127.0.0.250", with_ur())


@pytest.mark.parametrize("url", ["ur://", "ur:///x", "127.0.0.1"])
def test_a_url_without_an_address_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="names no arm"):
        UrStage(url, with_ur())


def test_a_frozen_controller_is_noticed_and_told_once(fake: FakeController) -> None:
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        fake.freeze()
        with pytest.raises(ArmFrozenError, match="has told nothing for"):
            poll_until(stage, lambda: False)
        # The robot must be stopped after that, in a loop that polls the stage too.
        stage.poll(0)
        assert not stage.moving
        with pytest.raises(ArmFrozenError, match="has told nothing for"):
            stage.stop()
        with pytest.raises(ArmFrozenError):
            stage.move_to((0, 0, 0))


def test_a_frozen_controller_is_noticed_by_a_host_that_was_busy(fake: FakeController) -> None:
    """The state's age grew with the polls alone, by 0.05 s each at most: a host that polled every
    0.2 s needed a second.
    """
    with connected(fake, state_age_s=0.5) as stage:
        fake.freeze()
        wait_until(lambda: stage.state_age_s > 0.5)  # and nobody polls
        with pytest.raises(ArmFrozenError):
            stage.poll(0)


def test_a_computer_that_stalls_does_not_blame_the_controller() -> None:
    now_s = 100.0
    watch = Watch(lambda: 7.0, lambda: now_s)
    watch.start()
    watch.close()  # the thread: from here on the test looks
    before_s = watch.unseen_s
    now_s += 10
    watch.look()
    assert watch.unseen_s - before_s == pytest.approx(0.05)


def test_a_state_that_the_library_cannot_tell_counts_as_unseen() -> None:
    """It ended the watching thread without a word: a controller that froze afterwards was never
    noticed.
    """
    clock = itertools.count(100.0, 0.01)
    watch = Watch(lambda: None, lambda: next(clock))
    watch.start()
    wait_until(lambda: watch.unseen_s >= 0.1)  # ten looks of the thread
    watch.close()


def test_an_arm_whose_controller_fails_at_a_call_is_braked(
    fake: FakeController, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any failure of the library passed for a frozen controller, which nobody tells to brake:
    the arm went on to its target while the controller told where it was.
    """
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        submit = stage._process.submit

        def refuse(what: str, method: Method, *arguments: object) -> Job:
            job = submit(what, method, *arguments)
            if method == "kick_watchdog":
                job.finish(ArmFrozenError("The controller failed at a sign of life: refused."))
            return job

        monkeypatch.setattr(stage._process, "submit", refuse)
        with pytest.raises(ArmFrozenError, match="failed at a sign of life"):
            poll_until(stage, lambda: False)
        assert fake.told()["brake"] == 0
        stage.stop()
        poll_until(stage, lambda: fake.told()["brake"] == pytest.approx(0.2))


def test_closing_twice_says_goodbye_once(
    fake: FakeController, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second close handed its goodbye to a worker that had ended, and waited in vain."""
    with connected(fake) as stage:
        stage.close()
        assert not fake.told()["playing"], "the program on the controller goes on"
        with pytest.raises(StageError, match="let go of"):
            stage.move_to((0, 0, -1))
        submitted: list[str] = []
        monkeypatch.setattr(stage._process, "submit", lambda what, _: submitted.append(what))
        stage.close()
    assert not submitted


def test_a_second_stage_on_the_same_arm_is_refused(fake: FakeController) -> None:
    """A notebook's cell that was run twice left the first one connected, and a real controller
    then says that registers are in use.
    """
    with connected(fake) as stage:
        with pytest.raises(StageError, match=r"drives the arm at .* already"):
            UrStage(fake.url, with_ur())
        stage.move_to((0, 0, -1))
        poll_until(stage, lambda: not stage.moving)
    with connected(fake):
        pass


def test_a_box_that_was_never_set_is_told(fake: FakeController) -> None:
    """The default one reaches as far as the arm, and protects nobody."""
    default = load().ur
    with (
        pytest.warns(UserWarning, match="box_min_mm"),
        connected(fake, box_min_mm=default.box_min_mm, box_max_mm=default.box_max_mm),
    ):
        pass


def test_a_controller_that_takes_no_move_but_tells_its_state_is_noticed(
    fake: FakeController,
) -> None:
    # Without its deadline a move that nobody carries out would have been waited for until the
    # experiment's own, and no test would have noticed.
    with connected(fake, command_deadline_s=1.0) as stage:
        fake.tell("deaf")
        stage.move_to((0, 0, -80))
        with pytest.raises(ArmFrozenError, match="did not take a move within 1 s"):
            poll_until(stage, lambda: False)
        assert stage.position_mm == pytest.approx((0, 0, 0), abs=1e-6)


def test_a_dead_controller_is_noticed(fake: FakeController) -> None:
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        fake.close()
        with pytest.raises(StageError):
            poll_until(stage, lambda: False)


def test_a_protective_stop_in_mid_move_is_noticed(fake: FakeController) -> None:
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        fake.tell("safety 3")
        with pytest.raises(ArmSafetyError, match="protective stop"):
            poll_until(stage, lambda: False)
        stage.stop()
        assert not stage.moving, "it braked for ever, as far as it told"


@pytest.mark.parametrize("position_mm", [(1, 2), (0, 0, math.nan)])
def test_nonsense_is_refused(fake: FakeController, position_mm: tuple[float, ...]) -> None:
    with connected(fake) as stage, pytest.raises(StageError, match="can't go to"):
        stage.move_to(position_mm)


angles = st.floats(-3, 3)


@given(st.tuples(angles, angles, angles))
def test_rotation_vectors_turn_about_themselves(vector_rad: tuple[float, float, float]) -> None:
    matrix = rotation(vector_rad)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)
    assert matrix @ np.array(vector_rad) == pytest.approx(np.array(vector_rad), abs=1e-9)
    angle_rad = math.hypot(*vector_rad)
    assert np.trace(matrix) == pytest.approx(1 + 2 * math.cos(angle_rad), abs=1e-9)


@given(st.tuples(angles, angles, angles), st.tuples(angles, angles, angles))
def test_host_and_stand_in_turn_alike(
    vector_rad: tuple[float, float, float], point_mm: tuple[float, float, float]
) -> None:
    assert rotation(vector_rad) @ np.array(point_mm) == pytest.approx(
        turned(turn_of(vector_rad), point_mm), abs=1e-9
    )


@given(st.tuples(angles, angles, angles), st.tuples(angles, angles, angles))
def test_the_world_and_the_base_frame_agree(
    turn_rad: tuple[float, float, float], point_mm: tuple[float, float, float]
) -> None:
    world = WorldFrame.at((100.0, 200.0, 300.0, *turn_rad))
    assert world.to_world_mm(world.to_base_mm(point_mm).tolist()) == pytest.approx(
        point_mm, abs=1e-9
    )
