"""What became of a command that the board has acknowledged.

An acknowledgement says that the board took the command; whether it refused it,
only the refusal's record says. That record may be lost on the way up. So a
command counts as executed once no refusal can be on its way any more.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from setae.link.arrivals import Arrivals
from setae.link.events import Ticket, TicketState
from setae_protocol.messages import (
    RECORD_REPEAT_FRAMES,
    GuardMessage,
    RefusalMessage,
    Segments,
)

__all__ = ["Verdicts"]

# Far more than can be sent between a guard and the end of its tare, which may refuse it.
_REMEMBERED: Final = 64


@dataclass(slots=True)
class _Acknowledged:
    ticket: Ticket
    end: TicketState
    epoch: int
    gaps_when_sent: int
    clean_from_frame: int
    gaps_when_clean: int | None = None


class Verdicts:
    """Tickets whose command was acknowledged, and those that a refusal may still name."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._acknowledged: list[_Acknowledged] = []
        self._recent: deque[Ticket] = deque(maxlen=_REMEMBERED)

    def remember(self, ticket: Ticket) -> None:
        """A command goes out for the first time."""
        self._recent.append(ticket)

    def acknowledged(self, ticket: Ticket, *, epoch: int, gaps_when_sent: int) -> None:
        """The board has taken a command, and was in this epoch afterwards."""
        if ticket.done:
            return
        message = ticket.message
        end = TicketState.EXECUTED
        if isinstance(message, (Segments, GuardMessage)) and message.epoch != epoch:
            end = TicketState.DISCARDED
        self._acknowledged.append(_Acknowledged(ticket, end, epoch, gaps_when_sent, 0))

    def on_telemetry(self, frame: int) -> None:
        """Settle the tickets of which no refusal can come any more.

        The board sends the record of a refusal ahead of its next telemetry, and
        repeats it until it is acknowledged. So no refusal is on its way where
        telemetry has come and no board frame was lost since the command was
        sent; or, where one was, after as many frames without a loss as lie
        between two repeats.
        """
        gaps = self._arrivals.gaps
        still = []
        for item in self._acknowledged:
            if item.ticket.done:
                continue
            if item.gaps_when_clean != gaps:
                item.gaps_when_clean = gaps
                item.clean_from_frame = frame
            certain = item.gaps_when_sent == gaps
            if certain or frame - item.clean_from_frame > RECORD_REPEAT_FRAMES:
                item.ticket.state = item.end
                if item.end is TicketState.DISCARDED:
                    item.ticket.discarded_by_epoch = item.epoch
            else:
                still.append(item)
        self._acknowledged = still

    def on_refusal(self, record: RefusalMessage) -> Ticket | None:
        """Find the ticket of a refused command."""
        for ticket in reversed(self._recent):
            if (
                ticket.sequence == record.command_sequence
                and record.command_type == ticket.message.TYPE
            ):
                ticket.state = TicketState.REFUSED
                ticket.refusal = record
                ticket.discarded_by_epoch = None
                return ticket
        return None

    def fail(self) -> None:
        """The link is gone: nobody will know."""
        for item in self._acknowledged:
            if not item.ticket.done:
                item.ticket.state = TicketState.FAILED
        self._acknowledged.clear()
