"""A fake controller as a process of its own, so that it can freeze and die."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from setae.config import Ur

_ROOT = Path(__file__).parents[2]
_READY_TIMEOUT_S = 30
# ur-rtde can't be told a port: each controller has an address of its own.
_addresses = (f"127.7.{os.getpid() % 250 + 1}.{last}" for last in itertools.count(1))


def boxed(settings: Ur) -> Ur:
    """With a box around where the stand-in stands."""
    return dataclasses.replace(
        settings, box_min_mm=(-850.0, -850.0, 50.0), box_max_mm=(850.0, 850.0, 1050.0)
    )


def patient(settings: Ur) -> Ur:
    """For a busy machine, on which the stand-in may get no turn for a while; with a box."""
    return dataclasses.replace(
        boxed(settings), state_age_s=5.0, command_deadline_s=20.0, watchdog_hz=0.5
    )


class FakeController:
    """A running fake; its `url` is what `--stage` takes."""

    def __init__(self) -> None:
        self.address = next(_addresses)
        self.url = f"ur://{self.address}"
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.ur.fake_controller", self.address],
            cwd=_ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._line() == "ready\n"

    def _line(self) -> str:
        assert self._process.stdout is not None
        readable, _, _ = select.select([self._process.stdout], [], [], _READY_TIMEOUT_S)
        assert readable
        return self._process.stdout.readline()

    def told(self) -> dict[str, Any]:
        """What it was told, and where its flange is; see `Fake.told`."""
        self.tell("tell")
        told: dict[str, Any] = json.loads(self._line())
        return told

    def tell(self, line: str) -> None:
        """Have something go wrong; see `Fake.obey`."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def freeze(self) -> None:
        """It keeps its connections, and neither answers nor moves."""
        self._process.send_signal(signal.SIGSTOP)

    def close(self) -> None:
        """It dies."""
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGCONT)
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):
                pipe.close()


@contextlib.contextmanager
def controller() -> Iterator[FakeController]:
    fake = FakeController()
    try:
        yield fake
    finally:
        fake.close()
