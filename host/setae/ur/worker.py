"""Calls that may hang, made where they can't block the robot.

A call into the UR library may wait for a controller that has died: for minutes, and
nothing can interrupt it. So one thread makes them, and whoever waits for a call has a
deadline.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from setae.errors import ArmFrozenError

__all__ = ["Job", "Worker"]

_Result = TypeVar("_Result")


class Job(Generic[_Result]):
    """A call that was handed to the worker.

    Attributes
    ----------
    what
        For messages: what the call asks of the arm.
    submitted_s
        When, by the worker's clock.
    """

    def __init__(self, what: str, call: Callable[[], _Result], submitted_s: float) -> None:
        self.what: Final = what
        self.submitted_s: Final = submitted_s
        self._call = call
        self._done = threading.Event()
        self._results: list[_Result] = []
        self._error: Exception | None = None

    @property
    def done(self) -> bool:
        """Whether the call has come back."""
        return self._done.is_set()

    def result(self) -> _Result:
        """What it returned; raises what it raised. Only once it is done."""
        if self._error is not None:
            raise self._error
        return self._results[0]

    def wait(self, timeout_s: float) -> _Result:
        """Wait for it.

        Raises
        ------
        ArmFrozenError
            It did not come back in time.
        """
        if not self._done.wait(timeout_s):
            raise ArmFrozenError(
                f"The arm's controller did not answer within {timeout_s:g} s: {self.what}."
            )
        return self.result()

    def run(self) -> None:
        """Make the call; the worker's thread does."""
        try:
            self._results.append(self._call())
        except Exception as error:  # whoever looks at the job raises it
            self._error = error
        self._done.set()


class Worker:
    """One thread that makes one call after the other."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._jobs: queue.SimpleQueue[Job[object] | None] = queue.SimpleQueue()
        # A daemon: a call that hangs must not keep the program from ending.
        threading.Thread(target=self._run, name="setae-arm", daemon=True).start()

    def submit(self, what: str, call: Callable[[], _Result]) -> Job[_Result]:
        """Have a call made after those before it; returns at once."""
        job: Job[_Result] = Job(what, call, self._clock())
        self._jobs.put(job)  # type: ignore[arg-type]  # nobody asks the queue for the result
        return job

    def close(self) -> None:
        """End the thread after the calls that it has."""
        self._jobs.put(None)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job.run()
