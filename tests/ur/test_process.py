"""The process in which the UR library lives: what it keeps from the host, and when it ends."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest
from tests.ur.controller import FakeController, controller
from tests.ur.driving import (
    TIMEOUT_S,
    connected,
    far_on_its_way,
    poll_until,
    wait_until,
    with_ur,
)

from setae.errors import ArmFrozenError, StageError
from setae.ur import UrStage

# As a user's script is: without a guard against being imported.
SCRIPT = """
import sys
from setae.ur import UrStage
from tests.ur.driving import poll_until, with_ur

stage = UrStage(sys.argv[1], with_ur(watchdog_hz=1.0))
stage.move_to((0, 0, float(sys.argv[2])), speed_mm_s=20)
if sys.argv[2] == "-1":
    poll_until(stage, lambda: not stage.moving)
try:
    print(stage._process.pid, flush=True)
    poll_until(stage, lambda: False)
except KeyboardInterrupt:
    stage.stop()
    poll_until(stage, lambda: not stage.moving)
    print("rests", flush=True)
"""


def line(pipe: IO[str]) -> str:
    readable, _, _ = select.select([pipe], [], [], TIMEOUT_S)
    assert readable
    return pipe.readline()


@contextmanager
def script(fake: FakeController, z_mm: str = "-300") -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT, fake.url, z_mm],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # as in a terminal, a group that hears Ctrl-C
    ) as host:
        try:
            yield host
        finally:
            host.kill()


@pytest.mark.parametrize("happens", [FakeController.freeze, FakeController.close])
def test_a_lost_controller_is_looked_for_by_nobody(
    fake: FakeController,
    happens: Callable[[FakeController], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The library's threads went on looking for it: they took Python's lock from the next stage
    of the same program, and printed lines of their own into notebooks and progress bars.
    """
    with controller() as lost:
        with connected(lost, state_age_s=1.0) as stage:
            stage.move_to((0, 0, -80))
            poll_until(stage, lambda: far_on_its_way(stage))
            happens(lost)
            with pytest.raises(StageError):
                poll_until(stage, lambda: False)
        with connected(fake, state_age_s=1.0, command_deadline_s=2.0) as stage:
            stage.move_to((0, 0, -5))
            poll_until(stage, lambda: not stage.moving)
    assert capfd.readouterr() == ("", "")


def test_a_controller_that_freezes_while_it_is_connected_to_holds_up_nobody(
    fake: FakeController, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library waits for it with Python's lock held: the whole program stood still for ever,
    whatever its deadline.
    """
    with controller() as mute, monkeypatch.context() as quick:
        mute.tell("mute")
        quick.setattr("setae.ur.stage._CONNECT_TIMEOUT_S", 3.0)
        with pytest.raises(ArmFrozenError, match="did not answer within 3 s: connecting"):
            UrStage(mute.url, with_ur())
    with connected(fake):
        pass


def test_a_python_that_is_not_to_be_found_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program with Python inside has none: a traceback from the standard library told so."""
    monkeypatch.setattr(sys, "executable", "")
    with pytest.raises(StageError, match="can't be started"):
        UrStage("ur://127.0.0.250", with_ur())


def test_a_library_that_ends_is_told(fake: FakeController) -> None:
    """Without it nobody would brake, or say why."""
    with connected(fake) as stage:
        stage.move_to((0, 0, -80))
        poll_until(stage, lambda: far_on_its_way(stage))
        os.kill(stage._process.pid, signal.SIGKILL)
        with pytest.raises(ArmFrozenError, match=r"process that talks to .* ended") as caught:
            poll_until(stage, lambda: False)
        assert "exit code -9" in caught.value.problem
        with pytest.raises(ArmFrozenError):
            stage.stop()


def test_closing_does_not_wait_for_a_fork_that_holds_the_pipe(fake: FakeController) -> None:
    """The reading thread held the pipe's lock for as long as anybody could write into it."""
    with connected(fake) as stage:
        pipe = stage._process._process.stdout
        assert pipe is not None
        number = os.fstat(pipe.fileno()).st_ino
        opened = Path(f"/proc/{stage._process.pid}/fd").iterdir()
        held = os.open(next(fd for fd in opened if fd.stat().st_ino == number), os.O_WRONLY)
        try:
            stage.close()
        finally:
            os.close(held)
        with pytest.raises(ArmFrozenError, match="was ended"):
            stage._process.submit("a stop", "brake", 200.0).wait(TIMEOUT_S)


def test_a_library_that_hangs_holds_up_nobody(fake: FakeController) -> None:
    with connected(fake, state_age_s=1.0) as stage:
        os.kill(stage._process.pid, signal.SIGSTOP)
        with pytest.raises(ArmFrozenError, match="has told nothing for"):
            poll_until(stage, lambda: False)


@pytest.mark.parametrize("z_mm", ["-300", "-1"], ids=["moving", "resting"])
def test_a_host_that_is_killed_takes_the_library_along(fake: FakeController, z_mm: str) -> None:
    """A process that outlived it could go on telling the controller that the host lives."""
    with script(fake, z_mm) as host:
        assert host.stdout is not None
        library = os.pidfd_open(int(line(host.stdout)))
        try:
            host.kill()
            ended, _, _ = select.select([library], [], [], TIMEOUT_S)
            assert ended
        finally:
            os.close(library)
    wait_until(lambda: not fake.told()["playing"])  # nobody feeds the controller's watchdog


def test_ctrl_c_leaves_the_host_an_arm_that_it_can_brake(fake: FakeController) -> None:
    """It reaches every process of a terminal's or notebook's group."""
    with script(fake) as host:
        assert host.stdout is not None
        line(host.stdout)
        os.killpg(host.pid, signal.SIGINT)
        assert line(host.stdout) == "rests\n"
        assert host.wait(TIMEOUT_S) == 0
    assert fake.told()["brake"] == pytest.approx(0.2)
