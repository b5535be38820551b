"""`setae calibrate bristle`: moves, touches, and the threshold between them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from setae import record
from setae.cli import main
from setae.config import load
from setae.errors import InputError
from setae.experiments.bristle import Move, Threshold, moves_in, threshold


def moved(*peaks_hpa: float, touched: bool) -> list[Move]:
    depth_mm = 4.0 if touched else math.nan
    return [
        Move(touched=touched, duration_s=1.0, depth_mm=depth_mm, peak_hpa=peak)
        for peak in peaks_hpa
    ]


def test_moves_and_touches_part_near_the_papers_threshold_and_give_a_usable_fragment(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", "bristle", "--sim", "--moves", "12", "--touches", "8",
              "--out", str(out)])  # fmt: skip
    assert ended.value.code == 0, capsys.readouterr().err
    moves = moves_in(record.read(out / "bristle.mcap"))
    assert [sum(move.touched == kind for move in moves) for kind in (False, True)] == [12, 8]
    chosen = threshold(moves)
    assert (chosen.false, chosen.missed) == (0, 0)
    assert 10 < chosen.hpa < 20
    # The fragment is a configuration as it is.
    assert load(out / "bristle.toml").bristle.threshold_hpa == pytest.approx(chosen.hpa, abs=0.06)
    page = (out / "report.html").read_text()
    assert "0 of 12 moves without contact" in page
    assert len((out / "moves.csv").read_text().splitlines()) == 21
    # The robot was left alone with nothing in its way.
    assert record.read(out / "bristle.mcap").array("/telemetry", "state")[-1] == "relaxed"


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
