"""`setae explore` at a serial port: a board that keeps real time, and a person who answers."""

from __future__ import annotations

import os
import select
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from setae import record
from setae.cli import main
from setae.sim import World

# One direction of one level, and no longer than it has to be.
SHORT = """
[explore]
steps = 1
directions = 1
extend_duration_s = 0.3
retract_duration_s = 0.3
[motion]
relax_speed_mm_s = 100.0
"""


@contextmanager
def board_at_a_port() -> Iterator[str]:
    """The simulated board behind a pseudo terminal; yields the port's name."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    over = threading.Event()

    def run() -> None:
        with World(seed=1) as world:
            world.start()
            began_s = time.monotonic()
            while not over.is_set():
                if select.select([ours], [], [], 0.002)[0]:
                    world.send(os.read(ours, 4096))
                now_us = round((time.monotonic() - began_s) * 1e6)
                while data := world.run(now_us):
                    os.write(ours, data)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        over.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


def explore(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, *more: str
) -> tuple[int, Path]:
    """Run it with these keys pressed, then the end of the input; exit code and folder."""
    config = tmp_path / "short.toml"
    config.write_text(SHORT)
    keys = tmp_path / "keys"
    keys.write_text(typed)
    out = tmp_path / "out"
    with board_at_a_port() as port, keys.open() as keyboard:
        monkeypatch.setattr(sys, "stdin", keyboard)
        with pytest.raises(SystemExit) as ended:
            main(["explore", "--port", port, "--config", str(config), "--obstacle", "none",
                  "--out", str(out), "--no-report", *more])  # fmt: skip
    assert isinstance(ended.value.code, int)
    return ended.value.code, out


def test_a_person_places_the_robot_and_moves_the_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = explore(tmp_path, monkeypatch, "\n\n\n", "--accept-jump")
    printed = capsys.readouterr()
    assert code == 0, printed.err
    asked = [line for line in printed.out.splitlines() if "press Enter" in line]
    assert len(asked) == 3
    assert "bring the arm to its start" in asked[0]
    assert "z -20 mm" in asked[1]
    log = record.read(out / "trial-1.mcap")
    assert not log.simulated
    assert log.events("trial_end")[0].data["descent_mm"] == 20.0


def test_the_end_of_the_input_is_one_line_and_keeps_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A prompt used to end in a traceback where nobody could answer it."""
    code, out = explore(tmp_path, monkeypatch, "\n", "--accept-jump")
    lines = capsys.readouterr().err.splitlines()
    assert code == 1
    assert len(lines) == 1
    assert "press Enter" in lines[0]
    assert "trial-1.mcap" in lines[0]
    log = record.read(out / "trial-1.mcap")
    assert log.damage is None
    assert log.array("/telemetry", "state")[-1] == "stopped"
    assert log.events("trial_aborted")


def test_nobody_there_at_all_moves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = explore(tmp_path, monkeypatch, "")
    assert code == 1
    assert "press Enter" in capsys.readouterr().err
    assert list(out.iterdir()) == []
