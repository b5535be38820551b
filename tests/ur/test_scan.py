"""The scan with a simulated robot on a UR arm, in real time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
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
)
from setae.experiments.scan import read, scan, simulate
from setae.link.events import Event
from setae.objects import ScanObject, TableScene, table_scene
from setae.ur import UrStage
from setae_protocol.messages import State

ARM_TIMEOUT_S = 120.0  # a busy machine
ON_THE_WAY_MM = 3.0


def quick() -> tuple[Config, TableScene]:
    """Two places by two, with an object at the second column."""
    config = load()
    settings = dataclasses.replace(
        config.scan, area_mm=(30.0, 30.0), step_mm=30.0, extend_speed_mm_s=60.0
    )
    config = dataclasses.replace(config, scan=settings, ur=patient(config.ur))
    what = ScanObject(shape="eraser", x_mm=40.0, y_mm=15.0, yaw_deg=90.0)
    return config, table_scene(config, what)


def test_a_scan_on_the_arm_finds_what_one_in_the_simulator_finds(
    fake: FakeController, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, scene = quick()
    robot, table = tmp_path / "robot.toml", tmp_path / "scene.toml"
    robot.write_text(config.to_toml())
    table.write_text('[object]\nshape = "eraser"\nx_mm = 40.0\ny_mm = 15.0\nyaw_deg = 90.0\n')
    monkeypatch.setattr("setae.stage._SLACK_S", ARM_TIMEOUT_S)
    with pytest.raises(SystemExit) as ended:
        main(["scan", "--sim", "--stage", fake.url, "--config", str(robot), "--scene", str(table),
              "--out", str(tmp_path / "run")])  # fmt: skip
    assert ended.value.code == 0
    assert (tmp_path / "run" / "report.html").is_file()
    result = read(tmp_path / "run")
    with rig.open("sim://", config=config, stage=fake.url) as opened:
        assert isinstance(opened.stage, UrStage)
        start_mm = record.read(tmp_path / "run" / "paper.mcap").metadata["arm_base_mm"]
        assert opened.stage.base_mm((0, 0, 0)) == pytest.approx(start_mm, abs=0.3), "it is back"
    simulated = simulate(config, scene)
    ours, theirs = result.height_map.height_mm, simulated.height_map.height_mm
    assert (np.isfinite(ours) == np.isfinite(theirs)).all()
    assert np.nanmax(np.abs(ours - theirs)) < 1.0


@pytest.mark.parametrize(
    ("happens", "kind"),
    [
        (FakeController.freeze, ArmFrozenError),
        (FakeController.close, ArmFrozenError),
        (lambda fake: fake.tell("safety 3"), ArmSafetyError),
    ],
    ids=["freezes", "dies", "protective stop"],
)
def test_an_arm_that_fails_in_a_step_stops_the_robot(
    fake: FakeController, happens: Callable[[FakeController], None], kind: type[StageError]
) -> None:
    config, scene = quick()
    with rig.open("sim://", config=config, scene=scene, stage=fake.url) as opened:
        opened.robot.enable()

        def on_the_way(_: Event) -> None:
            if opened.stage.moving and opened.stage.position_mm[0] > ON_THE_WAY_MM:
                happens(fake)

        opened.robot.session.subscribe(on_the_way)
        with pytest.raises(kind):
            scan(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S)
        assert opened.robot.state is State.STOPPED
        assert ON_THE_WAY_MM < opened.stage.position_mm[0] < config.scan.step_mm


def test_a_stop_that_is_pressed_between_two_steps_ends_the_scan(fake: FakeController) -> None:
    """It passed for a watchdog that had expired: the arm went on through all places."""
    config, scene = quick()
    with rig.open("sim://", config=config, scene=scene, stage=fake.url) as opened:
        opened.robot.enable()
        ends_by_a_pressed_stop(
            fake, opened,
            when=lambda: not opened.stage.moving and opened.stage.position_mm[0] > ON_THE_WAY_MM,
            run=lambda: scan(opened.robot, opened.stage, arm_timeout_s=ARM_TIMEOUT_S),
        )  # fmt: skip


def test_a_corner_outside_of_the_box_is_told_before_anything_moves(fake: FakeController) -> None:
    config, scene = quick()
    wide = dataclasses.replace(config.scan, area_mm=(2000.0, 30.0))
    config = dataclasses.replace(config, scan=wide)
    with rig.open("sim://", config=config, scene=scene, stage=fake.url) as opened:
        opened.robot.enable()
        with pytest.raises(ArmBoxError):
            scan(opened.robot, opened.stage)
        assert opened.stage.position_mm == pytest.approx((0, 0, 0), abs=0.1)
        assert opened.robot.lengths_mm == pytest.approx([70.0] * 4, abs=0.1)


def test_an_earlier_log_outlives_a_box_that_is_too_small(
    fake: FakeController, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With --force the earlier log was deleted and the servos enabled before the box was looked
    at: it left neither the old scan nor a new one.
    """
    config, _ = quick()
    robot, log = tmp_path / "robot.toml", tmp_path / "run" / "paper.mcap"
    robot.write_text(config.to_toml())
    log.parent.mkdir()
    log.write_bytes(b"a scan of yesterday")
    with pytest.raises(SystemExit) as ended:
        main(["scan", "--sim", "--object", "none", "--stage", fake.url, "--config", str(robot),
              "--area", "1980x30", "--out", str(log.parent), "--force"])  # fmt: skip
    assert ended.value.code != 0
    assert "the box goes" in capsys.readouterr().err
    assert log.read_bytes() == b"a scan of yesterday"


def test_the_dry_run_shows_the_corners(
    fake: FakeController, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(
            ["scan", "--sim", "--object", "none", "--stage", fake.url, "--area", "40", "--dry-run"]
        )
    printed = capsys.readouterr()
    assert ended.value.code == 0, printed.err
    assert "40.0, 40.0, 0.0" in printed.out
    assert "Nothing was moved" in printed.out
    assert printed.err.count("Set box_min_mm and box_max_mm") == 1, (
        "the default box protects nobody"
    )
