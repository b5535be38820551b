"""The link's rules, without input or output: bytes and time in, bytes and events out.

The engine puts the parts together; each of them keeps one rule:

- `handshake`: how a session opens, and how the host notices that it is over;
- `reliable`: commands, in order, sent again until the board has taken them;
- `retransmission`: how long to wait before sending again;
- `verdicts`: what became of a command that the board has taken;
- `stops`: ahead of everything, repeated until the board shows them;
- `records`: trips, faults and refusals, acknowledged and told once;
- `arrivals`: which board frames are new, late or lost;
- `timing`: pings and the board's clock;
- `outbox`: the frames that wait for the line.
"""

from __future__ import annotations

from setae.errors import LinkError
from setae.link.arrivals import Arrivals
from setae.link.clock import Clock
from setae.link.counts import Statistics
from setae.link.events import (
    Event,
    LimitsRead,
    LinkFailed,
    Opened,
    Refused,
    StateChanged,
    StatusReceived,
    TelemetryReceived,
    Ticket,
    TicketState,
)
from setae.link.handshake import Handshake, Phase
from setae.link.outbox import Outbox
from setae.link.records import Records
from setae.link.reliable import ReliableSender
from setae.link.stops import Stops
from setae.link.timing import Timing
from setae.link.verdicts import Verdicts
from setae_protocol.frame import BoardDecoder, BoardFrame, Damage
from setae_protocol.messages import (
    BoardMessage,
    FaultMessage,
    GuardMessage,
    HelloReply,
    HostMessage,
    Limits,
    Pong,
    ReadLimits,
    Receipt,
    Record,
    RefusalMessage,
    Segments,
    State,
    Status,
    Stop,
    Telemetry,
    Trip,
)

__all__ = ["Engine", "Phase", "Statistics"]


class Engine:
    """One side of one session with a board.

    After every call of `open`, `send`, `stop`, `receive` or `poll`: put
    `outgoing` on the line and look at `events`. Call `poll` no later than
    `next_deadline_us`. Times are host microseconds and never go back.

    Attributes
    ----------
    state, epoch
        As the board last showed them.
    telemetry
        The latest; None before the first.
    error
        What ended the session; None while it lives.
    statistics
        Counts of frames.
    """

    def __init__(self) -> None:
        self.state = State.RELAXED
        self.epoch = 0
        self.telemetry: Telemetry | None = None
        self.error: LinkError | None = None
        self.statistics = Statistics()
        self._events: list[Event] = []
        self._decoder = BoardDecoder()
        self._outbox = Outbox(self.statistics)
        self._arrivals = Arrivals(self.statistics)
        self._timing = Timing(self._outbox)
        self._handshake = Handshake(self._outbox, self._timing)
        self._verdicts = Verdicts()
        self._records = Records(self._outbox, self._verdicts)
        self._stops = Stops(self._outbox, self.statistics)
        self._reliable = ReliableSender(
            self._outbox, self._records, self._verdicts, self.statistics
        )

    # --------------------------------------------------------------------- what is known

    @property
    def phase(self) -> Phase:
        """Where the session stands."""
        return self._handshake.phase

    @property
    def is_open(self) -> bool:
        """Whether commands go out."""
        return self._handshake.phase is Phase.OPEN

    @property
    def session(self) -> int:
        """The session's number; 0 before there is one."""
        return self._outbox.session

    @property
    def hello(self) -> HelloReply | None:
        """What the board said of itself when the session opened."""
        return self._handshake.reply

    @property
    def clock(self) -> Clock:
        """Board time against host time."""
        return self._timing.clock

    @property
    def damage(self) -> dict[Damage, int]:
        """Frames dropped because they were damaged, by cause."""
        return self._decoder.damage

    @property
    def round_trip_us(self) -> float | None:
        """Smoothed time from a command to its receipt; None before the first."""
        return self._reliable.timer.smoothed_us

    @property
    def credit(self) -> int:
        """Segments that the board has room for, less those on their way."""
        return self._reliable.credit

    @property
    def next_deadline_us(self) -> int | None:
        """When `poll` has something to do, or None."""
        if self.phase is Phase.FAILED:
            return None
        times = [
            self._stops.next_deadline_us,
            self._handshake.next_deadline_us(self._arrivals.heard_at_us),
        ]
        if self.is_open:
            times += [self._reliable.next_deadline_us, self._timing.ping_at_us]
        return min([time for time in times if time is not None], default=None)

    # ------------------------------------------------------------------ what users call

    def open(self, session: int, now_us: int) -> None:
        """Start the handshake.

        Parameters
        ----------
        session
            1 to 255. If the board is in a session of this number, another is taken.
        """
        self._handshake.open(session, now_us)

    def send(self, message: HostMessage, now_us: int) -> Ticket:
        """Queue a reliable command; its ticket tells what becomes of it."""
        if not message.RELIABLE:
            raise ValueError(f"{type(message).__name__} is not a reliable command")
        ticket = Ticket(message)
        if self.phase is Phase.FAILED:
            ticket.state = TicketState.FAILED
        elif isinstance(message, (Segments, GuardMessage)) and (
            self._stops.under_way or (self.is_open and message.epoch != self.epoch)
        ):
            ticket.state = TicketState.DISCARDED
            ticket.discarded_by_epoch = self.epoch
        else:
            self._reliable.queue(ticket)
            self._pump(now_us)
        return ticket

    def stop(self, now_us: int) -> Ticket:
        """Stop the robot, ahead of everything; may be called in any phase but failed."""
        if self.phase is Phase.FAILED:
            return Ticket(Stop(stop_number=0), TicketState.FAILED)
        self._reliable.discard_at_stop(self.epoch)
        return self._stops.stop(now_us)

    def recall(self, record: Record, now_us: int) -> None:
        """Ask for a latched record; it comes as an event, told before or not."""
        del now_us
        self._records.recall(record)

    def read_limits(self, now_us: int) -> None:
        """Ask for the limits in force; they come as an event."""
        del now_us
        self._outbox.put(ReadLimits(token=0))

    def outgoing(self) -> bytes:
        """Take the bytes that are to go on the line now."""
        return self._outbox.take()

    def events(self) -> list[Event]:
        """Take what has happened since the last call."""
        events, self._events = self._events, []
        return events

    def receive(self, data: bytes, now_us: int) -> None:
        """Take bytes from the line."""
        for frame in self._decoder.feed(data):
            if self.phase is Phase.FAILED:
                return
            try:
                self._on_frame(frame, now_us)
            except LinkError as error:
                self._fail(error)
        self._pump(now_us)

    def poll(self, now_us: int) -> None:
        """Do what is due: repeat, give up, ask."""
        if self.phase is Phase.FAILED:
            return
        self._stops.poll(now_us)
        try:
            self._handshake.poll(now_us, heard_at_us=self._arrivals.heard_at_us)
            if self.is_open:
                self._reliable.poll(now_us)
        except LinkError as error:
            self._fail(error)
            return
        if self.is_open and now_us >= self._timing.ping_at_us:
            self._timing.ping(now_us)
        self._pump(now_us)

    # ------------------------------------------------------------------------ receiving

    def _on_frame(self, frame: BoardFrame, now_us: int) -> None:
        header, message = frame.header, frame.message
        if isinstance(message, HelloReply):
            self._on_hello(frame, message, now_us)
        elif not self._handshake.in_session:
            if isinstance(message, Receipt) and frame.state in (State.STOPPED, State.FAULT):
                self._stops.confirm()
        elif header.session != self.session:
            # From before our session, or from a reset board: only an answer tells.
            self.statistics.frames_foreign += 1
            self._handshake.probe(now_us)
        else:
            self.statistics.frames_received += 1
            fresh = self._arrivals.note(header.sequence, now_us)
            confirmed = fresh and self._on_header(frame, now_us)
            self._on_message(message, now_us, fresh=fresh, confirmed=confirmed)

    def _on_hello(self, frame: BoardFrame, reply: HelloReply, now_us: int) -> None:
        header = frame.header
        if self._handshake.in_session and header.session == self.session:
            # It lives, only its telemetry is lost. Or a late answer of the handshake.
            self._arrivals.note(header.sequence, now_us)
        elif self._handshake.on_hello(header, reply, now_us):
            self._arrivals.start(header.sequence, now_us)
            self._reliable.board_credit = header.credit
            self.state, self.epoch = frame.state, header.epoch

    def _on_header(self, frame: BoardFrame, now_us: int) -> bool:
        """Return whether it confirms a command."""
        header, state = frame.header, frame.state
        if (state, header.epoch) != (self.state, self.epoch):
            self._events.append(StateChanged(state, header.epoch, self.state, self.epoch, now_us))
            moved_on = header.epoch != self.epoch
            self.state, self.epoch = state, header.epoch
            if moved_on:
                self._reliable.discard_stale(self.epoch)
        confirmed = self._reliable.on_header(header, now_us)
        self._verdicts.on_header(refusal_waits=frame.refusal_waits)
        return confirmed

    def _on_message(
        self, message: BoardMessage, now_us: int, *, fresh: bool, confirmed: bool
    ) -> None:
        if isinstance(message, Telemetry):
            if fresh:
                self._on_telemetry(message, now_us)
        elif isinstance(message, Receipt):
            if fresh and not confirmed:
                self._reliable.on_receipt(gap=bool(message.gap), now_us=now_us)
        elif isinstance(message, (Trip, FaultMessage, RefusalMessage)):
            settling = self.phase is Phase.SETTLING
            event = self._records.receive(message, now_us, settling=settling)
            if event is not None:
                self._events.append(event)
                if isinstance(event, Refused) and event.ticket is not None:
                    self._reliable.on_refusal()
        elif isinstance(message, Pong):
            self._on_pong(message, now_us)
        elif isinstance(message, Limits):
            self._events.append(LimitsRead(message))
        elif isinstance(message, Status) and fresh:
            self._events.append(StatusReceived(message, now_us))

    def _on_telemetry(self, message: Telemetry, now_us: int) -> None:
        self.telemetry = message
        self._timing.on_telemetry(message, now_us)
        self._events.append(TelemetryReceived(message, self.state, self.epoch, self.credit, now_us))
        self._stops.on_telemetry(message)
        self._open_if_settled()

    def _on_pong(self, message: Pong, now_us: int) -> None:
        self._handshake.on_pong(message.token)
        round_trip_us = self._timing.on_pong(message, now_us)
        if round_trip_us is not None:
            # It is known which ping was answered, however often commands were sent.
            self._reliable.timer.measure(round_trip_us)
            self._reliable.timer.recover()
        self._open_if_settled()

    def _open_if_settled(self) -> None:
        if self._handshake.settled and self.telemetry is not None:
            assert self.hello is not None
            self._handshake.finish()
            self._reliable.discard_stale(self.epoch)
            self._events.append(Opened(self.session, self.hello))

    # -------------------------------------------------------------------------- sending

    def _pump(self, now_us: int) -> None:
        if self.is_open:
            self._reliable.pump(now_us)

    def _fail(self, error: LinkError) -> None:
        self._handshake.fail()
        self.error = error
        self._reliable.fail()
        self._verdicts.fail()
        self._stops.fail()
        self._outbox.clear()
        self._events.append(LinkFailed(error))
