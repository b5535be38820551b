"""Draw the protocol's exchanges of messages, as the real host and the real board have them.

    python docs/protocol_pictures.py

The host is the package's, the board is the firmware's own code in the simulator; the line between
them loses the frames that each picture is about. `make_pictures.py` does it too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import states_picture
from svg import Svg

from setae.link.events import Event, Ticket, Tripped
from setae.link.session import Session
from setae.report import palette
from setae.sim import SimTransport, World
from setae_protocol.frame import BoardDecoder, BoardFrame, HostDecoder, HostFrame
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    Acknowledge,
    BoardMessage,
    Enable,
    GuardMessage,
    HostMessage,
    Receipt,
    Record,
    Reflex,
    RefusalMessage,
    Resume,
    Segment,
    Segments,
    State,
    Stop,
    Telemetry,
    Trip,
)

PICTURES = Path(__file__).resolve().parent / "pictures"
WIDTH = 800
HOST_X, BOARD_X = 210, 580
ROW = 34
FREE_TICKS = 1700


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A frame, or a remark on one side."""

    at_us: int
    words: str
    down: bool
    lost: bool = False
    remark: bool = False
    done: str = ""  # what the board did with it


@dataclass
class Line:
    """A transport that shows what passes, and loses what it is told to.

    Attributes
    ----------
    lose
        Asked for each frame's message, once.
    shown
        Which messages become rows.
    """

    inner: SimTransport
    lose: Callable[[HostMessage | BoardMessage], bool] = field(default=lambda _: False)
    shown: Callable[[HostMessage | BoardMessage], bool] = field(default=lambda _: False)
    rows: list[Row] = field(default_factory=list)
    _unanswered: list[tuple[int, HostFrame]] = field(default_factory=list)  # row, command or stop
    _expected: int = 0
    _from_host: HostDecoder = field(default_factory=HostDecoder)
    _from_board: BoardDecoder = field(default_factory=BoardDecoder)
    _up: bytes = b""

    @property
    def name(self) -> str:
        """The simulator's."""
        return self.inner.name

    @property
    def simulated(self) -> bool:
        """The simulator's."""
        return self.inner.simulated

    def now_us(self) -> int:
        """Return the simulator's time."""
        return self.inner.now_us()

    def close(self) -> None:
        """Let go of the simulator."""
        self.inner.close()

    def remark(self, words: str, *, host: bool = True) -> None:
        """Write beside one side what it knows now."""
        self.rows.append(Row(at_us=self.now_us(), words=words, down=host, remark=True))

    def send(self, data: bytes) -> None:
        """Send frame by frame what is not lost."""
        for wire in data.split(b"\0")[:-1]:
            kept = True
            for frame in self._from_host.feed(wire + b"\0"):
                kept = self._pass(frame, describe_host(frame), down=True)
            if kept:
                self.inner.send(wire + b"\0")

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Wait for what is not lost."""
        received = self.inner.receive(deadline_us)
        if received is None:
            return None
        *wires, self._up = (self._up + received[0]).split(b"\0")
        kept = b""
        for wire in wires:
            keep = True
            for frame in self._from_board.feed(wire + b"\0"):
                keep = self._pass(frame, self._describe_board(frame), down=False)
            if keep:
                kept += wire + b"\0"
        return kept, received[1]

    def _pass(self, frame: HostFrame | BoardFrame, words: str, *, down: bool) -> bool:
        lost = self.lose(frame.message)
        if isinstance(frame, HostFrame) and not lost:
            if frame.message.RELIABLE or isinstance(frame.message, Stop):
                self._unanswered.append((len(self.rows), frame))
        elif isinstance(frame, BoardFrame):
            self._answer(frame)
        if self.shown(frame.message):
            self.rows.append(Row(at_us=self.now_us(), words=words, down=down, lost=lost))
        return not lost

    def _answer(self, frame: BoardFrame) -> None:
        """Say beside the command what its receipt tells that the board did with it."""
        header, message = frame.header, frame.message
        if isinstance(message, Receipt) and self._unanswered:
            place, asked = self._unanswered.pop(0)
            if isinstance(asked.message, Stop):
                done = "freezes, drops its queue"
            elif message.gap:
                done = f"drops it: {header.expected} is missing"
            elif header.expected == self._expected:
                done = "has had it: does nothing"
            elif isinstance(asked.message, Segments) and asked.message.epoch != header.epoch:
                done = "discards it: an old epoch"
            else:
                done = "carries it out"
            if place < len(self.rows):
                self.rows[place] = dataclasses.replace(self.rows[place], done=done)
        if isinstance(message, Receipt):
            self._expected = header.expected

    def _describe_board(self, frame: BoardFrame) -> str:
        header, message = frame.header, frame.message
        state = frame.state.name.lower()
        words = type(message).__name__.removesuffix("Message").lower()
        if isinstance(message, Receipt):
            words += ": gap!" if message.gap else ""
        if isinstance(message, Telemetry):
            words += f": stop {message.stop_number}"
        if isinstance(message, Trip | RefusalMessage):
            words += f" {message.record_id}"
        return f"{words} · expects {header.expected} · epoch {header.epoch} · {state}"


def describe_host(frame: HostFrame) -> str:
    message = frame.message
    name = type(message).__name__.lower()
    if isinstance(message, Stop):
        return f"stop {message.stop_number}"
    if isinstance(message, Acknowledge):
        return f"acknowledge {Record(message.record).name.lower()} {message.record_id}"
    words = f"{frame.header.sequence}: {name.removesuffix('message')}"
    if isinstance(message, Segments | GuardMessage | Resume):
        words += f" · epoch {message.epoch}"
    return words


class Stage:
    """A robot that holds, with the line's picture still empty."""

    def __init__(self) -> None:
        self.world = World(seed=1)
        self.world.start()
        self.line = Line(SimTransport(self.world))
        self.session = Session(self.line, session_id=5)
        self.session.open()
        self.request(Enable(pulse_ticks=(FREE_TICKS,) * 4))
        self.until(lambda: self.session.state is State.HOLDING)
        # Between two servo frames, so that pictures begin alike.
        frame = self.session.telemetry
        self.until(lambda: self.session.telemetry is not frame)

    def request(self, message: HostMessage) -> Ticket:
        """Send a command, wait for its verdict."""
        return self.session.request(message)

    def until(self, done: Callable[[], bool]) -> None:
        """Let time pass."""
        self.session.run_until(done, 10_000_000)

    def say(self, ticket: Ticket, words: str) -> None:
        """Wait for a verdict, and remark it."""
        self.until(lambda: ticket.done)
        self.line.remark(f"{words} {ticket.state.value}")

    def segments(self, ticks: int, frames: int = 10) -> Segments:
        """Return one segment for all four servos."""
        unused = Segment(0, (0, 0, 0, 0))
        first = Segment(frames, (ticks,) * 4)
        return Segments(
            epoch=self.session.epoch,
            count=1,
            segments=(first, unused, unused, unused, unused),
        )


def each_nth(kind: type, numbers: set[int]) -> Callable[[HostMessage | BoardMessage], bool]:
    """Return what loses the n-th messages of a type, from 0 on."""
    count = -1

    def lose(message: HostMessage | BoardMessage) -> bool:
        nonlocal count
        count += isinstance(message, kind)
        return isinstance(message, kind) and count in numbers

    return lose


def lost_command() -> list[Row]:
    """The first of three commands is lost."""
    stage = Stage()
    line = stage.line
    line.shown = lambda message: isinstance(message, Segments | Receipt)
    line.lose = each_nth(Segments, {0})
    tickets = [stage.session.send(stage.segments(FREE_TICKS + 40 * i)) for i in (1, 2, 3)]
    for ticket in tickets:
        stage.until(lambda ticket=ticket: ticket.done)
    line.remark("all three executed")
    return line.rows


def lost_receipt() -> list[Row]:
    """A command arrives, its receipts don't."""
    stage = Stage()
    line = stage.line
    begin = line.now_us()
    line.shown = lambda message: isinstance(message, Segments | Receipt)
    # Telemetry acknowledges too: for this picture it is lost for a while.
    lose_receipt = each_nth(Receipt, {0})
    line.lose = lambda message: (
        lose_receipt(message) or (isinstance(message, Telemetry) and line.now_us() < begin + 45_000)
    )
    ticket = stage.session.send(stage.segments(FREE_TICKS + 40))
    stage.say(ticket, "segments")
    return line.rows


def lost_stop() -> list[Row]:
    """A stop in the middle of a motion; its first frame is lost, and so is a command."""
    stage = Stage()
    line, session = stage.line, stage.session
    stage.request(stage.segments(FREE_TICKS + 400, 50))
    stage.until(lambda: session.state is State.MOVING)
    stopping = False

    def shown(message: HostMessage | BoardMessage) -> bool:
        if isinstance(message, Telemetry):
            return stopping and bool(line.rows) and message.stop_number == 1
        return isinstance(message, Segments | Receipt | Stop | Resume)

    lose_segments, lose_stop = each_nth(Segments, {0}), each_nth(Stop, {0})
    line.shown = shown
    line.lose = lambda message: lose_segments(message) or lose_stop(message)
    late = session.send(stage.segments(FREE_TICKS + 600, 50))
    stopping = True
    stop = session.send_stop()
    stage.until(lambda: stop.done)
    line.remark("stop executed")
    line.shown = lambda message: isinstance(message, Segments | Receipt | Stop | Resume)
    stage.say(late, "segments")
    resume = session.send(Resume(epoch=session.epoch))
    stage.say(resume, "resume")
    return line.rows


def lost_record() -> list[Row]:
    """A contact; its record is lost, then its acknowledgement."""
    stage = Stage()
    line, session = stage.line, stage.session
    told: list[Event] = []
    session.subscribe(lambda event: told.append(event) if isinstance(event, Tripped) else None)
    stage.request(
        GuardMessage(
            epoch=session.epoch, threshold_raw=15 * PRESSURE_LSB_PER_HPA,
            consecutive=2, deadline_frames=20, reflex=Reflex.HOLD,
            retract_ticks=(FREE_TICKS,) * 4, retract_slew_ticks=20,
        )
    )  # fmt: skip
    stage.request(stage.segments(FREE_TICKS + 200, 100))
    stage.until(lambda: session.state is State.MOVING)
    line.shown = lambda message: isinstance(message, Trip | Acknowledge)
    lose_trip, lose_answer = each_nth(Trip, {0}), each_nth(Acknowledge, {0})
    line.lose = lambda message: lose_trip(message) or lose_answer(message)
    stage.until(lambda: bool(told))
    line.remark("told: tripped")
    session.run_for(250_000)
    line.remark("(not told again)")
    return line.rows


CHARTS: dict[str, tuple[Callable[[], list[Row]], str]] = {
    "lost_command": (lost_command, "A lost command"),
    "lost_receipt": (lost_receipt, "A lost receipt"),
    "lost_stop": (lost_stop, "A stop in motion"),
    "lost_record": (lost_record, "A lost record"),
}


def chart(rows: list[Row], title: str, path: Path) -> None:
    """Draw one exchange: time runs downwards, a row for each frame."""
    svg = Svg(WIDTH, 78 + ROW * len(rows) + 12)
    bottom = svg.height - 12
    svg.text(20, 30, title, size=17, weight="bold")
    for x, name in ((HOST_X, "host"), (BOARD_X, "board")):
        svg.box(x - 45, 40, 90, 26, fill=palette.PANEL, edge=palette.HOLDER)
        svg.text(x, 58, name, anchor="middle", weight="bold")
        svg.path(f"M{x},66 V{bottom:g}", colour=palette.HOLDER, width=2)
    start_us = rows[0].at_us
    y = 78.0
    told_us = None
    for row in rows:
        y += ROW
        if row.remark:
            x = HOST_X - 12 if row.down else BOARD_X + 12
            svg.text(x, y - 4, row.words, anchor="end" if row.down else "start",
                     colour=palette.TENDON, weight="bold")  # fmt: skip
            continue
        if row.at_us != told_us:
            told_us = row.at_us
            svg.text(20, y - 4, f"{(row.at_us - start_us) / 1000:.1f} ms", colour=palette.MUTED,
                     size=12)  # fmt: skip
        colour = palette.CONTACT if row.lost else palette.PRESSURE if row.down else palette.INK
        begin, end = (HOST_X, BOARD_X) if row.down else (BOARD_X, HOST_X)
        middle = (begin + end) / 2
        if row.lost:
            svg.path(f"M{begin},{y - 12:g} L{middle:g},{y - 8:g}", colour=colour, dashed=True)
            svg.cross(middle, y - 8, colour=colour)
        else:
            svg.path(f"M{begin},{y - 12:g} L{end},{y - 4:g}", colour=colour, arrow=True)
        if row.done:
            svg.text(BOARD_X + 12, y, row.done, colour=palette.TENDON, size=12.5)
        if row.down:
            svg.text(HOST_X + 12, y - 18, row.words, colour=colour, size=12.5, halo=True)
        else:
            svg.text(BOARD_X - 12, y - 18, row.words, colour=colour, size=12.5, anchor="end",
                     halo=True)  # fmt: skip
    svg.save(path, title)


def draw(folder: Path) -> None:
    """Draw all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (play, title) in CHARTS.items():
        chart(play(), title, folder / f"{name}.svg")
    states_picture.draw(folder / "states.svg")


if __name__ == "__main__":
    draw(PICTURES)
