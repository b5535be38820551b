"""Trips, faults and refusals: each acknowledged as often as it comes, and told once."""

from __future__ import annotations

from collections import deque
from typing import Final, TypeAlias

from setae.link.events import Event, FaultReported, Refused, Tripped
from setae.link.outbox import Outbox
from setae.link.verdicts import Verdicts
from setae_protocol.messages import (
    Acknowledge,
    FaultMessage,
    Recall,
    Record,
    RefusalMessage,
    Trip,
)

__all__ = ["RecordMessage", "Records"]

RecordMessage: TypeAlias = Trip | FaultMessage | RefusalMessage

_LATCH: Final = {
    Trip: Record.TRIP,
    FaultMessage: Record.FAULT,
    RefusalMessage: Record.REFUSAL,
}
# Late copies are of the last few records.
_REMEMBERED: Final = 8


class Records:
    """The host's side of the board's latches."""

    def __init__(self, outbox: Outbox, verdicts: Verdicts) -> None:
        self._outbox = outbox
        self._verdicts = verdicts
        self._seen: dict[Record, deque[int]] = {
            record: deque(maxlen=_REMEMBERED) for record in Record
        }
        self._asked: set[Record] = set()

    def recall(self, record: Record) -> None:
        """Ask for a record; it is told even if it was before."""
        self._asked.add(record)
        self._outbox.put(Recall(record=record))

    def acknowledge_again(self) -> None:
        """Say once more what was got: an acknowledgement may have been lost."""
        for record, ids in self._seen.items():
            if ids:
                self._outbox.put(Acknowledge(record=record, record_id=ids[-1]))

    def receive(self, message: RecordMessage, now_us: int, *, settling: bool) -> Event | None:
        """Take one copy of a record; return what there is to tell."""
        if message.record_id == 0:
            return None  # an empty latch
        # While settling even where the session's number was used before.
        earlier = settling or message.session != self._outbox.session
        kind = _LATCH[type(message)]
        # Each time: the last acknowledgement may have been lost.
        self._outbox.put(Acknowledge(record=kind, record_id=message.record_id))
        asked = kind in self._asked
        self._asked.discard(kind)
        known = message.record_id in self._seen[kind]
        if known and not asked:
            return None
        if not known:
            self._seen[kind].append(message.record_id)
        if isinstance(message, Trip):
            return Tripped(message, earlier, now_us)
        if isinstance(message, FaultMessage):
            return FaultReported(message, earlier, now_us)
        ticket = None if earlier or known else self._verdicts.on_refusal(message)
        return Refused(message, ticket, earlier, now_us)
