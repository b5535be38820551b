"""The host's targets: bytes in, and no exception but `SetaeError` out; nothing lost, no hang.

hypothesis drives them in `test_host.py`, atheris in `atheris_host.py`.
"""

from __future__ import annotations

import contextlib
import functools
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from mcap.writer import Writer
from tests.host.link.model import POSE, ModelBoard

from setae.config import loads
from setae.errors import SetaeError
from setae.link.engine import Engine, Phase
from setae.link.events import Ticket, TicketState
from setae.record import Recorder, read
from setae.record.topics import JSON_RECORD, PROFILE, TOPICS
from setae_protocol.messages import Disarm, Enable, Record, Segment, Segments

# ------------------------------------------------------------------------------- engine

_STEP_US: Final = 10_000
_CALM_US: Final = 9_000_000
"""After this on a good line every command has an end: 20 tries take 8 s at most."""
_AFTER_US: Final = 300_000
"""What happens twice, or too late, happens within this."""


class _Play:
    """An engine, a model of a board, and a line between them that the input controls."""

    def __init__(self) -> None:
        self.now_us = 0
        self.engine = Engine()
        self.to_host: list[bytes] = []
        self.board = ModelBoard(self.to_host.append)
        self.frame_us = 20_000
        self.tickets: list[Ticket] = []
        self.engine.open(7, 0)

    def wait(self, duration_us: int, line: Callable[[bytes], bytes]) -> None:
        for _ in range(0, duration_us, _STEP_US):
            self.now_us += _STEP_US
            if self.now_us >= self.frame_us:
                self.frame_us += 20_000
                self.board.on_frame_start()
            self.engine.poll(self.now_us)
            self.exchange(line)
            self.engine.poll(self.now_us)  # what came may have made something due at once
            due_us = self.engine.next_deadline_us
            assert due_us is None or due_us > self.now_us, "a wait that never ends"

    def exchange(self, line: Callable[[bytes], bytes]) -> None:
        sent = self.engine.outgoing()
        if sent:
            self.board.receive(line(sent))
        arrived, self.to_host[:] = list(self.to_host), []
        for data in arrived:
            self.engine.receive(line(data), self.now_us)
        self.engine.events()

    def send(self, which: int) -> None:
        segment = Segment(1, (1700 + len(self.tickets),) * 4)
        if which == 0:
            self.tickets.append(self.engine.send(Enable(pulse_ticks=POSE), self.now_us))
        elif which == 1:
            self.tickets.append(self.engine.send(Disarm(reserved=0), self.now_us))
        else:
            message = Segments(epoch=self.engine.epoch, count=which, segments=(segment,) * 5)
            self.tickets.append(self.engine.send(message, self.now_us))


def engine(data: bytes) -> None:
    """Commands, stops and recalls over a line that does what the input says."""
    play = _Play()
    play.wait(200_000, bytes)
    todo = iter(data)

    def line(sent: bytes) -> bytes:
        what = next(todo, 0)
        if what < 160:
            return sent
        if what < 190:
            return b""
        if what < 210:
            return sent + sent
        where = next(todo, 0) % len(sent)
        if what < 230:
            return sent[:where] + bytes([sent[where] ^ (1 << what % 8)]) + sent[where + 1 :]
        return sent[:where] + sent[where + 1 :]

    for action in todo:
        if action < 96:
            play.send(action % 6)
        elif action < 112:
            play.engine.stop(play.now_us)
        elif action < 120:
            play.engine.recall(Record(action % 3), play.now_us)
        elif action < 128:
            garbage = bytes(next(todo, 0) for _ in range(action % 8 * 3))
            play.engine.receive(garbage, play.now_us)
        else:
            play.wait((1 + action % 16) * _STEP_US, line)
    end_us = play.now_us + _CALM_US
    while play.now_us < end_us and not all(ticket.done for ticket in play.tickets):
        play.wait(_STEP_US, bytes)
    play.wait(_AFTER_US, bytes)
    assert all(ticket.done for ticket in play.tickets), "a command without an end"
    if play.engine.phase is Phase.FAILED:
        assert play.engine.error is not None
        return
    done = [ticket.message for ticket in play.tickets if ticket.state is TicketState.EXECUTED]
    ran = [message for message in play.board.executed if message != "stop"]
    # Segments that ran may count as discarded where a stop came at once behind them.
    rest = iter(ran)
    assert all(any(message == item for item in rest) for message in done), (
        "executed commands ran once, and in their order"
    )
    assert len(ran) <= len(play.tickets), "no command runs twice"


# -------------------------------------------------------------------------------- config


def config(data: bytes) -> None:
    """Any text is a configuration, or refused with a reason."""
    with contextlib.suppress(SetaeError):
        loads(data.decode("utf-8", errors="replace"))


# ----------------------------------------------------------------------------------- log


@functools.cache
def whole_log() -> bytes:
    """Return a small log with a few messages of some topics."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.mcap"
        with Recorder(path, metadata={"simulated": True, "note": "small"}) as recorder:
            for number in range(5):
                recorder.command(number * 1000, "move", {"number": number})
                recorder.experiment(number * 1000, "step", {"number": number})
                recorder.stage(number * 1000, position_mm=(0.0, 1.0, 2.0), moving=False)
        return path.read_bytes()


def _sealed(topic: str, body: bytes, metadata: str) -> bytes:
    """A log that is whole, with a message that may be none of ours."""
    out = BytesIO()
    writer = Writer(out)
    writer.start(profile=PROFILE, library="")
    writer.add_metadata(JSON_RECORD, {"simulated": metadata})
    schema = writer.register_schema("any", "jsonschema", b"{}")
    writer.add_message(writer.register_channel(topic, "json", schema), 0, body, 0)
    writer.finish()
    return out.getvalue()


def log(data: bytes) -> None:
    """Any file is a log, as far as it goes, or refused with a reason."""
    how, rest = data[:1] or b"\0", data[1:]
    content = bytearray(whole_log())
    if how[0] % 4 == 1:
        content[len(rest) % len(content) :] = rest
    elif how[0] % 4 == 2:
        for at in range(0, len(rest) - 2, 3):
            content[int.from_bytes(rest[at : at + 2], "little") % len(content)] = rest[at + 2]
    elif how[0] % 4 == 3:
        topics = [*TOPICS, "/other"]
        topic = topics[how[0] // 4 % len(topics)]
        content[:] = _sealed(topic, rest, rest.decode("utf-8", errors="replace"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.mcap"
        path.write_bytes(content)
        try:
            found = read(path)
        except SetaeError:
            return
    if how[0] % 4 == 0:
        assert found.damage is None
        assert len(found.messages("/experiment")) == 5, "nothing is lost"
    assert found.span_us[0] <= found.span_us[1]
    str(found.damage)
    found.events()
    _use(found)


def _use(found: Any) -> None:
    for topic in found.topics:
        found.times_us(topic)
        for field in TOPICS.get(topic, {}):
            with contextlib.suppress(SetaeError):  # objects are no arrays
                found.array(topic, field)
