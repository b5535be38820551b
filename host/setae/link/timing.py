"""Pings, and what they and the telemetry say about the board's clock."""

from __future__ import annotations

from typing import Final

from setae.link.clock import Clock
from setae.link.outbox import Outbox
from setae_protocol.messages import (
    BAUD,
    BOARD_OVERHEAD_BYTES,
    HOST_OVERHEAD_BYTES,
    SERVO_FRAME_US,
    Ping,
    Pong,
    Telemetry,
)

__all__ = ["Timing"]

_PING_US: Final = 1_000_000
_PINGS_REMEMBERED: Final = 8
_MICROSECONDS_PER_BYTE: Final = 10 * 1_000_000 // BAUD


class Timing:
    """Feeds the clock.

    Attributes
    ----------
    clock
        Board time against host time.
    ping_at_us
        When the next ping is due.
    """

    def __init__(self, outbox: Outbox) -> None:
        self.clock = Clock()
        self.ping_at_us = 0
        self._outbox = outbox
        self._sent_us: dict[int, int] = {}

    def ping(self, now_us: int) -> int:
        """Ask for the board's time; return the question's token."""
        token = self._outbox.new_token()
        self._sent_us[token] = now_us
        while len(self._sent_us) > _PINGS_REMEMBERED:
            del self._sent_us[next(iter(self._sent_us))]
        self._outbox.put(Ping(token=token))
        self.ping_at_us = now_us + _PING_US
        return token

    def on_pong(self, message: Pong, now_us: int) -> int | None:
        """Take an answer; return the round trip, or None where nobody asked."""
        sent_us = self._sent_us.pop(message.token, None)
        if sent_us is None:
            return None
        board_us = self._note(message, Pong.SIZE, now_us)
        line_us = (HOST_OVERHEAD_BYTES + Ping.SIZE) * _MICROSECONDS_PER_BYTE
        self.clock.add_sent(sent_us=sent_us + line_us, board_us=board_us)
        return now_us - sent_us

    def on_telemetry(self, message: Telemetry, now_us: int) -> None:
        """Take the time that telemetry carries."""
        self._note(message, Telemetry.SIZE, now_us)

    def _note(self, message: Telemetry | Pong, size: int, now_us: int) -> int:
        board_us = message.frame * SERVO_FRAME_US + message.phase_us
        line_us = (BOARD_OVERHEAD_BYTES + size) * _MICROSECONDS_PER_BYTE
        self.clock.add(board_us=board_us, received_us=now_us - line_us)
        return board_us
