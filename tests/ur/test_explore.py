"""The tube's exploration with a simulated robot on a UR arm, in real time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.ur.controller import FakeController, patient
from tests.ur.driving import ends_by_a_pressed_stop

from setae import record, rig
from setae.cli import main
from setae.config import Config, load
from setae.errors import (
    ArmBoxError,
    ArmFrozenError,
    ArmSafetyError,
    StageError,
    StoppedError,
)
from setae.experiments.explore import explore
from setae.link.events import Event
from setae.scene import Obstacle, tube_scene
from setae_protocol.messages import State

ARM_TIMEOUT_S = 120.0  # a busy machine
ON_THE_WAY_MM = 3.0


def quick(step_mm: float = 40.0) -> Config:
    config = load()
    settings = dataclasses.replace(config.explore, steps=1, directions=2, step_mm=step_mm)
    return dataclasses.replace(config, explore=settings, ur=patient(config.ur))


def test_a_trial_by_the_command_finds_the_cube_and_brings_the_arm_back(
    fake: FakeController, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = fake.told()["flange"]
    robot, out = tmp_path / "robot.toml", tmp_path / "run"
    robot.write_text(quick().to_toml())
    monkeypatch.setattr("setae.stage._SLACK_S", ARM_TIMEOUT_S)
    with pytest.raises(SystemExit) as ended:
        main(["explore", "--sim", "--stage", fake.url, "--config", str(robot), "--obstacle", "35",
              "--out", str(out)])  # fmt: skip
    assert ended.value.code == 0
    assert (out / "report.html").is_file()
    log = record.read(out / "trial-1.mcap")
    (end,) = log.events("trial_end")
    assert [touch["alpha_deg"] for touch in end.data["contacts"]] == [0.0]
    assert end.data["descent_mm"] == pytest.approx(40, abs=0.3)
    assert fake.told()["flange"] == pytest.approx(start, abs=0.3e-3), "it is back"


def test_the_world_s_arm_goes_where_the_arm_goes(fake: FakeController) -> None:
    with rig.open("sim://", config=quick(), stage=fake.url) as opened:
        opened.stage.move_to((0.0, 0.0, -5.0))
        opened.robot.wait(lambda: not opened.stage.moving, timeout_s=ARM_TIMEOUT_S, what="the arm")
        opened.robot.session.run_for(1_000_000)
        assert opened.stage.position_mm == pytest.approx((0, 0, -5), abs=0.3)
        assert opened.world is not None
        assert opened.world.arm_mm == pytest.approx(opened.stage.position_mm, abs=0.01)


def test_a_level_outside_of_the_box_is_told_before_anything_moves(fake: FakeController) -> None:
    """Each move was checked when its turn came: the trial went down a level, felt around, and
    ended with the arm left there.
    """
    config = quick(step_mm=20.0)
    deep = dataclasses.replace(config.explore, steps=5)
    box = dataclasses.replace(config.ur, box_min_mm=(0.0, 0.0, 460.0))
    config = dataclasses.replace(config, explore=deep, ur=box)
    with rig.open("sim://", config=config, stage=fake.url) as opened:
        opened.robot.enable()
        with pytest.raises(ArmBoxError, match=r"z = 440\.0 mm"):
            explore(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S)
        assert opened.stage.position_mm == pytest.approx((0, 0, 0), abs=0.1)
        assert opened.robot.lengths_mm == pytest.approx([70.0] * 4, abs=0.1)


@pytest.mark.parametrize(
    ("happens", "kind", "says"),
    [
        (FakeController.freeze, ArmFrozenError, "Nobody knows whether the arm still moves"),
        (FakeController.close, ArmFrozenError, "Nobody knows whether the arm still moves"),
        (lambda fake: fake.tell("safety 3"), ArmSafetyError, "protective stop"),
    ],
    ids=["freezes", "dies", "protective stop"],
)
def test_an_arm_that_fails_while_it_lowers_stops_the_robot(
    fake: FakeController,
    happens: Callable[[FakeController], None],
    kind: type[StageError],
    says: str,
) -> None:
    """What became of the robot was looked at after a freeze alone. And that one was told as
    three failures to stop the arm, each with the same remedy, and not as what it was.
    """
    config = quick()
    with pytest.raises(kind, match=says) as caught:  # noqa: SIM117, PT012
        with rig.open("sim://", config=config, stage=fake.url) as opened:
            opened.robot.enable()

            def on_the_way(_: Event) -> None:
                if opened.stage.moving and -opened.stage.position_mm[2] > ON_THE_WAY_MM:
                    happens(fake)

            opened.robot.session.subscribe(on_the_way)
            try:
                explore(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S)
            finally:
                assert opened.robot.state is State.STOPPED
                with pytest.raises(StoppedError):
                    opened.robot.move_to((0, 0, 60))
    assert not hasattr(caught.value, "__notes__"), "it was told more than once"


def test_a_stop_that_is_pressed_while_the_robot_feels_stops_it(fake: FakeController) -> None:
    """Nobody looked at the program of an arm at rest: the robot went on, and the next move
    started the program again.
    """
    config = quick()
    with rig.open("sim://", config=config, stage=fake.url) as opened:
        opened.robot.enable()
        ends_by_a_pressed_stop(
            fake, opened,
            when=lambda: not opened.stage.moving and opened.stage.position_mm[2] < -ON_THE_WAY_MM,
            run=lambda: explore(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S),
        )  # fmt: skip


def test_a_contact_while_the_arm_lowers_stops_the_arm(fake: FakeController) -> None:
    config = quick(step_mm=100.0)
    # Right below: the bristle meets the cube's top while the arm comes down.
    config = dataclasses.replace(
        config, tube=dataclasses.replace(config.tube, cube_edge_mm=69.0, axis_offset_mm=104.0)
    )
    obstacle = Obstacle(below_tip_mm=30, edge_mm=69.0)
    scene = tube_scene(config, obstacle)
    assert scene.box is not None
    scene = dataclasses.replace(
        scene, box=dataclasses.replace(scene.box, centre_mm=(0.0, 0.0, scene.box.centre_mm[2]))
    )
    with rig.open("sim://", config=config, scene=scene, stage=fake.url) as opened:
        opened.robot.enable()
        result = explore(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S)
        (touch,) = result.contacts
        assert touch.alpha_deg is None
        assert 30 < touch.descent_mm < 50, "the arm stopped soon after the touch"
