"""Reliable commands: out in order, sent again until the board has taken them (go-back-N)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from setae.errors import LinkLostError
from setae.link.counts import Statistics
from setae.link.events import Ticket, TicketState
from setae.link.outbox import Outbox
from setae.link.records import Records
from setae.link.retransmission import RetransmissionTimer
from setae.link.verdicts import Verdicts
from setae_protocol.messages import (
    WINDOW_FRAMES,
    BoardHeader,
    Enable,
    GuardMessage,
    Resume,
    Segments,
)

__all__ = ["ReliableSender"]

# Both: a host that stood still for that long has not tried yet.
_TRIES: Final = 20
_LOST_US: Final = 4_000_000


@dataclass(slots=True)
class _InFlight:
    ticket: Ticket
    sequence: int
    first_sent_us: int
    transmissions: int = 1


class ReliableSender:
    """The queue of commands, and the window of those that are on their way.

    Attributes
    ----------
    timer
        Round trip and timeout.
    board_credit
        Segments that the board has room for after all commands it has taken.
    """

    def __init__(
        self,
        outbox: Outbox,
        records: Records,
        verdicts: Verdicts,
        statistics: Statistics,
    ) -> None:
        self.timer = RetransmissionTimer()
        self.board_credit = 0
        self._outbox = outbox
        self._records = records
        self._verdicts = verdicts
        self._statistics = statistics
        self._queue: deque[Ticket] = deque()
        self._flight: deque[_InFlight] = deque()
        self._next_sequence = 0
        self._tries = 0
        self._unconfirmed_since_us = 0
        self._sent_at_us = 0
        self._timeout_at_us = 0
        self._resent_at_us: int | None = None
        self._shown_missing = False
        self._refused = False

    @property
    def credit(self) -> int:
        """Segments that the board has room for, less those on their way."""
        on_their_way = sum(
            item.ticket.message.count
            for item in self._flight
            if isinstance(item.ticket.message, Segments)
        )
        return self.board_credit - on_their_way

    @property
    def next_deadline_us(self) -> int | None:
        """When `poll` has something to do, or None."""
        return self._timeout_at_us if self._flight else None

    # -------------------------------------------------------------------------- sending

    def queue(self, ticket: Ticket) -> None:
        """Put a command behind those that wait; `pump` sends it."""
        self._queue.append(ticket)

    def pump(self, now_us: int) -> None:
        """Send queued commands as far as the window and the board's queue allow."""
        while self._queue and len(self._flight) < WINDOW_FRAMES:
            message = self._queue[0].message
            if isinstance(message, Segments) and self.credit < message.count:
                return
            ticket = self._queue.popleft()
            item = _InFlight(ticket, self._next_sequence, now_us)
            ticket.sequence = item.sequence
            ticket.state = TicketState.SENT
            self._next_sequence = (self._next_sequence + 1) & 0xFF
            if not self._flight:
                self._start_waiting(now_us)
                self._unconfirmed_since_us = now_us
            self._flight.append(item)
            self._verdicts.remember(ticket)
            self._transmit(item)

    def poll(self, now_us: int) -> None:
        """Send again what was not confirmed in time.

        Raises
        ------
        LinkLostError
            It was sent often enough, for long enough.
        """
        if not self._flight or now_us < self._timeout_at_us:
            return
        self._tries += 1
        if self._tries > _TRIES and now_us - self._unconfirmed_since_us >= _LOST_US:
            name = type(self._flight[0].ticket.message).__name__.lower()
            raise LinkLostError(
                f"The board did not confirm `{name}` in {self._tries - 1} tries"
                f" and {_LOST_US / 1e6:.0f} s."
            )
        self._statistics.timeouts += 1
        if self._shown_missing:
            self.timer.recover()
        else:
            self.timer.back_off()
        self._retransmit(now_us)

    def _transmit(self, item: _InFlight) -> None:
        message = item.ticket.message
        if isinstance(message, (Enable, Resume)):
            # The board refuses them while a record waits to be acknowledged.
            self._records.acknowledge_again()
        self._outbox.put(message, sequence=item.sequence)

    def _retransmit(self, now_us: int) -> None:
        for item in self._flight:
            item.transmissions += 1
            self._transmit(item)
            self._statistics.frames_retransmitted += 1
        self._resent_at_us = now_us
        self._refused = False
        self._start_waiting(now_us)

    def _start_waiting(self, now_us: int) -> None:
        self._sent_at_us = now_us
        self._timeout_at_us = now_us + self.timer.timeout_us
        self._shown_missing = False

    # ------------------------------------------------------------------------ receiving

    def on_header(self, header: BoardHeader, now_us: int) -> bool:
        """Take room and acknowledgement from a board frame that is newer than all before.

        Returns
        -------
        Whether it confirms a command.
        """
        self.board_credit = header.credit
        if not self._flight:
            return False
        confirmed = (header.expected - self._flight[0].sequence) & 0xFF
        if not 0 < confirmed <= len(self._flight):
            # The board lives, and should have it by now: it is lost, not late.
            if now_us - self._sent_at_us >= self.timer.estimate_us:
                self._shown_missing = True
                self._timeout_at_us = now_us
            return False
        for _ in range(confirmed):
            item = self._flight.popleft()
            self._verdicts.acknowledged(item.ticket, epoch=header.epoch)
        if item.transmissions == 1:  # Karn: nobody knows which of several was answered
            self.timer.measure(now_us - item.first_sent_us)
        self._tries = 0
        self.timer.recover()
        self._start_waiting(now_us)
        self._unconfirmed_since_us = now_us
        return True

    def on_refusal(self) -> None:
        """A refusal was told: until its acknowledgement arrives the board takes no second one."""
        self._refused = bool(self._flight)

    def on_receipt(self, *, gap: bool, now_us: int) -> None:
        """Send again what the board did not take.

        With `gap` it says that a command is missing. Without, and after a refusal, it
        may have held one back that it would have to refuse too. Either once per round
        trip, but for the first after a refusal: its acknowledgement went out meanwhile.
        """
        if not self._flight or not (gap or self._refused):
            return
        since = self._resent_at_us
        if since is None or self._refused or now_us - since >= self.timer.round_trip_us:
            self._retransmit(now_us)

    # ---------------------------------------------------------------------------- ends

    def discard_stale(self, epoch: int) -> None:
        """What was planned for an older epoch need not go out at all."""
        for ticket in list(self._queue):
            message = ticket.message
            if isinstance(message, (Segments, GuardMessage)) and message.epoch != epoch:
                self._discard(ticket, epoch)

    def discard_at_stop(self, epoch: int) -> None:
        """A stop ends this epoch: nothing that was planned for it may move the robot."""
        for ticket in list(self._queue):
            if isinstance(ticket.message, (Segments, GuardMessage, Resume)):
                self._discard(ticket, epoch)

    def _discard(self, ticket: Ticket, epoch: int) -> None:
        self._queue.remove(ticket)
        ticket.state = TicketState.DISCARDED
        ticket.discarded_by_epoch = epoch

    def fail(self) -> None:
        """The link is gone."""
        for ticket in [*self._queue, *(item.ticket for item in self._flight)]:
            if not ticket.done:
                ticket.state = TicketState.FAILED
        self._queue.clear()
        self._flight.clear()
