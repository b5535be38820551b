"""The host's end of the process in which the UR library lives (`setae.ur.child`).

A call into the library may wait for a controller that has died: for minutes, and nothing
can interrupt it. So whoever waits for a call has a deadline, and ends the process.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import Final, Literal

from setae.config import Ur
from setae.errors import ArmFrozenError, StageError
from setae.ur.controller import ArmState

__all__ = ["ArmProcess", "Job"]

_MODULE: Final = "setae.ur.child"
_END_TIMEOUT_S: Final = 1.0

Method = Literal["connect", "move", "rest", "brake", "kick_watchdog", "close"]


class Job:
    """A call that was handed to the process.

    Attributes
    ----------
    what
        For messages: what the call asks of the arm.
    submitted_s
        When, by the host's clock.
    """

    def __init__(self, what: str, submitted_s: float) -> None:
        self.what: Final = what
        self.submitted_s: Final = submitted_s
        self._done = threading.Event()
        self._error: Exception | None = None

    @property
    def done(self) -> bool:
        """Whether the call has come back."""
        return self._done.is_set()

    def check(self) -> None:
        """Raise what it raised. Only once it is done."""
        if self._error is not None:
            raise self._error

    def wait(self, timeout_s: float) -> None:
        """Wait for it, and raise what it raised.

        Raises
        ------
        ArmFrozenError
            It did not come back in time.
        """
        if not self._done.wait(timeout_s):
            raise ArmFrozenError(
                f"The arm's controller did not answer within {timeout_s:g} s: {self.what}."
            )
        self.check()

    def finish(self, error: Exception | None) -> None:
        """It came back; the reading thread says so."""
        self._error = error
        self._done.set()


class ArmProcess:
    """A process that makes one call of `Controller` after the other, and tells the arm's states.

    Parameters
    ----------
    host
        The controller's address.
    settings
        What the controller is told.
    clock
        Seconds, of the host.

    Raises
    ------
    StageError
        It can't be started.

    Attributes
    ----------
    ended : str or None
        Why the process is no more; None as long as it lives.
    """

    def __init__(self, host: str, settings: Ur, clock: Callable[[], float]) -> None:
        self._state: ArmState | None = None
        self.ended: str | None = None
        self._clock = clock
        self._numbers = itertools.count()
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()  # of jobs and ended
        self._printed = tempfile.TemporaryFile()  # noqa: SIM115  # as long as the process lives
        # -P, and no "" in the path: a file in a notebook's folder can't stand in for a module. The
        # group of its own: Ctrl-C in a terminal or a notebook is for the host alone.
        try:
            self._process = subprocess.Popen(
                [sys.executable or "", "-P", "-m", _MODULE],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._printed,
                process_group=0,
            )
        except OSError as error:
            self._printed.close()
            raise StageError(
                f"The process that talks to the arm's controller can't be started: {error}.",
                "It needs the Python that sys.executable names.",
            ) from error
        assert self._process.stdin is not None
        self._calls = self._process.stdin.fileno()
        # A process that takes no calls must not hold up the host.
        os.set_blocking(self._calls, False)
        self._write((host, settings))
        self._reader = threading.Thread(target=self._read, name="setae-arm", daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    @property
    def told_s(self) -> float | None:
        """The controller's time when it last told; None where it never did."""
        return None if self._state is None else self._state.timestamp_s

    @property
    def state(self) -> ArmState:
        """What the controller last told; only once it has."""
        assert self._state is not None
        return self._state

    def submit(self, what: str, method: Method, *arguments: object) -> Job:
        """Have a method of `Controller` called after those before it; returns at once."""
        job = Job(what, self._clock())
        with self._lock:
            if self.ended is not None:
                job.finish(ArmFrozenError(self.ended))
                return job
            number = next(self._numbers)
            self._jobs[number] = job
            self._write((number, method, arguments))
        return job

    def _write(self, call: tuple[object, ...]) -> None:
        # It fails where the process has ended, which the reading thread tells, and where the pipe
        # is full of calls that were never taken, which the deadline of any of them tells.
        with contextlib.suppress(OSError):
            os.write(self._calls, pickle.dumps(call))

    def _read(self) -> None:
        # A fork of the host may hold the pipe open: nobody but this thread can wait for that.
        assert self._process.stdout is not None
        with self._printed, self._process.stdout as pipe:
            with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):
                while True:
                    self._hear(pickle.load(pipe))
            self._end(
                f"The process that talks to the arm's controller ended: {self._last_words()}."
            )

    def _hear(self, told: ArmState | tuple[int, Exception | None]) -> None:
        if isinstance(told, ArmState):
            self._state = told
        else:
            number, error = told
            self._jobs.pop(number).finish(error)

    def _end(self, why: str) -> None:
        with self._lock:
            self.ended = self.ended or why
            jobs = list(self._jobs.values())
        for job in jobs:
            job.finish(ArmFrozenError(self.ended))

    def _last_words(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_TIMEOUT_S)
        code = self._process.returncode
        self._printed.seek(0)
        lines = self._printed.read().decode(errors="replace").split("\n")
        said = [line.strip() for line in lines if line.strip()]
        return f"exit code {code}" + (f", {said[-1]}" if said else "")

    def kill(self) -> None:
        """End it, whatever it does; returns at once."""
        self._process.kill()

    def close(self) -> None:
        """End it, and let go of its pipes. Closing twice is fine."""
        self.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_TIMEOUT_S)
        self._reader.join(_END_TIMEOUT_S)
        # From here on nothing is written: the pipe's number may be another file's.
        self._end("The process that talks to the arm's controller was ended.")
        assert self._process.stdin is not None
        self._process.stdin.close()
