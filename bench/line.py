"""What the link costs on the line to the board, and what a bad line does to commands."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from bench.figure import Figure
from tests.system.link_stress import RUNS
from tests.system.witness import spell

from setae.board import Board
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae.link.transport import Transport
from setae.sim import SimTransport, World
from setae_protocol.messages import (
    SEGMENTS_PER_MESSAGE,
    SERVO_FRAME_US,
    Enable,
    Segment,
    Segments,
)

SEED = 1
SEGMENTS = 3_000
# All but epoch and count.
SEGMENT_BYTES = (Segments.SIZE - 2) // SEGMENTS_PER_MESSAGE


class _Meter:
    """Passes everything on, and counts the bytes to the board."""

    simulated = True

    def __init__(self, inner: Transport) -> None:
        self.name = inner.name
        self.now_us = inner.now_us
        self.receive = inner.receive
        self.close = inner.close
        self.bytes_down = 0
        self._inner = inner

    def send(self, data: bytes) -> None:
        self.bytes_down += len(data)
        self._inner.send(data)


@dataclass(frozen=True)
class Goodput:
    """Of one stream of segments."""

    percent: float
    retransmitted: int
    underruns: int


def stream(faults: Faults) -> Goodput:
    """Have the board play a segment each servo frame, as a move does.

    Parameters
    ----------
    faults
        Of the line, each way.

    Returns
    -------
    Goodput
        Bytes of segments over all that the host put on the line meanwhile:
        retransmissions, acknowledgements and pings included.
    """
    world = World(seed=SEED)
    world.start()
    meter = _Meter(LossyTransport(SimTransport(world), seed=SEED, down=faults, up=faults))
    with world, Session(meter, session_id=1) as session:
        board = Board(session)
        session.open()
        session.request(Enable(pulse_ticks=spell(0)))
        board.wait(lambda: board.at_rest(spell(0)), 5.0, "the servos")
        segments = [Segment(1, spell(number)) for number in range(1, SEGMENTS + 1)]
        underruns = board.telemetry.underruns
        before = meter.bytes_down
        board.play(segments, SEGMENTS * SERVO_FRAME_US / 1e6)
        return Goodput(
            100.0 * SEGMENTS * SEGMENT_BYTES / (meter.bytes_down - before),
            session.engine.statistics.frames_retransmitted,
            board.telemetry.underruns - underruns,
        )


def goodput() -> Iterable[Figure]:
    """How much of what goes to the board is segments."""
    how = (
        f"bytes of segments over bytes on the wire to the simulated board, {SEGMENTS} segments of"
        " one servo frame each, five a frame"
    )
    for name, faults, what in (
        ("goodput_percent_clean_line", Faults(), "nothing lost"),
        ("goodput_percent_1_percent_loss", Faults(lose=0.01), "1 % of frames lost each way"),
    ):
        got = stream(faults)
        yield Figure(
            name,
            round(got.percent, 1),
            "%",
            f"{how}; {what}, {got.retransmitted} frames sent again, the queue ran dry"
            f" {got.underruns} times",
        )


def commands() -> Iterable[Figure]:
    """What a bad line does to commands: the recorded runs, which take ten minutes."""
    recorded: list[dict[str, Any]] = json.loads(RUNS.read_text())
    newest = recorded[-1]
    runs = [run for run in recorded if run["commit"] == newest["commit"]]
    rates = " and ".join(f"{100 * rate:g} %" for rate in sorted({run["rate"] for run in runs}))

    def total(*names: str) -> int:
        return sum(run[name] for run in runs for name in names)

    how = (
        f"{len(runs)} runs recorded {newest['date']} at {newest['commit']}, `make line-stress`: the"
        f" simulated board, each of seven kinds of harm to {rates} of all frames, each way"
    )
    yield Figure(
        "line_commands",
        total("commands"),
        "commands",
        f"{how}; besides, {total('stops')} stops, {total('trips')} trips, {total('faults')} faults"
        f" and {total('refusals')} refusals: {total('records_lost')} records lost,"
        f" {total('records_doubled')} told twice",
    )
    yield Figure(
        "line_commands_lost",
        total("commands_lost", "segments_lost"),
        "commands",
        f"{how}; not carried out, and not reported as failed ({total('commands_failed')} were)",
    )
    yield Figure(
        "line_commands_doubled",
        total("commands_doubled", "played_twice_or_out_of_order"),
        "commands",
        f"{how}; carried out twice or out of order",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "goodput": goodput,
    "line_commands": commands,
}
