"""A session with a board over a transport. Here, and only here, the host waits."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Final, Protocol, Self

from setae.errors import BoardSilentError, DeadlineError, LinkError, RefusedError
from setae.link.clock import ClockEstimate
from setae.link.engine import Engine
from setae.link.events import Event, LimitsRead, Ticket, TicketState
from setae.link.transport import Transport
from setae_protocol.messages import (
    HelloReply,
    HostMessage,
    Limits,
    MessageType,
    Record,
    RefusalMessage,
    State,
    Telemetry,
)

__all__ = ["Pollable", "Session", "refused_error"]

# Pollables are looked at at least this often, and Ctrl-C is noticed.
_SLICE_US: Final = 20_000
# Nobody read for this long: the program did something else, or the computer stalled.
_AWAY_US: Final = 100_000
_READ_REPEAT_US: Final = 100_000


class Pollable(Protocol):
    """Something that needs a look while the session waits, such as a moving stage."""

    def poll(self, now_us: int) -> None:
        """Do what is due."""
        ...


def refused_error(record: RefusalMessage) -> RefusedError:
    """Turn a refusal's record into the error that says what to do."""
    try:
        command = MessageType(record.command_type).name.lower()
    except ValueError:
        command = f"command {record.command_type}"
    detail = record.reason.doc
    if record.index != 255:
        detail += f" (index {record.index}: {record.value}, limit {record.limit})"
    return RefusedError(
        record.reason.name.lower(), record.reason.remedy, command=command, detail=detail
    )


class Session:
    """Commands to a board and events from it.

    Parameters
    ----------
    transport
        What carries the bytes; `close` closes it.
    session_id
        1 to 255; None draws one. Give one where a run must be repeatable.
    pollables
        Looked at while the session waits.

    Examples
    --------
    A session is a context manager::

        with Session(transport) as session:
            session.open()
            session.request(Enable(pulse_ticks=(1700, 1700, 1700, 1700)))
    """

    def __init__(
        self,
        transport: Transport,
        *,
        session_id: int | None = None,
        pollables: Sequence[Pollable] = (),
    ) -> None:
        self.transport = transport
        self.engine = Engine()
        self.pollables: list[Pollable] = list(pollables)
        self._session_id = secrets.randbelow(255) + 1 if session_id is None else session_id
        self._subscribers: list[Callable[[Event], None]] = []
        self._read_up_to_us = transport.now_us()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    # --------------------------------------------------------------------- what is known

    @property
    def state(self) -> State:
        """The board's state, as last shown."""
        return self.engine.state

    @property
    def epoch(self) -> int:
        """The board's motion epoch, as last shown."""
        return self.engine.epoch

    @property
    def credit(self) -> int:
        """Segments that may still be sent."""
        return self.engine.credit

    @property
    def telemetry(self) -> Telemetry | None:
        """The latest telemetry; None before the first."""
        return self.engine.telemetry

    @property
    def hello(self) -> HelloReply | None:
        """What the board said of itself when the session opened."""
        return self.engine.hello

    @property
    def clock(self) -> ClockEstimate:
        """Board time against host time; ValueError before the session is open."""
        return self.engine.clock.estimate()

    @property
    def now_us(self) -> int:
        """The transport's time."""
        return self.transport.now_us()

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Have each event passed to `callback`; returns what ends that."""
        self._subscribers.append(callback)

        def unsubscribe() -> None:
            if callback in self._subscribers:
                self._subscribers.remove(callback)

        return unsubscribe

    # -------------------------------------------------------------------------- waiting

    def run_until(self, done: Callable[[], bool], timeout_us: int, *, what: str = "") -> None:
        """Run the link until `done()` is true.

        Parameters
        ----------
        timeout_us
            Longest wait.
        what
            What is waited for, for the error's text.

        Raises
        ------
        DeadlineError
            It did not become true in time.
        LinkError
            The link failed.
        """
        deadline_us = self.transport.now_us() + timeout_us
        self._catch_up()
        while not self._turn(done):
            now_us = self.transport.now_us()
            if now_us >= deadline_us:
                raise DeadlineError(
                    f"{what or 'What was waited for'} did not happen within {timeout_us / 1e6:g} s."
                )
            wake_us = min(deadline_us, now_us + _SLICE_US)
            engine_us = self.engine.next_deadline_us
            if engine_us is not None:
                wake_us = max(now_us, min(wake_us, engine_us))
            self._read(wake_us)
            self._catch_up()

    def _read(self, deadline_us: int) -> bool:
        """Wait for bytes; return whether any came."""
        received = self.transport.receive(deadline_us)
        if received is None:
            self._read_up_to_us = deadline_us
            return False
        self._read_up_to_us = received[1]
        self.engine.receive(*received)
        return True

    def _catch_up(self) -> None:
        """After a break, read what came meanwhile before anything counts as late or lost."""
        now_us = self.transport.now_us()
        if now_us - self._read_up_to_us < _AWAY_US:
            return
        while self._read(now_us + _SLICE_US):
            pass

    def run_for(self, duration_us: int) -> None:
        """Run the link for a time."""
        end_us = self.transport.now_us() + duration_us
        self.run_until(lambda: self.transport.now_us() >= end_us, duration_us + _SLICE_US)

    def _turn(self, done: Callable[[], bool]) -> bool:
        """Do what is due, tell what happened; return whether the waiting is over."""
        now_us = self.transport.now_us()
        self.engine.poll(now_us)
        for pollable in self.pollables:
            pollable.poll(now_us)
        self._flush()
        self._tell()
        # Told ones may have sent something.
        self._flush()
        if self.engine.error is not None:
            raise self.engine.error
        return done()

    def _flush(self) -> None:
        data = self.engine.outgoing()
        if data:
            self.transport.send(data)

    def _tell(self) -> None:
        for event in self.engine.events():
            for callback in tuple(self._subscribers):
                callback(event)

    # ------------------------------------------------------------------------- commands

    def open(self, timeout_us: int = 6_000_000) -> HelloReply:
        """Shake hands and start a session.

        The timeout covers the two seconds for which a UNO's bootloader waits
        after the port was opened.

        Raises
        ------
        BoardSilentError
            Nothing that speaks this protocol answered.
        ProtocolMismatchError
            The board has the firmware of another version.
        """
        self.engine.open(self._session_id, self.transport.now_us())
        try:
            self.run_until(lambda: self.engine.is_open, timeout_us)
        except DeadlineError:
            raise BoardSilentError(
                f"No setae board answered on {self.transport.name} within {timeout_us / 1e6:g} s."
            ) from None
        assert self.engine.hello is not None
        return self.engine.hello

    def send(self, message: HostMessage) -> Ticket:
        """Send a command without waiting; its ticket tells what becomes of it."""
        ticket = self.engine.send(message, self.transport.now_us())
        self._flush()
        return ticket

    def request(self, message: HostMessage, timeout_us: int = 2_000_000) -> Ticket:
        """Send a command and wait until its end is known.

        Returns
        -------
        The ticket: executed, or discarded because a stop, trip or fault came first.

        Raises
        ------
        RefusedError
            The board did not carry it out.
        DeadlineError, LinkError
            As in `run_until`.
        """
        ticket = self.send(message)
        name = message.TYPE.name.lower()
        self.run_until(lambda: ticket.done, timeout_us, what=f"The answer to `{name}`")
        if ticket.state is TicketState.REFUSED and ticket.refusal is not None:
            raise refused_error(ticket.refusal)
        return ticket

    def send_stop(self) -> Ticket:
        """Put a stop on the line now; repeats go out while the session waits."""
        ticket = self.engine.stop(self.transport.now_us())
        self._flush()
        return ticket

    def stop(self, timeout_us: int = 2_000_000) -> None:
        """Stop the robot and wait until the board shows it.

        Raises
        ------
        DeadlineError, LinkError
            As in `run_until`: nobody knows whether it stopped.
        """
        ticket = self.send_stop()
        self.run_until(lambda: ticket.done, timeout_us, what="The stop's confirmation")

    def recall(self, record: Record) -> None:
        """Ask for a latched record; it comes as an event."""
        self.engine.recall(record, self.transport.now_us())
        self._flush()

    def read_limits(self, timeout_us: int = 2_000_000) -> Limits:
        """Return the limits in force."""
        found: list[Limits] = []

        def keep(event: Event) -> None:
            if isinstance(event, LimitsRead):
                found.append(event.limits)

        unsubscribe = self.subscribe(keep)
        end_us = self.transport.now_us() + timeout_us
        try:
            while True:
                self.engine.read_limits(self.transport.now_us())
                self._flush()
                left_us = end_us - self.transport.now_us()
                try:
                    self.run_until(
                        lambda: bool(found),
                        max(0, min(left_us, _READ_REPEAT_US)),
                        what="The answer to `read_limits`",
                    )
                except DeadlineError:
                    if left_us <= _READ_REPEAT_US:
                        raise
                else:
                    return found[0]
        finally:
            unsubscribe()

    def close(self) -> None:
        """Let go of the transport. The board plays what it has queued, then holds."""
        self.transport.close()

    @property
    def error(self) -> LinkError | None:
        """What ended the session; None while it lives."""
        return self.engine.error
