"""`setae calibrate bristle`: moves, touches, and the threshold between them."""

from __future__ import annotations

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.system.serial_board import SerialBoard

from setae import record, rig
from setae.cli import main
from setae.config import load
from setae.errors import InputError
from setae.experiments.bristle import Bristle, Move, Threshold, moves_in, surface_mm, threshold
from setae.report import style
from setae.scene import open_scene
from setae.sim import World

RAISED_MM = 30.0


def moved(*peaks_hpa: float, touched: bool) -> list[Move]:
    depth_mm = 4.0 if touched else math.nan
    return [
        Move(touched=touched, duration_s=1.0, depth_mm=depth_mm, peak_hpa=peak)
        for peak in peaks_hpa
    ]


def test_moves_and_touches_part_near_the_papers_threshold_and_give_a_usable_fragment(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    drawn: list[Any] = []
    save = style.save

    def draw(figure: Any, path: Any) -> None:
        drawn.append(figure)
        save(figure, path)

    monkeypatch.setattr(style, "save", draw)
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", "bristle", "--sim", "--moves", "12", "--touches", "8",
              "--out", str(out)])  # fmt: skip
    assert ended.value.code == 0, capsys.readouterr().err
    moves = moves_in(record.read(out / "bristle.mcap"))
    assert [sum(move.touched == kind for move in moves) for kind in (False, True)] == [12, 8]
    chosen = threshold(moves)
    assert (chosen.false, chosen.missed) == (0, 0)
    # The paper's lies in the gap too, on the side of the lighter touch.
    papers = Threshold.of(15.0, moves)
    assert (papers.false, papers.missed) == (0, 0)
    assert 8 < chosen.hpa < 20
    # The fragment is a configuration as it is.
    assert load(out / "bristle.toml").bristle.threshold_hpa == pytest.approx(chosen.hpa, abs=0.06)
    page = (out / "report.html").read_text()
    assert "0 of 12 moves without contact" in page
    # Any threshold in the gap does as well: the picture called this one the best.
    assert f"Every threshold in between parts them; {chosen.hpa:g} hPa is recommended" in page
    assert f"{chosen.hpa:g}</b> (recommended)" in page
    assert f"recommended: {chosen.hpa:g} hPa" in drawn[0].axes[0].get_legend_handles_labels()[1]
    # Its few moves were counted as "6 × 10⁰".
    histogram = drawn[0].axes[0]
    ticks = [*histogram.get_yticklabels(), *histogram.get_yticklabels(minor=True)]
    assert "1" in {tick.get_text() for tick in ticks}
    assert not any("10^" in tick.get_text() for tick in ticks)
    assert len((out / "moves.csv").read_text().splitlines()) == 21
    # The robot was left alone with nothing in its way.
    assert record.read(out / "bristle.mcap").array("/telemetry", "state")[-1] == "relaxed"


def test_a_touch_begins_off_the_surface_though_the_robot_froze_on_its_way_up() -> None:
    """One in four hundred began where the last had frozen: so little was left to feel."""
    config = load()
    watchful = dataclasses.replace(config.bristle, coarse_threshold_hpa=25.0)
    config = dataclasses.replace(config, bristle=watchful)
    scene = open_scene(surface_mm(config))
    with rig.open("sim://", config=config, seed=3, scene=scene, leave="hold") as opened:
        opened.robot.enable()
        touches = Bristle(opened.robot, seed=3).touches(4)
    assert min(touch.peak_hpa for touch in touches) > 20


def test_a_board_at_a_port_and_a_person_who_puts_something_below_it(tmp_path: Path) -> None:
    """In real time, as with hardware: no simulator is seen from the command."""
    config = load()
    floor_mm = -(surface_mm(config) + RAISED_MM)
    out = tmp_path / "run"
    with World(seed=1) as world:
        world.add_box((0.0, 0.0, floor_mm - 10.0), (200.0, 200.0, 20.0))
        world.start()
        with SerialBoard(world) as board:
            command = subprocess.Popen(
                [sys.executable, "-u", "-m", "setae.cli", "calibrate", "bristle", "--port",
                 board.port, "--accept-jump", "--moves", "2", "--touches", "2", "--no-report",
                 "--out", str(out)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "400"},
            )  # fmt: skip
            assert command.stdin is not None
            assert command.stdout is not None
            asked = []
            for line in command.stdout:
                if "press Enter" not in line:
                    continue
                asked.append(line)
                if "Put something flat" in line:
                    board.do(lambda: world.arm_move((0.0, 0.0, -RAISED_MM), 200.0, 2000.0))
                elif "Take it away" in line:
                    board.do(lambda: world.arm_move((0.0, 0.0, 0.0), 200.0, 2000.0))
                board.do_when(lambda: not world.arm_moving)
                command.stdin.write("\n")
                command.stdin.flush()
            _, errors = command.communicate()
    assert command.returncode == 0, errors
    assert len(asked) == 3
    assert "15 mm below the bristle's tip" in asked[1]
    log = record.read(out / "bristle.mcap")
    assert not log.simulated
    moves = moves_in(log)
    assert [sum(move.touched == kind for move in moves) for kind in (False, True)] == [2, 2]
    chosen = threshold(moves)
    assert (chosen.false, chosen.missed) == (0, 0)
    assert "this robot" in (out / "bristle.toml").read_text()


def test_where_the_two_kinds_overlap_the_threshold_makes_the_fewest_errors() -> None:
    moves = moved(2, 4, 6, 8, 20, touched=False) + moved(10, 22, 24, 26, 28, touched=True)
    chosen = threshold(moves)
    assert 8 < chosen.hpa <= 22
    assert chosen.false + chosen.missed == 1
    now = Threshold.of(15.0, moves)
    assert (now.false_rate, now.missed_rate) == (0.2, 0.2)


def test_one_kind_alone_gives_no_threshold() -> None:
    with pytest.raises(InputError, match="Measure both"):
        threshold(moved(2, 4, touched=False))
