"""`setae scan`: what it writes, what it shows, what it refuses."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from setae import record, report, rig
from setae.cli import live_map, main
from setae.errors import LogError
from setae.experiments.events import Event
from setae.experiments.scan import read, read_parts, scans_of
from setae.report import scan_notes, scan_page, scan_pictures, style
from setae.robot import Robot


def main_ends(code: int, *arguments: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == code


def test_the_command_scans_in_two_modes_and_reports_them_side_by_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[object]\nshape = "eraser"\nscale = 1.0\nx_mm = 50.0\ny_mm = 10.0\nyaw_deg = 90.0\n'
    )
    out = tmp_path / "run"
    main_ends(
        0, "scan", "--sim", "--scene", str(scene), "--area", "60x20", "--step", "20",
        "--mode", "paper", "--mode", "adaptive", "--out", str(out),
    )  # fmt: skip
    printed = capsys.readouterr().out
    assert re.search(r" 50%  4 of 8 places, .* robot time, about \d+:\d\d left", printed)
    assert "100%  8 of 8 places" in printed
    assert "adaptive" in printed
    assert sorted(path.name for path in out.glob("*.mcap")) == ["adaptive.mcap", "paper.mcap"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "of the time of the paper’s cycle" in page
    assert (out / "places.csv").read_text().count("\n") == 17
    # Each log alone too, and the log's events in words.
    report.write(out / "paper.mcap", tmp_path / "alone" / "report.html")
    main_ends(0, "replay", str(out / "paper.mcap"))
    assert "scan_end" in capsys.readouterr().out
    with pytest.raises(LogError, match="holds 2 scans"):
        read(out)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--object", "apple"), "There is no object 'apple'. Give one of lidded_container"),
        (("--object", "eraser:x"), "is no seed"),
        (("--object", ""), "There is no object ''."),  # it was an eraser
        # It stood outside of the area: all places were empty, and nothing said so.
        (("--object", "eraser:1", "--area", "60"), "eraser:1 doesn't fit into the scanned 60 x 60"),
        (("--area", "wide"), "is no area. Give mm: --area 200 or --area 120x80."),
        (("--step", "0.1"), "step_mm"),
        (("--area", "2000", "--step", "1"), "Give a longer step or a smaller area"),
        (("--step", "500"), "Give a shorter step"),  # it scanned a single place
        (("--tallest", "30"), "The simulator knows its own."),
        (("--mode", "paper", "--mode", "paper"), "A --mode is given twice."),
        (("--object", "coil", "--scene", "s.toml"), "exclude each other"),
        (("--scene", "nowhere.toml"), "can't be read"),
        (("--resume", "nowhere"), "holds no log"),
        (("--resume", "nowhere", "--step", "5"), "goes on with the settings"),
        # Nobody was told that these had no effect.
        (("--resume", "nowhere", "--force"), "goes on with the settings"),
        (("--resume", "nowhere", "--seed", "3"), "goes on with the settings"),
        (("--dry-run",), "Give --stage ur://ADDRESS too."),
    ],
)
def test_bad_input_is_told_in_one_line(
    arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    main_ends(1, "scan", "--sim", *arguments)
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_one_resume_does_all_that_the_run_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Modes that had not begun were never done, and a second --resume said that all was complete.
    out = tmp_path / "run"
    with monkeypatch.context() as pressed:
        pressed.setattr(live_map.LiveMap, "event", _ctrl_c_at("place", 2))
        main_ends(
            130, "scan", "--sim", "--object", "none", "--area", "40x20", "--step", "20",
            "--mode", "paper", "--mode", "safe", "--out", str(out), "--no-report",
        )  # fmt: skip
    assert f"`setae scan --resume {out}` does what is left." in capsys.readouterr().err
    # Again in the second, and so early that its log holds no scan.
    with monkeypatch.context() as pressed:
        pressed.setattr(rig.Rig, "record", _ctrl_c_after_second(rig.Rig.record))
        main_ends(130, "scan", "--resume", str(out), "--no-report")
    assert sorted(path.name for path in out.glob("*.mcap")) == [
        "paper-2.mcap", "paper.mcap", "safe.mcap",
    ]  # fmt: skip
    main_ends(0, "scan", "--resume", str(out), "--no-report")
    assert "mode safe" in capsys.readouterr().out
    scans = scans_of(record.read(path) for path in sorted(out.glob("*.mcap")))
    assert {read_parts(parts).mode: read_parts(parts).complete for parts in scans} == {
        "paper": True, "safe": True,
    }  # fmt: skip
    main_ends(1, "scan", "--resume", str(out))
    assert "is complete" in capsys.readouterr().err


def _interrupted(
    out: Path, monkeypatch: pytest.MonkeyPatch, *arguments: str, at: tuple[str, int] = ("place", 1)
) -> None:
    with monkeypatch.context() as pressed:
        pressed.setattr(live_map.LiveMap, "event", _ctrl_c_at(*at))
        main_ends(130, "scan", "--sim", "--out", str(out), "--force", "--no-report", *arguments)


def test_scans_of_two_runs_in_a_folder_go_on_each_with_its_own_settings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The first log's settings were taken for all: the orange was gone on with as a bare table.
    out = tmp_path / "run"
    _interrupted(out, monkeypatch, "--object", "orange:1", "--step", "100", "--mode", "paper")
    _interrupted(out, monkeypatch, "--object", "none", "--area", "20", "--step", "20",
                 "--mode", "adaptive", "--seed", "3")  # fmt: skip
    main_ends(0, "scan", "--resume", str(out), "--no-report")
    first, later = (record.read(out / f"paper{part}.mcap") for part in ("", "-2"))
    assert later.config == first.config
    assert later.metadata["seed"] == first.metadata["seed"] == 0
    assert later.metadata["scene"]["object"]["shape"] == "orange"
    assert read_parts([first, later]).complete
    assert record.read(out / "adaptive-2.mcap").metadata["seed"] == 3
    capsys.readouterr()
    # Their report named the orange for both, compared their times, and was alike to "nan%".
    scans = report.scan.scans(out)
    assert scan_notes.note(scans) == (
        "Orange, size 0.85 (paper) and an empty table (adaptive); simulated, plant ideal, seed 0 "
        "(paper) and simulated, plant ideal, seed 3 (adaptive)."
    )
    finding = scan_page.finding(scans)
    assert "the scans differ in: object, seed, places." in finding
    assert "of the time of the paper" not in finding
    assert "nan" not in scan_page._table(scans)


def test_a_mode_that_two_runs_asked_for_with_other_settings_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # It was scanned with the settings of whichever log came first by its name.
    out = tmp_path / "run"
    for mode, area in (("paper", "20"), ("adaptive", "40")):
        _interrupted(out, monkeypatch, "--object", "none", "--area", area, "--step", "20",
                     "--mode", mode, "--mode", "safe")  # fmt: skip
    capsys.readouterr()
    main_ends(1, "scan", "--resume", str(out), "--no-report")
    assert "adaptive.mcap and paper.mcap differ in settings" in capsys.readouterr().err
    main_ends(0, "scan", "--resume", str(out / "paper.mcap"), "--no-report")
    assert read_parts([record.read(out / f"paper{part}.mcap") for part in ("", "-2")]).complete
    assert not (out / "safe.mcap").exists()


def test_of_a_log_in_which_no_scan_had_begun_its_own_mode_is_done_and_none_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The run's other mode came first, and ended at its own log, which was there already. And
    # `setae report` of the folder said only that this log holds no scan.
    out = tmp_path / "run"
    with monkeypatch.context() as pressed:
        pressed.setattr(Robot, "enable", _ctrl_c_after_second(Robot.enable))
        main_ends(
            130, "scan", "--sim", "--object", "none", "--area", "20", "--step", "20",
            "--mode", "paper", "--mode", "safe", "--out", str(out), "--no-report",
        )  # fmt: skip
    capsys.readouterr()
    main_ends(0, "report", str(out))
    printed = capsys.readouterr()
    assert f"Left out: {out / 'safe.mcap'} holds no scan." in printed.err
    assert read(out).mode == "paper"
    main_ends(0, "scan", "--resume", str(out / "safe.mcap"), "--no-report")
    # It said that --force, which nobody had given, replaced the log.
    assert "--force" not in capsys.readouterr().out
    assert read_parts([record.read(out / "safe.mcap")]).complete
    assert not (out / "paper-2.mcap").exists()


def test_a_new_run_by_force_has_no_part_of_the_run_that_it_replaces(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The old run's second part stayed, and counted as that of the new one.
    out = tmp_path / "run"
    table = ("--object", "none", "--area", "20", "--step", "20", "--mode", "paper")
    _interrupted(out, monkeypatch, *table)
    main_ends(0, "scan", "--resume", str(out), "--no-report")
    stale = (out / "paper-2.mcap").read_bytes()
    capsys.readouterr()
    main_ends(0, "scan", "--sim", *table, "--out", str(out), "--force", "--no-report")
    printed = capsys.readouterr().out.replace("\n", "")
    for name in ("paper.mcap", "paper-2.mcap"):
        assert f"Replaced, because of --force: {out / name}" in printed
    assert [path.name for path in out.iterdir()] == ["paper.mcap"]
    # Put there by hand it is refused.
    (out / "paper-2.mcap").write_bytes(stale)
    with pytest.raises(LogError, match=r"paper-2\.mcap resumes another scan than"):
        read(out)


def _ctrl_c_at(name: str, count: int) -> Callable[[live_map.LiveMap, Event], None]:
    left = [count]

    def event(self: live_map.LiveMap, event: Event) -> None:
        del self
        left[0] -= event.name == name
        if left[0] == 0:
            raise KeyboardInterrupt

    return event


def _ctrl_c_after_second(call: Callable[..., Any]) -> Callable[..., Any]:
    count = 0

    def called(*arguments: Any, **options: Any) -> Any:
        nonlocal count
        count += 1
        result = call(*arguments, **options)
        if count == 2:
            raise KeyboardInterrupt
        return result

    return called


def test_a_start_inside_of_something_is_told_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The robot pressed 15 mm into the table; then came tare_far, and the advice to resume.
    scene = tmp_path / "scene.toml"
    scene.write_text("table_z_mm = -120.0\n")
    main_ends(1, "scan", "--sim", "--scene", str(scene), "--out", str(tmp_path / "run"))
    error = capsys.readouterr().err
    assert "reaches 15 mm into what is below the first place" in error
    assert "table_z_mm = -138" in error
    assert "resume" not in error
    assert not (tmp_path / "run").exists()


def test_a_scan_that_extends_less_than_the_robot_at_rest_goes_on_a_simulated_table(
    tmp_path: Path,
) -> None:
    # The table was put just below the scan's extended tip, and the robot at rest pressed into it.
    short = tmp_path / "robot.toml"
    short.write_text("[scan]\nextended_length_mm = 60\narea_mm = [20, 20]\nstep_mm = 20\n")
    out = tmp_path / "run"
    main_ends(0, "scan", "--sim", "--object", "none", "--config", str(short), "--out", str(out),
              "--no-report")  # fmt: skip
    assert set(read(out).height_map.mark.ravel()) == {"empty"}


def test_a_scan_that_felt_nothing_is_drawn_as_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Its report had a scale of colours from 0.9 to 3.0 mm, of nothing, and an error of "nan (0)".
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(style, "save", lambda figure, path, **_: drawn.update({path.stem: figure}))
    out = tmp_path / "run"
    main_ends(0, "scan", "--sim", "--object", "none", "--area", "20x20", "--step", "20",
              "--out", str(out), "--no-report")  # fmt: skip
    felt = report.scan.scans(out)
    scan_pictures.write_all(tmp_path, felt)
    assert {text.get_text() for axes in drawn["heights"].axes for text in axes.texts} == {
        "nothing touched", "nothing in reach",
    }  # fmt: skip
    for name in ("heights", "clouds"):
        assert not [axes for axes in drawn[name].axes if "height" in axes.get_ylabel()]
    assert "nan" not in scan_page._table(felt)


def test_a_real_scan_says_that_its_height_window_is_not_checked(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # The default height is the whole window, so the check passed whatever stood there.
    main_ends(1, "scan", "--port", "/dev/null")
    assert "Nobody said how tall the object is" in capsys.readouterr().err
    for tallest, said in (("30", ""), ("45", ""), ("300", "Raise the arm's start by 255 mm")):
        main_ends(1, "scan", "--port", "/dev/null", "--tallest", tallest)
        error = capsys.readouterr().err
        assert said in error
        assert "Nobody said" not in error


def test_an_object_that_stands_beside_the_scanned_square_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # All places were empty, and nothing said why.
    scene = tmp_path / "scene.toml"
    for x_mm, told in ((300.0, True), (210.0, False)):
        scene.write_text(f'[object]\nshape = "orange"\nx_mm = {x_mm}\n')
        main_ends(1, "scan", "--sim", "--scene", str(scene), "--plant", "none")
        assert ("beside the scanned 200 x 200 mm" in capsys.readouterr().err) == told


def test_a_scene_without_its_table_has_it_low_enough_for_what_stands_on_it(
    tmp_path: Path,
) -> None:
    # It lay as if nothing stood on it, and a tall object was refused.
    scene = tmp_path / "scene.toml"
    scene.write_text('[object]\nshape = "orange"\nscale = 1.0\nx_mm = 80\ny_mm = 0\nyaw_deg = 0\n')
    out = tmp_path / "run"
    main_ends(
        0, "scan", "--sim", "--scene", str(scene), "--area", "80x40", "--step", "40", "--out",
        str(out), "--no-report",
    )  # fmt: skip
    assert record.read(out / "paper.mcap").metadata["scene"]["table_z_mm"] == -158.0


def three_places(live: live_map.LiveMap) -> None:
    """Events of a scan that knows one of four places, and finds the others."""
    live.event(Event(time_us=0, name="scan_start", data={"columns": 4, "rows": 1, "known": 1}))
    for column, mark, height_mm in ((1, "lost", None), (2, "empty", None), (3, "felt", -100.0)):
        place = {"column": column, "row": 0, "x_mm": 10.0 * column, "y_mm": 0.0, "mark": mark,
                 "height_mm": height_mm, "uncertainty_mm": None}  # fmt: skip
        known = {"known": column + 1, "total": 4}
        time_us = 50_000_000 + 5_000_000 * column
        live.event(Event(time_us=time_us, name="place", data={**place, **known}))


@pytest.mark.parametrize("terminal", ["xterm", "dumb"])
def test_the_map_grows_in_a_terminal(terminal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setenv("TERM", terminal)
    monkeypatch.setattr(live_map, "console", Console(file=screen, force_terminal=True, width=100))
    monkeypatch.setattr(live_map, "_REDRAW_S", 0.0)
    with live_map.LiveMap() as live:
        three_places(live)
    drawn = screen.getvalue()
    # The way to a resumed run's first place counted as a place's: hours were left.
    assert re.search(r"50%  2 of 4 places, 0 touched, 0:55 robot time\s", drawn)
    # Where nothing can be drawn anew, nothing was told.
    assert "75%  3 of 4 places, 0 touched, 1:00 robot time, about 0:05 left" in drawn
    assert "100%  4 of 4 places, 1 touched" in drawn
    assert ("L " in drawn) == (terminal == "xterm"), "a lost contact is flagged"


def test_a_real_robot_has_no_object(capsys: pytest.CaptureFixture[str]) -> None:
    main_ends(1, "scan", "--port", "/dev/null", "--object", "coil")
    assert "for the simulator" in capsys.readouterr().err
