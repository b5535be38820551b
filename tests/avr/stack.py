"""How deep the firmware's stack gets, over all tests that can run on the simulated UNO.

python -m pytest -p tests.avr.stack tests/avr tests/system/test_both_boards.py

With SETAE_TEST_BACK_END=avr tests of the robot that are else run on the simulator of every day are
run there, too: see `_ROBOT_TESTS`.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from tests.avr.simavr import CYCLES_PER_US, FIRMWARE, ROOT, Uno
from tests.system.robots import BACK_END_VARIABLE

# Names the file for the figure, where one is wanted.
_FILE_VARIABLE = "SETAE_STACK_FILE"
_TESTS = ("tests/avr", "tests/system/test_both_boards.py")
_KNOWS_ITS_POSE = (
    "tests/system/test_robot_sim.py::test_a_pose_left_outside_of_the_limits_is_told_with_a_way_out"
)
_ROBOT_TESTS = (
    "tests/system/test_robot_sim.py",
    "tests/system/test_robot_ways.py",
    "tests/system/test_lossy_link.py",
    # An UNO that was just switched on does not.
    f"--deselect={_KNOWS_ITS_POSE}",
)

_deepest_bytes = 0
_boards = 0
_time_s = 0.0
_close = Uno.close


def _note_and_close(uno: Uno) -> None:
    global _deepest_bytes, _boards, _time_s
    if not uno.closed and uno.firmware == FIRMWARE:
        _deepest_bytes = max(_deepest_bytes, uno.statistics().stack_bytes)
        _boards += 1
        _time_s += uno.cycle / (1e6 * CYCLES_PER_US)
    _close(uno)


def pytest_configure(config: pytest.Config) -> None:
    """Look at each board as it is let go of."""
    del config
    setattr(Uno, "close", _note_and_close)  # noqa: B010  # no type says that it may be


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say it, and write it down where that was asked for."""
    terminalreporter.write_line(
        f"deepest stack {_deepest_bytes} bytes, of {_boards} boards in {_time_s:.1f} s of theirs"
    )
    if file := os.environ.get(_FILE_VARIABLE):
        Path(file).write_text(f"{_deepest_bytes} {_boards}\n")


def deepest_in_tests() -> tuple[int, int]:
    """Run the tests, and return the deepest stack in bytes, and of how many boards."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "stack"
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "tests.avr.stack", *_TESTS, *_ROBOT_TESTS],
            cwd=ROOT, check=True, capture_output=True,
            env={**os.environ, _FILE_VARIABLE: str(file), BACK_END_VARIABLE: "avr"},
        )  # fmt: skip
        deepest_bytes, boards = file.read_text().split()
        return int(deepest_bytes), int(boards)
