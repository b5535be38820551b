"""Random commands through a bad line to the real firmware, and a count of what went wrong.

A witness sits between the simulated board and the bad line. Now and then a stop, a
guarded move that trips or a broken sensor interrupts.

    python -m tests.system.link_stress --commands 100000 --rate 0.01

`--record` appends what came out to `link_runs.json`, with date and commit;
`make line-stress` does so with a million.
"""

from __future__ import annotations

import argparse
import datetime
import json
import random
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise
from pathlib import Path

from tests.system.witness import Witness, read, spell

from setae.link.events import Event, FaultReported, Refused, Ticket, TicketState, Tripped
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae.sim import SensorFault, SimTransport, World
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    Disarm,
    Enable,
    FaultMessage,
    Guard,
    GuardMessage,
    HostMessage,
    Reflex,
    RefusalMessage,
    Relax,
    Resume,
    Segment,
    Segments,
    State,
    Trip,
)

RUNS = Path(__file__).with_name("link_runs.json")
SECOND_US = 1_000_000
UNDER_WAY = 12
THRESHOLD_RAW = 15 * PRESSURE_LSB_PER_HPA
# A floor that the bristle's tip reaches where the arm goes down so far.
FLOOR_TOP_MM, DOWN_MM = -155.0, (0.0, 0.0, -30.0)
UP_MM = (0.0, 0.0, 0.0)
FROZEN = (State.STOPPED, State.TRIPPED, State.FAULT)


@dataclass
class Count:
    """What was sent, and what went wrong: the second half has to be zero."""

    commands: int = 0
    segments: int = 0
    stops: int = 0
    trips: int = 0
    faults: int = 0
    refusals: int = 0
    frames_harmed: int = 0
    retransmitted: int = 0
    timeouts: int = 0
    virtual_s: float = 0.0

    commands_lost: int = 0
    commands_doubled: int = 0
    commands_failed: int = 0
    segments_lost: int = 0
    played_twice_or_out_of_order: int = 0
    moved_while_frozen: int = 0
    records_lost: int = 0
    records_doubled: int = 0
    wrong_verdicts: int = 0

    @property
    def wrong(self) -> int:
        """Everything that must not happen."""
        return sum(getattr(self, item.name) for item in fields(self)[10:])


@dataclass
class _Era:
    """What was sent between two freezes: (number, its command) of each segment."""

    sent: list[tuple[int, Ticket]] = field(default_factory=list)
    played_from: int = 0


@dataclass
class Stress:
    """One run; `freezes` times as often stopped, tripped and in fault as in a long one."""

    seed: int
    rate: float
    freezes: float = 1.0
    count: Count = field(default_factory=Count)

    def __post_init__(self) -> None:
        self.rng = random.Random(self.seed)
        self.world = World(seed=self.seed)
        self.world.add_box((0.0, 0.0, FLOOR_TOP_MM - 50.0), (200.0, 200.0, 100.0))
        self.world.start()
        self.witness = Witness(SimTransport(self.world))
        faults = Faults.each(self.rate)
        self.line = LossyTransport(self.witness, seed=self.seed, down=faults, up=faults)
        self.session = Session(self.line, session_id=7)
        self.told: list[Tripped | FaultReported | Refused] = []
        self.session.subscribe(self._on_event)
        self.under_way: deque[tuple[Ticket, bool | None]] = deque()
        self.drawn = 0
        self.number = 0
        # An era is judged when the next one is over: until then its last pulses may show.
        self.eras = [_Era()]

    def _on_event(self, event: Event) -> None:
        if isinstance(event, (Tripped, FaultReported, Refused)):
            self.told.append(event)

    def run(self, commands: int) -> Count:
        session, count = self.session, self.count
        session.open(60 * SECOND_US)
        self._send(Enable(pulse_ticks=spell(0)), refused=False)
        self._await(0)
        self._until(lambda: session.state is State.HOLDING)
        while self.drawn < commands:
            self.drawn += 1
            what = self.rng.random() / self.freezes
            if what < 0.002:
                self._stop()
            elif what < 0.003:
                self._trip()
            elif what < 0.0035:
                self._break_sensor()
            message, refused = self._draw()
            self._send(message, refused=refused)
            if len(self.under_way) >= UNDER_WAY:
                self._await(UNDER_WAY // 2)
        self._await(0)
        self.line.down_faults = self.line.up_faults = Faults()
        session.run_for(2 * SECOND_US)
        self._judge()
        self.world.close()
        return count

    # ------------------------------------------------------------------------ commands

    def _send(self, message: HostMessage, *, refused: bool | None) -> Ticket:
        """`refused`: whether it must be; None where it depends."""
        ticket = self.session.send(message)
        if isinstance(message, Segments):
            for segment in message.segments[: message.count]:
                self.eras[-1].sent.append((read(segment.target_ticks), ticket))
        self.under_way.append((ticket, refused))
        return ticket

    def _draw(self) -> tuple[HostMessage, bool | None]:
        what = self.rng.random()
        if what < 0.2:
            return self._segments(), False
        if what < 0.3:
            return Disarm(reserved=0), None
        if what < 0.34:
            return Resume(epoch=(self.session.epoch + 7) & 0xFF), True
        if what < 0.38:
            return Enable(pulse_ticks=spell(0)), True
        if what < 0.42:
            return Relax(slew_ticks=0, free_ticks=spell(0)), True
        return Resume(epoch=self.session.epoch), False

    def _segments(self) -> Segments:
        used = []
        for _ in range(self.rng.randint(1, 5)):
            self.number += 1
            used.append(Segment(1, spell(self.number)))
        unused = [Segment(0, (0, 0, 0, 0))] * (5 - len(used))
        first, second, third, fourth, fifth = used + unused
        return Segments(self.session.epoch, len(used), (first, second, third, fourth, fifth))

    def _await(self, left: int) -> None:
        while len(self.under_way) > left:
            ticket, refused = self.under_way.popleft()
            self._until(lambda ticket=ticket: ticket.done)  # type: ignore[misc]
            self._settle(ticket)
            if refused is not None and refused != (ticket.state is TicketState.REFUSED):
                self.count.wrong_verdicts += 1

    def _settle(self, ticket: Ticket) -> None:
        self.count.commands += ticket.sequence is not None  # a stop discards what waits
        self.count.commands_failed += ticket.state is TicketState.FAILED

    def _until(self, done: Callable[[], bool]) -> None:
        self.session.run_until(done, 60 * SECOND_US)

    # ------------------------------------------------------------------------- freezes

    def _stop(self) -> None:
        self.session.stop(60 * SECOND_US)
        self.count.stops += 1
        self._resume()

    def _trip(self) -> None:
        """A guarded move that trips: a touch, or else its deadline."""
        self._arm(deadline_frames=self.rng.randint(5, 60))
        for _ in range(self.rng.randint(0, 4)):
            self._send(self._segments(), refused=False)
        if self.rng.random() < 0.7:
            self._move_arm(DOWN_MM)
        self._until(lambda: self.session.state in FROZEN)
        self._move_arm(UP_MM)
        self._until(lambda: not self.world.arm_moving)
        self._resume()

    def _move_arm(self, target_mm: tuple[float, float, float]) -> None:
        if self.world.arm_moving:
            self._until(lambda: not self.world.arm_moving)
        self.world.arm_move(target_mm, 300.0, 3_000.0)

    def _break_sensor(self) -> None:
        """The sensor fails under an armed guard, and comes back."""
        self._arm(deadline_frames=1_000)
        broken = self.rng.choice([SensorFault.ABSENT, SensorFault.SILENT, SensorFault.BUS])
        self.world.sensor_fault(broken)
        self._send(self._segments(), refused=False)
        self._until(lambda: self.session.state in FROZEN)
        self.world.sensor_fault(SensorFault.NONE)
        self.session.run_for(100_000)
        self._resume()

    def _arm(self, *, deadline_frames: int) -> None:
        session = self.session
        self._await(0)
        self._until(lambda: session.state is State.HOLDING)
        session.run_for(200_000)  # the tare needs a bristle at rest
        guard = GuardMessage(
            epoch=session.epoch, threshold_raw=THRESHOLD_RAW, consecutive=1,
            deadline_frames=deadline_frames, reflex=Reflex.HOLD, retract_ticks=spell(0),
            retract_slew_ticks=0,
        )  # fmt: skip
        ticket = self._send(guard, refused=False)

        def armed() -> bool:
            assert ticket.refusal is None, ticket.refusal
            telemetry = session.telemetry
            assert telemetry is not None
            return telemetry.guard is Guard.ARMED or session.state in FROZEN

        self._until(armed)

    def _resume(self) -> None:
        """From whatever froze it; a new era begins."""
        # Planned before: whether the board took them first is open.
        self.under_way = deque((ticket, None) for ticket, _ in self.under_way)
        while self.session.state in FROZEN:
            # It is refused where a late copy of the stop came first, or the record is pending.
            ticket = self.session.send(Resume(epoch=self.session.epoch))
            self._until(lambda ticket=ticket: ticket.done)  # type: ignore[misc]
            self._settle(ticket)
        self._await(0)
        self.eras.append(_Era(played_from=max(0, len(self.witness.played) - 3)))
        if len(self.eras) > 2:
            self._judge_era(self.eras.pop(0), last=False)

    # ------------------------------------------------------------------------- verdict

    def _judge(self) -> None:
        count, witness = self.count, self.witness
        while self.eras:
            self._judge_era(self.eras.pop(0), last=not self.eras)
        statistics = self.session.engine.statistics
        count.virtual_s = self.line.now_us() / SECOND_US
        count.frames_harmed = sum(self.line.counts.values())
        count.retransmitted = statistics.frames_retransmitted
        count.timeouts = statistics.timeouts
        count.commands_lost = max(0, count.commands - witness.taken)
        count.commands_doubled = max(0, witness.taken - count.commands)
        count.moved_while_frozen = witness.moved_while_frozen
        count.played_twice_or_out_of_order = sum(b <= a for a, b in pairwise(witness.played))
        told = [event.record for event in self.told]
        count.trips = sum(isinstance(event, Tripped) for event in self.told)
        count.faults = sum(isinstance(event, FaultReported) for event in self.told)
        count.refusals = len(told) - count.trips - count.faults
        count.wrong_verdicts += sum(
            isinstance(event, Refused) and event.ticket is None for event in self.told
        )
        self._judge_records()

    def _judge_records(self) -> None:
        """Each kind's records, in order."""
        count = self.count
        for kind in (Trip, FaultMessage, RefusalMessage):
            told = [event.record for event in self.told if isinstance(event.record, kind)]
            really = [record for record in self.witness.records if isinstance(record, kind)]
            count.records_lost += max(0, len(really) - len(told))
            count.records_doubled += max(0, len(told) - len(really))
            count.wrong_verdicts += sum(a != b for a, b in zip(told, really, strict=False))

    def _judge_era(self, era: _Era, *, last: bool) -> None:
        """A freeze drops what was queued: an era's last segments may be missing, no others."""
        count = self.count
        count.segments += len(era.sent)
        played = set(self.witness.played[era.played_from :])
        last_played = max((number for number, _ in era.sent if number in played), default=0)
        for number, ticket in era.sent:
            if number in played:
                count.wrong_verdicts += ticket.state is TicketState.REFUSED
            elif number < last_played or last:
                count.segments_lost += 1


def record(count: Count, *, seed: int, rate: float) -> None:
    """Append a run to the file of runs."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short=10", "HEAD"],
        cwd=RUNS.parent, check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    runs = json.loads(RUNS.read_text()) if RUNS.is_file() else []
    when = datetime.datetime.now(datetime.UTC).date().isoformat()
    runs.append({"date": when, "commit": commit, "seed": seed, "rate": rate, **asdict(count)})
    lines = ",\n".join(json.dumps(run) for run in runs)
    RUNS.write_text(f"[\n{lines}\n]\n")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=100_000)
    parser.add_argument("--rate", type=float, default=0.01, help="of each kind of fault, each way")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", action="store_true", help="append to link_runs.json")
    options = parser.parse_args(arguments)
    count = Stress(options.seed, options.rate).run(options.commands)
    for item in fields(count):
        sys.stdout.write(f"{item.name:30} {getattr(count, item.name):g}\n")
    if options.record:
        record(count, seed=options.seed, rate=options.rate)
    return int(count.wrong != 0)


if __name__ == "__main__":
    raise SystemExit(main())
