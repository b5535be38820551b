"""What the board really did: a look at each frame that it sends, ahead of any bad line.

Each segment's pulses spell its number, so that the pulses tell which segments were
played, how often and in which order.
"""

from __future__ import annotations

from setae.link.transport import Transport
from setae_protocol.frame import BoardDecoder
from setae_protocol.messages import (
    FaultMessage,
    HelloReply,
    Receipt,
    RefusalMessage,
    State,
    Telemetry,
    Trip,
)

BASE_TICKS = 1_800
# Four servos spell a number of four such digits; no digit's change is too fast for a frame.
DIGITS = 64
Ticks = tuple[int, int, int, int]
Record = Trip | FaultMessage | RefusalMessage

_RECEIPT = bytes([Receipt.TYPE])
_FROZEN = (State.STOPPED, State.TRIPPED, State.FAULT)


def spell(number: int) -> Ticks:
    """Return pulses that stand for a number."""
    digits = []
    for _ in range(4):
        number, digit = divmod(number, DIGITS)
        digits.append(BASE_TICKS + digit)
    first, second, third, fourth = digits
    return (first, second, third, fourth)


def read(ticks: Ticks) -> int:
    """Return the number that pulses stand for."""
    number = 0
    for tick in reversed(ticks):
        number = number * DIGITS + tick - BASE_TICKS
    return number


class Witness:
    """Passes everything on, and remembers what the board did.

    Attributes
    ----------
    taken
        Commands that the board has counted as carried out.
    played
        Numbers of the segments that it played.
    records
        What it latched.
    moved_while_frozen
        Frames in which the pulses changed although it was stopped, tripped or in fault.
    """

    simulated = True

    def __init__(self, inner: Transport) -> None:
        self.inner = inner
        self.name = inner.name
        # Each a lookup that the link makes ten times a command.
        self.now_us = inner.now_us
        self.send = inner.send
        self.close = inner.close
        self.taken = 0
        self.played: list[int] = []
        self.records: list[Record] = []
        self.moved_while_frozen = 0
        self._decoder = BoardDecoder()
        self._partial = b""
        self._expected = 0
        self._last_ids: dict[type[Record], int] = {}
        self._frozen_for = 0

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Pass on, and look at it."""
        received = self.inner.receive(deadline_us)
        if received is not None:
            self._look(received[0])
        return received

    def _look(self, data: bytes) -> None:
        *whole, self._partial = (self._partial + data).split(b"\0")
        # Receipts are most of what comes, and telemetry tells the same a little later.
        worth = [wire for wire in whole if wire[1:2] != _RECEIPT]
        for frame in self._decoder.feed(b"".join(wire + b"\0" for wire in worth)):
            message = frame.message
            if isinstance(message, HelloReply):
                self._expected = frame.header.expected
                continue
            self.taken += (frame.header.expected - self._expected) & 0xFF
            self._expected = frame.header.expected
            if isinstance(message, Telemetry):
                self._on_telemetry(message, frame.state)
            elif isinstance(message, (Trip, FaultMessage, RefusalMessage)):
                kind = type(message)
                if message.record_id != self._last_ids.get(kind, 0):
                    self._last_ids[kind] = message.record_id
                    self.records.append(message)

    def _on_telemetry(self, telemetry: Telemetry, state: State) -> None:
        if telemetry.attached != 15:
            return
        number = read(telemetry.pulse_ticks)
        self._frozen_for = self._frozen_for + 1 if state in _FROZEN else 0
        if not self.played or number != self.played[-1]:
            self.played.append(number)
            # The frame in which the freeze came still shows its own pulses.
            self.moved_while_frozen += self._frozen_for > 1
