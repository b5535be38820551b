"""The process in which the UR library lives; `setae.ur.process` starts it.

    python -m setae.ur.child

Its threads go on looking for a controller that is gone, some of its calls hang with
Python's lock held, and it prints: none of that reaches whoever drives the arm, and all of
it ends with this process.

Standard input brings pickles: the controller's address and the settings, then calls, each
as number, method of `Controller` and arguments. Standard output takes pickles: an
`ArmState` each time that the controller has told a new one, and for each call its number
and what it raised, or None. Nothing is said to the controller that was not asked for.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import sys
import threading
import time
from typing import Any, BinaryIO, Final

from setae.errors import ArmFrozenError
from setae.ur.controller import ArmState, Controller

_PERIOD_S: Final = 0.002
# A call that hangs with Python's lock held leaves nobody to see that the host has ended: then
# the kernel ends this process. Longer than the host ever waits for such a call.
_LEASE_S: Final = 20


class _Told:
    """The way back to the host."""

    def __init__(self, pipe: BinaryIO) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def tell(self, what: tuple[int, Exception | None] | ArmState) -> None:
        """Wait until the host has room for it."""
        with self._lock:
            self._write(what)

    def offer(self, state: ArmState) -> None:
        """Drop it where the host stands still: the next one is as good, and the lease runs."""
        if not self._lock.acquire(blocking=False):
            return
        try:
            if select.select([], [self._pipe], [], 0)[1]:
                self._write(state)
        finally:
            self._lock.release()

    def _write(self, what: tuple[int, Exception | None] | ArmState) -> None:
        pickle.dump(what, self._pipe)
        self._pipe.flush()


def _watch(controller: Controller, told: _Told, connected: threading.Event, host: int) -> None:
    """Tell each new state, until the host has ended."""
    last_s: float | None = None
    while os.getppid() == host:
        signal.alarm(_LEASE_S)
        time.sleep(_PERIOD_S)
        if not connected.is_set():
            continue
        try:
            state = controller.state()
        except ArmFrozenError:  # the library has none: the host sees that nothing comes
            continue
        if state.timestamp_s != last_s:
            last_s = state.timestamp_s
            told.offer(state)
    os._exit(0)


def _serve(calls: BinaryIO, told: _Told, host: int) -> None:
    """Make one call after the other, until the host has ended."""
    controller = Controller(*pickle.load(calls))
    connected = threading.Event()
    watching: tuple[Any, ...] = (controller, told, connected, host)
    threading.Thread(target=_watch, args=watching, daemon=True).start()
    while True:
        number, method, arguments = pickle.load(calls)
        failure: Exception | None = None
        try:
            getattr(controller, method)(*arguments)
        except Exception as error:  # whoever waits for the call raises it
            failure = error
        if method == "connect" and failure is None:
            connected.set()
        told.tell((number, failure))


def main() -> None:
    """Live until the host closes the pipe, ends, or ends this process."""
    host = os.getppid()
    # What the library prints must not come between what is told.
    with os.fdopen(os.dup(1), "wb") as pipe:
        os.dup2(2, 1)
        try:
            _serve(sys.stdin.buffer, _Told(pipe), host)
        except (EOFError, BrokenPipeError):
            os._exit(0)  # the library's threads would hold up an ordinary end


if __name__ == "__main__":
    main()
