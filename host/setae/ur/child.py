"""The process in which the UR library lives; `setae.ur.process` starts it.

    python -m setae.ur.child

Its threads go on looking for a controller that is gone, some of its calls hang with
Python's lock held, and it prints: none of that reaches whoever drives the arm, and all of
it ends with this process.

Standard input brings pickles: the controller's address and the settings, then calls, each
as number, method of `Controller` and arguments. Standard output takes pickles: an
`ArmState` each time that the controller has told a new one, and for each call its number
and what it raised, or None. Nothing is said to the controller that was not asked for, but
for one thing: as long as the arm rests and the host lives, its watchdog is fed. So a program
that ends at rest was stopped by somebody, however long the host thinks.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import select
import signal
import sys
import threading
import time
import traceback
from typing import Any, BinaryIO, Final

from setae.errors import ArmFrozenError
from setae.ur.controller import ArmState, Controller

_PERIOD_S: Final = 0.004
_FEEDS_PER_PERIOD: Final = 4
# A call that hangs with Python's lock held leaves nobody to see that the host has ended: then
# the kernel ends this process. Longer than the host ever waits for such a call.
_LEASE_S: Final = 20


_Calls = queue.SimpleQueue[tuple[int, str, tuple[Any, ...]]]


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
        # The library has none where it raises: the host sees that nothing comes.
        with contextlib.suppress(ArmFrozenError, BrokenPipeError):
            if controller.timestamp_s != last_s:
                state = controller.state()
                last_s = state.timestamp_s
                told.offer(state)
    os._exit(0)


def _take(pipe: BinaryIO, calls: _Calls) -> None:
    """Take calls until the host has ended, or has closed the pipe: then end, whatever hangs."""
    try:
        while True:
            calls.put(pickle.load(pipe))
    except (EOFError, pickle.UnpicklingError):
        os._exit(0)  # the library's threads would hold up an ordinary end


def _serve(pipe: BinaryIO, told: _Told, host: int) -> None:
    """Make one call after the other, until the host has ended."""
    address, settings = pickle.load(pipe)
    controller = Controller(address, settings)
    connected = threading.Event()
    watching: tuple[Any, ...] = (controller, told, connected, host)
    threading.Thread(target=_watch, args=watching, daemon=True).start()
    calls: _Calls = queue.SimpleQueue()
    threading.Thread(target=_take, args=(pipe, calls), daemon=True).start()
    feed_s = 1 / (_FEEDS_PER_PERIOD * settings.watchdog_hz)
    while True:
        try:
            number, method, arguments = calls.get(timeout=feed_s)
        except queue.Empty:
            with contextlib.suppress(ArmFrozenError):  # the host's own next call tells
                if controller.rests:
                    controller.kick_watchdog()
            continue
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
            os._exit(0)
        except Exception:  # the host tells its last line; an ordinary end waits for the library
            traceback.print_exc()
            os._exit(1)


if __name__ == "__main__":
    main()
