"""What the link has to tell, as typed values."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

from setae.errors import LinkError
from setae_protocol.messages import (
    FaultMessage,
    HelloReply,
    HostMessage,
    Limits,
    RefusalMessage,
    State,
    Status,
    Telemetry,
    Trip,
)

__all__ = [
    "Event",
    "FaultReported",
    "LimitsRead",
    "LinkFailed",
    "Opened",
    "Refused",
    "StateChanged",
    "StatusReceived",
    "TelemetryReceived",
    "Ticket",
    "TicketState",
    "Tripped",
]


class TicketState(Enum):
    """What became of a command."""

    QUEUED = "queued"
    """Waits in the host for room in the window or in the board's queue."""
    SENT = "sent"
    """On its way, perhaps more than once; the board has not confirmed it."""
    EXECUTED = "executed"
    """Carried out; for segments: taken into the board's queue."""
    REFUSED = "refused"
    """Not carried out; `Ticket.refusal` says why."""
    DISCARDED = "discarded"
    """Its epoch ended first, by a stop, trip, fault or refusal: it never ran, or was dropped."""
    FAILED = "failed"
    """The link failed first: it may have been carried out or not."""


@dataclass(slots=True, eq=False)
class Ticket:
    """Follows one command to its end.

    Attributes
    ----------
    message
        The command.
    state
        What became of it so far. A tare that fails turns an executed guard into
        a refused one.
    refusal
        Why the board refused it.
    discarded_by_epoch
        The epoch that the board was in when it discarded the command.
    """

    message: HostMessage
    state: TicketState = TicketState.QUEUED
    refusal: RefusalMessage | None = None
    discarded_by_epoch: int | None = None
    sequence: int | None = field(default=None, repr=False)

    @property
    def done(self) -> bool:
        """Whether its end is known."""
        return self.state not in (TicketState.QUEUED, TicketState.SENT)


@dataclass(frozen=True, slots=True)
class Opened:
    """The session is open; commands may go out."""

    session: int
    reply: HelloReply


@dataclass(frozen=True, slots=True)
class TelemetryReceived:
    """The board's report of one servo frame.

    Attributes
    ----------
    time_us
        Host time at which the frame arrived.
    """

    telemetry: Telemetry
    state: State
    epoch: int
    credit: int
    time_us: int


@dataclass(frozen=True, slots=True)
class StateChanged:
    """State or epoch of the board is another one than before."""

    state: State
    epoch: int
    previous_state: State
    previous_epoch: int
    time_us: int


@dataclass(frozen=True, slots=True)
class Tripped:
    """A trip's record, told once.

    Attributes
    ----------
    earlier
        It was latched before this session: another host's, or one that died.
    """

    record: Trip
    earlier: bool
    time_us: int


@dataclass(frozen=True, slots=True)
class FaultReported:
    """A fault's record, told once; `earlier` as in `Tripped`."""

    record: FaultMessage
    earlier: bool
    time_us: int


@dataclass(frozen=True, slots=True)
class Refused:
    """A refusal's record, told once; `earlier` as in `Tripped`.

    Attributes
    ----------
    ticket
        The refused command, where it is one of this session.
    """

    record: RefusalMessage
    ticket: Ticket | None
    earlier: bool
    time_us: int


@dataclass(frozen=True, slots=True)
class LimitsRead:
    """The limits in force."""

    limits: Limits


@dataclass(frozen=True, slots=True)
class StatusReceived:
    """Supply, EEPROM, stop switch and counters, as the board tells them once a second."""

    status: Status
    time_us: int


@dataclass(frozen=True, slots=True)
class LinkFailed:
    """The session is over; nothing is sent any more."""

    error: LinkError


Event: TypeAlias = (
    Opened
    | TelemetryReceived
    | StateChanged
    | Tripped
    | FaultReported
    | Refused
    | LimitsRead
    | StatusReceived
    | LinkFailed
)
"""Whatever the link has to tell."""
