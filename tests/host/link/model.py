"""A small model of a board, and a line to it: what the tests of the link talk to."""

from __future__ import annotations

import dataclasses
import heapq
import itertools
from collections.abc import Callable
from typing import Any

from setae.link.events import Event
from setae.link.session import Session
from setae_protocol.frame import HostDecoder, HostFrame, encode_board
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    RECORD_REPEAT_FRAMES,
    REFUSAL_WAITS,
    SCHEMA_HASH,
    SEGMENT_QUEUE_SLOTS,
    Acknowledge,
    BoardMessage,
    Enable,
    Fault,
    FaultMessage,
    Guard,
    Hello,
    HelloReply,
    Limits,
    Ping,
    Pong,
    ReadLimits,
    Recall,
    Receipt,
    Record,
    Refusal,
    RefusalMessage,
    Resume,
    Sample,
    Segment,
    Segments,
    Sensor,
    State,
    Stop,
    Telemetry,
    Trip,
    TripCause,
)

POSE = (1700, 1700, 1700, 1700)
SECOND_US = 1_000_000
LINE_US = 1_000


class ModelBoard:
    """What the host can see of a board, and a diary of what it did."""

    def __init__(self, post: Callable[[bytes], None]) -> None:
        self.post = post
        self.executed: list[Any] = []
        self.discarded: list[Any] = []
        self.refused: list[Any] = []
        self.version = (PROTOCOL_VERSION, SCHEMA_HASH)
        self.frame = 0
        self.latches: dict[Record, tuple[Any, bool, int]] = {}
        self.reset()

    def reset(self) -> None:
        self.session = 0
        self.expected = 0
        self.epoch = 0
        self.state = State.RELAXED
        self.queued = 0
        self.sequence = 0
        self.stop_number: int | None = None
        self.stops = 0
        self.decoder = HostDecoder()

    def say(self, message: BoardMessage) -> None:
        self.post(
            encode_board(
                message,
                session=self.session,
                sequence=self.sequence,
                expected=self.expected,
                credit=SEGMENT_QUEUE_SLOTS - self.queued,
                epoch=self.epoch,
                state=self.state | (REFUSAL_WAITS if self.pending(Record.REFUSAL) else 0),
            )
        )
        self.sequence = (self.sequence + 1) & 0xFF

    def on_frame_start(self) -> None:
        self.frame += 1
        if self.queued and self.state is State.MOVING:
            self.queued -= 1
            if not self.queued:
                self.state = State.HOLDING
        if self.session == 0:
            return
        self.say(
            Telemetry(
                frame=self.frame, phase_us=0, pulse_ticks=POSE, attached=15, queued=self.queued,
                guard=Guard.OFF, reflex_running=0, sensor=Sensor.OK, baseline_raw=0,
                sample_count=0, samples=(Sample(0, 0), Sample(0, 0), Sample(0, 0)), rx_damaged=0,
                stop_number=self.stop_number or 0, underruns=0,
            )
        )  # fmt: skip
        for message, acknowledged, since in list(self.latches.values()):
            if not acknowledged and (self.frame - since) % RECORD_REPEAT_FRAMES == 0:
                self.say(message)

    def receive(self, data: bytes) -> None:
        for frame in self.decoder.feed(data):
            self.on_frame(frame)

    def freeze(self, state: State) -> None:
        self.state = state
        self.queued = 0
        self.epoch = (self.epoch + 1) & 0xFF

    def latch(self, record: Record, make: Callable[[int], Any]) -> None:
        old = self.latches.get(record)
        record_id = 1 if old is None else old[0].record_id % 255 + 1
        message = dataclasses.replace(make(record_id), session=self.session)
        self.latches[record] = (message, False, self.frame)
        if self.session:
            self.say(message)

    def pending(self, record: Record) -> bool:
        return record in self.latches and not self.latches[record][1]

    def trip(self) -> None:
        self.freeze(State.TRIPPED)
        self.latch(
            Record.TRIP,
            lambda i: Trip(
                record_id=i, session=0, cause=TripCause.CONTACT, sample_frame=self.frame,
                sample_phase_us=0, pressure_raw=1, baseline_raw=0,
                pulse_ticks=(POSE, POSE, POSE, POSE),
            ),
        )  # fmt: skip

    def fault(self, fault: Fault) -> None:
        self.freeze(State.FAULT)
        self.latch(
            Record.FAULT,
            lambda i: FaultMessage(
                record_id=i,
                session=0,
                further=0,
                fault=fault,
                detail=0,
                frame=self.frame,
                phase_us=0,
                pulse_ticks=POSE,
            ),
        )

    def on_frame(self, frame: HostFrame) -> None:
        header, message = frame.header, frame.message
        if isinstance(message, Hello):
            if message.new_session and message.new_session != self.session:
                self.session = message.new_session
                self.expected = 0
                self.freeze(State.HOLDING if self.state is State.MOVING else self.state)
            self.say(
                HelloReply(
                    protocol_version=self.version[0], schema_hash=self.version[1],
                    token=message.token, firmware_major=1, firmware_minor=2, firmware_patch=3,
                    previous_session=0, reset_cause=2, limits_crc=0, pose_known=1,
                    pulse_ticks=POSE, sensor=0,
                )
            )  # fmt: skip
        elif isinstance(message, Stop):
            if message.stop_number != self.stop_number:
                self.stop_number = message.stop_number
                self.stops += 1
                self.freeze(State.FAULT if self.state is State.FAULT else State.STOPPED)
                self.executed.append("stop")
            self.say(Receipt(gap=0))
        elif header.session != self.session:
            pass
        elif isinstance(message, Ping):
            self.say(Pong(token=message.token, frame=self.frame, phase_us=0))
        elif isinstance(message, Recall):
            if message.record in self.latches:
                self.say(self.latches[message.record][0])
        elif isinstance(message, Acknowledge):
            latch = self.latches.get(message.record)
            if latch and latch[0].record_id == message.record_id:
                self.latches[message.record] = (latch[0], True, latch[2])
        elif isinstance(message, ReadLimits):
            self.say(LIMITS)
        elif self.session != 0:
            self.on_reliable(header.sequence, message)

    def on_reliable(self, sequence: int, message: Any) -> None:
        if sequence != self.expected:
            self.say(Receipt(gap=int((sequence - self.expected) & 0xFF < 128)))
            return
        stale = isinstance(message, Segments) and message.epoch != self.epoch
        reason = Refusal.NONE if stale else self.refusal(message)
        no_room = (
            isinstance(message, Segments)
            and not stale
            and self.queued + message.count > SEGMENT_QUEUE_SLOTS
        )
        if no_room or (reason is not Refusal.NONE and self.pending(Record.REFUSAL)):
            self.say(Receipt(gap=0))
            return
        self.expected = (self.expected + 1) & 0xFF
        if stale:
            self.discarded.append(message)
            self.say(Receipt(gap=0))
        elif reason is not Refusal.NONE:
            self.refused.append(message)
            if isinstance(message, Segments):
                self.freeze(State.HOLDING if self.state is State.MOVING else self.state)
            self.latch(
                Record.REFUSAL,
                lambda i: RefusalMessage(
                    record_id=i, session=0, command_type=message.TYPE, command_sequence=sequence,
                    reason=reason, index=255, value=0, limit=0,
                ),
            )  # fmt: skip
            self.say(Receipt(gap=0))
        else:
            self.executed.append(message)
            if isinstance(message, (Enable, Resume)):
                self.state = State.HOLDING
            elif isinstance(message, Segments):
                self.queued += message.count
                self.state = State.MOVING
            self.say(Receipt(gap=0))

    def refusal(self, message: Any) -> Refusal:
        if isinstance(message, Enable) and self.state is not State.RELAXED:
            return Refusal.ALREADY_ENABLED
        if isinstance(message, Resume):
            if message.epoch != self.epoch:
                return Refusal.WRONG_EPOCH
            if self.state is State.TRIPPED and self.pending(Record.TRIP):
                return Refusal.RECORD_PENDING
        if isinstance(message, Segments):
            return {
                State.RELAXED: Refusal.NOT_ENABLED,
                State.STOPPED: Refusal.STOPPED,
                State.TRIPPED: Refusal.TRIPPED,
                State.FAULT: Refusal.FAULT,
            }.get(self.state, Refusal.NONE)
        return Refusal.NONE


LIMITS = Limits(
    pulse_min_ticks=(1660, 1660, 1660, 1660), pulse_max_ticks=(4300, 4300, 4300, 4300),
    slew_ticks=140, pair_sum_min_ticks=(3000, 3000), pair_sum_max_ticks=(8000, 8000),
    pair_difference_min_ticks=(-900, -900), pair_difference_max_ticks=(900, 900),
    coarse_threshold_raw=200_000, hold_timeout_s=0, stop_switch=0,
)  # fmt: skip


class ModelTransport:
    """Virtual time, and a line that takes a millisecond each way."""

    name = "model"
    simulated = True

    def __init__(self) -> None:
        self.time_us = 0
        self.pending: list[tuple[int, int, Callable[[], bytes]]] = []
        self.number = itertools.count()
        self.board = ModelBoard(self.post)
        self.delay_us = LINE_US
        self.cut_off = False
        self.deaf = False
        self.sent: list[bytes] = []
        self.at(20_000, self.tick)

    def at(self, time_us: int, action: Callable[[], bytes]) -> None:
        heapq.heappush(self.pending, (time_us, next(self.number), action))

    def tick(self) -> bytes:
        self.at(self.time_us + 20_000, self.tick)
        self.board.on_frame_start()
        return b""

    def post(self, data: bytes) -> None:
        self.at(self.time_us + self.delay_us, lambda: b"" if self.cut_off else data)

    def now_us(self) -> int:
        return self.time_us

    def send(self, data: bytes) -> None:
        self.sent.append(data)

        def arrive() -> bytes:
            if not self.cut_off and not self.deaf:
                self.board.receive(data)
            return b""

        self.at(self.time_us + self.delay_us, arrive)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        while self.pending and self.pending[0][0] <= deadline_us:
            time_us, _, action = heapq.heappop(self.pending)
            self.time_us = max(self.time_us, time_us)
            data = action()
            if data:
                return data, self.time_us
        self.time_us = max(self.time_us, deadline_us)
        return None

    def close(self) -> None:
        pass


def segments(session: Session, count: int = 5, *, mark: int = 1700) -> Segments:
    """Segments that `mark` makes distinguishable."""
    used = [Segment(1, (mark, 1700, 1700, 1700))] * count
    unused = [Segment(0, (0, 0, 0, 0))] * (5 - count)
    first, second, third, fourth, fifth = used + unused
    return Segments(
        epoch=session.epoch, count=count, segments=(first, second, third, fourth, fifth)
    )


def record_events(session: Session) -> list[Event]:
    events: list[Event] = []
    session.subscribe(events.append)
    return events
