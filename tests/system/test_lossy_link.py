"""The firmware behind a bad line: each command runs once, in order, and a stop wins."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.system.link_stress import Stress

from setae.errors import BoardResetError
from setae.link.events import Event, Refused, TelemetryReceived, Ticket, TicketState
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae.sim import SimTransport, World
from setae_protocol.messages import (
    SEGMENT_QUEUE_SLOTS,
    Disarm,
    Enable,
    Resume,
    Segment,
    Segments,
    State,
    Telemetry,
)

SECOND_US = 1_000_000
START_TICKS = 1_800
STEP_TICKS = 15
GOOD = Faults()

rates = st.sampled_from([0.0, 0.1, 0.3])
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


def pose(ticks: int) -> tuple[int, int, int, int]:
    return (ticks, ticks, ticks, ticks)


@dataclass
class Bench:
    """A session with the simulated board, and all that the board showed."""

    world: World
    lossy: LossyTransport
    session: Session
    shown: list[Telemetry] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    planned: int = START_TICKS

    def on_event(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self.shown.append(event.telemetry)
        elif isinstance(event, Refused):
            self.refused.append(event)

    def state(self) -> State:
        return self.session.state

    def enable(self) -> None:
        ticket = self.session.request(Enable(pulse_ticks=pose(START_TICKS)), 20 * SECOND_US)
        assert ticket.state is TicketState.EXECUTED
        self.session.run_until(lambda: self.session.state is State.HOLDING, 20 * SECOND_US)

    def send_steps(self, messages: int) -> list[Ticket]:
        """Each segment one frame and one step further: what runs twice or is left out shows."""
        tickets = []
        for _ in range(messages):
            steps = []
            for _ in range(5):
                self.planned += STEP_TICKS
                steps.append(Segment(1, pose(self.planned)))
            first, second, third, fourth, fifth = steps
            tickets.append(
                self.session.send(
                    Segments(
                        epoch=self.session.epoch,
                        count=5,
                        segments=(first, second, third, fourth, fifth),
                    )
                )
            )
        return tickets

    def mend(self) -> None:
        self.lossy.down_faults = self.lossy.up_faults = GOOD


def bench(seed: int, *, down: Faults = GOOD, up: Faults = GOOD) -> Bench:
    world = World(seed=seed)
    world.start()
    lossy = LossyTransport(SimTransport(world), seed=seed, down=down, up=up)
    made = Bench(world, lossy, Session(lossy, session_id=7))
    made.session.subscribe(made.on_event)
    made.session.open(60 * SECOND_US)
    return made


@settings(max_examples=30, deadline=None)
@given(down=faults, up=faults, seed=st.integers(0, 1_000))
def test_every_segment_plays_once_and_in_order(down: Faults, up: Faults, seed: int) -> None:
    made = bench(seed, down=down, up=up)
    with made.world, made.session:
        made.enable()
        tickets = made.send_steps(20)
        made.session.run_until(lambda: all(ticket.done for ticket in tickets), 120 * SECOND_US)
        made.mend()
        made.session.run_for(2 * SECOND_US)
        assert {ticket.state for ticket in tickets} == {TicketState.EXECUTED}
        played = [t.pulse_ticks[0] for t in made.shown if t.attached == 15]
        assert played == sorted(played), "a segment that runs again would go back"
        assert played[-1] == made.planned, "none was left out"
        frames = [t.frame for t in made.shown]
        assert frames == sorted(set(frames))
        # The board would refuse a second enable, and a step that follows a missing one.
        assert made.refused == []
        assert max(t.queued for t in made.shown) <= SEGMENT_QUEUE_SLOTS


@settings(max_examples=30, deadline=None)
@given(
    down=faults, up=faults, seed=st.integers(0, 1_000), before_ms=st.integers(0, 300),
)  # fmt: skip
def test_stop_wins_over_segments_in_flight(
    down: Faults, up: Faults, seed: int, before_ms: int
) -> None:
    made = bench(seed)
    with made.world, made.session:
        made.enable()
        made.lossy.down_faults, made.lossy.up_faults = down, up
        tickets = made.send_steps(20)
        made.session.run_for(before_ms * 1_000)
        made.session.stop(60 * SECOND_US)
        frozen = made.session.telemetry
        assert frozen is not None
        assert made.state() is State.STOPPED
        made.session.run_until(lambda: all(ticket.done for ticket in tickets), 60 * SECOND_US)
        assert TicketState.DISCARDED in {ticket.state for ticket in tickets}
        made.mend()
        made.session.run_for(SECOND_US)
        made.session.request(Resume(epoch=made.session.epoch))
        made.session.run_for(2 * SECOND_US)
        assert made.state() is State.HOLDING
        # The next frame's pulses may be those of the frame in which the stop came.
        after = {t.pulse_ticks for t in made.shown if t.frame > frozen.frame + 1}
        assert after == {made.shown[-1].pulse_ticks}
        assert made.shown[-1].pulse_ticks[0] < made.planned
        assert made.refused == []


@settings(max_examples=15, deadline=None)
@given(down=faults, up=faults, seed=st.integers(0, 1_000))
def test_each_refusal_reaches_its_command(down: Faults, up: Faults, seed: int) -> None:
    """Not one refusal is lost, doubled, or taken for another command's."""
    made = bench(seed)
    with made.world, made.session:
        made.lossy.down_faults, made.lossy.up_faults = down, up
        tickets = [made.session.send(Disarm(reserved=0)) for _ in range(3)]
        tickets.insert(1, made.session.send(Enable(pulse_ticks=pose(START_TICKS))))
        tickets.append(made.session.send(Enable(pulse_ticks=pose(START_TICKS))))
        made.session.run_until(lambda: all(ticket.done for ticket in tickets), 120 * SECOND_US)
        refused = [ticket for ticket in tickets if ticket.state is TicketState.REFUSED]
        assert [event.ticket for event in made.refused] == refused
        assert tickets[-1] in refused, "the second enable"
        assert tickets[1] not in refused, "the first enable"


@pytest.mark.parametrize(("seed", "rate"), [(1, 0.01), (2, 0.1)])
def test_random_commands_lose_and_double_nothing(seed: int, rate: float) -> None:
    """`make line-stress` is the same with a million commands."""
    count = Stress(seed, rate, freezes=5.0).run(1_500)
    assert count.wrong == 0, count
    assert min(count.stops, count.trips, count.faults, count.refusals) > 0
    assert count.frames_harmed > 0


def test_button_pressed_in_mid_motion() -> None:
    """The reset button: the host notices, nothing is sent into the new board, nothing moves."""
    made = bench(5)
    with made.world, made.session:
        made.enable()
        made.send_steps(20)
        made.session.run_for(200_000)
        made.world.reset_board()
        with pytest.raises(BoardResetError):
            made.session.run_for(10 * SECOND_US)
        assert made.session.error is not None
        made.world.run(made.world.now_us + SECOND_US)
        assert not any(made.world.truth().attached)
