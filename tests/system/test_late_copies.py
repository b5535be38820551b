"""Copies that are later than the numbers allow: half the numbers, 127 commands, and more.

No serial line does that, and what it does then is not promised command by command. What
is: the board's own checks hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import pytest

from setae.link.events import Event, Refused, TelemetryReceived
from setae.link.session import Session
from setae.sim import SimTransport, World
from setae_protocol.frame import encode_host
from setae_protocol.messages import (
    Disarm,
    Enable,
    HostMessage,
    Refusal,
    Resume,
    Segment,
    Segments,
    State,
    Telemetry,
)

SECOND_US = 1_000_000
START_TICKS, END_TICKS = 1_800, 2_300
SESSION = 7


def pose(ticks: int) -> tuple[int, int, int, int]:
    return (ticks, ticks, ticks, ticks)


class Robot:
    """A session, and all that the board showed."""

    def __init__(self, world: World) -> None:
        self.session = Session(SimTransport(world), session_id=SESSION)
        self.shown: list[Telemetry] = []
        self.refused: list[Refused] = []
        self.next_number = 0
        self.session.subscribe(self._on_event)
        self.session.open()
        self.request(Enable(pulse_ticks=pose(START_TICKS)))
        self.session.run_until(lambda: self.session.state is State.HOLDING, SECOND_US)

    def _on_event(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self.shown.append(event.telemetry)
        elif isinstance(event, Refused):
            self.refused.append(event)

    def request(self, message: HostMessage) -> bytes:
        """Have it carried out; return the frame that did it."""
        ticket = self.session.request(message)
        assert ticket.sequence is not None
        self.next_number = (ticket.sequence + 1) & 0xFF
        return encode_host(message, session=SESSION, sequence=ticket.sequence)

    def go_on_until_number(self, number: int) -> None:
        """With commands that do nothing, until the board expects this number again."""
        while self.next_number != number:
            self.request(Disarm(reserved=0))

    def move(self, to_ticks: int) -> bytes:
        unused = Segment(0, pose(0))
        return self.request(
            Segments(
                self.session.epoch, 1, (Segment(50, pose(to_ticks)), unused, unused, unused, unused)
            )
        )

    def arrive(self, copy: bytes) -> list[Telemetry]:
        """A late copy comes; return what the board showed in the two seconds after it."""
        before = len(self.shown)
        self.session.transport.send(copy)
        self.session.run_for(2 * SECOND_US)
        return self.shown[before + 1 :]


@pytest.fixture
def robot() -> Iterator[Robot]:
    with World(seed=1) as world:
        world.start()
        yield Robot(world)


def test_a_motion_from_before_a_stop_never_moves_the_robot(robot: Robot) -> None:
    number = robot.next_number
    copy = robot.move(END_TICKS)
    robot.session.stop()
    robot.request(Resume(epoch=robot.session.epoch))
    robot.go_on_until_number(number)
    assert len({telemetry.pulse_ticks for telemetry in robot.arrive(copy)}) == 1


def test_a_resume_from_before_a_stop_leaves_it_stopped(robot: Robot) -> None:
    number = robot.next_number
    copy = robot.request(Resume(epoch=robot.session.epoch))
    robot.go_on_until_number(number)
    robot.session.stop()
    robot.arrive(copy)
    assert robot.session.state is State.STOPPED
    assert [event.record.reason for event in robot.refused] == [Refusal.WRONG_EPOCH]


def test_a_motion_of_the_same_epoch_runs_again_within_the_limits(robot: Robot) -> None:
    """What such a copy can do at most: go somewhere it was told to go before."""
    number = robot.next_number
    copy = robot.move(END_TICKS)
    robot.session.run_until(lambda: robot.session.state is State.HOLDING, 5 * SECOND_US)
    robot.move(START_TICKS)
    robot.session.run_until(lambda: robot.session.state is State.HOLDING, 5 * SECOND_US)
    limits = robot.session.read_limits()
    robot.go_on_until_number(number)
    ticks = [telemetry.pulse_ticks[0] for telemetry in robot.arrive(copy)]
    assert ticks[-1] == END_TICKS
    steps = [abs(b - a) for a, b in pairwise(ticks)]
    assert max(steps) <= limits.slew_ticks


def test_up_to_half_the_numbers_a_copy_does_nothing(robot: Robot) -> None:
    copy = robot.move(END_TICKS)
    robot.session.run_until(lambda: robot.session.state is State.HOLDING, 5 * SECOND_US)
    robot.move(START_TICKS)
    robot.session.run_until(lambda: robot.session.state is State.HOLDING, 5 * SECOND_US)
    robot.go_on_until_number((robot.next_number + 125) & 0xFF)
    assert {telemetry.pulse_ticks for telemetry in robot.arrive(copy)} == {pose(START_TICKS)}
    assert robot.refused == []
