"""How soon a command's end is known on a bad line, and how a loss is told from a delay."""

from __future__ import annotations

import pytest
from tests.host.link.model import POSE, SECOND_US, ModelTransport

from setae.errors import LinkLostError
from setae.link.events import TicketState
from setae.link.session import Session
from setae_protocol.messages import Disarm, Enable, RefusalMessage, Resume


@pytest.fixture
def line() -> ModelTransport:
    return ModelTransport()


@pytest.fixture
def session(line: ModelTransport) -> Session:
    opened = Session(line, session_id=7)
    opened.open()
    return opened


class Sieve(ModelTransport):
    """Loses every third frame from the board."""

    def __init__(self) -> None:
        super().__init__()
        self.posted = 0

    def post(self, data: bytes) -> None:
        self.posted += 1
        if self.posted % 3:
            super().post(data)


def test_an_answer_needs_no_row_of_frames_without_a_loss() -> None:
    """Whether a command was refused was known only after six reports in a row without a loss.

    Where every third frame was lost that never came; at 30 % loss a `resume` took more than its
    two seconds in 3 % of all cases.
    """
    line = Sieve()
    session = Session(line, session_id=7)
    session.open()
    session.request(Enable(pulse_ticks=POSE))
    for _ in range(50):
        sent_us = line.now_us()
        assert session.request(Disarm(reserved=0)).state is TicketState.EXECUTED
        assert line.now_us() - sent_us <= 60_000


def test_acknowledged_is_not_executed_while_a_refusal_waits(
    line: ModelTransport, session: Session
) -> None:
    """The record of the refusal is lost, the receipt is not."""
    post = line.board.post
    line.board.post = lambda data: post(data) if data[1] != RefusalMessage.TYPE else None
    ticket = session.send(Resume(epoch=99))
    session.run_for(90_000)
    assert line.board.refused
    assert not ticket.done
    line.board.post = post
    session.run_until(lambda: ticket.done, 120_000)
    assert ticket.state is TicketState.REFUSED


def test_a_mended_line_is_used_at_once(line: ModelTransport, session: Session) -> None:
    """After an outage the host waited for up to 0.4 s more, though the board's reports had shown
    all along that it lacks the command.
    """
    line.deaf = True
    ticket = session.send(Enable(pulse_ticks=POSE))
    session.run_for(2 * SECOND_US)
    line.deaf = False
    session.run_until(lambda: ticket.done, 50_000)
    assert ticket.state is TicketState.EXECUTED


def test_a_line_that_says_nothing_is_asked_ever_less_often(
    line: ModelTransport, session: Session
) -> None:
    line.cut_off = True
    session.send(Enable(pulse_ticks=POSE))
    session.run_for(2 * SECOND_US)
    assert 5 <= session.engine.statistics.timeouts <= 10


def test_a_dead_line_to_the_board_is_given_up_after_four_seconds(
    line: ModelTransport, session: Session
) -> None:
    line.deaf = True
    begun_us = line.now_us()
    with pytest.raises(LinkLostError, match=r"enable.*tries and 4 s"):
        session.request(Enable(pulse_ticks=POSE), timeout_us=60 * SECOND_US)
    assert 4 * SECOND_US <= line.now_us() - begun_us < 5 * SECOND_US
