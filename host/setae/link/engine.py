"""The link's rules, without input or output: bytes and time in, bytes and events out.

Reliable commands go out in order, at most a window of them at a time, and are
sent again until the board has confirmed them (go-back-N). The board carries each
out once, in order. A stop is not in that queue: it goes ahead of it and is
repeated until the board shows it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Final, TypeAlias

from setae.errors import (
    BoardResetError,
    LinkError,
    LinkLostError,
    ProtocolMismatchError,
)
from setae.link.clock import Clock
from setae.link.events import (
    Event,
    FaultReported,
    LimitsRead,
    LinkFailed,
    Opened,
    Refused,
    StateChanged,
    TelemetryReceived,
    Ticket,
    TicketState,
    Tripped,
)
from setae_protocol.frame import BoardDecoder, BoardFrame, Damage, encode_host
from setae_protocol.messages import (
    BAUD,
    BOARD_OVERHEAD_BYTES,
    HOST_OVERHEAD_BYTES,
    PROTOCOL_VERSION,
    RECORD_REPEAT_FRAMES,
    SCHEMA_HASH,
    SERVO_FRAME_US,
    WINDOW_FRAMES,
    Acknowledge,
    BoardHeader,
    FaultMessage,
    GuardMessage,
    Hello,
    HelloReply,
    HostMessage,
    Limits,
    Ping,
    Pong,
    ReadLimits,
    Recall,
    Receipt,
    Record,
    RefusalMessage,
    ResetCause,
    Resume,
    Segments,
    State,
    Stop,
    Telemetry,
    Trip,
)

__all__ = ["Engine", "Statistics"]

# RFC 6298, with a floor far above a frame's time on the line and the 4 ms that a USB chip
# may hold back an answer.
_RTO_FLOOR_US: Final = 25_000
_RTO_INITIAL_US: Final = 200_000
_RTO_MAX_US: Final = 400_000
_TRIES_MAX: Final = 20
_STOP_REPEAT_US: Final = 10_000
_HELLO_REPEAT_US: Final = 200_000
_SETTLE_REPEAT_US: Final = 50_000
# Telemetry comes every 20 ms. Without it, ask whether the board is still in the session.
_SILENCE_US: Final = 150_000
# Longer than a bootloader takes: a board that was reset then says so itself.
_LOST_US: Final = 4_000_000
_PING_US: Final = 1_000_000
# Board frames are numbered modulo 256; after this much silence an old number means nothing.
_RESYNCHRONISE_US: Final = 500_000
_MICROSECONDS_PER_BYTE: Final = 10 * 1_000_000 // BAUD

RecordMessage: TypeAlias = Trip | FaultMessage | RefusalMessage
_EPOCH_BOUND = (Segments, GuardMessage, Resume)


class Phase(Enum):
    """Where the handshake stands."""

    CLOSED = "closed"
    ASKING = "asking"  # for version and running session
    OPENING = "opening"  # our session
    SETTLING = "settling"  # reading what was latched before
    OPEN = "open"
    FAILED = "failed"


@dataclass(slots=True)
class Statistics:
    """What the link went through, since it was opened."""

    frames_received: int = 0
    frames_lost: int = 0
    frames_late: int = 0
    frames_foreign: int = 0
    frames_sent: int = 0
    frames_retransmitted: int = 0
    timeouts: int = 0
    stops_sent: int = 0


@dataclass(slots=True)
class _InFlight:
    ticket: Ticket
    first_sent_us: int
    gaps_when_sent: int
    transmissions: int = 1


@dataclass(slots=True)
class _Unconfirmed:
    """Acknowledged, but the refusal's record may have been lost on the way up."""

    ticket: Ticket
    end: TicketState
    epoch: int
    certain: bool  # no board frame was lost since the command was sent
    clean_from_frame: int | None = None


class Engine:
    """One side of one session with a board.

    After every call of `open`, `send`, `stop`, `receive` or `poll`: put
    `outgoing` on the line and look at `events`. Call `poll` no later than
    `next_deadline_us`. Times are host microseconds and never go back.

    Attributes
    ----------
    state, epoch, credit
        As the board last showed them. `credit` is what is left after the
        segments that are on their way.
    clock
        Board time against host time.
    statistics
        Counts of frames.
    """

    def __init__(self) -> None:
        self.state = State.RELAXED
        self.epoch = 0
        self.session = 0
        self.clock = Clock()
        self.statistics = Statistics()
        self.telemetry: Telemetry | None = None
        self.hello: HelloReply | None = None
        self.phase = Phase.CLOSED
        self.error: LinkError | None = None
        self._decoder = BoardDecoder()
        self._out: list[bytes] = []
        self._events: list[Event] = []
        self._token = 0
        # Handshake.
        self._hello_token: int | None = None
        self._settle_token: int | None = None
        self._settled = False
        self._repeat_at_us = 0
        self._wanted_session = 0
        # Reliable commands.
        self._queue: deque[Ticket] = deque()
        self._flight: deque[_InFlight] = deque()
        self._unconfirmed: list[_Unconfirmed] = []
        self._recent: deque[Ticket] = deque(maxlen=64)
        self._next_sequence = 0
        self._board_credit = 0
        self._rto_us = _RTO_INITIAL_US
        self._srtt_us: float | None = None
        self._rttvar_us = 0.0
        self._timeout_at_us = 0
        self._tries = 0
        self._resent_at_us: int | None = None
        # Stop.
        self._stops: list[Ticket] = []
        self._stop_number = 0
        self._stop_at_us = 0
        # What the board sends by itself.
        self._last_sequence: int | None = None
        self._gaps = 0
        self._heard_at_us = 0
        self._probe_at_us = 0
        self._seen: dict[Record, deque[int]] = {record: deque(maxlen=8) for record in Record}
        self._recalled: set[Record] = set()
        self._pings: dict[int, int] = {}
        self._ping_at_us = 0

    # ------------------------------------------------------------------ what users call

    @property
    def is_open(self) -> bool:
        """Whether commands go out."""
        return self.phase is Phase.OPEN

    @property
    def damage(self) -> dict[Damage, int]:
        """Frames dropped because they were damaged, by cause."""
        return self._decoder.damage

    @property
    def round_trip_us(self) -> float | None:
        """Smoothed time from a command to its receipt; None before the first."""
        return self._srtt_us

    @property
    def credit(self) -> int:
        """Segments that the board has room for, less those on their way."""
        on_their_way = sum(
            item.ticket.message.count
            for item in self._flight
            if isinstance(item.ticket.message, Segments)
        )
        return self._board_credit - on_their_way

    def open(self, session: int, now_us: int) -> None:
        """Start the handshake.

        Parameters
        ----------
        session
            1 to 255. If the board is in a session of this number, another is taken.
        """
        if self.phase is not Phase.CLOSED:
            raise ValueError("an engine opens one session only")
        if not 1 <= session <= 255:
            raise ValueError(f"session must be 1 to 255, not {session}")
        self._wanted_session = session
        self._token = session << 16
        self.phase = Phase.ASKING
        # Ends whatever the board had half received.
        self._out.append(b"\0")
        self._say_hello(0, now_us)

    def send(self, message: HostMessage, now_us: int) -> Ticket:
        """Queue a reliable command; its ticket tells what becomes of it."""
        if not message.RELIABLE:
            raise ValueError(f"{type(message).__name__} is not a reliable command")
        ticket = Ticket(message)
        if self.phase is Phase.FAILED:
            ticket.state = TicketState.FAILED
        elif isinstance(message, (Segments, GuardMessage)) and (
            self._stops or (self.is_open and message.epoch != self.epoch)
        ):
            ticket.state = TicketState.DISCARDED
            ticket.discarded_by_epoch = self.epoch
        else:
            self._queue.append(ticket)
            self._pump(now_us)
        return ticket

    def stop(self, now_us: int) -> Ticket:
        """Stop the robot, ahead of everything; may be called in any phase but failed."""
        ticket = Ticket(Stop(stop_number=0))
        if self.phase is Phase.FAILED:
            ticket.state = TicketState.FAILED
            return ticket
        for waiting in list(self._queue):
            if isinstance(waiting.message, _EPOCH_BOUND):
                self._queue.remove(waiting)
                self._discard(waiting)
        self._raise_stop_number()
        ticket.message = Stop(stop_number=self._stop_number)
        ticket.state = TicketState.SENT
        # The newest stands for all that are under way: once it is done, so are they.
        self._stops.append(ticket)
        self._send_stop(now_us)
        return ticket

    def recall(self, record: Record, now_us: int) -> None:
        """Ask for a latched record; it comes as an event, told before or not."""
        del now_us
        self._recalled.add(record)
        self._send_plain(Recall(record=record))

    def read_limits(self, now_us: int) -> None:
        """Ask for the limits in force; they come as an event."""
        del now_us
        self._send_plain(ReadLimits(token=0))

    def outgoing(self) -> bytes:
        """Take the bytes that are to go on the line now."""
        data = b"".join(self._out)
        self._out.clear()
        return data

    def events(self) -> list[Event]:
        """Take what has happened since the last call."""
        events, self._events = self._events, []
        return events

    def receive(self, data: bytes, now_us: int) -> None:
        """Take bytes from the line."""
        for frame in self._decoder.feed(data):
            if self.phase is Phase.FAILED:
                return
            self._on_frame(frame, now_us)
        self._pump(now_us)

    def poll(self, now_us: int) -> None:
        """Do what is due: repeat, give up, ask."""
        if self.phase in (Phase.CLOSED, Phase.FAILED):
            if self._stops and now_us >= self._stop_at_us:
                self._send_stop(now_us)
            return
        if self._stops and now_us >= self._stop_at_us:
            if self.telemetry is None:
                # Nobody told the number of the board's last stop; ours may be the same.
                self._raise_stop_number()
            self._send_stop(now_us)
        if self.phase in (Phase.ASKING, Phase.OPENING) and now_us >= self._repeat_at_us:
            self._say_hello(0 if self.phase is Phase.ASKING else self.session, now_us)
        elif self.phase is Phase.SETTLING and now_us >= self._repeat_at_us:
            self._settle(now_us)
        if self.phase not in (Phase.SETTLING, Phase.OPEN):
            return
        if now_us - self._heard_at_us >= _LOST_US:
            self._fail(LinkLostError(f"The board has been silent for {_LOST_US / 1e6:.0f} s."))
            return
        if now_us - self._heard_at_us >= _SILENCE_US and now_us >= self._probe_at_us:
            self._probe(now_us)
        if self._flight and now_us >= self._timeout_at_us:
            self._tries += 1
            if self._tries > _TRIES_MAX:
                name = type(self._flight[0].ticket.message).__name__.lower()
                self._fail(
                    LinkLostError(f"The board did not confirm `{name}` in {_TRIES_MAX} tries.")
                )
                return
            self.statistics.timeouts += 1
            self._rto_us = min(2 * self._rto_us, _RTO_MAX_US)
            self._retransmit(now_us)
        if self.is_open and now_us >= self._ping_at_us:
            self._ping(now_us)
        self._pump(now_us)

    @property
    def next_deadline_us(self) -> int | None:
        """When `poll` has something to do, or None."""
        if self.phase is Phase.FAILED:
            return None
        times = []
        if self._stops:
            times.append(self._stop_at_us)
        if self.phase in (Phase.ASKING, Phase.OPENING, Phase.SETTLING):
            times.append(self._repeat_at_us)
        if self.phase in (Phase.SETTLING, Phase.OPEN):
            times.append(max(self._heard_at_us + _SILENCE_US, self._probe_at_us))
            times.append(self._heard_at_us + _LOST_US)
            if self._flight:
                times.append(self._timeout_at_us)
            if self.is_open:
                times.append(self._ping_at_us)
        return min(times) if times else None

    # -------------------------------------------------------------------------- sending

    def _send_plain(self, message: HostMessage, *, session: int | None = None) -> None:
        session = self.session if session is None else session
        self._out.append(encode_host(message, session=session))
        self.statistics.frames_sent += 1

    def _new_token(self) -> int:
        self._token = (self._token + 1) & 0xFFFFFFFF
        return self._token

    def _say_hello(self, new_session: int, now_us: int) -> None:
        # One token for all repeats: a late answer to an earlier repeat is as good.
        if self._hello_token is None:
            self._hello_token = self._new_token()
        self._send_plain(
            Hello(
                protocol_version=PROTOCOL_VERSION,
                schema_hash=SCHEMA_HASH,
                new_session=new_session,
                token=self._hello_token,
            )
        )
        self._repeat_at_us = now_us + _HELLO_REPEAT_US

    def _settle(self, now_us: int) -> None:
        """Ask for what was latched before, so that it isn't taken for this session's."""
        for record in Record:
            self._send_plain(Recall(record=record))
        self._settle_token = self._ping(now_us)
        self._repeat_at_us = now_us + _SETTLE_REPEAT_US

    def _ping(self, now_us: int) -> int:
        token = self._new_token()
        self._pings[token] = now_us
        while len(self._pings) > 8:
            del self._pings[next(iter(self._pings))]
        self._send_plain(Ping(token=token))
        self._ping_at_us = now_us + _PING_US
        return token

    def _probe(self, now_us: int) -> None:
        """Ask which session the board is in. The answer of a reset board says 0."""
        self._hello_token = None
        self._say_hello(0, now_us)
        self._probe_at_us = now_us + _SILENCE_US

    def _raise_stop_number(self) -> None:
        last = self._stop_number
        if not self._stops and self.telemetry is not None:
            last = self.telemetry.stop_number
        self._stop_number = (last + 1) & 0xFF

    def _send_stop(self, now_us: int) -> None:
        frame = encode_host(Stop(stop_number=self._stop_number), session=self.session)
        self._out.insert(0, frame)
        self.statistics.frames_sent += 1
        self.statistics.stops_sent += 1
        self._stop_at_us = now_us + _STOP_REPEAT_US

    def _pump(self, now_us: int) -> None:
        """Send queued commands as far as the window and the board's queue allow."""
        if not self.is_open:
            return
        while self._queue and len(self._flight) < WINDOW_FRAMES:
            message = self._queue[0].message
            if isinstance(message, Segments) and self.credit < message.count:
                return
            ticket = self._queue.popleft()
            ticket.sequence = self._next_sequence
            ticket.state = TicketState.SENT
            self._next_sequence = (self._next_sequence + 1) & 0xFF
            if not self._flight:
                self._timeout_at_us = now_us + self._rto_us
            self._flight.append(_InFlight(ticket, now_us, self._gaps))
            self._recent.append(ticket)
            self._transmit(ticket)

    def _transmit(self, ticket: Ticket) -> None:
        if isinstance(ticket.message, (Resume, GuardMessage)):
            # They are refused while a record waits; an acknowledgement may have been lost.
            for record, ids in self._seen.items():
                if ids:
                    self._send_plain(Acknowledge(record=record, record_id=ids[-1]))
        assert ticket.sequence is not None
        self._out.append(
            encode_host(ticket.message, session=self.session, sequence=ticket.sequence)
        )
        self.statistics.frames_sent += 1

    def _retransmit(self, now_us: int) -> None:
        for item in self._flight:
            item.transmissions += 1
            self._transmit(item.ticket)
            self.statistics.frames_retransmitted += 1
        self._resent_at_us = now_us
        self._timeout_at_us = now_us + self._rto_us

    # ------------------------------------------------------------------------ receiving

    def _on_frame(self, frame: BoardFrame, now_us: int) -> None:
        header, message = frame.header, frame.message
        if isinstance(message, HelloReply):
            self._on_hello(header, message, now_us)
            return
        if self.phase in (Phase.CLOSED, Phase.ASKING, Phase.OPENING):
            if isinstance(message, Receipt) and header.state in (State.STOPPED, State.FAULT):
                self._stop_done()
            return
        if header.session != self.session:
            # From before our session, or from a reset board: only an answer tells.
            self.statistics.frames_foreign += 1
            if now_us >= self._probe_at_us:
                self._probe(now_us)
            return
        self.statistics.frames_received += 1
        fresh = self._note_sequence(header.sequence, now_us)
        if fresh:
            self._on_header(header, now_us)
        self._on_message(message, header, now_us, fresh=fresh)
        if fresh and isinstance(message, Receipt) and message.gap and self._flight:
            since = self._resent_at_us
            if since is None or now_us - since >= (self._srtt_us or _RTO_FLOOR_US):
                self._retransmit(now_us)

    def _on_hello(self, header: BoardHeader, reply: HelloReply, now_us: int) -> None:
        if self.phase in (Phase.SETTLING, Phase.OPEN) and header.session == self.session:
            # It lives, only its telemetry is lost. Or a late answer of the handshake.
            self._note_sequence(header.sequence, now_us)
            return
        if reply.token != self._hello_token:
            return
        if (reply.protocol_version, reply.schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH):
            firmware = f"{reply.firmware_major}.{reply.firmware_minor}.{reply.firmware_patch}"
            self._fail(
                ProtocolMismatchError(
                    f"The board's firmware {firmware} speaks protocol {reply.protocol_version}"
                    f" (schema {reply.schema_hash:08x}); this host speaks protocol"
                    f" {PROTOCOL_VERSION} (schema {SCHEMA_HASH:08x})."
                )
            )
            return
        if self.phase is Phase.ASKING:
            self.phase = Phase.OPENING
            self.session = self._wanted_session
            if self.session == header.session:
                self.session = self.session % 255 + 1
            self._hello_token = None
            self._say_hello(self.session, now_us)
        elif self.phase is Phase.OPENING and header.session == self.session:
            self.hello = reply
            self._heard_at_us = now_us
            self._hello_token = None
            self.phase = Phase.SETTLING
            self._last_sequence = header.sequence
            self._board_credit = header.credit
            self.epoch = header.epoch
            self.state = State(header.state)
            self._settle(now_us)
        elif self.phase in (Phase.SETTLING, Phase.OPEN):
            cause = (
                ResetCause(reply.reset_cause).doc
                if reply.reset_cause in ResetCause._value2member_map_
                else ""
            )
            self._fail(
                BoardResetError(f"The board started anew in the middle of the session. {cause}")
                if header.session == 0
                else BoardResetError(
                    f"Another host opened session {header.session} on this board.",
                    "Close the other program, then connect again.",
                )
            )

    def _note_sequence(self, sequence: int, now_us: int) -> bool:
        """Count lost frames; return whether this one is newer than all before it."""
        silent = now_us - self._heard_at_us >= _RESYNCHRONISE_US
        step = 1 if self._last_sequence is None else (sequence - self._last_sequence) & 0xFF
        if not silent and (step == 0 or step >= 128):
            self.statistics.frames_late += 1
            return False
        if step != 1:
            self.statistics.frames_lost += (step - 1) & 0xFF
            self._gaps += 1
            for item in self._unconfirmed:
                item.certain = False
                item.clean_from_frame = None
        self._last_sequence = sequence
        self._heard_at_us = now_us
        return True

    def _on_header(self, header: BoardHeader, now_us: int) -> None:
        state = State(header.state)
        if (state, header.epoch) != (self.state, self.epoch):
            self._events.append(StateChanged(state, header.epoch, self.state, self.epoch, now_us))
            moved_on = header.epoch != self.epoch
            self.state, self.epoch = state, header.epoch
            if moved_on:
                self._discard_queued()
        self._board_credit = header.credit
        if not self._flight:
            return
        oldest = self._flight[0].ticket.sequence
        assert oldest is not None
        confirmed = (header.expected - oldest) & 0xFF
        if not 0 < confirmed <= len(self._flight):
            return
        for _ in range(confirmed):
            item = self._flight.popleft()
            self._on_confirmed(item, header.epoch)
        if item.transmissions == 1:  # Karn: nobody knows which of several was answered
            self._measure(now_us - item.first_sent_us)
        self._tries = 0
        if self._srtt_us is not None:
            self._rto_us = self._rto_from_estimate()
        self._timeout_at_us = now_us + self._rto_us

    def _on_confirmed(self, item: _InFlight, epoch: int) -> None:
        ticket = item.ticket
        if ticket.done:
            return
        end = TicketState.EXECUTED
        if isinstance(ticket.message, (Segments, GuardMessage)) and ticket.message.epoch != epoch:
            end = TicketState.DISCARDED
        certain = item.gaps_when_sent == self._gaps
        self._unconfirmed.append(_Unconfirmed(ticket, end, epoch, certain))

    def _confirm(self, frame: int) -> None:
        """Settle the tickets of which no refusal can come any more.

        The board sends the record of a refusal ahead of its next telemetry, and
        repeats it until it is acknowledged. So no refusal is on its way where
        telemetry has come and no board frame was lost since the command was
        sent; or, where one was, after as many frames without a loss as lie
        between two repeats.
        """
        still = []
        for item in self._unconfirmed:
            if item.ticket.done:
                continue
            if item.clean_from_frame is None:
                item.clean_from_frame = frame
            if item.certain or frame - item.clean_from_frame > RECORD_REPEAT_FRAMES:
                item.ticket.state = item.end
                if item.end is TicketState.DISCARDED:
                    item.ticket.discarded_by_epoch = item.epoch
            else:
                still.append(item)
        self._unconfirmed = still

    def _measure(self, round_trip_us: int) -> None:
        """RFC 6298, section 2."""
        if self._srtt_us is None:
            self._srtt_us = float(round_trip_us)
            self._rttvar_us = round_trip_us / 2
        else:
            error = abs(self._srtt_us - round_trip_us)
            self._rttvar_us += (error - self._rttvar_us) / 4
            self._srtt_us += (round_trip_us - self._srtt_us) / 8

    def _rto_from_estimate(self) -> int:
        assert self._srtt_us is not None
        return max(_RTO_FLOOR_US, min(_RTO_MAX_US, int(self._srtt_us + 4 * self._rttvar_us)))

    def _on_message(
        self, message: object, header: BoardHeader, now_us: int, *, fresh: bool
    ) -> None:
        if isinstance(message, Telemetry):
            if fresh:
                self._on_telemetry(message, header, now_us)
        elif isinstance(message, (Trip, FaultMessage, RefusalMessage)):
            self._on_record(message, now_us)
        elif isinstance(message, Pong):
            self._on_pong(message, now_us)
        elif isinstance(message, Limits):
            self._events.append(LimitsRead(message))

    def _on_telemetry(self, message: Telemetry, header: BoardHeader, now_us: int) -> None:
        self.telemetry = message
        self._note_time(message, Telemetry.SIZE, now_us)
        self._events.append(
            TelemetryReceived(message, self.state, header.epoch, self.credit, now_us)
        )
        if self._stops and message.stop_number == self._stop_number:
            self._stop_done()
        self._confirm(message.frame)
        if self.phase is Phase.SETTLING and self._settled:
            self._opened()

    def _note_time(self, message: Telemetry | Pong, size: int, now_us: int) -> int:
        board_us = message.frame * SERVO_FRAME_US + message.phase_us
        line_us = (BOARD_OVERHEAD_BYTES + size) * _MICROSECONDS_PER_BYTE
        self.clock.add(board_us=board_us, received_us=now_us - line_us)
        return board_us

    def _on_pong(self, message: Pong, now_us: int) -> None:
        sent_us = self._pings.pop(message.token, None)
        if sent_us is None:
            return
        board_us = self._note_time(message, Pong.SIZE, now_us)
        line_us = (HOST_OVERHEAD_BYTES + Ping.SIZE) * _MICROSECONDS_PER_BYTE
        self.clock.add_sent(sent_us=sent_us + line_us, board_us=board_us)
        if self.phase is Phase.SETTLING and message.token == self._settle_token:
            if self._srtt_us is None:
                self._measure(now_us - sent_us)
                self._rto_us = self._rto_from_estimate()
            self._settled = True
            if self.telemetry is not None:
                self._opened()

    def _opened(self) -> None:
        assert self.hello is not None
        self.phase = Phase.OPEN
        self._discard_queued()
        self._events.append(Opened(self.session, self.hello))

    def _on_record(self, message: RecordMessage, now_us: int) -> None:
        kind = {Trip: Record.TRIP, FaultMessage: Record.FAULT, RefusalMessage: Record.REFUSAL}[
            type(message)
        ]
        if message.record_id == 0:
            return  # an empty latch
        # Each time: the last acknowledgement may have been lost.
        self._send_plain(Acknowledge(record=kind, record_id=message.record_id))
        asked = kind in self._recalled
        self._recalled.discard(kind)
        known = message.record_id in self._seen[kind]
        if known and not asked:
            return
        if not known:
            self._seen[kind].append(message.record_id)
        earlier = self.phase is Phase.SETTLING
        if isinstance(message, Trip):
            self._events.append(Tripped(message, earlier, now_us))
        elif isinstance(message, FaultMessage):
            self._events.append(FaultReported(message, earlier, now_us))
        else:
            ticket = None if earlier or known else self._refused_ticket(message)
            self._events.append(Refused(message, ticket, earlier, now_us))

    def _refused_ticket(self, message: RefusalMessage) -> Ticket | None:
        for ticket in reversed(self._recent):
            if (
                ticket.sequence == message.command_sequence
                and message.command_type == ticket.message.TYPE
            ):
                ticket.state = TicketState.REFUSED
                ticket.refusal = message
                ticket.discarded_by_epoch = None
                return ticket
        return None

    # ---------------------------------------------------------------------------- ends

    def _stop_done(self) -> None:
        for ticket in self._stops:
            ticket.state = TicketState.EXECUTED
        self._stops.clear()

    def _discard(self, ticket: Ticket) -> None:
        ticket.state = TicketState.DISCARDED
        ticket.discarded_by_epoch = self.epoch

    def _discard_queued(self) -> None:
        """What was planned for an older epoch need not go out at all."""
        for ticket in list(self._queue):
            message = ticket.message
            if isinstance(message, (Segments, GuardMessage)) and message.epoch != self.epoch:
                self._queue.remove(ticket)
                self._discard(ticket)

    def _fail(self, error: LinkError) -> None:
        self.phase = Phase.FAILED
        self.error = error
        tickets = [*self._queue, *(item.ticket for item in self._flight)]
        tickets += [item.ticket for item in self._unconfirmed]
        tickets += self._stops
        self._stops.clear()
        for ticket in tickets:
            if not ticket.done:
                ticket.state = TicketState.FAILED
        self._queue.clear()
        self._flight.clear()
        self._unconfirmed.clear()
        self._out.clear()
        self._events.append(LinkFailed(error))
