"""`setae validate`: driving to targets, measuring, interrupting, resuming, reporting."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from tests.system.test_explore_by_hand import board_at_a_port

from setae import record, rig
from setae.cli import errors_table, main
from setae.cli.common import interrupts
from setae.config import load
from setae.experiments import causes, runs
from setae.experiments.accuracy import Pose
from setae.experiments.events import Event
from setae.experiments.targets import Target, choose, paper_targets
from setae.experiments.validate import Noise, measured, validate
from setae.link.session import Session
from setae.report.causes import note_of, picture, section
from setae.report.validation_pictures import bubbles_picture
from setae.robot import Robot
from setae.scene import open_scene
from setae.sim import Truth, World


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["validate", *arguments])
    captured = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    return ended.value.code, captured.out, captured.err


def runs_in(folder: Path) -> tuple[runs.Run, ...]:
    return runs.read(record.read(log) for log in sorted(folder.glob("*.mcap")))


def test_two_models_side_by_side_with_tables_and_one_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    code, printed, errors = run(
        capsys, "--sim", "--targets", "12", "--model", "paper", "--model", "taut",
        "--out", str(out),
    )  # fmt: skip
    assert code == 0, errors
    assert "4.32±2.73" in printed  # the paper's own, beside
    assert "These are 12 of 145 targets: not comparable" in printed
    found = runs_in(out)
    assert [one.model for one in found] == ["paper", "taut"]
    assert all(one.complete and one.simulated for one in found)
    count = len(choose(paper_targets(load()), 12))
    assert [len(one.poses) for one in found] == [count, count]
    # The shortest path inside the bore is nearer to what the plant's tendons do.
    errors_mm = [np.mean([pose.in_plane_mm for pose in one.poses]) for one in found]
    assert errors_mm[1] < errors_mm[0]
    page = (out / "report.html").read_text()
    assert "model paper" in page
    assert "model taut" in page
    data = json.loads((out / "validation.json").read_text())
    assert data["runs"][0]["groups"]["all"]["targets"] == count
    assert data["paper"]["compression"]["distance"] == {"mean_mm": 2.06, "sd_mm": 1.52}
    lines = (out / "targets.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * count
    assert {path.stem for path in (out / "pictures").iterdir()} == {
        "boxes", "bubbles", "places", "targets",
    }  # fmt: skip


def test_noise_is_added_as_asked_and_is_the_same_again() -> None:
    target = paper_targets(load())[0]
    noise = [Noise(sd_mm=0.5, seed=seed).on(target) for seed in (1, 1, 2)]
    assert noise[0] == pytest.approx(noise[1])
    assert noise[0] != pytest.approx(noise[2])
    every = [Noise(sd_mm=0.5, seed=3).on(target) for target in paper_targets(load())]
    assert np.std(every) == pytest.approx(0.5, rel=0.1)
    assert Noise().on(target) == pytest.approx((0.0, 0.0, 0.0))


def test_an_interrupted_run_keeps_what_it_has_and_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    arguments = ("--sim", "--targets", "8", "--out", str(out), "--no-report")
    polls = 0

    def press_ctrl_c(now_us: int) -> None:
        nonlocal polls
        polls += 1
        if now_us > 6_000_000:
            monkeypatch.undo()
            raise KeyboardInterrupt

    monkeypatch.setattr(interrupts, "poll", press_ctrl_c)
    code, _, errors = run(capsys, *arguments)
    assert code == 130, errors
    assert "--resume" in errors
    assert len(errors.splitlines()) == 1
    (before,) = runs_in(out)
    assert not before.complete
    assert 0 < len(before.poses) < 8
    # A resumed run doesn't mix two configurations.
    other = tmp_path / "other.toml"
    other.write_text("[spring]\nbending_factor = 0.8\n")
    code, _, errors = run(capsys, *arguments, "--resume", "--config", str(other))
    assert code == 1
    assert "another configuration" in errors
    code, _, errors = run(capsys, *arguments, "--resume", "--seed", "4")
    assert code == 1
    assert "another --seed" in errors  # it was gone on with
    code, _, errors = run(capsys, *arguments, "--resume")
    assert code == 0, errors
    (after,) = runs_in(out)
    assert after.complete
    assert len(after.logs) == 2
    wanted = [target.label for target in choose(paper_targets(load()), 8)]
    assert sorted(after.visited) == sorted(wanted)
    # What was measured before is still what it was.
    kept = {pose.target.label: pose.position_mm for pose in after.poses}
    for pose in before.poses:
        assert kept[pose.target.label] == pytest.approx(pose.position_mm)
    # The second log of this run, and what was measured of it, counted as parts of a new one.
    (out / "paper-measured.mcap").write_bytes((out / "paper-2.mcap").read_bytes())
    code, _, errors = run(capsys, "--sim", "--targets", "5", "--force", *arguments[3:])
    assert code == 0, errors
    (anew,) = runs_in(out)
    assert (len(anew.logs), len(anew.visited)) == (1, 5)


def test_a_run_that_ended_before_its_first_bent_target_is_reported(tmp_path: Path) -> None:
    """The report failed over a shape, and with it the advice that Ctrl-C gives."""
    config = load()
    straight = [target for target in paper_targets(config) if target.bend_deg == 0][:2]
    poses = [Pose(target, np.array(target.position_mm)) for target in straight]
    measured(tmp_path / "paper.mcap", poses, config, model="paper", files=["x.csv"])
    bubbles_picture(tmp_path / "bubbles.png", runs.read([record.read(tmp_path / "paper.mcap")]))


def test_ctrl_c_stops_the_robot() -> None:
    config = load()
    events: list[Event] = []

    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    def drive(robot: Robot) -> None:
        robot.enable()
        validate(robot, paper_targets(config)[:1], interrupt, on_event=events.append)

    with (
        pytest.raises(KeyboardInterrupt),
        rig.open("sim://", config=config, scene=open_scene()) as opened,
    ):
        drive(opened.robot)
    assert opened.robot.state.name == "STOPPED"
    assert events[-1].name == "validate_aborted"


def test_a_real_robot_waits_for_pictures_and_is_measured_by_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    fast = tmp_path / "fast.toml"
    fast.write_text("[motion]\nmove_speed_mm_s = 150.0\nrelax_speed_mm_s = 100.0\n")
    keys = tmp_path / "keys"
    keys.write_text("\n" * 5)
    with board_at_a_port() as port, keys.open() as keyboard:
        monkeypatch.setattr(sys, "stdin", keyboard)
        code, printed, errors = run(
            capsys, "--port", port, "--targets", "5", "--config", str(fast), "--out", str(out),
            "--accept-jump",
        )  # fmt: skip
    assert code == 0, errors
    assert "5 of 5: -Y z50 b30" in printed
    assert "none measured" in printed
    assert not (out / "report.html").exists()
    driven = choose(paper_targets(load()), 5)
    table = tmp_path / "measured.csv"
    rows = []
    for target in driven:
        x, y, z = target.position_mm
        rows.append(f"{target.label},{x},{y},{z + 2}")
    table.write_text("\n".join(["target,x_mm,y_mm,z_mm", *rows]))
    code, printed, errors = run(
        capsys, "--positions", str(table), "--config", str(fast), "--out", str(out)
    )
    assert code == 0, errors
    (found,) = runs_in(out)
    assert [pose.height_mm for pose in found.poses] == pytest.approx([2.0] * 5)
    assert "Measured on the robot" in (out / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--sim", "--model", "straight"), "straight"),
        (("--sim", "--targets", "3"), "too few"),
        (("--sim", "--targets", "146"), "There are 145"),  # it drove all 145
        (("--sim", "--frame", "f.toml"), "--positions"),
        (("--port", "x", "--noise-mm", "1"), "simulated"),
        (("--sim", "--resume"), "--out"),
        (("--sim", "--resume", "--out", "nothing"), "nothing holds no run"),  # it began one there
        (("--sim", "--noise-mm", "-1"), "noise"),
        (("--positions", "a.csv", "--model", "paper", "--model", "taut"), "one --model"),
        (("--positions", "a.csv", "--causes"), "--causes is for driving"),  # was passed over
        (("--positions", "a.csv", "--sim"), "--sim is for driving"),  # these two were, too
        (("--positions", "a.csv", "--plant", "paper_like"), "--plant is for driving"),
    ],
)
def test_contradictions_are_told_in_one_line_before_anything_moves(
    arguments: tuple[str, ...],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Session, "open", lambda _: pytest.fail("it connected"))
    code, _, errors = run(capsys, *arguments)
    assert code == 1
    assert words in errors
    assert len(errors.splitlines()) == 1
    assert not (tmp_path / "runs").exists()


def test_figures_are_whole_in_a_narrow_terminal() -> None:
    """2.06±1.52 came out as 2.06±1…"""
    target = paper_targets(load())[0]
    table = errors_table._table([Pose(target, np.array(target.position_mm))])
    narrow = Console(width=45)
    with narrow.capture() as shown:
        narrow.print(table)
    assert "…" not in shown.get()


def test_the_list_of_targets_is_a_table_that_can_be_filled_in(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, printed, _ = run(capsys, "--list")
    assert code == 0
    lines = printed.splitlines()
    assert len(lines) == 146
    assert lines[0].startswith("target,x_mm,y_mm,z_mm,length_0_mm")
    assert lines[1].startswith("C z30,0.000,0.000,30.000,30.000")


def test_a_target_that_another_log_measured_is_not_unsolved(tmp_path: Path) -> None:
    """It was named as not measured beside its own measured position."""
    first, second = paper_targets(load())[9:11]
    metadata = {"experiment": "validate", "model": "paper", "simulated": True}
    with record.Recorder(tmp_path / "a.mcap", metadata={**metadata, "config": ""}) as recorder:
        for target in (first, second):
            data = {"label": target.label, "residual": 0.5}
            recorder.experiment(0, runs.UNSOLVED, data)
            recorder.experiment(0, "target", {"label": target.label, "position_mm": None})
    measured(
        tmp_path / "b.mcap", [Pose(first, np.array(first.position_mm))], load(), model="paper",
        files=["x.csv"],
    )  # fmt: skip
    (run,) = runs_in(tmp_path)
    assert list(run.unsolved) == [second.label]


def test_causes_alone_and_mended_with_the_largest_gain_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    plant = tmp_path / "plant.toml"
    # One large imperfection, and one so small that nobody would notice.
    plant.write_text('[simulator]\n"tendon.offset_mm_0" = 3.0\n"tendon.winding_error_1" = 0.001\n')
    code, printed, errors = run(
        capsys, "--sim", "--config", str(plant), "--targets", "5", "--causes", "--no-report",
        "--out", str(out),
    )  # fmt: skip
    assert code == 0, errors
    assert "mending gains" in printed
    effects = causes.effects(record.read(out / "causes.mcap"))
    assert effects[0].cause == "zero offsets"
    assert effects[0].gains_mm > 0.5
    by_name = {effect.cause: effect for effect in effects}
    assert abs(by_name["winding gain"].adds_mm) < 0.1
    assert {"servo dead band", "weight and load", "tendon model taut"} <= by_name.keys()
    assert "zero offsets" in section(effects, _picture(tmp_path, effects))
    code, _, errors = run(capsys, "--port", "nowhere", "--causes")
    assert code == 1
    assert "--sim" in errors


def test_causes_go_on_where_they_were_interrupted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    plant = tmp_path / "plant.toml"
    plant.write_text('[simulator]\n"tendon.offset_mm_0" = 3.0\n')
    options = ["--sim", "--config", str(plant), "--targets", "5", "--causes", "--no-report",
               "--out", str(out)]  # fmt: skip
    module = sys.modules["setae.cli.validate"]
    driven: list[str] = []
    poses: list[Pose] = []
    drive = module.validate

    def counted(*arguments: Any, **named: Any) -> Any:
        driven.append(named["model"])
        if len(driven) == 4:
            raise KeyboardInterrupt
        if not poses:  # which are as good as any, for the other cases too
            poses.extend(drive(*arguments, **named))
        return poses

    monkeypatch.setattr(module, "validate", counted)
    code, _, errors = run(capsys, *options)
    assert code == 130, errors
    assert "--resume" in errors
    first = record.read(out / "causes.mcap").events("case")
    assert len(first) == 2  # the first call was for the targets themselves
    code, printed, errors = run(capsys, *options, "--resume")
    assert code == 0, errors
    assert "mending gains" in printed
    cases = record.read(out / "causes.mcap").events("case")
    assert len(driven) == 4 + len(cases) - len(first)
    assert [case.data for case in cases[:2]] == [case.data for case in first]
    more = ["10" if option == "5" else option for option in options]
    code, _, errors = run(capsys, *more, "--resume")
    assert code == 1
    assert "another targets" in errors


def test_causes_are_compared_over_the_targets_that_all_plants_have(tmp_path: Path) -> None:
    """A plant without a solution at its worst target counted as better; one without any as NaN."""
    near, far = paper_targets(load())[9:11]

    def pose(target: Target, error_mm: float) -> Pose:
        return Pose(target, target.position_mm + np.array([0.0, 0.0, error_mm]))

    def study(name: str, mended: list[Pose], unsolved: list[str]) -> record.Log:
        path = tmp_path / name
        with record.Recorder(path, metadata={"config": load().to_toml()}) as recorder:
            for number, case in enumerate(causes.cases({"slip": {}}, "paper", ["paper"])):
                found = [pose(near, 1.0), pose(far, 9.0)]
                data = causes.told(case, found)
                if case.name == "mended slip":
                    data = causes.told(case, mended, unsolved)
                recorder.experiment(number, "case", data)
        return record.read(path)

    log = study("one.mcap", [pose(near, 1.0)], [far.label])
    assert {effect.gains_mm for effect in causes.effects(log)} == {0.0}
    assert f"{far.label} (mended slip)" in causes.left_out(log)
    assert "1 of 145 targets" in note_of(log)
    log = study("none.mcap", [], [near.label, far.label])
    assert causes.effects(log) == ()
    assert "No target is left" in causes.left_out(log)


def _picture(folder: Path, effects: Sequence[causes.Effect]) -> Path:
    return picture(folder / "causes.png", effects, "Simulated.")


def test_a_pose_without_a_solution_is_no_measurement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever the spring was when its equilibrium was not found counted as measured."""
    truth = World.truth

    def unsolved_towards_x(world: World) -> Truth:
        found = truth(world)
        bent = found.backbone_mm[-1][0] > 5
        return dataclasses.replace(found, plant_residual=0.5) if bent else found

    monkeypatch.setattr(World, "truth", unsolved_towards_x)
    out = tmp_path / "run"
    code, printed, errors = run(capsys, "--sim", "--targets", "5", "--out", str(out))
    assert code == 0, errors
    (one,) = runs_in(out)
    assert [pose.target.group for pose in one.poses] == ["compression", "-X", "+Y", "-Y"]
    (label,) = one.unsolved
    assert label.startswith("+X")
    for text in (printed, (out / "report.html").read_text()):
        assert f"had no solution there: {label} (residual 0.5)" in " ".join(text.split())


def test_a_frame_that_fits_better_mirrored_is_asked_about(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "mirrored.csv"
    rows = [
        f"{target.label},{-x},{y},{z}"
        for target in paper_targets(load())
        for x, y, z in [target.position_mm]
        if target.group == "+X" and x < 29  # beyond, it is refused
    ]
    table.write_text("\n".join(["target,x_mm,y_mm,z_mm", *rows]))
    code, printed, errors = run(
        capsys, "--positions", str(table), "--out", str(tmp_path / "run"), "--no-report"
    )
    assert code == 0, errors
    assert "Is the frame right? The 30 positions of +X lie on the other side" in printed
