"""The engine survives whatever a board, or something else, may say in whatever order."""

from __future__ import annotations

import dataclasses
import typing
from enum import IntEnum
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from setae.link.engine import Engine, Phase
from setae_protocol.frame import HostDecoder, encode_board
from setae_protocol.messages import (
    BOARD_MESSAGES,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Disarm,
    Guard,
    Hello,
    HelloReply,
    Ping,
    Pong,
    Record,
    Sample,
    Sensor,
    State,
    Telemetry,
)

u8 = st.integers(0, 255)
SESSION = 7


def values(kind: Any) -> st.SearchStrategy[Any]:
    if typing.get_origin(kind) is tuple:
        return st.tuples(*(values(item) for item in typing.get_args(kind)))
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        fields = dataclasses.fields(kind)
        return st.builds(
            typing.cast(Any, kind), **{field.name: values(hints[field.name]) for field in fields}
        )
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return st.sampled_from(kind)
    return st.integers(0, 127)


frames = st.builds(
    encode_board,
    st.one_of([values(kind) for kind in BOARD_MESSAGES.values()]),
    session=st.sampled_from([0, SESSION, SESSION, SESSION, 9]),
    sequence=u8, expected=st.integers(0, 5), credit=st.integers(0, 50), epoch=u8,
    state=st.integers(0, len(State) - 1),
)  # fmt: skip
actions = st.one_of(
    st.tuples(st.just("receive"), st.one_of(frames, st.binary(max_size=80))),
    st.tuples(st.sampled_from(["send", "stop", "recall", "limits", "answer"]), st.just(b"")),
)


TELEMETRY = Telemetry(
    frame=1, phase_us=0, pulse_ticks=(0, 0, 0, 0), attached=0, queued=0, guard=Guard.OFF,
    reflex_running=0, sensor=Sensor.OK, baseline_raw=0, sample_count=0,
    samples=(Sample(0, 0), Sample(0, 0), Sample(0, 0)), rx_damaged=0, stop_number=0, underruns=0,
)  # fmt: skip


class Play:
    """Answers hello and ping where the script says so, so that every phase is met."""

    def __init__(self) -> None:
        self.engine = Engine()
        self.decoder = HostDecoder()
        self.asked: list[Any] = []

    def take(self) -> None:
        for frame in self.decoder.feed(self.engine.outgoing()):
            if isinstance(frame.message, (Hello, Ping)):
                self.asked.append(frame.message)
        self.engine.events()

    def answer(self, now_us: int) -> None:
        if not self.asked:
            return
        question = self.asked.pop(0)
        if isinstance(question, Ping):
            reply: Any = Pong(token=question.token, frame=1, phase_us=1)
        else:
            reply = HelloReply(
                protocol_version=PROTOCOL_VERSION, schema_hash=SCHEMA_HASH, token=question.token,
                firmware_major=0, firmware_minor=0, firmware_patch=0, previous_session=0,
                reset_cause=99, limits_crc=0, pose_known=0, pulse_ticks=(0, 0, 0, 0), sensor=77,
            )  # fmt: skip
        session = SESSION if not isinstance(question, Hello) else question.new_session
        self.engine.receive(encode_board(reply, session=session), now_us)


@settings(max_examples=200, deadline=None)
@given(
    script=st.lists(st.tuples(actions, st.integers(0, 300_000)), max_size=40),
    opened=st.booleans(),
)
def test_nothing_that_arrives_breaks_the_engine(
    script: list[tuple[tuple[str, bytes], int]], opened: bool
) -> None:
    play = Play()
    engine = play.engine
    now_us = 0
    engine.open(SESSION, now_us)
    if opened:
        for _ in range(3):
            play.take()
            play.answer(now_us)
        engine.receive(encode_board(TELEMETRY, session=SESSION, sequence=1), now_us)
        assert engine.is_open
    tickets = []
    for (what, data), pause_us in script:
        now_us += pause_us
        if what == "receive":
            engine.receive(data, now_us)
        elif what == "send":
            tickets.append(engine.send(Disarm(reserved=0), now_us))
        elif what == "stop":
            tickets.append(engine.stop(now_us))
        elif what == "recall":
            engine.recall(Record.TRIP, now_us)
        elif what == "limits":
            engine.read_limits(now_us)
        else:
            play.answer(now_us)
        engine.poll(now_us)
        play.take()
        deadline_us = engine.next_deadline_us
        assert deadline_us is None or deadline_us > now_us, "a wait that never ends"
    if engine.phase is Phase.FAILED:
        assert engine.error is not None
        assert all(ticket.done for ticket in tickets)
