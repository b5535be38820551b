"""The simulated board behind a pseudo-terminal, in real time: what a serial port looks like."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from types import TracebackType
from typing import Self

from setae.sim import World

_SLICE_S = 0.002


class SerialBoard:
    """Runs a world as fast as real time passes, and joins its line to a terminal.

    Attributes
    ----------
    port
        What a host opens.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._closing = threading.Event()
        self._pull = threading.Event()
        self._pulled = threading.Event()
        self._asked: list[tuple[Callable[[], bool], threading.Event]] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.plug()
        self._thread.start()

    def plug(self) -> None:
        """Give the cable a new end, with a new name."""
        board, self._keeps_open = pty.openpty()
        tty.setraw(board)
        os.set_blocking(board, False)
        self.port = os.ttyname(self._keeps_open)
        self._board = board  # from here on the thread uses it

    def unplug(self) -> None:
        """Pull the cable. The board goes on."""
        # The thread closes its end itself: it may be about to use it.
        self._pull.set()
        self._pulled.wait()
        self._pull.clear()
        self._pulled.clear()
        os.close(self._keeps_open)

    def do(self, action: Callable[[], object]) -> None:
        """Do something to the world, between two of its slices; returns when it is done."""
        self.do_when(lambda: (action(), True)[1])

    def do_when(self, ready: Callable[[], bool]) -> None:
        """Return when something holds, asked between slices: the world is the thread's own."""
        happened = threading.Event()
        self._asked.append((ready, happened))
        happened.wait()

    def forget_exclusive(self) -> None:
        """What a serial driver does when the last who had the port open is gone."""
        fcntl.ioctl(self._keeps_open, termios.TIOCNXCL)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._board >= 0:
            self.unplug()
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        from_s, from_us = time.monotonic(), self._world.now_us
        while not self._closing.is_set():
            if self._board < 0:
                self._closing.wait(_SLICE_S)
            elif select.select([self._board], [], [], _SLICE_S)[0]:
                self._world.send(os.read(self._board, 4096))
            until_us = from_us + round(1e6 * (time.monotonic() - from_s))
            while data := self._world.run(until_us):
                if self._board >= 0:
                    self._write(data)
            for asked in list(self._asked):
                if asked[0]():
                    self._asked.remove(asked)
                    asked[1].set()
            if self._pull.is_set() and self._board >= 0:
                os.close(self._board)
                self._board = -1
                self._pulled.set()

    def _write(self, data: bytes) -> None:
        # Where nobody reads, and a port's buffer is full, what comes is lost.
        with contextlib.suppress(BlockingIOError):
            os.write(self._board, data)
