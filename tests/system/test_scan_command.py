"""`setae scan`: what it writes, what it shows, what it refuses."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from rich.console import Console

from setae import report
from setae.cli import live_map, main
from setae.errors import LogError
from setae.experiments.events import Event
from setae.experiments.scan import read


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


def test_the_map_grows_in_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    terminal = Console(file=screen, force_terminal=True, width=100)
    monkeypatch.setattr(live_map, "console", terminal)
    monkeypatch.setattr(live_map, "_REDRAW_S", 0.0)
    with live_map.LiveMap() as live:
        live.event(Event(time_us=0, name="scan_start", data={"columns": 2, "rows": 1, "known": 0}))
        for column, mark, height_mm in ((0, "lost", None), (1, "felt", -100.0)):
            place = {"column": column, "row": 0, "x_mm": 10.0 * column, "y_mm": 0.0, "mark": mark,
                     "height_mm": height_mm, "uncertainty_mm": None}  # fmt: skip
            known = {"known": column + 1, "total": 2}
            live.event(Event(time_us=5_000_000, name="place", data={**place, **known}))
    drawn = screen.getvalue()
    assert "50%  1 of 2 places, 0 touched, 0:05 robot time, about 0:05 left" in drawn
    assert "100%  2 of 2 places, 1 touched" in drawn
    assert "L " in drawn, "a lost contact is flagged"


def test_a_real_robot_has_no_object(capsys: pytest.CaptureFixture[str]) -> None:
    main_ends(1, "scan", "--port", "/dev/null", "--object", "coil")
    assert "for the simulator" in capsys.readouterr().err
