"""Each test opens with what went wrong once."""

from __future__ import annotations

from collections import deque

import pytest
from tests.host.link.model import (
    POSE,
    SECOND_US,
    ModelTransport,
    record_events,
    segments,
)

from setae.board import Board
from setae.errors import BoardResetError, DeadlineError, FaultError
from setae.link.events import FaultReported, Refused, TicketState, Tripped
from setae.link.handshake import Phase
from setae.link.session import Session
from setae_protocol.frame import HostDecoder, encode_host
from setae_protocol.messages import (
    BoardMessage,
    Disarm,
    Enable,
    Fault,
    MessageType,
    Recall,
    Record,
    Refusal,
    RefusalMessage,
    Resume,
    State,
    Stop,
)


class WithoutRecall(ModelTransport):
    """A line that loses every `recall`."""

    def send(self, data: bytes) -> None:
        kept = b""
        for wire in data.split(b"\0")[:-1]:
            frames = HostDecoder().feed(wire + b"\0")
            if not (frames and isinstance(frames[0].message, Recall)):
                kept += wire + b"\0"
        super().send(kept)


@pytest.mark.parametrize("delay_us", [60_000, 350_000])
def test_a_slow_line_opens_a_session(delay_us: int) -> None:
    """The handshake took the answer to its latest ping only, and sent one every 50 ms.

    So a line on which an answer takes longer than that never opened.
    """
    line = ModelTransport()
    line.delay_us = delay_us
    session = Session(line, session_id=7)
    session.open(5 * SECOND_US)
    assert session.request(Enable(pulse_ticks=POSE)).state is TicketState.EXECUTED


def test_a_line_that_becomes_slow_is_learnt() -> None:
    """Each command was sent three times for ever.

    Nobody can say which of several copies was answered, so a round trip longer
    than the timeout was never measured.
    """
    line = ModelTransport()
    session = Session(line, session_id=7)
    session.open()
    line.delay_us = 60_000
    session.run_for(5 * SECOND_US)
    session.request(Enable(pulse_ticks=POSE))
    before = session.engine.statistics.frames_retransmitted
    for _ in range(10):
        session.request(Disarm(reserved=0))
    assert session.engine.statistics.frames_retransmitted == before


def test_a_reset_is_noticed_on_a_slow_line() -> None:
    """Only the answer to the latest question counted, and the next was asked before it came.

    So the reset was reported as a lost line, four seconds later.
    """
    line = ModelTransport()
    line.delay_us = 100_000
    session = Session(line, session_id=7)
    session.open()
    line.board.reset()
    with pytest.raises(BoardResetError):
        session.run_for(SECOND_US)


def test_an_earlier_hosts_refusal_is_no_verdict_on_our_command() -> None:
    """Where the recall was lost, the refusal's repeat came after the session was open.

    It named the first command's type and number, and a command that the board
    had carried out counted as refused.
    """
    line = WithoutRecall()
    line.board.session = 9
    line.board.latch(
        Record.REFUSAL,
        lambda i: RefusalMessage(
            record_id=i, session=9, command_type=MessageType.ENABLE, command_sequence=0,
            reason=Refusal.BUSY, index=255, value=0, limit=0,
        ),
    )  # fmt: skip
    session = Session(line, session_id=7)
    events = record_events(session)
    session.open()
    assert session.request(Enable(pulse_ticks=POSE)).state is TicketState.EXECUTED
    session.run_for(SECOND_US)
    told = [event for event in events if isinstance(event, Refused)]
    assert [(event.earlier, event.ticket) for event in told] == [(True, None)]
    assert line.board.executed == [Enable(pulse_ticks=POSE)]


def test_an_earlier_hosts_trip_and_fault_are_told_as_earlier_though_the_recall_was_lost() -> None:
    """They came as this session's own, and ended its first motion with an error."""
    line = WithoutRecall()
    line.board.session = 9
    line.board.trip()
    line.board.fault(Fault.SENSOR_SILENT)
    session = Session(line, session_id=7)
    events = record_events(session)
    session.open()
    session.run_for(SECOND_US)
    told = [event for event in events if isinstance(event, (Tripped, FaultReported))]
    assert len(told) == 2
    assert all(event.earlier for event in told)


def test_a_fault_from_before_the_session_is_named() -> None:
    """A board that the watchdog had reset answered motion with the fault `unknown`.

    Its record was told as an earlier one, and no longer known when somebody asked.
    """
    line = ModelTransport()
    line.board.fault(Fault.WATCHDOG)
    session = Session(line, session_id=7)
    board = Board(session)
    session.open()
    session.run_for(SECOND_US)
    assert session.state is State.FAULT
    with pytest.raises(FaultError, match="watchdog"):
        board.require_holding()


def test_an_earlier_hosts_stop_does_not_confirm_ours() -> None:
    """Telemetry shows the last stop's number, even where it was another session's.

    A stop before the first telemetry had the same number: it counted as carried
    out, was not repeated, and the robot went on where its only copy was lost.
    """
    line = ModelTransport()
    line.board.session, line.board.stop_number = 9, 1
    session = Session(line, session_id=7)
    session.engine.open(7, line.now_us())
    # The first telemetry has left the board, and arrives after the stop went out.
    with pytest.raises(DeadlineError):
        session.run_until(lambda: False, 20_500)
    assert session.engine.phase is Phase.SETTLING
    stops_before = line.board.stops
    line.deaf = True
    ticket = session.send_stop()
    session.run_for(5_000)
    line.deaf = False
    session.run_until(lambda: ticket.done, SECOND_US)
    assert line.board.stops > stops_before
    assert line.board.state is State.STOPPED


def test_a_stop_takes_no_number_that_an_older_copy_may_carry() -> None:
    """The next number was the one after telemetry's.

    Late copies of stops 1 and 2 made the board show 1, and then know 2 as the
    last again. The third stop was sent as 2, and the board did not act on it.
    """
    line = ModelTransport()
    session = Session(line, session_id=7)
    session.open()
    session.request(Enable(pulse_ticks=POSE))
    copies = []
    for _ in range(2):
        session.stop()
        assert line.board.stop_number is not None
        copies.append(encode_host(Stop(stop_number=line.board.stop_number), session=7))
        session.request(Resume(epoch=session.epoch))
    line.board.receive(copies[0])
    session.run_for(50_000)
    line.board.receive(copies[1])
    # The host's newest telemetry is from before the second copy; somebody resumed meanwhile.
    line.board.state = State.MOVING
    session.stop()
    assert line.board.state is State.STOPPED


def test_256_lost_frames_are_a_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    """Board frames are numbered modulo 256: after 256 lost ones the next looks like the next.

    The refusal was among them, and the command counted as carried out.
    """
    line = ModelTransport()
    session = Session(line, session_id=7)
    session.open()
    ticket = session.send(segments(session))  # refused: not enabled
    line.receive(line.now_us() + 100)
    say = line.board.say
    unheard = 0

    def swallow(message: BoardMessage) -> None:
        nonlocal unheard
        unheard += 1
        line.board.sequence = (line.board.sequence + 1) & 0xFF

    monkeypatch.setattr(line.board, "say", swallow)
    session.run_for(2 * SECOND_US)
    line.board.sequence = (line.board.sequence + 256 - unheard) & 0xFF
    monkeypatch.setattr(line.board, "say", say)
    session.run_until(lambda: ticket.done, SECOND_US)
    assert ticket.state is TicketState.REFUSED


def test_refusals_in_a_row_cost_no_timeout() -> None:
    """The board takes no second refusal before the host has the first one's record.

    It dropped the next command until then, and did not say so: each of several in
    a row waited for a timeout of 25 ms or more.
    """
    line = ModelTransport()
    session = Session(line, session_id=7)
    session.open()
    wrong = Resume(epoch=session.epoch + 1)
    tickets = [session.send(wrong) for _ in range(2)]
    session.run_until(lambda: all(ticket.done for ticket in tickets), SECOND_US)
    assert [ticket.state for ticket in tickets] == [TicketState.REFUSED] * 2
    assert session.engine.statistics.timeouts == 0


class RealTime(ModelTransport):
    """Time passes without the host, and what came meanwhile waits with its time of arrival."""

    def __init__(self) -> None:
        super().__init__()
        self.arrived: deque[tuple[bytes, int]] = deque()

    def pass_by(self, duration_us: int) -> None:
        end_us = self.time_us + duration_us
        while (item := super().receive(end_us)) is not None:
            self.arrived.append(item)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        return self.arrived.popleft() if self.arrived else super().receive(deadline_us)


def test_a_program_may_do_something_else_for_ten_seconds() -> None:
    """What had come meanwhile was not read before the silence was judged.

    So a program that slept, computed or waited for its user for more than four
    seconds lost a link on which nothing was wrong.
    """
    line = RealTime()
    session = Session(line, session_id=7)
    session.open()
    line.pass_by(10 * SECOND_US)
    assert session.request(Enable(pulse_ticks=POSE)).state is TicketState.EXECUTED
    assert session.telemetry is not None
    assert session.telemetry.frame * 20_000 > 10 * SECOND_US


def test_a_callback_may_take_its_time() -> None:
    """The same within a wait: the first of what had come was taken for the last."""
    line = RealTime()
    session = Session(line, session_id=7)
    session.open()
    asleep = iter([5 * SECOND_US])
    session.subscribe(lambda _: line.pass_by(next(asleep, 0)))
    session.run_for(10 * SECOND_US)


def test_a_stalled_host_repeats_nothing_that_was_answered() -> None:
    """A computer that stood still sent every command again whose receipt it had not read yet."""
    line = RealTime()
    session = Session(line, session_id=7)
    session.open()
    ticket = session.send(Enable(pulse_ticks=POSE))
    line.pass_by(600_000)
    session.run_until(lambda: ticket.done, SECOND_US)
    assert session.engine.statistics.frames_retransmitted == 0
    assert ticket.state is TicketState.EXECUTED


def test_a_silent_board_is_asked_for_its_records_every_50_ms() -> None:
    """The question whether the session lives put the next one for the records off by 200 ms."""
    line = ModelTransport()
    session = Session(line, session_id=7)
    session.engine.open(7, 0)
    session.run_until(lambda: session.engine.phase is Phase.SETTLING, SECOND_US)
    line.cut_off = True
    before = len(line.sent)
    session.run_for(SECOND_US)
    asked = HostDecoder().feed(b"".join(line.sent[before:]))
    assert sum(isinstance(frame.message, Recall) for frame in asked) >= 19 * len(Record)
