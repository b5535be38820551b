"""The simulator of every day against the chip: the same commands give the same pulses."""

from __future__ import annotations

import random

import pytest
from tests.avr.driver import WIDE_LIMITS, Driver, Ticks
from tests.avr.simavr import Uno

from setae.link.events import TelemetryReceived
from setae.link.session import Session
from setae.sim import SimTransport, World
from setae_protocol.messages import Enable, Segment, Segments, State

_UNUSED = Segment(duration_frames=0, target_ticks=(0, 0, 0, 0))


def _segments(seed: int) -> list[Segment]:
    rng = random.Random(seed)

    def target() -> Ticks:
        a, b, c, d = (rng.randint(1000, 5000) for _ in range(4))
        return (a, b, c, d)

    return [Segment(duration_frames=rng.randint(2, 9), target_ticks=target()) for _ in range(12)]


def _played(session: Session, segments: list[Segment]) -> list[Ticks]:
    """What the board says it puts out, frame by frame, from the first change to the last."""
    seen: dict[int, Ticks] = {}

    def keep(event: object) -> None:
        if isinstance(event, TelemetryReceived) and event.telemetry.attached == 15:
            a, b, c, d = event.telemetry.pulse_ticks
            seen[event.telemetry.frame] = (a, b, c, d)

    session.subscribe(keep)
    session.open()
    session.request(WIDE_LIMITS)
    session.request(Enable(pulse_ticks=(1000, 1000, 1000, 1000)))
    session.run_until(lambda: session.state is State.HOLDING, 2_000_000)
    for first in range(0, len(segments), 5):
        part = segments[first : first + 5]
        a, b, c, d, e = part + [_UNUSED] * (5 - len(part))
        session.send(Segments(epoch=session.epoch, count=len(part), segments=(a, b, c, d, e)))
    frames = sum(segment.duration_frames for segment in segments)
    session.run_for((frames + 10) * 20_000)
    assert list(seen) == list(range(min(seen), max(seen) + 1))
    shown = list(seen.values())
    while shown[1] == shown[0]:
        del shown[0]
    while shown[-2] == shown[-1]:
        del shown[-1]
    return shown


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_same_commands_give_the_same_pulses_per_frame(uno: Uno, seed: int) -> None:
    segments = _segments(seed)
    with World(seed=1) as world:
        world.start()
        simulated = _played(Session(SimTransport(world), session_id=7), segments)

    driver = Driver(uno)
    on_the_chip = _played(driver.session, segments)

    assert on_the_chip == simulated
    at_the_pins = [frame.ticks for frame in driver.frames()]
    first = at_the_pins.index(tuple(map(float, on_the_chip[0])))
    while at_the_pins[first + 1] == at_the_pins[first]:
        first += 1
    assert at_the_pins[first : first + len(on_the_chip)] == [
        tuple(map(float, ticks)) for ticks in on_the_chip
    ]
