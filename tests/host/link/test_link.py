"""The link against a small model of a board: whatever the line does, each command runs once."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.host.link.model import (
    LIMITS,
    POSE,
    SECOND_US,
    ModelTransport,
    record_events,
    segments,
)

from setae.errors import (
    BoardResetError,
    BoardSilentError,
    DeadlineError,
    LinkLostError,
    ProtocolMismatchError,
    RefusedError,
)
from setae.link.events import FaultReported, Refused, StateChanged, TicketState, Tripped
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    SEGMENT_QUEUE_SLOTS,
    BoardMessage,
    Disarm,
    Enable,
    Fault,
    MessageType,
    Record,
    Refusal,
    RefusalMessage,
    Resume,
    Segments,
    State,
)


@pytest.fixture
def line() -> ModelTransport:
    return ModelTransport()


@pytest.fixture
def session(line: ModelTransport) -> Session:
    session = Session(line, session_id=7)
    session.open()
    return session


def is_part(some: list[Any], whole: list[Any]) -> bool:
    """Whether `some` is `whole` with gaps, in the same order, nothing twice."""
    rest = iter(whole)
    return all(any(item == other for other in rest) for item in some)


# ------------------------------------------------------------------------------ a good line


def test_commands_run_in_order(line: ModelTransport, session: Session) -> None:
    session.request(Enable(pulse_ticks=POSE))
    sent = [segments(session, mark=1700 + i) for i in range(6)]
    tickets = [session.send(message) for message in sent]
    session.run_until(lambda: all(ticket.done for ticket in tickets), SECOND_US)
    assert line.board.executed[1:] == sent
    assert {ticket.state for ticket in tickets} == {TicketState.EXECUTED}


def test_the_boards_queue_never_overflows(line: ModelTransport, session: Session) -> None:
    """More motion than the queue holds flows as fast as it is played, in first tries."""
    session.request(Enable(pulse_ticks=POSE))
    tickets = [session.send(segments(session, mark=1000 + i)) for i in range(30)]
    highest = 0
    while not all(ticket.done for ticket in tickets):
        session.run_for(20_000)
        highest = max(highest, line.board.queued)
    assert len(line.board.executed) == 31
    assert 40 <= highest <= SEGMENT_QUEUE_SLOTS
    assert session.engine.statistics.frames_retransmitted == 0


def test_refusal_is_an_error_with_remedy(line: ModelTransport, session: Session) -> None:
    with pytest.raises(RefusedError, match=r"segments.*not_enabled.*enable\(\)"):
        session.request(segments(session))
    assert session.request(Enable(pulse_ticks=POSE)).state is TicketState.EXECUTED


def test_lost_refusal_is_not_taken_for_success(line: ModelTransport) -> None:
    """The receipt arrives, the refusal's first copy doesn't: the ticket must wait."""
    lossy = LossyTransport(line, seed=1)
    session = Session(lossy, session_id=7)
    session.open()
    say = line.board.say
    lost: list[BoardMessage] = []

    def lose_first_refusal(message: BoardMessage) -> None:
        if isinstance(message, RefusalMessage) and not lost:
            lost.append(message)
            line.board.sequence = (line.board.sequence + 1) & 0xFF
        else:
            say(message)

    line.board.say = lose_first_refusal  # type: ignore[method-assign]  # a fault to inject
    with pytest.raises(RefusedError, match="not_enabled"):
        session.request(segments(session))
    assert lost


def test_limits_can_be_read(session: Session) -> None:
    assert session.read_limits() == LIMITS


def test_trip_is_told_once_and_acknowledged(line: ModelTransport, session: Session) -> None:
    events = record_events(session)
    session.request(Enable(pulse_ticks=POSE))
    line.board.trip()
    session.run_for(SECOND_US)
    trips = [event for event in events if isinstance(event, Tripped)]
    assert len(trips) == 1
    assert not trips[0].earlier
    assert not line.board.pending(Record.TRIP)
    assert session.state is State.TRIPPED
    assert any(isinstance(e, StateChanged) and e.state is State.TRIPPED for e in events)
    session.recall(Record.TRIP)
    session.run_for(100_000)
    assert len([event for event in events if isinstance(event, Tripped)]) == 2


def test_doubled_records_are_told_once(line: ModelTransport) -> None:
    session = Session(LossyTransport(line, seed=1, up=Faults(double=1.0)), session_id=7)
    events = record_events(session)
    session.open()
    with pytest.raises(RefusedError):
        session.request(segments(session))
    line.board.trip()
    session.run_for(SECOND_US)
    assert len([event for event in events if isinstance(event, (Tripped, Refused))]) == 2


def test_records_of_a_dead_host_are_told_as_earlier(line: ModelTransport) -> None:
    line.board.session = 7
    line.board.fault(Fault.SENSOR_SILENT)
    line.board.latch(
        Record.REFUSAL,
        lambda i: RefusalMessage(
            record_id=i, session=0, command_type=MessageType.ENABLE, command_sequence=0,
            reason=Refusal.BUSY, index=255, value=0, limit=0,
        ),
    )  # fmt: skip
    line.board.state = State.RELAXED
    session = Session(line, session_id=7)
    events = record_events(session)
    session.open()
    assert session.engine.session != 7, "a new session is another one than the dead host's"
    assert session.request(Enable(pulse_ticks=POSE)).state is TicketState.EXECUTED
    session.run_for(SECOND_US // 2)
    told = [event for event in events if isinstance(event, (FaultReported, Refused))]
    assert [event.earlier for event in told] == [True, True]
    assert not line.board.pending(Record.REFUSAL)


# ------------------------------------------------------------------------------------- stop


def test_stop_goes_ahead_of_what_is_queued(line: ModelTransport, session: Session) -> None:
    session.request(Enable(pulse_ticks=POSE))
    tickets = [session.send(segments(session, mark=1000 + i)) for i in range(20)]
    session.stop()
    assert session.state is State.STOPPED
    session.run_until(lambda: all(ticket.done for ticket in tickets), SECOND_US)
    states = [ticket.state for ticket in tickets]
    executed = states.count(TicketState.EXECUTED)
    assert states == [TicketState.EXECUTED] * executed + [TicketState.DISCARDED] * (20 - executed)
    assert line.board.executed.count("stop") == 1
    assert line.board.queued == 0
    session.request(Resume(epoch=session.epoch))
    session.run_for(SECOND_US)
    assert line.board.executed[-1] == Resume(epoch=session.epoch), "nothing restarts by itself"


def test_first_stop_acts_whatever_number_the_last_host_used(line: ModelTransport) -> None:
    for number in (None, 0, 1, 2, 255):
        line = ModelTransport()
        line.board.stop_number = number
        line.board.state = State.HOLDING
        session = Session(line, session_id=7)
        session.open()
        session.stop()
        assert line.board.stops >= 1
        assert session.state is State.STOPPED


def test_stop_before_the_session_opens(line: ModelTransport) -> None:
    line.board.session, line.board.state, line.board.queued = 9, State.MOVING, 40
    session = Session(line, session_id=7)
    session.send_stop()
    line.receive(5_000)
    assert line.board.state is State.STOPPED


def test_second_stop_after_resume_acts(line: ModelTransport, session: Session) -> None:
    session.request(Enable(pulse_ticks=POSE))
    session.stop()
    session.request(Resume(epoch=session.epoch))
    session.run_until(lambda: session.state is State.HOLDING, SECOND_US)
    session.stop()
    assert line.board.stops == 2
    assert line.board.state is State.STOPPED


def test_older_frames_that_show_stopped_do_not_confirm_a_newer_stop(
    line: ModelTransport, session: Session
) -> None:
    """Stopped, resumed and stopped again, while the line to the board is dead for 60 ms."""
    session.request(Enable(pulse_ticks=POSE))
    session.stop()
    line.deaf = True
    session.send(Resume(epoch=session.epoch))
    ticket = session.send_stop()
    session.run_for(60_000)
    assert not ticket.done
    line.deaf = False
    session.run_until(lambda: ticket.done, SECOND_US)
    session.run_for(SECOND_US)
    assert line.board.state is State.STOPPED


def test_two_stops_at_once_are_both_confirmed_by_the_board(
    line: ModelTransport, session: Session
) -> None:
    session.request(Enable(pulse_ticks=POSE))
    first, second = session.send_stop(), session.send_stop()
    assert not first.done
    session.run_until(lambda: second.done, SECOND_US)
    assert first.state is second.state is TicketState.EXECUTED
    assert line.board.state is State.STOPPED


# ------------------------------------------------------------------------- ends of a session


def test_silent_board_is_named(line: ModelTransport) -> None:
    line.cut_off = True
    with pytest.raises(BoardSilentError, match="No setae board answered on model"):
        Session(line, session_id=7).open(timeout_us=3 * SECOND_US)


def test_slow_bootloader_is_waited_for(line: ModelTransport) -> None:
    line.cut_off = True

    def boot() -> bytes:
        line.cut_off = False
        return b""

    line.at(2 * SECOND_US, boot)
    Session(line, session_id=7).open()
    assert line.now_us() < 2.5 * SECOND_US


def test_mismatch_names_both_versions_and_the_cure(line: ModelTransport) -> None:
    line.board.version = (PROTOCOL_VERSION + 1, 0xDEADBEEF)
    with pytest.raises(ProtocolMismatchError) as caught:
        Session(line, session_id=7).open()
    text = str(caught.value)
    assert f"protocol {PROTOCOL_VERSION + 1}" in text
    assert f"protocol {PROTOCOL_VERSION} " in text
    assert "deadbeef" in text
    assert "setae flash" in text


def test_reset_board_ends_the_session_and_gets_nothing(
    line: ModelTransport, session: Session
) -> None:
    session.request(Enable(pulse_ticks=POSE))
    line.board.reset()
    line.board.executed.clear()
    ticket = session.send(segments(session))
    with pytest.raises(BoardResetError, match="reset pin"):
        session.run_for(2 * SECOND_US)
    assert ticket.state is TicketState.FAILED
    assert line.board.executed == []
    with pytest.raises(BoardResetError):
        session.run_for(1)


def test_another_host_taking_over_is_told(line: ModelTransport, session: Session) -> None:
    line.board.session = 99
    with pytest.raises(BoardResetError, match="session 99"):
        session.run_for(SECOND_US)


def test_pulled_cable_is_link_lost(line: ModelTransport, session: Session) -> None:
    ticket = session.send(Enable(pulse_ticks=POSE))
    line.cut_off = True
    with pytest.raises(LinkLostError):
        session.run_for(20 * SECOND_US)
    assert line.now_us() < 6 * SECOND_US
    assert ticket.state is TicketState.FAILED


def test_dead_downlink_is_link_lost_though_telemetry_comes(
    line: ModelTransport, session: Session
) -> None:
    line.deaf = True
    with pytest.raises(LinkLostError, match="enable"):
        session.request(Enable(pulse_ticks=POSE), timeout_us=60 * SECOND_US)
    assert line.now_us() < 15 * SECOND_US


def test_deadline_says_what_was_waited_for(session: Session) -> None:
    with pytest.raises(DeadlineError, match=r"The end did not happen within 0\.1 s"):
        session.run_until(lambda: False, 100_000, what="The end")


def test_long_gap_in_telemetry_does_not_make_new_frames_old(
    line: ModelTransport, session: Session
) -> None:
    """Board frames are numbered modulo 256: after 3 s of silence, newer may look older."""
    session.run_for(100_000)
    line.cut_off = True
    session.run_for(3 * SECOND_US)
    line.cut_off = False
    session.run_for(200_000)
    assert session.telemetry is not None
    assert line.board.frame - session.telemetry.frame <= 1


# -------------------------------------------------------------------------------- a bad line

rates = st.sampled_from([0.0, 0.05, 0.2, 0.4])
faults = st.builds(
    Faults,
    lose=rates,
    double=rates,
    damage=rates,
    delay=rates,
    reorder=rates,
    split=rates,
    merge=rates,
)
steps = st.lists(
    st.one_of(
        st.tuples(st.just("segments"), st.integers(1, 5)),
        st.tuples(st.just("disarm"), st.just(0)),
        st.tuples(st.just("stop"), st.just(0)),
        st.tuples(st.just("resume"), st.just(0)),
        st.tuples(st.just("wait"), st.integers(1, 300)),
        st.tuples(st.just("trip"), st.just(0)),
    ),
    min_size=1,
    max_size=30,
)


@settings(max_examples=150, deadline=None)
@given(down=faults, up=faults, seed=st.integers(0, 10**6), script=steps)
def test_nothing_runs_twice_or_out_of_order(
    down: Faults, up: Faults, seed: int, script: list[tuple[str, int]]
) -> None:
    line = ModelTransport()
    lossy = LossyTransport(line, seed=seed)
    session = Session(lossy, session_id=7)
    session.open()
    session.request(Enable(pulse_ticks=POSE))
    line.board.executed.clear()
    lossy.down_faults, lossy.up_faults = down, up
    tickets = []
    stops = 0
    for number, (what, amount) in enumerate(script):
        if what == "segments":
            tickets.append(session.send(segments(session, amount, mark=1000 + number)))
        elif what == "disarm":
            tickets.append(session.send(Disarm(reserved=number)))
        elif what == "resume":
            tickets.append(session.send(Resume(epoch=session.epoch)))
        elif what == "stop":
            session.send_stop()
            stops += 1
        elif what == "trip":
            line.board.trip()
        else:
            session.run_for(amount * 1_000)
    lossy.down_faults = lossy.up_faults = Faults()
    session.run_until(
        lambda: all(t.done for t in tickets) and session.engine.next_deadline_us is not None,
        20 * SECOND_US,
    )
    session.run_for(300_000)
    board = line.board

    def messages(state: TicketState) -> list[Any]:
        return [ticket.message for ticket in tickets if ticket.state is state]

    # Segments that a stop dropped from the board's queue count as discarded.
    discarded = messages(TicketState.DISCARDED)
    dropped = [message for message in discarded if isinstance(message, Segments)]
    ran = [message for message in board.executed if message != "stop"]
    assert [message for message in ran if message not in dropped] == messages(TicketState.EXECUTED)
    assert is_part(ran, [ticket.message for ticket in tickets])
    assert is_part(board.discarded, discarded), "some never left the host"
    assert board.refused == messages(TicketState.REFUSED)
    assert not messages(TicketState.FAILED)
    assert session.state is board.state
    assert session.epoch == board.epoch
    if stops:
        assert board.stops >= 1


@settings(max_examples=100, deadline=None)
@given(
    down=faults, up=faults, seed=st.integers(0, 10**6), before=st.integers(0, 12),
    wait_ms=st.integers(0, 60),
)  # fmt: skip
def test_stop_wins_over_what_is_in_flight(
    down: Faults, up: Faults, seed: int, before: int, wait_ms: int
) -> None:
    """Segments sent, lost or sent again around a stop never move the robot after it."""
    line = ModelTransport()
    lossy = LossyTransport(line, seed=seed)
    session = Session(lossy, session_id=7)
    session.open()
    session.request(Enable(pulse_ticks=POSE))
    lossy.down_faults, lossy.up_faults = down, up
    tickets = [session.send(segments(session, mark=1000 + i)) for i in range(before)]
    session.run_for(wait_ms * 1_000)
    session.stop(timeout_us=20 * SECOND_US)
    acted = line.board.executed.index("stop")
    lossy.down_faults = lossy.up_faults = Faults()
    session.run_until(lambda: all(ticket.done for ticket in tickets), 20 * SECOND_US)
    session.run_for(300_000)
    assert line.board.executed[acted:] == ["stop"] * line.board.stops
    assert line.board.state is State.STOPPED
    assert line.board.queued == 0


@settings(max_examples=40, deadline=None)
@given(down=faults, up=faults, seed=st.integers(0, 10**6))
def test_session_opens_over_a_bad_line(down: Faults, up: Faults, seed: int) -> None:
    line = ModelTransport()
    session = Session(LossyTransport(line, seed=seed, down=down, up=up), session_id=7)
    session.open(timeout_us=60 * SECOND_US)
    assert line.board.session == 7


def test_same_seed_same_bytes() -> None:
    def run() -> list[bytes]:
        line = ModelTransport()
        bad = Faults.each(0.2)
        session = Session(LossyTransport(line, seed=5, down=bad, up=bad), session_id=7)
        session.open(timeout_us=60 * SECOND_US)
        ticket = session.send(Enable(pulse_ticks=POSE))
        session.run_until(lambda: ticket.done, 20 * SECOND_US)
        return line.sent

    assert run() == run()
