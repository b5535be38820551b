"""A board on a serial port."""

from __future__ import annotations

import contextlib
import errno
import queue
import threading
import time
from typing import Final

import serial

from setae.errors import LinkLostError, PortBusyError, PortNotFoundError
from setae_protocol.messages import BAUD

try:
    import fcntl
    import termios
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["SerialTransport"]

_READ_TIMEOUT_S: Final = 0.1
_WRITE_TIMEOUT_S: Final = 1.0


class SerialTransport:
    """Bytes over a serial port, stamped by a reader thread when they arrive.

    Opening the port resets a UNO; its bootloader then takes up to two seconds,
    which `Session.open` waits for.

    Parameters
    ----------
    port
        Such as ``/dev/ttyACM0``.

    Raises
    ------
    PortNotFoundError
        There is no such port.
    PortBusyError
        Another program holds it, or this user may not open it.
    """

    simulated: Final = False

    def __init__(self, port: str) -> None:
        self._name = port
        self._port = _open(port)
        self._queue: queue.SimpleQueue[tuple[bytes, int] | LinkLostError] = queue.SimpleQueue()
        self._lost: LinkLostError | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"setae {port}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The port's name."""
        return self._name

    def now_us(self) -> int:
        """Return the computer's monotonic time."""
        return time.monotonic_ns() // 1000

    def send(self, data: bytes) -> None:
        """Write to the port; LinkLostError if it is gone or takes nothing."""
        if self._lost is not None:
            raise self._lost
        try:
            self._port.write(data)
        except (serial.SerialException, OSError) as error:
            self._lost = self._gone(error)
            raise self._lost from error

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Wait for bytes until the deadline; LinkLostError if the port is gone."""
        if self._lost is not None:
            raise self._lost
        try:
            item = self._queue.get(timeout=max(0, deadline_us - self.now_us()) / 1e6)
        except queue.Empty:
            return None
        if isinstance(item, LinkLostError):
            self._lost = item
            raise item
        return item

    def close(self) -> None:
        """Close the port."""
        self._closing.set()
        if self._port.is_open:
            self._port.cancel_read()
            _keep_others_out(self._port, keep=False)
        self._thread.join(timeout=2 * _READ_TIMEOUT_S)
        self._port.close()

    def _read(self) -> None:
        while not self._closing.is_set():
            try:
                # One byte wakes it; the rest of what is there comes along.
                data = self._port.read(1)
                if data:
                    data += self._port.read(self._port.in_waiting)
                    self._queue.put((data, self.now_us()))
            except (serial.SerialException, OSError, TypeError) as error:
                # TypeError: what pyserial raises where the port is closed under a read.
                if not self._closing.is_set():
                    self._queue.put(self._gone(error))
                return

    def _gone(self, error: Exception) -> LinkLostError:
        return LinkLostError(f"The port {self._name} is gone ({error}).")


def _keep_others_out(opened: serial.Serial, *, keep: bool = True) -> None:
    """Have the system refuse other opens, or let them in again.

    The lock that pyserial takes binds only who asks for it. A serial monitor doesn't,
    and its opening alone would reset the board in mid-motion. Root may still open.
    """
    if fcntl is not None:  # Windows opens no port twice anyway
        with contextlib.suppress(OSError):
            fcntl.ioctl(opened.fileno(), termios.TIOCEXCL if keep else termios.TIOCNXCL)


def _open(port: str) -> serial.Serial:
    try:
        opened = serial.Serial(
            port,
            baudrate=BAUD,
            timeout=_READ_TIMEOUT_S,
            write_timeout=_WRITE_TIMEOUT_S,
            # Without it two programs can share a port and each gets half of the bytes.
            exclusive=True,
        )
        # An FTDI chip holds bytes back for 16 ms otherwise. Other drivers can't, or needn't.
        with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
            opened.set_low_latency_mode(True)
        _keep_others_out(opened)
        return opened
    except serial.SerialException as error:
        # What the system said, an error of termios included, which has no errno of its own.
        number = error.errno or next(iter(getattr(error.__context__, "args", ())), None)
        if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV) or "FileNotFoundError" in str(error):
            raise PortNotFoundError(f"There is no serial port {port}.") from error
        if number in (errno.ENOTTY, errno.EISDIR):
            raise PortNotFoundError(f"{port} is no serial port.") from error
        if number in (errno.EACCES, errno.EPERM):
            raise PortBusyError(
                f"This user may not open {port}.",
                "On Linux add the user to the port's group, usually"
                " `sudo usermod -a -G dialout $USER`, and log in again.",
            ) from error
        if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(error):
            raise PortBusyError(f"Another program holds {port}.") from error
        raise PortBusyError(f"{port} can't be opened ({error}).") from error
    except ValueError as error:
        raise PortNotFoundError(f"{port} is not the name of a serial port ({error}).") from error
