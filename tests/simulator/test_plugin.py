"""Another plant in the place of the spring, driven by the same board."""

from __future__ import annotations

import importlib
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from setae import rig
from setae.cli import main
from setae.cli.common import with_plugin
from setae.config import load
from setae.errors import SetaeError
from setae.experiments import runs
from setae.record import read
from setae.report import solving
from setae.sim.plugin import Answer, PluginError, checked, make

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
HERE = Answer(position_mm=np.array([0.0, 0.0, 70.0]), rotation=np.eye(3))


@pytest.fixture
def plugin_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose modules can be plugged in."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", list(sys.path))
    return tmp_path


def write(folder: Path, name: str, body: str) -> None:
    (folder / f"{name}.py").write_text(textwrap.dedent(body))


def test_the_documented_robot_moves_by_its_own_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    with rig.open("python:arc_robot:make") as opened:
        assert opened.plant == "python:arc_robot:make"
        opened.robot.enable()
        opened.robot.move_to((15.0, 0.0, 60.0), model="parallel")
        opened.robot.session.run_for(300_000)
        assert opened.world is not None
        truth = opened.world.truth()
    # Its rule is the host's: what is left is the servos' dead band.
    assert truth.backbone_mm[-1] == pytest.approx([15.0, 0.0, 60.0], abs=0.7)
    assert truth.backbone_mm[0] == pytest.approx([0.0, 0.0, 0.0])
    assert truth.filament_mm[1] == pytest.approx(
        truth.backbone_mm[-1] + 65.0 * truth.rotation[:, 2], abs=1e-9
    )


def test_pulses_go_in_and_pressure_comes_out(plugin_folder: Path) -> None:
    write(
        plugin_folder,
        "feels_pulses",
        """
        import numpy as np
        from setae.sim.plugin import Answer

        class Robot:
            def step(self, drive):
                return Answer(position_mm=np.array([0.0, 0.0, 70.0]), rotation=np.eye(3),
                              tension_n=drive.pull_mm, pressure_hpa=float(drive.pulse_us[0]) / 100)

        def make(config, seed):
            return Robot()
        """,
    )
    with rig.open("python:feels_pulses:make") as opened:
        opened.robot.enable()
        opened.robot.session.run_for(300_000)
        assert opened.world is not None
        truth = opened.world.truth()
        assert truth.attached == (True,) * 4
        assert truth.pressure_hpa == pytest.approx(1013.25 + truth.pulse_us[0] / 100)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("python:nowhere", "python:module:factory"),
        ("python:no_such_module:make", "no_such_module"),
        ("python:math:no_such_factory", "no_such_factory"),
        ("python:math:pi", "pi"),
        ("python:math:gcd", "factory failed"),
        ("python:operator:eq", "no step"),
    ],
)
def test_a_name_that_leads_nowhere_says_where_it_ends(name: str, says: str) -> None:
    with pytest.raises(PluginError, match=says):
        make(name, load(), 0)


def test_a_module_that_breaks_is_named(plugin_folder: Path) -> None:
    write(plugin_folder, "broken_module", "import nothing_of_that_name")
    with pytest.raises(PluginError, match=r"broken_module.*nothing_of_that_name"):
        make("python:broken_module:make", load(), 0)


def test_an_exception_in_a_step_ends_the_run_as_an_error_of_ours(plugin_folder: Path) -> None:
    write(
        plugin_folder,
        "breaks_later",
        """
        import numpy as np
        from setae.sim.plugin import Answer

        class Robot:
            def step(self, drive):
                if drive.time_s > 0.2:
                    raise RuntimeError("out of air")
                return Answer(position_mm=np.array([0.0, 0.0, 70.0]), rotation=np.eye(3))

        def make(config, seed):
            return Robot()
        """,
    )

    def run() -> None:
        with rig.open("python:breaks_later:make") as opened:
            opened.robot.session.run_for(2_000_000)

    with pytest.raises(SetaeError, match="out of air") as caught:
        run()
    assert isinstance(caught.value, PluginError)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (Answer(position_mm=np.zeros(2), rotation=np.eye(3)), "position_mm"),
        (Answer(position_mm=np.full(3, np.nan), rotation=np.eye(3)), "position_mm"),
        (Answer(position_mm=np.zeros(3), rotation=2 * np.eye(3)), "rotation"),
        (Answer(position_mm=np.zeros(3), rotation=-np.eye(3)), "rotation"),
        (Answer(position_mm=np.zeros(3), rotation=np.eye(3), tension_n=np.ones(3)), "tension_n"),
        (Answer(position_mm=np.zeros(3), rotation=np.eye(3), pressure_hpa=np.inf), "pressure_hpa"),
    ],
)
def test_an_answer_that_is_no_pose_is_refused_by_name(answer: Answer, says: str) -> None:
    with pytest.raises(PluginError, match=says):
        checked(answer)
    checked(HERE)


def test_time_never_goes_back(plugin_folder: Path) -> None:
    write(
        plugin_folder,
        "keeps_times",
        """
        import numpy as np
        from setae.sim.plugin import Answer
        times = []

        class Robot:
            def step(self, drive):
                times.append(drive.time_s)
                return Answer(position_mm=np.array([0.0, 0.0, 70.0]), rotation=np.eye(3))

        def make(config, seed):
            return Robot()
        """,
    )
    with rig.open("python:keeps_times:make") as opened:
        assert opened.world is not None
        opened.robot.session.run_for(200_000)
        for _ in range(5):
            opened.world.truth()  # looking asks nobody
    times = importlib.import_module("keeps_times").times
    assert times[0] == 0.0
    assert (np.diff(times) > 0).all()
    assert np.diff(times) == pytest.approx(1 / 75, abs=1e-5)


def test_the_command_line_takes_a_plugin_after_sim() -> None:
    assert with_plugin(["move", "0", "0", "60", "--sim", "python:a:b"]) == [
        "move", "0", "0", "60", "--sim", "--plugin", "python:a:b",
    ]  # fmt: skip
    assert with_plugin(["info", "--sim=python:a:b"]) == ["info", "--sim", "--plugin", "python:a:b"]
    assert with_plugin(["move", "--sim", "15", "0", "60"]) == ["move", "--sim", "15", "0", "60"]


def test_a_command_drives_a_plugin(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    with pytest.raises(SystemExit) as ended:
        main(["move", "0", "0", "60", "--sim", "python:arc_robot:make"])
    assert ended.value.code == 0
    with pytest.raises(SystemExit) as ended:
        main(["move", "0", "0", "60", "--sim", "python:arc_robot:nothing"])
    assert ended.value.code == 1
    assert "nothing" in capsys.readouterr().err


def test_a_plugin_is_validated_and_its_bristle_calibrated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The tools of this robot for another: nobody knows its residual, so none is doubted."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    robot = ["--sim", "python:arc_robot:make", "--no-report", "--out"]
    with pytest.raises(SystemExit) as ended:
        main(["validate", "--model", "parallel", "--targets", "5", *robot, str(tmp_path / "v")])
    assert ended.value.code == 0, capsys.readouterr().err
    (run,) = runs.read([read(tmp_path / "v" / "parallel.mcap")])
    assert len(run.poses) == 5
    # An arc that is commanded as an arc; the servos' dead band is left.
    assert np.median([pose.in_plane_mm for pose in run.poses]) < 1.0
    assert np.isnan(run.logs[0].array("/truth", "largest_residual")).all()
    # It said that none was without a solution.
    assert np.isnan(run.logs[0].array("/truth", "unsolved_samples")).all()
    assert solving.told(run.logs) == ""
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", "bristle", "--moves", "4", "--touches", "3", *robot,
              str(tmp_path / "b")])  # fmt: skip
    assert ended.value.code == 0, capsys.readouterr().err
    assert load(tmp_path / "b" / "bristle.toml").bristle.threshold_hpa > 0


def test_what_a_plugin_cannot_do_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["validate", "--causes", "--sim", "python:arc_robot:make"])
    assert ended.value.code == 1
    assert "the simulator's own robot" in capsys.readouterr().err
