"""The bad line itself does what it says, and no record gets lost on it."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from tests.host.link.model import SECOND_US, ModelTransport, record_events

from setae.link.events import FaultReported, Refused, Tripped
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae_protocol.frame import BoardDecoder, Damage
from setae_protocol.messages import Fault, Record, Resume, State

FRAMES = [b"\x02\x01\0", b"\x02\x02\0", b"\x02\x03\0", b"\x02\x04\0"]


class Wire:
    """What was sent, with its time."""

    name = "wire"
    simulated = True

    def __init__(self) -> None:
        self.time_us = 0
        self.sent: list[tuple[int, bytes]] = []

    def now_us(self) -> int:
        return self.time_us

    def send(self, data: bytes) -> None:
        self.sent.append((self.time_us, data))

    def receive(self, deadline_us: int) -> None:
        self.time_us = max(self.time_us, deadline_us)

    def close(self) -> None:
        pass


def pass_on(faults: Faults, frames: list[bytes], *, every_us: int = 100) -> Wire:
    wire = Wire()
    line = LossyTransport(wire, seed=1, down=faults)
    for frame in frames:
        line.send(frame)
        line.receive(wire.time_us + every_us)
    line.receive(wire.time_us + 20 * SECOND_US)
    return wire


def test_reorder_changes_places() -> None:
    sent = b"".join(data for _, data in pass_on(Faults(reorder=1.0), FRAMES).sent)
    assert sent == FRAMES[1] + FRAMES[0] + FRAMES[3] + FRAMES[2]


def test_split_pauses_in_mid_frame_and_keeps_the_order() -> None:
    sent = pass_on(Faults(split=1.0), FRAMES).sent
    assert b"".join(data for _, data in sent) == b"".join(FRAMES)
    assert len({time_us for time_us, _ in sent}) > len(FRAMES)


def test_merge_loses_every_other_delimiter() -> None:
    frames = FRAMES * 50
    sent = pass_on(Faults(merge=1.0), frames).sent
    joined = b"".join(data for _, data in sent)
    lost = sum(map(len, frames)) - len(joined)
    assert 30 < lost < 70, "of a hundred pairs"
    assert joined.replace(b"\0", b"") == b"".join(frames).replace(b"\0", b"")
    decoder = BoardDecoder()
    decoder.feed(joined)
    assert sum(decoder.damage.values()) == joined.count(b"\0")
    assert decoder.damage[Damage.SHORT] > 0


def test_nothing_comes_later_than_the_frames_it_may_miss() -> None:
    frames = [bytes([2, number]) + b"\0" for number in range(1, 251)]
    for most in (3, 20):
        faults = Faults(delay=0.5, delay_max_us=10 * SECOND_US, delay_max_frames=most)
        sent = pass_on(faults, frames).sent
        order = [number for _, data in sent for number in data[1::3]]
        assert sorted(order) == list(range(1, 251))
        newest = 0
        for number in order:
            assert newest - number <= most + 1
            newest = max(newest, number)
        assert order != sorted(order)


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


@settings(max_examples=40, deadline=None)
@given(
    down=faults,
    up=faults,
    seed=st.integers(0, 10**6),
    script=st.lists(st.sampled_from(Record), min_size=1, max_size=12),
)
def test_every_record_is_told_once(
    down: Faults, up: Faults, seed: int, script: list[Record]
) -> None:
    """The next of a kind comes after the last was acknowledged, as the board sees to."""
    line = ModelTransport()
    lossy = LossyTransport(line, seed=seed)
    session = Session(lossy, session_id=7)
    events = record_events(session)
    session.open()
    lossy.down_faults, lossy.up_faults = down, up
    latched: list[Any] = []
    for what in script:
        if what is Record.TRIP:
            line.board.trip()
        elif what is Record.FAULT:
            line.board.fault(Fault.SENSOR_SILENT)
        else:
            ticket = session.send(Resume(epoch=(line.board.epoch + 9) & 0xFF))
            session.run_until(lambda ticket=ticket: ticket.done, 60 * SECOND_US)  # type: ignore[misc]
        latched.append(line.board.latches[what][0])
        session.run_until(lambda what=what: not line.board.pending(what), 60 * SECOND_US)  # type: ignore[misc]
    lossy.down_faults = lossy.up_faults = Faults()
    session.run_for(SECOND_US)
    told = [
        event.record for event in events if isinstance(event, (Tripped, FaultReported, Refused))
    ]
    assert told == latched
    assert session.state in (State.RELAXED, State.TRIPPED, State.FAULT)
