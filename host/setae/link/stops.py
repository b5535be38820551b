"""Stops: ahead of everything, and repeated until the board shows them."""

from __future__ import annotations

from typing import Final

from setae.link.counts import Statistics
from setae.link.events import Ticket, TicketState
from setae.link.outbox import Outbox
from setae_protocol.messages import Stop, Telemetry

__all__ = ["Stops"]

_REPEAT_US: Final = 10_000


class Stops:
    """The stops that the board has not shown yet.

    The newest stands for all that are under way: once it is done, so are they.
    """

    def __init__(self, outbox: Outbox, statistics: Statistics) -> None:
        self._outbox = outbox
        self._statistics = statistics
        self._tickets: list[Ticket] = []
        self._number = 0
        self._shown_number: int | None = None  # by telemetry
        self._repeat_at_us = 0

    @property
    def under_way(self) -> bool:
        """Whether a stop is not confirmed yet."""
        return bool(self._tickets)

    @property
    def next_deadline_us(self) -> int | None:
        """When `poll` has something to do, or None."""
        return self._repeat_at_us if self._tickets else None

    def stop(self, now_us: int) -> Ticket:
        """Send a stop, and keep sending it."""
        self._raise_number()
        ticket = Ticket(Stop(stop_number=self._number), TicketState.SENT)
        self._tickets.append(ticket)
        self._send(now_us)
        return ticket

    def poll(self, now_us: int) -> None:
        """Repeat what is not confirmed."""
        if not self._tickets or now_us < self._repeat_at_us:
            return
        if self._shown_number is None:
            # Nobody told the number of the board's last stop; ours may be the same.
            self._raise_number()
        self._send(now_us)

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Look whether the board shows our stop."""
        first = self._shown_number is None
        self._shown_number = telemetry.stop_number
        if not self._tickets or telemetry.stop_number != self._number:
            return
        if first:
            # It may be the number of an earlier session's stop.
            self._raise_number()
        else:
            self.confirm()

    def confirm(self) -> None:
        """The board has stopped."""
        self._finish(TicketState.EXECUTED)

    def fail(self) -> None:
        """The link is gone: nobody knows whether it stopped."""
        self._finish(TicketState.FAILED)

    def _finish(self, state: TicketState) -> None:
        for ticket in self._tickets:
            ticket.state = state
        self._tickets.clear()

    def _raise_number(self) -> None:
        """Take a number that was not ours yet, and that the board does not show."""
        self._number = (self._number + 1) & 0xFF
        if self._number == self._shown_number:
            self._number = (self._number + 1) & 0xFF

    def _send(self, now_us: int) -> None:
        self._outbox.put_first(Stop(stop_number=self._number))
        self._statistics.stops_sent += 1
        self._repeat_at_us = now_us + _REPEAT_US
