"""Random commands through a bad line to the real firmware, and a count of what went wrong.

A witness sits between the simulated board and the bad line: it sees every frame
that the board sent. Each segment's pulses spell its number, so that the witness
knows which segments were played, how often and in which order.

    python -m tests.system.link_stress --commands 100000 --rate 0.01
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from itertools import pairwise

from setae.errors import RefusedError
from setae.link.events import Event, Refused, Ticket, TicketState
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae.link.transport import Transport
from setae.sim import SimTransport, World
from setae_protocol.frame import BoardDecoder
from setae_protocol.messages import (
    Disarm,
    Enable,
    HostMessage,
    RefusalMessage,
    Relax,
    Resume,
    Segment,
    Segments,
    State,
    Telemetry,
)

SECOND_US = 1_000_000
BASE_TICKS = 1_800
# Four servos spell a number of four such digits; no digit's change is too fast for a frame.
DIGITS = 64
UNDER_WAY = 12
Ticks = tuple[int, int, int, int]


def spell(number: int) -> Ticks:
    digits = []
    for _ in range(4):
        number, digit = divmod(number, DIGITS)
        digits.append(BASE_TICKS + digit)
    first, second, third, fourth = digits
    return (first, second, third, fourth)


def read(ticks: Ticks) -> int:
    number = 0
    for tick in reversed(ticks):
        number = number * DIGITS + tick - BASE_TICKS
    return number


class Witness:
    """Passes everything on, and remembers what the board did."""

    def __init__(self, inner: Transport) -> None:
        self.inner = inner
        self.played: list[int] = []
        self.refusals: list[RefusalMessage] = []
        self.moved_while_stopped = 0
        self._decoder = BoardDecoder()
        self._stopped_for = 0

    @property
    def name(self) -> str:
        return self.inner.name

    @property
    def simulated(self) -> bool:
        return self.inner.simulated

    def now_us(self) -> int:
        return self.inner.now_us()

    def send(self, data: bytes) -> None:
        self.inner.send(data)

    def close(self) -> None:
        self.inner.close()

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        received = self.inner.receive(deadline_us)
        if received is not None:
            for frame in self._decoder.feed(received[0]):
                if isinstance(frame.message, Telemetry):
                    self._look(frame.message, State(frame.header.state))
                elif isinstance(frame.message, RefusalMessage):
                    last = self.refusals[-1].record_id if self.refusals else 0
                    if frame.message.record_id != last:
                        self.refusals.append(frame.message)
        return received

    def _look(self, telemetry: Telemetry, state: State) -> None:
        if telemetry.attached != 15:
            return
        number = read(telemetry.pulse_ticks)
        self._stopped_for = self._stopped_for + 1 if state is State.STOPPED else 0
        if not self.played or number != self.played[-1]:
            self.played.append(number)
            # The frame in which the stop came still shows its own pulses.
            self.moved_while_stopped += self._stopped_for > 1


@dataclass
class Count:
    """What was sent, and what went wrong: the second half has to be zero."""

    commands: int = 0
    segments: int = 0
    stops: int = 0
    frames_harmed: int = 0
    retransmitted: int = 0
    virtual_s: float = 0.0

    played_twice_or_out_of_order: int = 0
    segments_lost: int = 0
    moved_while_stopped: int = 0
    refusals_lost: int = 0
    refusals_doubled: int = 0
    wrong_verdicts: int = 0

    @property
    def wrong(self) -> int:
        """Everything that must not happen."""
        return sum(getattr(self, item.name) for item in fields(self)[6:])


@dataclass
class Stress:
    """One run."""

    seed: int
    rate: float
    count: Count = field(default_factory=Count)

    def __post_init__(self) -> None:
        self.rng = random.Random(self.seed)
        self.world = World(seed=self.seed)
        self.world.start()
        self.witness = Witness(SimTransport(self.world))
        faults = Faults.each(self.rate)
        self.line = LossyTransport(self.witness, seed=self.seed, down=faults, up=faults)
        self.session = Session(self.line, session_id=7)
        self.told: list[Refused] = []
        self.session.subscribe(self._on_event)
        # Sent segments: (era, number, ticket); an era ends with a stop.
        self.sent: list[tuple[int, int, Ticket]] = []
        self.number = 0
        self.era = 0

    def _on_event(self, event: Event) -> None:
        if isinstance(event, Refused):
            self.told.append(event)

    def run(self, commands: int) -> Count:
        session, count = self.session, self.count
        session.open(60 * SECOND_US)
        session.request(Enable(pulse_ticks=spell(0)), 20 * SECOND_US)
        session.run_until(lambda: session.state is State.HOLDING, 20 * SECOND_US)
        under_way: deque[tuple[Ticket, bool | None]] = deque()
        while count.commands < commands:
            if self.rng.random() < 0.002:
                self._stop_and_resume()
                # Planned before the stop: whether the board took them first is open.
                under_way = deque((ticket, None) for ticket, _ in under_way)
            message, refused = self._draw()
            ticket = session.send(message)
            count.commands += 1
            if isinstance(message, Segments):
                for segment in message.segments[: message.count]:
                    self.sent.append((self.era, read(segment.target_ticks), ticket))
            under_way.append((ticket, refused))
            if len(under_way) >= UNDER_WAY:
                self._await(under_way, UNDER_WAY // 2)
        self._await(under_way, 0)
        self.line.down_faults = self.line.up_faults = Faults()
        session.run_for(2 * SECOND_US)
        self._judge()
        self.world.close()
        return count

    def _draw(self) -> tuple[HostMessage, bool | None]:
        """Return a command, and whether it must be refused; None where it depends."""
        what = self.rng.random()
        if what < 0.25:
            used = [self._next_segment() for _ in range(self.rng.randint(1, 5))]
            unused = [Segment(0, (0, 0, 0, 0))] * (5 - len(used))
            first, second, third, fourth, fifth = used + unused
            return Segments(
                self.session.epoch, len(used), (first, second, third, fourth, fifth)
            ), False
        if what < 0.5:
            return Disarm(reserved=0), None
        if what < 0.75:
            return Resume(epoch=self.session.epoch), False
        if what < 0.85:
            return Resume(epoch=(self.session.epoch + 7) & 0xFF), True
        if what < 0.95:
            return Enable(pulse_ticks=spell(0)), True
        return Relax(slew_ticks=0, free_ticks=spell(0)), True

    def _next_segment(self) -> Segment:
        self.number += 1
        return Segment(1, spell(self.number))

    def _stop_and_resume(self) -> None:
        session = self.session
        session.stop(60 * SECOND_US)
        self.count.stops += 1
        self.era += 1
        while session.state is State.STOPPED:
            # Refused where a late copy of the stop came first.
            with suppress(RefusedError):
                session.request(Resume(epoch=session.epoch), 60 * SECOND_US)

    def _await(self, under_way: deque[tuple[Ticket, bool | None]], left: int) -> None:
        while len(under_way) > left:
            ticket, refused = under_way.popleft()
            self._wait_for(ticket)
            if refused is not None and refused != (ticket.state is TicketState.REFUSED):
                self.count.wrong_verdicts += 1

    def _wait_for(self, ticket: Ticket) -> None:
        self.session.run_until(lambda: ticket.done, 60 * SECOND_US)

    def _judge(self) -> None:
        count, witness = self.count, self.witness
        count.segments = len(self.sent)
        count.virtual_s = self.line.now_us() / SECOND_US
        count.frames_harmed = sum(self.line.counts.values())
        count.retransmitted = self.session.engine.statistics.frames_retransmitted
        count.moved_while_stopped = witness.moved_while_stopped
        played = witness.played
        count.played_twice_or_out_of_order = sum(b <= a for a, b in pairwise(played))
        # A stop drops what was queued: the last segments of an era may be missing.
        was_played = set(played)
        last_played: dict[int, int] = {}
        for era, number, _ in self.sent:
            if number in was_played:
                last_played[era] = number
        for era, number, ticket in self.sent:
            if number in was_played:
                count.wrong_verdicts += ticket.state is TicketState.REFUSED
            elif number < last_played.get(era, 0) or era == self.era:
                count.segments_lost += 1
        told = [event.record.record_id for event in self.told]
        really = [record.record_id for record in witness.refusals]
        count.refusals_lost = max(0, len(really) - len(told))
        count.refusals_doubled = max(0, len(told) - len(really))
        count.wrong_verdicts += sum(a != b for a, b in zip(told, really, strict=False))
        count.wrong_verdicts += sum(event.ticket is None for event in self.told)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=100_000)
    parser.add_argument("--rate", type=float, default=0.01, help="of each kind of fault, each way")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    count = Stress(options.seed, options.rate).run(options.commands)
    for item in fields(count):
        sys.stdout.write(f"{item.name:30} {getattr(count, item.name):g}\n")
    return int(count.wrong != 0)


if __name__ == "__main__":
    raise SystemExit(main())
