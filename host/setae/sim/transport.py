"""The line to the simulated board."""

from __future__ import annotations

import math
import time

from setae.errors import InputError, LinkLostError
from setae.sim.world import World

__all__ = ["SimTransport"]

# Between two slices Python sees Ctrl-C; one takes about a millisecond to compute.
_SLICE_US = 100_000
_PACED_SLICE_US = 10_000


class SimTransport:
    """A `setae.link.transport.Transport` whose board and time are a world's.

    Parameters
    ----------
    world
        A world that has been started. Closing the transport leaves it open.
    speed
        Virtual seconds a second of real time; None runs as fast as it can.

    Raises
    ------
    InputError
        The speed is not a positive number.
    """

    def __init__(self, world: World, *, speed: float | None = None) -> None:
        if speed is not None and not (math.isfinite(speed) and speed > 0):
            raise InputError(f"speed is {speed}.", "Give a positive number, or None.")
        self._world = world
        self._speed = speed
        self._closed = False
        self._paced_from = (time.monotonic(), world.now_us)

    @property
    def name(self) -> str:
        """How a user would name it."""
        return "sim://"

    @property
    def simulated(self) -> bool:
        """True: time passes only inside `receive`."""
        return True

    def now_us(self) -> int:
        """Return the world's time."""
        return self._world.now_us

    def send(self, data: bytes) -> None:
        """Put bytes on the line. Raises LinkLostError after close()."""
        self._require_open()
        self._world.send(data)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Let the world run until bytes come or the deadline is there.

        Returns
        -------
        The bytes and when they came, or None at the deadline.

        Raises
        ------
        LinkLostError
            The transport was closed.
        SimulationError
            The plant has no solution.
        """
        self._require_open()
        slice_us = _SLICE_US if self._speed is None else _PACED_SLICE_US
        while True:
            now_us = self._world.now_us
            data = self._world.run(min(deadline_us, now_us + slice_us))
            self._pace()
            now_us = self._world.now_us
            if data:
                return data, now_us
            if now_us >= deadline_us:
                return None

    def close(self) -> None:
        """Let go of the line. Closing twice is fine."""
        self._closed = True

    def _pace(self) -> None:
        if self._speed is None:
            return
        from_s, from_us = self._paced_from
        ahead_s = (self._world.now_us - from_us) / (1e6 * self._speed) - (time.monotonic() - from_s)
        if ahead_s > 0:
            time.sleep(ahead_s)

    def _require_open(self) -> None:
        if self._closed:
            raise LinkLostError("The line to the simulated board was closed.", "Connect again.")
