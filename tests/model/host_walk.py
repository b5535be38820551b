"""The model's host and the real engine, taken through the same events.

`walk.c` writes down what the model's host does and hears, in every state that it gets into.
Here an `Engine` does and hears the same; what it sends, knows and tells must be the model's.

python -m tests.model.host_walk          all scopes (a minute)
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from tests.model.checker import WHOLE
from tests.model.walk import Down, Step, Up, Walker, paths

from setae.link.engine import Engine
from setae.link.events import FaultReported, Refused, Ticket, TicketState, Tripped
from setae.link.handshake import Phase
from setae_protocol.frame import HostDecoder, encode_board
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    REFUSAL_WAITS,
    SCHEMA_HASH,
    Acknowledge,
    BoardMessage,
    Disarm,
    Enable,
    Fault,
    FaultMessage,
    Guard,
    GuardMessage,
    Hello,
    HelloReply,
    HostMessage,
    Limp,
    Ping,
    Pong,
    Recall,
    Receipt,
    Record,
    Reflex,
    Refusal,
    RefusalMessage,
    Relax,
    Resume,
    Sample,
    Segment,
    Segments,
    Sensor,
    State,
    Stop,
    Telemetry,
    Trip,
    TripCause,
)

# As in board.h and host.h.
_HELLO, _STOP, _SETTLE, _ACKNOWLEDGE, _ENABLE = 1, 2, 3, 4, 5
_HELLO_REPLY, _RECEIPT, _RECORD, _PONG = 13, 14, 15, 16
_SEQUENCES, _STOP_NUMBERS = 4, 4
_COMMANDS: Final[tuple[type[HostMessage], ...]] = (
    Enable, Segments, GuardMessage, Disarm, Relax, Limp, Resume, Segments,
)  # fmt: skip
_PHASES: Final = (Phase.ASKING, Phase.OPENING, Phase.SETTLING, Phase.OPEN, Phase.FAILED)
_ENDS: Final = {2: TicketState.EXECUTED, 3: TicketState.DISCARDED, 4: TicketState.REFUSED}
_RECORDS: Final = {Tripped: Record.TRIP, FaultReported: Record.FAULT, Refused: Record.REFUSAL}
_POSE: Final = (1700, 1700, 1700, 1700)
# One of the model's messages of segments; its queue holds two.
_PER_MESSAGE: Final = 5


class Double:
    """An engine that does what the model's host does."""

    def __init__(self) -> None:
        self._now_us = 0
        self._tokens: dict[int, int] = {}  # the model's: the real one's
        self._frame = 0
        self._late = 0
        self._start(1)

    def _start(self, session: int) -> None:
        self._engine = Engine()
        self._engine.open(session, self._now_us)
        self._tickets: dict[int, Ticket] = {}
        self._settle_token = 0

    @property
    def counts_otherwise(self) -> bool:
        """Whether so many stop numbers were drawn that the model, modulo 4, takes them again."""
        return self._engine._stops._number >= _STOP_NUMBERS

    def follow(self, step: Step) -> None:
        """Take an event, and fail where the engine is not as the model's host is then."""
        self._now_us += 1_000
        self._act(step)
        self._check_sent(step)
        self._check_told(step)
        self._check_known(step)

    # ------------------------------------------------------------------------ the event

    def _act(self, step: Step) -> None:
        """Times are each part's own: the model's host does one thing at a time."""
        engine, action = self._engine, step.action
        if action == "host_is_replaced":
            if step.before >= 0:
                self._start(max(frame.token for frame in step.sent) // 4)
        elif action == "user_stops":
            engine.stop(self._now_us)
        elif action.startswith("user_"):
            (sent,) = step.sent
            self._tickets[sent.command] = engine.send(self._command(sent), self._now_us)
        elif action == "host_sends_again":
            due_us = engine._reliable.next_deadline_us
            assert due_us is not None
            engine._reliable.poll(due_us)
        elif action == "host_stops_again":
            due_us = engine._stops.next_deadline_us
            assert due_us is not None
            engine._stops.poll(due_us)
        elif action == "host_asks_again":
            self._ask_again()
        else:
            self._hear(step.heard, fresh=action == "line_delivers_up")

    def _command(self, sent: Down) -> HostMessage:
        kind = sent.kind - _ENABLE
        epoch = self._engine.epoch
        if _COMMANDS[kind] is Segments:
            segment = Segment(1, _POSE)
            return Segments(epoch, _PER_MESSAGE, (segment,) * _PER_MESSAGE)
        messages: dict[type[HostMessage], HostMessage] = {
            Enable: Enable(pulse_ticks=_POSE),
            GuardMessage: GuardMessage(epoch, 1, 1, 1, Reflex.HOLD, _POSE, 1),
            Disarm: Disarm(reserved=0),
            Relax: Relax(slew_ticks=1, free_ticks=_POSE),
            Limp: Limp(reserved=0),
            Resume: Resume(epoch=epoch),
        }
        return messages[_COMMANDS[kind]]

    def _ask_again(self) -> None:
        """By its own time; in a session also by the silence."""
        handshake, heard_us = self._engine._handshake, self._engine._arrivals.heard_at_us
        due_us = handshake.next_deadline_us(heard_us)
        assert due_us is not None
        if handshake.in_session:
            due_us = max(due_us, heard_us + 150_000, handshake._probe_at_us)
            due_us = min(due_us, heard_us + 3_999_999)
        handshake.poll(due_us, heard_at_us=heard_us)

    def _hear(self, f: Up, *, fresh: bool) -> None:
        if f.session != self._engine.session:
            self._now_us = max(self._now_us, self._engine._handshake._probe_at_us)
        self._frame = (self._frame + 1) & 0xFF
        number = self._frame if fresh else (self._frame - 100) & 0xFF
        wire = encode_board(
            self._message(f),
            session=f.session,
            sequence=number,
            expected=self._expected(f),
            credit=f.credit * _PER_MESSAGE,
            epoch=f.epoch,
            state=(State.STOPPED if f.stopped else State.HOLDING) | f.waits * REFUSAL_WAITS,
        )
        self._engine.receive(wire, self._now_us)

    def _expected(self, f: Up) -> int:
        """The model counts modulo 4: what is not one of those under way is an old number."""
        flight = self._engine._reliable._flight
        first = flight[0].sequence if flight else self._engine._reliable._next_sequence
        ahead = (f.expected - first) % _SEQUENCES
        return (first + ahead - (_SEQUENCES if ahead > len(flight) else 0)) & 0xFF

    def _message(self, f: Up) -> BoardMessage:
        if f.kind == _HELLO_REPLY:
            token = self._tokens.get(f.token, 0xFFFF)
            return HelloReply(
                PROTOCOL_VERSION, SCHEMA_HASH, token, 1, 2, 3, 0, 2, 0, 1, _POSE, Sensor.OK
            )
        if f.kind == _RECEIPT:
            return Receipt(gap=0)
        if f.kind == _PONG:
            return Pong(self._settle_token if f.token == self._run else 0, self._frame, 0)
        if f.kind == _RECORD:
            return self._record(f)
        samples = (Sample(0, 0),) * 3
        return Telemetry(
            frame=self._frame, phase_us=0, pulse_ticks=_POSE, attached=15, queued=0,
            guard=Guard.OFF, reflex_running=0, sensor=Sensor.OK, baseline_raw=0, sample_count=0,
            samples=samples, rx_damaged=0, stop_number=f.token, underruns=0,
        )  # fmt: skip

    @property
    def _run(self) -> int:
        return self._engine._handshake._wanted_session

    def _record(self, f: Up) -> BoardMessage:
        if f.which == 0:
            return Trip(f.id, f.record_session, TripCause.CONTACT, 0, 0, 0, 0, (_POSE,) * 4)
        if f.which == 1:
            return FaultMessage(f.id, f.record_session, 0, Fault.SENSOR_BUS, 0, 0, 0, _POSE)
        ticket = self._tickets.get(f.command)
        sequence = f.sequence if ticket is None or ticket.sequence is None else ticket.sequence
        kind = _COMMANDS[f.refused_kind - _ENABLE].TYPE
        return RefusalMessage(f.id, f.record_session, kind, sequence, Refusal.BUSY, 255, 0, 0)

    # ------------------------------------------------------------------ what comes of it

    def _check_sent(self, step: Step) -> None:
        """It sends what the model's host sends; more only of what may go out at any time."""
        frames = HostDecoder().feed(self._engine.outgoing())
        for frame in frames:
            if isinstance(frame.message, Ping):
                self._settle_token = frame.message.token
            if isinstance(frame.message, Hello):
                self._tokens[self._run * 4 + step.known[0] + 1] = frame.message.token
        left = [(frame.header, frame.message) for frame in frames]
        recalled = {message.record for _, message in left if isinstance(message, Recall)}
        settles = any(isinstance(message, Ping) for _, message in left)
        assert recalled == (set(Record) if settles else set())
        left = [pair for pair in left if not isinstance(pair[1], Recall)]
        for wanted in step.sent:
            found = next((pair for pair in left if self._is(wanted, *pair)), None)
            assert found is not None, f"it does not send {wanted}, but {left}"
            left.remove(found)
        for _, message in left:
            more = isinstance(message, (Acknowledge, Hello)) or any(
                message is ticket.message or message == ticket.message
                for ticket in self._tickets.values()
                if not ticket.done
            )
            assert more, f"it sends {message}"

    def _is(self, wanted: Down, header: Any, message: HostMessage) -> bool:
        if header.session != wanted.session and wanted.kind != _HELLO:
            return False
        if wanted.kind == _HELLO:
            return isinstance(message, Hello) and message.new_session == wanted.value
        if wanted.kind == _STOP:
            number = message.stop_number if isinstance(message, Stop) else -1
            return number % _STOP_NUMBERS == wanted.value
        if wanted.kind == _SETTLE:
            return isinstance(message, Ping)
        if wanted.kind == _ACKNOWLEDGE:
            return message == Acknowledge(Record(wanted.value), wanted.token)
        ticket = self._tickets[wanted.command]
        return message == ticket.message and header.sequence == ticket.sequence

    def _check_told(self, step: Step) -> None:
        events = self._engine.events()
        told = [event for event in events if isinstance(event, (Tripped, FaultReported, Refused))]
        assert len(told) == step.heard.new, "whether it tells a record"
        for event in told:
            assert _RECORDS[type(event)] is Record(step.heard.which)
            assert event.record.record_id == step.heard.id
            assert event.earlier == bool(step.heard.earlier), "whose record it is"

    def _check_known(self, step: Step) -> None:
        engine = self._engine
        phase, session, epoch, credit, stopping, number, shown_known, shown = step.known
        assert engine.phase is _PHASES[phase]
        if engine.phase is Phase.FAILED:
            return
        assert engine.session == session
        stops = engine._stops
        assert stops.under_way == bool(stopping), "whether a stop is under way"
        assert self.counts_otherwise or stops._number == number
        assert (stops._shown_number is not None) == bool(shown_known)
        if shown_known:
            assert stops._shown_number == shown
        if phase >= _PHASES.index(Phase.SETTLING):
            assert engine.epoch == epoch
            assert engine.credit == credit * _PER_MESSAGE
        for kind, command, end in step.tickets:
            if kind:
                state = self._tickets[command].state
                assert state is _ENDS.get(end, TicketState.SENT), f"the end of command {command}"


def replay(path: list[Step]) -> None:
    """Take an engine along a path; AssertionError with the path where it leaves the model's."""
    double = Double()
    for place, step in enumerate(path):
        try:
            double.follow(step)
            if double.counts_otherwise:
                return
        except AssertionError as error:
            way = ", ".join(item.action for item in path[: place + 1])
            raise AssertionError(f"after {way}: {error}") from error


def main() -> None:
    """All scopes, as far as so many states lead."""
    states = 100_000
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        walker = Walker(Path(folder))
        for scope in WHOLE:
            steps = walker.steps(scope, states)
            for path in paths(steps):
                replay(path)
            count += len(steps)
            sys.stdout.write(f"{scope.name:10} {len(steps):>10} events of the host\n")
    sys.stdout.write(f"{count} events: the engine does what the model's host does\n")


if __name__ == "__main__":
    main()
