"""The simulator of every day against the chip: the same commands and the same samples.

Both boards get the same bytes in the same servo frames, and their sensors the same
pressures at the same times in them, all of it away from the frames' edges. Then all
that they send is the same, but for times within a frame.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
import pytest
from tests.avr.driver import WIDE_LIMITS, Ticks
from tests.avr.simavr import CYCLES_PER_TICK, CYCLES_PER_US, AvrTransport, Uno, pulses

from setae.link.transport import Transport
from setae.sim import SensorFault, SimTransport, World
from setae.sim.plugin import Answer, Drive
from setae_protocol.frame import BoardDecoder, BoardFrame, encode_host
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    SERVO_FRAME_US,
    Acknowledge,
    BoardMessage,
    Enable,
    FaultMessage,
    Guard,
    GuardMessage,
    Hello,
    HostMessage,
    Record,
    Reflex,
    RefusalMessage,
    Resume,
    Segment,
    Segments,
    Status,
    Stop,
    Telemetry,
    Trip,
)

# The first session tells when the board's frames begin, the second opens in a frame of our choice.
FIRST_SESSION, SESSION = 6, 7
OPENING = 50
# From this servo frame on everything is compared; by then both boards and sensors are in step.
START = 60
END = START + 190
TOUCH, RELEASE, SILENCE = START + 62, START + 75, START + 160
REST_RAW = round(1013.25 * PRESSURE_LSB_PER_HPA)
TOUCH_RAW = 27 * PRESSURE_LSB_PER_HPA
SAMPLE_US = 1e6 / 75
# When in its first frame the sensor of the simulator of every day takes a sample: with 75 and 50 Hz
# the others then come 3.3, 10 or 16.7 ms after a frame's start.
SAMPLED_AT_US = 10_000
BOOT_US = 510_000
LISTENING_US = BOOT_US + 50_000
REST: Ticks = (1500, 1500, 1500, 1500)
_UNUSED = Segment(duration_frames=0, target_ticks=(0, 0, 0, 0))
BEYOND = Segment(duration_frames=5, target_ticks=(10, 10, 10, 10))


def pressure_raw(board_us: float) -> int:
    """What the sensor measures at a time of the board; never the same twice in a row."""
    number = round((board_us - SAMPLED_AT_US) / SAMPLE_US)
    touched = TOUCH <= board_us / SERVO_FRAME_US < RELEASE
    return REST_RAW + (0, 3, 1, 4, 2)[number % 5] + touched * TOUCH_RAW


RecordMessage = Trip | FaultMessage | RefusalMessage


class Board(Protocol):
    """One of the two."""

    @property
    def line(self) -> Transport: ...
    def silence(self) -> None: ...


class Simulated:
    """The simulator of every day: no latency, no noise, a plant that only has a pressure."""

    def __init__(self) -> None:
        quiet = {"sensor.noise_hpa": 0.0, "sensor.drift_hpa_per_sqrt_s": 0.0}
        direct = {"line.down_latency_us": 0.0, "line.up_flush_us": 0.0, "board.poll_us": 100.0}
        start = {"board.boot_us": float(BOOT_US), "board.pose_known": 0.0}
        self.world = World(seed=1, parameters={**quiet, **direct, **start}, plant=self)
        self.world.start()
        self.world.reset_board()  # at power-on it is in step with the sensor, after BOOT_US not
        self.line = SimTransport(self.world)

    def step(self, drive: Drive) -> Answer:
        hpa = (pressure_raw(1e6 * drive.time_s - BOOT_US) - REST_RAW) / PRESSURE_LSB_PER_HPA
        return Answer(position_mm=np.array([0.0, 0.0, 70.0]), rotation=np.eye(3), pressure_hpa=hpa)

    def silence(self) -> None:
        self.world.sensor_fault(SensorFault.SILENT)


class OnTheChip:
    """The firmware in the simulated UNO."""

    def __init__(self, uno: Uno) -> None:
        self.uno = uno
        self.line = AvrTransport(uno)

    def silence(self) -> None:
        self.uno.set_sensor_silent(True)

    def align(self, frame_zero_us: float) -> None:
        """Bring the sensor into step, by its oscillator, and give it its pressures."""
        self.uno.set_sensor_rate(1.03)
        while abs((self._next_us() - frame_zero_us) % SAMPLE_US - SAMPLED_AT_US) > 300:
            self.uno.run_for_us(SAMPLE_US)
        self.uno.set_sensor_rate(1.0)
        self.uno.run_for_us(SAMPLE_US)
        first = self._next_us()
        for number in range(round((END * SERVO_FRAME_US - first) / SAMPLE_US)):
            due_us = first + number * SAMPLE_US
            self.uno.set_pressure(
                pressure_raw(due_us - frame_zero_us) / PRESSURE_LSB_PER_HPA,
                from_cycle=round((due_us - SAMPLE_US / 2) * CYCLES_PER_US),
            )

    def _next_us(self) -> float:
        due = self.uno.next_sample
        assert due is not None
        return due / CYCLES_PER_US


class Host:
    """Sends what it is told to in the frame it is told to, and keeps all that comes."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.heard: list[BoardFrame] = []
        self._decoder = BoardDecoder()
        self.frame_zero_us = float("inf")
        while board.line.now_us() < LISTENING_US:
            self.listen(LISTENING_US)
        self.open(FIRST_SESSION)
        while not any(isinstance(frame.message, Telemetry) for frame in self.heard):
            self.listen(2 * LISTENING_US)

    def open(self, session: int) -> None:
        """Open a session."""
        hello = Hello(PROTOCOL_VERSION, SCHEMA_HASH, session, session)
        self.board.line.send(encode_host(hello, session=session))

    def listen(self, until_us: int) -> None:
        """Take what comes next, if anything."""
        got = self.board.line.receive(until_us)
        if got is None:
            return
        for frame in self._decoder.feed(got[0]):
            self.heard.append(frame)
            if isinstance(frame.message, Telemetry):
                at = frame.message
                zero_us = got[1] - 1_100 - at.phase_us - at.frame * SERVO_FRAME_US
                self.frame_zero_us = min(self.frame_zero_us, zero_us)

    @property
    def telemetry(self) -> Telemetry:
        return next(f.message for f in reversed(self.heard) if isinstance(f.message, Telemetry))

    @property
    def epoch(self) -> int:
        return self.heard[-1].header.epoch

    def send(self, message: HostMessage, *, reliable: bool = True) -> None:
        """Send with the number that the board expects next."""
        sequence = self.heard[-1].header.expected if reliable else 0
        self.board.line.send(encode_host(message, session=SESSION, sequence=sequence))

    def follow(self, script: dict[int, Callable[[Host], None]]) -> None:
        """Carry out the script, right after the telemetry of each of its frames."""
        for frame in range(OPENING, END):
            while self.telemetry.frame < frame:
                self.listen(self.board.line.now_us() + 100_000)
            if frame in script:
                script[frame](self)

    def last(self, kind: type[RecordMessage]) -> int:
        """The id of the last record of a kind."""
        found = (frame.message for frame in reversed(self.heard))
        return next(message.record_id for message in found if isinstance(message, kind))


def segments(rng: random.Random, low: int = 1000) -> Callable[[Host], None]:
    """A message with some random ones."""
    count = rng.randint(1, 5)

    def segment() -> Segment:
        a, b, c, d = (rng.randint(low, 5000) for _ in range(4))
        return Segment(rng.randint(2, 7), (a, b, c, d))

    a, b, c, d, e = [segment() for _ in range(count)] + [_UNUSED] * (5 - count)
    return lambda host: host.send(Segments(host.epoch, count, (a, b, c, d, e)))


def guard(reflex: Reflex) -> Callable[[Host], None]:
    threshold = 15 * PRESSURE_LSB_PER_HPA
    return lambda host: host.send(GuardMessage(host.epoch, threshold, 1, 500, reflex, REST, 200))


def acknowledge(record: Record, kind: type[RecordMessage]) -> Callable[[Host], None]:
    return lambda host: host.send(Acknowledge(record, host.last(kind)), reliable=False)


def script(seed: int) -> dict[int, Callable[[Host], None]]:
    """A touch and its reflex, a stop, a refusal, a fault, and motion before, between and after."""
    rng = random.Random(seed)
    at: dict[int, Callable[[Host], None]] = {
        0: lambda host: host.send(WIDE_LIMITS),
        2: lambda host: host.send(Enable(REST)),
        30: guard(rng.choice((Reflex.HOLD, Reflex.RETRACT))),
        76: acknowledge(Record.TRIP, Trip),
        77: acknowledge(Record.REFUSAL, RefusalMessage),
        79: lambda host: host.send(Resume(host.epoch)),
        82: segments(rng),
        83: segments(rng),
        91: lambda host: host.send(Stop(1), reliable=False),
        97: lambda host: host.send(Resume(host.epoch)),
        101: segments(rng, low=4999),
        102: lambda host: host.send(
            Segments(host.epoch, 1, (BEYOND, _UNUSED, _UNUSED, _UNUSED, _UNUSED))
        ),
        105: acknowledge(Record.REFUSAL, RefusalMessage),
        140: guard(Reflex.HOLD),
        SILENCE - START: lambda host: host.board.silence(),
        175: acknowledge(Record.FAULT, FaultMessage),
        178: lambda host: host.send(Resume(host.epoch)),
        181: lambda host: host.send(Enable(REST)),
    }
    at.update({frame: segments(rng) for frame in (40, 41, 43, 55, 58, 61, 66, 148, 150)})
    opening = {OPENING: lambda host: host.open(SESSION)}
    return {**opening, **{START + frame: act for frame, act in at.items()}}


def told(host: Host) -> list[BoardFrame]:
    """All that came from START on, without times within a frame."""
    first = next(
        index
        for index, frame in enumerate(host.heard)
        if isinstance(frame.message, Telemetry) and frame.message.frame == START
    )
    base = host.heard[first].header.sequence

    def timeless(frame: BoardFrame) -> BoardFrame:
        header = replace(frame.header, sequence=(frame.header.sequence - base) % 256)
        return replace(frame, header=header, message=_without_times(frame.message))

    return [timeless(frame) for frame in host.heard[first:]]


def _without_times(message: BoardMessage) -> BoardMessage:
    if isinstance(message, Telemetry):
        # Out of a guarded move it is the level at rest, from all samples since power-on.
        baseline = message.baseline_raw if message.guard is Guard.ARMED else 0
        a, b, c = (replace(sample, age_us=0) for sample in message.samples)
        return replace(message, phase_us=0, baseline_raw=baseline, samples=(a, b, c))
    if isinstance(message, Status):
        return replace(message, supply_mv=0)
    if isinstance(message, Trip):
        return replace(message, sample_phase_us=0)
    if isinstance(message, FaultMessage):
        return replace(message, phase_us=0)
    return message


def records(host: Host) -> set[type]:
    return {type(frame.message) for frame in host.heard}


def phases_us(host: Host) -> list[int]:
    """When in their frames what was latched happened."""
    messages = [frame.message for frame in host.heard]
    trips = [message.sample_phase_us for message in messages if isinstance(message, Trip)]
    return trips + [message.phase_us for message in messages if isinstance(message, FaultMessage)]


def widths(uno: Uno, frame_zero_us: float) -> dict[int, dict[int, int]]:
    """What the pins showed, by servo frame and servo, in cycles."""
    found: dict[int, dict[int, int]] = {}
    for pulse in pulses(uno.edges()):
        # The frame's start is known to better than 1 ms, and too late.
        frame = (pulse.rise / CYCLES_PER_US - frame_zero_us + 1_000) // SERVO_FRAME_US
        found.setdefault(int(frame), {})[pulse.servo] = pulse.width
    return found


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_commands_and_samples_give_the_same_answers(uno: Uno, seed: int) -> None:
    simulated = Host(Simulated())
    simulated.follow(script(seed))
    chip = OnTheChip(uno)
    on_the_chip = Host(chip)
    chip.align(on_the_chip.frame_zero_us)
    on_the_chip.follow(script(seed))

    assert records(simulated) >= {Trip, FaultMessage, RefusalMessage}
    ours, theirs = told(on_the_chip), told(simulated)
    for number, (one, other) in enumerate(zip(ours, theirs, strict=False)):
        assert one == other, f"the {number}th frame"
    assert len(ours) == len(theirs)
    for here, there in zip(phases_us(on_the_chip), phases_us(simulated), strict=True):
        assert abs(here - there) < 1_000
    at_the_pins = widths(uno, on_the_chip.frame_zero_us)
    for telemetry in (frame.message for frame in ours[:-3]):
        if isinstance(telemetry, Telemetry):
            assert at_the_pins.get(telemetry.frame, {}) == {
                servo: ticks * CYCLES_PER_TICK
                for servo, ticks in enumerate(telemetry.pulse_ticks)
                if telemetry.attached >> servo & 1
            }
