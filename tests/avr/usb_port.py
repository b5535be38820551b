"""The simulated UNO behind a pseudo-terminal: what another program opens as a serial port."""

from __future__ import annotations

import ctypes
import os
import pty
import select
import struct
import termios
import threading
import tty
from types import TracebackType
from typing import Self

from tests.avr.simavr import CYCLES_PER_US, Uno

_SLICE_US = 2_000
# The bootloader's longest answer: to a page that it erases and writes, and the chip's 4 ms.
_ANSWER_US = 14_000
_ANSWERS_END = b"\x10"  # STK500's OK
# inotify.h. With the closings no two in a row are the same, which the kernel would make one.
_OPENED = 0x20
_CLOSED = 0x18
_EVENT = struct.Struct("iIII")  # of a watched file, which has no name
# By termios' names for them.
_BAUDS = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if name[0] == "B" and name[1:].isdigit() and name != "B0"
}


class UsbPort:
    """Joins a simulated UNO, its USB chip switched on, to a terminal.

    Opening the port resets the board, as the DTR line does: once, since a
    pseudo-terminal has no such line to toggle. Bytes go to the board at the rate
    that the program has set. While bytes are under way the board's time passes as
    fast as this computer can; otherwise in slices, never faster than real time.

    Attributes
    ----------
    port
        What a program opens.
    openings
        How often that was done.
    """

    def __init__(self, uno: Uno) -> None:
        self._uno = uno
        uno.set_usb_chip()
        self._board, terminal = pty.openpty()
        tty.setraw(self._board)
        self.port = os.ttyname(terminal)
        os.close(terminal)
        self._watch = _watch_openings(self.port)
        self.openings = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._closing.set()
        self._thread.join()
        os.close(self._board)
        os.close(self._watch)
        self._uno.set_usb_chip(False)

    def _run(self) -> None:
        poller = select.poll()
        poller.register(self._watch, select.POLLIN)
        poller.register(self._board, select.POLLIN)
        while not self._closing.is_set():
            found = dict(poller.poll(_SLICE_US / 1000))
            # The kernel counts: who looks at the line alone misses a port that was soon open again.
            if self._watch in found:
                for _, event, _, _ in _EVENT.iter_unpack(os.read(self._watch, 4096)):
                    if event & _OPENED:
                        self.openings += 1
                        self._uno.press_reset()
            line = found.get(self._board, 0)
            if line & select.POLLIN:
                self._hand_down(os.read(self._board, 4096))
            else:
                if line & select.POLLHUP:
                    self._closing.wait(_SLICE_US / 1e6)
                self._pass(_SLICE_US)

    def _hand_down(self, data: bytes) -> None:
        """Send bytes, and let the board answer."""
        baud = _BAUDS[termios.tcgetattr(self._board)[4]]
        self._uno.send(data, bit_cycles=1e6 * CYCLES_PER_US / baud)
        end = self._uno.line_free + _ANSWER_US * CYCLES_PER_US
        while self._uno.cycle < end and not self._pass(_SLICE_US).endswith(_ANSWERS_END):
            pass

    def _pass(self, duration_us: int) -> bytes:
        """Let time pass, and hand up what the board says."""
        self._uno.run_to(self._uno.cycle + duration_us * CYCLES_PER_US, stop_after_frame=True)
        data, _ = self._uno.receive()
        if data:
            os.write(self._board, data)
        return data


def _watch_openings(path: str) -> int:
    """Return a file that tells each time that `path` is opened or closed."""
    libc = ctypes.CDLL(None, use_errno=True)
    watch: int = libc.inotify_init1(os.O_CLOEXEC)
    if watch < 0 or libc.inotify_add_watch(watch, path.encode(), _OPENED | _CLOSED) < 0:
        raise OSError(ctypes.get_errno(), f"inotify can't watch {path}")
    return watch
