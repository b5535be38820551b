"""The serial transport on pseudo-terminals, whose other end plays the board."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import pty
import tty
from collections.abc import Iterator

import pytest
import serial

from setae.errors import LinkLostError, PortBusyError, PortNotFoundError
from setae.link.serial_transport import SerialTransport

LONG_US = 5_000_000
# asm-generic/ioctls.h; Python does not name it.
TIOCGEXCL = 0x80045440


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """The board's end, and the name of the host's."""
    board, host = pty.openpty()
    tty.setraw(board)
    name = os.ttyname(host)
    os.close(host)
    yield board, name
    with contextlib.suppress(OSError):  # a test closed it
        os.close(board)


def test_bytes_go_both_ways_with_a_time(terminal: tuple[int, str]) -> None:
    board, name = terminal
    transport = SerialTransport(name)
    transport.send(b"\x01\x02\0")
    assert os.read(board, 10) == b"\x01\x02\0"
    before_us = transport.now_us()
    os.write(board, b"\x03\0\x11\x13")
    received = b""
    while len(received) < 4:
        item = transport.receive(transport.now_us() + LONG_US)
        assert item is not None
        data, time_us = item
        assert before_us <= time_us <= transport.now_us()
        received += data
    assert received == b"\x03\0\x11\x13", "no byte means anything to the terminal"
    transport.close()
    transport.close()


def test_deadline_passes_without_bytes(terminal: tuple[int, str]) -> None:
    _, name = terminal
    transport = SerialTransport(name)
    deadline_us = transport.now_us() + 1_000
    assert transport.receive(deadline_us) is None
    assert transport.now_us() >= deadline_us
    assert transport.receive(0) is None, "a deadline in the past does not wait"
    transport.close()


def test_second_program_is_told_that_the_port_is_taken(terminal: tuple[int, str]) -> None:
    """Without an exclusive lock both would open it, and each get half of the bytes."""
    _, name = terminal
    transport = SerialTransport(name)
    with pytest.raises(PortBusyError, match=f"Another program holds {name}"):
        SerialTransport(name)
    transport.close()
    SerialTransport(name).close()


def test_a_program_that_takes_no_lock_is_kept_out_too(terminal: tuple[int, str]) -> None:
    """A serial monitor asks for no lock. It opened the port, and that alone resets a board."""
    _, name = terminal
    monitor = os.open(name, os.O_RDWR | os.O_NOCTTY)  # was there before, and may ask

    def others_are_refused() -> bool:
        answer = fcntl.ioctl(monitor, TIOCGEXCL, bytes(4))
        return any(answer)

    assert not others_are_refused()
    transport = SerialTransport(name)
    assert others_are_refused()
    transport.close()
    assert not others_are_refused()
    os.close(monitor)


def test_no_second_setae_opens_the_port_and_of_other_programs_only_roots(
    terminal: tuple[int, str],
) -> None:
    """The system keeps nobody out who may administer it; the lock keeps out whoever asks for it."""
    _, name = terminal
    transport = SerialTransport(name)
    if os.geteuid() == 0:
        os.close(os.open(name, os.O_RDWR | os.O_NOCTTY))
    else:
        with pytest.raises(OSError, match="busy"):
            os.open(name, os.O_RDWR | os.O_NOCTTY)
    with pytest.raises(PortBusyError, match=f"Another program holds {name}"):
        SerialTransport(name)
    transport.close()


def test_pulled_cable(terminal: tuple[int, str]) -> None:
    board, name = terminal
    transport = SerialTransport(name)
    os.close(board)
    with pytest.raises(LinkLostError, match="is gone"):
        transport.receive(transport.now_us() + LONG_US)
    with pytest.raises(LinkLostError):
        transport.send(b"\0")
    transport.close()


def test_missing_port() -> None:
    with pytest.raises(PortNotFoundError, match=r"no serial port /dev/ttyNone.*setae ports"):
        SerialTransport("/dev/ttyNone")


def test_port_of_another_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object, **options: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port: Permission denied")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(PortBusyError, match="dialout"):
        SerialTransport("/dev/ttyACM0")
