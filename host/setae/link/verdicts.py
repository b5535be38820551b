"""What became of a command that the board has acknowledged.

An acknowledgement says that the board took the command; whether it refused it, only
the refusal's record says, and that may be lost on the way up. But each frame says
whether a refusal waits to be acknowledged. Where none does, none is on its way: those
that were have been told, and their tickets have their end.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from setae.link.events import Ticket, TicketState
from setae_protocol.messages import GuardMessage, RefusalMessage, Segments

__all__ = ["Verdicts"]

# Far more than can be sent between a guard and the end of its tare, which may refuse it.
_REMEMBERED: Final = 64


@dataclass(slots=True)
class _Acknowledged:
    ticket: Ticket
    end: TicketState
    epoch: int


class Verdicts:
    """Tickets whose command was acknowledged, and those that a refusal may still name."""

    def __init__(self) -> None:
        self._acknowledged: list[_Acknowledged] = []
        self._recent: deque[Ticket] = deque(maxlen=_REMEMBERED)

    def remember(self, ticket: Ticket) -> None:
        """A command goes out for the first time."""
        self._recent.append(ticket)

    def acknowledged(self, ticket: Ticket, *, epoch: int) -> None:
        """The board has taken a command, and was in this epoch afterwards."""
        if ticket.done:
            return
        message = ticket.message
        end = TicketState.EXECUTED
        if isinstance(message, (Segments, GuardMessage)) and message.epoch != epoch:
            end = TicketState.DISCARDED
        self._acknowledged.append(_Acknowledged(ticket, end, epoch))

    def on_header(self, *, refusal_waits: bool) -> None:
        """Settle what was acknowledged, unless a refusal may still name it.

        To be called for frames that are newer than all before, after `acknowledged`.
        """
        if refusal_waits:
            return
        for item in self._acknowledged:
            if item.ticket.done:
                continue
            item.ticket.state = item.end
            if item.end is TicketState.DISCARDED:
                item.ticket.discarded_by_epoch = item.epoch
        self._acknowledged.clear()

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
