"""Logs: what happened in a run, in one MCAP file that other tools open too.

`Recorder` writes, `read` gives a `Log`. Messages are JSON, each topic has a JSON
schema, so Foxglove and the ``mcap`` command line tool read the files without
setae. Times are integer microseconds of the run's own clock: virtual time in
the simulator, so that the same run gives the same bytes.

==============  ==========  ===========================================================
topic           rate        what
==============  ==========  ===========================================================
/telemetry      50 Hz       board state and the four pulses, `Recorder.telemetry`
/pressure       75 Hz       samples of the bristle's sensor, `Recorder.pressure`
/trip           on event    a contact or deadline froze the pulses, `Recorder.trip`
/fault          on event    the board is in fault, `Recorder.fault`
/refusal        on event    the board refused a command, `Recorder.refusal`
/command        on event    what the program asked for, `Recorder.command`
/stage          on change   the arm that carries the robot, `Recorder.stage`
/experiment     on event    steps of an experiment, `Recorder.experiment`
/truth          25 Hz       the simulator's own state (simulated only), `Recorder.truth`
==============  ==========  ===========================================================

The metadata that reports look for, all optional: ``simulated`` (bool), ``seed``,
``config`` (TOML text), ``versions`` (name to version), ``experiment`` (its name),
``trial`` (its number, from 1), ``obstacle_below_tip_mm`` (or None), and ``scene``::

    {"tube": {"axis_mm": [x, y], "inner_radius_mm": r},
     "cube": {"centre_mm": [x, y, z], "edge_mm": e, "yaw_rad": a} or None,
     "arm_start_mm": [x, y, z]}

in the world frame (z up). Frame D hangs from the arm: x_D = x, y_D = -y, z_D = -z.

Events of the tube exploration on ``/experiment``: ``trial_start`` {obstacle},
``arm_lowering``, ``lowering_contact`` {contact}, ``level_start`` {descent_mm},
``direction_start`` {alpha_deg, target_mm}, ``direction_end`` {alpha_deg, touched,
contact}, ``level_end``, ``arm_return``, ``trial_end`` {descent_mm, contacts},
``trial_aborted`` {reason}. ``contact`` is None or a mapping with ``time_us``,
``tip_mm`` (the bristle's tip in frame D), ``tip_world_mm``, ``uncertainty_mm``,
``pressure_hpa``, ``baseline_hpa``.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Final, Self

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.writer import Writer
from numpy.typing import ArrayLike, NDArray

from setae.errors import InputError, LogError

__all__ = ["TOPICS", "Damage", "Event", "Log", "Recorder", "read"]

PROFILE: Final = "setae"
LIBRARY: Final = "setae log 1"  # a fixed string: no version of a library in the bytes
FLUSH_US: Final = 1_000_000  # a killed run loses at most this much
DECIMALS: Final = 6  # nanometres; finer digits only cost space

_MAGIC: Final = b"\x89MCAP0\r\n"
_TEXT_RECORD: Final = "setae"  # metadata values that are text
_JSON_RECORD: Final = "setae.json"  # all other values, as JSON


# ------------------------------------------------------------------------- schemas


def _number(unit: str = "") -> dict[str, Any]:
    return {"type": ["number", "null"]} | ({"description": unit} if unit else {})


def _numbers(*shape: int, unit: str = "") -> dict[str, Any]:
    schema = _number(unit)
    for size in reversed(shape):
        schema = {"type": "array", "items": schema, "minItems": size, "maxItems": size}
    return schema


_INTEGER: Final[dict[str, Any]] = {"type": "integer"}
_TEXT: Final[dict[str, Any]] = {"type": "string"}
_FLAG: Final[dict[str, Any]] = {"type": "boolean"}
_ANY: Final[dict[str, Any]] = {"type": ["object", "null"]}

TOPICS: Final[Mapping[str, Mapping[str, Any]]] = {
    "/telemetry": {
        "frame": _INTEGER,
        "state": _TEXT,
        "epoch": _INTEGER,
        "pulse_us": _numbers(4, unit="us; 0 where the servo has no pulses"),
        "guard": _TEXT,
        "reflex_running": _FLAG,
        "queued": _INTEGER,
        "baseline_hpa": _number("hPa"),
    },
    "/pressure": {
        "pressure_hpa": _number("hPa"),
        "baseline_hpa": _number("hPa"),
        "armed": _FLAG,
    },
    "/trip": {
        "record_id": _INTEGER,
        "cause": _TEXT,
        "sample_time_us": _INTEGER,
        "pressure_hpa": _number("hPa"),
        "baseline_hpa": _number("hPa"),
        "pulse_us": _numbers(4, 4, unit="us; the last four servo frames, oldest first"),
        "contact": _ANY,
    },
    "/fault": {
        "record_id": _INTEGER,
        "fault": _TEXT,
        "detail": _INTEGER,
        "pulse_us": _numbers(4, unit="us"),
    },
    "/refusal": {
        "record_id": _INTEGER,
        "command": _TEXT,
        "reason": _TEXT,
        "index": _INTEGER,
        "value": _INTEGER,
        "limit": _INTEGER,
    },
    "/command": {"name": _TEXT, "args": _ANY},
    "/stage": {"position_mm": _numbers(3, unit="mm, world"), "moving": _FLAG},
    "/experiment": {"event": _TEXT, "data": _ANY},
    "/truth": {
        "backbone_mm": _numbers(21, 3, unit="mm, frame D, from the spring's base to its top"),
        "filament_mm": _numbers(2, 3, unit="mm, frame D, root and undeformed tip"),
        "arm_mm": _numbers(3, unit="mm, world"),
        "contact_depth_mm": _number("mm"),
        "contact_point_mm": _numbers(3, unit="mm, world; means something while the depth is > 0"),
        "tension_n": _numbers(4, unit="N"),
        "pressure_hpa": _number("hPa"),
    },
}


def _schema(topic: str) -> bytes:
    properties = {"time_us": {"type": "integer", "description": "us on the run's clock"}}
    properties.update(TOPICS[topic])
    schema = {"type": "object", "required": list(properties), "properties": properties}
    return json.dumps(schema, separators=(",", ":")).encode()


def _plain(value: Any) -> Any:
    """Turn a value into what JSON can say: NaN and infinity become null."""
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return round(float(value), DECIMALS) if math.isfinite(value) else None
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and np.isfinite(value).all():
            return value.round(DECIMALS).tolist()  # the fast way for the big ones
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Iterable):
        return [_plain(item) for item in value]
    raise InputError(f"A log can't hold a value of type {type(value).__name__}.")


_ENCODER = json.JSONEncoder(
    separators=(",", ":"), ensure_ascii=False, allow_nan=False, default=_plain
)


def _encode(time_us: int, data: Mapping[str, Any]) -> bytes:
    # An array goes through _plain by itself; only other containers may hold what JSON can't say.
    message: dict[str, Any] = {"time_us": time_us}
    for key, value in data.items():
        simple = type(value) in (int, str, bool, np.ndarray)
        message[key] = value if simple else _plain(value)
    return _ENCODER.encode(message).encode()


# ------------------------------------------------------------------------- writing


class Recorder:
    """Writes one log. Use it as a context manager.

    A message is on the disk at most a second of log time after it was written,
    so a run that is killed loses no more.

    Parameters
    ----------
    path
        The file to make. It must not exist.
    metadata
        What the log is about; see the module's page. Values of any JSON type.

    Raises
    ------
    LogError
        The file exists, its folder doesn't, it may not be written, or the disk
        is full. Any later write may raise it too.
    """

    def __init__(self, path: str | Path, *, metadata: Mapping[str, Any] | None = None) -> None:
        self.path = Path(path)
        self._flush_due_us: int | None = None
        self._sequence = dict.fromkeys(TOPICS, 0)
        self._file: IO[bytes] | None = None
        try:
            self._file = self.path.open("xb")
        except FileExistsError:
            raise LogError(
                f"{self.path} exists already.", "Choose another name; a log is never overwritten."
            ) from None
        except OSError as error:
            raise LogError(
                f"{self.path} can't be made: {error.strerror}.", "Check the folder."
            ) from error
        self._writer = Writer(self._file)
        with _LogErrors(self.path):
            self._writer.start(profile=PROFILE, library=LIBRARY)
            self._write_metadata(metadata or {})
            self._channels = {topic: self._register(topic) for topic in TOPICS}

    def _register(self, topic: str) -> int:
        schema = self._writer.register_schema(
            "setae." + topic.removeprefix("/"), "jsonschema", _schema(topic)
        )
        return self._writer.register_channel(topic, "json", schema)

    def _write_metadata(self, metadata: Mapping[str, Any]) -> None:
        text = {key: value for key, value in metadata.items() if isinstance(value, str)}
        other = {key: value for key, value in metadata.items() if key not in text}
        self._writer.add_metadata(_TEXT_RECORD, text)
        self._writer.add_metadata(
            _JSON_RECORD, {key: json.dumps(_plain(value)) for key, value in other.items()}
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except LogError:
            if kind is None:  # else the error that ended the run matters more
                raise

    def close(self) -> None:
        """Write what is left and the index. A second call does nothing."""
        if self._file is None:
            return
        file, self._file = self._file, None
        with _LogErrors(self.path):
            try:
                self._writer.finish()
            finally:
                file.close()

    def write(self, topic: str, time_us: int, data: Mapping[str, Any]) -> None:
        """Add a message to one of `TOPICS`, with exactly the topic's fields.

        Raises
        ------
        InputError
            No such topic, or a field is missing or unknown.
        LogError
            The recorder is closed, or the disk is full.
        """
        if topic not in TOPICS:
            raise InputError(f"No topic {topic!r}.", f"Topics: {', '.join(TOPICS)}.")
        if data.keys() != TOPICS[topic].keys():
            wrong = ", ".join(sorted(data.keys() ^ TOPICS[topic].keys()))
            raise InputError(f"Fields of {topic} missing or unknown: {wrong}.")
        if self._file is None:
            raise LogError(f"{self.path} is closed already.")
        time_us = int(time_us)
        payload = _encode(time_us, data)
        with _LogErrors(self.path):
            if self._flush_due_us is None:
                self._flush_due_us = time_us + FLUSH_US
            elif time_us >= self._flush_due_us:
                self._flush_due_us = time_us + FLUSH_US
                self._writer.flush()
            self._writer.add_message(
                self._channels[topic],
                log_time=time_us * 1000,
                data=payload,
                publish_time=time_us * 1000,
                sequence=self._sequence[topic],
            )
        self._sequence[topic] = (self._sequence[topic] + 1) % 2**32

    def telemetry(
        self,
        time_us: int,
        *,
        frame: int,
        state: str,
        epoch: int,
        pulse_us: ArrayLike,
        guard: str,
        reflex_running: bool,
        queued: int,
        baseline_hpa: float,
    ) -> None:
        """One telemetry frame; `pulse_us` (4,), 0 where a servo has no pulses."""
        self.write(
            "/telemetry",
            time_us,
            {
                "frame": frame,
                "state": state,
                "epoch": epoch,
                "pulse_us": np.asarray(pulse_us, dtype=float),
                "guard": guard,
                "reflex_running": bool(reflex_running),
                "queued": queued,
                "baseline_hpa": baseline_hpa,
            },
        )

    def pressure(
        self, time_us: int, *, pressure_hpa: float, baseline_hpa: float, armed: bool
    ) -> None:
        """One sample of the sensor; `time_us` is the sample's own time."""
        self.write(
            "/pressure",
            time_us,
            {"pressure_hpa": pressure_hpa, "baseline_hpa": baseline_hpa, "armed": bool(armed)},
        )

    def trip(
        self,
        time_us: int,
        *,
        record_id: int,
        cause: str,
        sample_time_us: int,
        pressure_hpa: float,
        baseline_hpa: float,
        pulse_us: ArrayLike,
        contact: Any = None,
    ) -> None:
        """One trip record.

        Parameters
        ----------
        sample_time_us
            Time of the deciding sample.
        pulse_us
            (4, 4) pulses of the last four servo frames, oldest first.
        contact
            What the host makes of it, a mapping or dataclass; None where it is
            no contact.
        """
        self.write(
            "/trip",
            time_us,
            {
                "record_id": record_id,
                "cause": cause,
                "sample_time_us": int(sample_time_us),
                "pressure_hpa": pressure_hpa,
                "baseline_hpa": baseline_hpa,
                "pulse_us": np.asarray(pulse_us, dtype=float),
                "contact": contact,
            },
        )

    def fault(
        self, time_us: int, *, record_id: int, fault: str, detail: int, pulse_us: ArrayLike
    ) -> None:
        """One fault record; `pulse_us` (4,) are the frozen pulses."""
        self.write(
            "/fault",
            time_us,
            {
                "record_id": record_id,
                "fault": fault,
                "detail": detail,
                "pulse_us": np.asarray(pulse_us, dtype=float),
            },
        )

    def refusal(
        self,
        time_us: int,
        *,
        record_id: int,
        command: str,
        reason: str,
        index: int,
        value: int,
        limit: int,
    ) -> None:
        """One refusal record."""
        self.write(
            "/refusal",
            time_us,
            {
                "record_id": record_id,
                "command": command,
                "reason": reason,
                "index": index,
                "value": value,
                "limit": limit,
            },
        )

    def command(self, time_us: int, name: str, args: Any = None) -> None:
        """What the program asked the robot for, and with which arguments."""
        self.write("/command", time_us, {"name": name, "args": args})

    def stage(self, time_us: int, *, position_mm: ArrayLike, moving: bool) -> None:
        """Where the arm is: `position_mm` (3,), world."""
        position = np.asarray(position_mm, dtype=float)
        self.write("/stage", time_us, {"position_mm": position, "moving": bool(moving)})

    def experiment(self, time_us: int, event: str, data: Any = None) -> None:
        """One step of an experiment, with what belongs to it (mapping or dataclass)."""
        self.write("/experiment", time_us, {"event": event, "data": data})

    def truth(
        self,
        time_us: int,
        *,
        backbone_mm: ArrayLike,
        filament_mm: ArrayLike,
        arm_mm: ArrayLike,
        contact_depth_mm: float,
        contact_point_mm: ArrayLike,
        tension_n: ArrayLike,
        pressure_hpa: float,
    ) -> None:
        """The simulator's own state; shapes (21, 3), (2, 3), (3,), -, (3,), (4,), -."""
        self.write(
            "/truth",
            time_us,
            {
                # A tenth of a micrometre is plenty for a picture, and halves the file.
                "backbone_mm": np.round(np.asarray(backbone_mm, dtype=float), 4),
                "filament_mm": np.round(np.asarray(filament_mm, dtype=float), 4),
                "arm_mm": np.round(np.asarray(arm_mm, dtype=float), 4),
                "contact_depth_mm": contact_depth_mm,
                "contact_point_mm": np.round(np.asarray(contact_point_mm, dtype=float), 4),
                "tension_n": np.round(np.asarray(tension_n, dtype=float), 4),
                "pressure_hpa": pressure_hpa,
            },
        )


class _LogErrors:
    """Turns errors of the file system into LogError."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        return None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if isinstance(error, OSError):
            raise LogError(
                f"{self.path} can't be written: {error.strerror or error}.",
                "What was written before can still be read. Make room, then start again.",
            ) from error


# ------------------------------------------------------------------------- reading


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """What is wrong with a log that could be read in part.

    Attributes
    ----------
    reason
        In words.
    bytes_lost
        Bytes of the file that gave no message: a cut or broken part. 0 where
        the run ended between two writes.
    chunks_lost
        Broken blocks in the middle, each up to a second of messages.
    last_time_us
        Time of the last message that could be read; what came later is gone,
        up to a second that was never written included.
    """

    reason: str
    bytes_lost: int
    chunks_lost: int
    last_time_us: int

    def __str__(self) -> str:
        lost = [f"{self.bytes_lost} bytes could not be read"] if self.bytes_lost else []
        if self.chunks_lost:
            lost.append(f"{self.chunks_lost} broken blocks of up to 1 s each were left out")
        lost.append(f"the last message is from {self.last_time_us / 1e6:.3f} s")
        return f"{self.reason}: {', '.join(lost)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A message of ``/experiment``."""

    time_us: int
    name: str
    data: Mapping[str, Any]


class Log:
    """A log in memory.

    Attributes
    ----------
    path : Path
        Where it was read from.
    metadata : dict
        As given to `Recorder`.
    damage : Damage or None
        What is wrong with the file; None where it is whole.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Any],
        messages: Mapping[str, Sequence[Mapping[str, Any]]],
        damage: Damage | None,
    ) -> None:
        self.path = path
        self.metadata = dict(metadata)
        self.damage = damage
        self._messages = {topic: list(items) for topic, items in messages.items()}

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics that hold messages."""
        return tuple(self._messages)

    @property
    def simulated(self) -> bool:
        """Whether the robot was simulated, as far as the log says."""
        return bool(self.metadata.get("simulated", "/truth" in self._messages))

    @property
    def span_us(self) -> tuple[int, int]:
        """Time of the first and the last message; (0, 0) where there is none."""
        times = [m["time_us"] for messages in self._messages.values() for m in messages]
        return (min(times), max(times)) if times else (0, 0)

    def messages(self, topic: str) -> list[Mapping[str, Any]]:
        """Messages of a topic, in the order written; none: an empty list."""
        return list(self._messages.get(topic, ()))

    def times_us(self, topic: str) -> NDArray[np.int64]:
        """Times of a topic's messages, (n,)."""
        return np.array([m["time_us"] for m in self._messages.get(topic, ())], dtype=np.int64)

    def array(self, topic: str, field: str) -> NDArray[Any]:
        """One field of all messages of a topic, (n, ...).

        Numbers come as float64 with NaN for null, flags as bool, text as str.

        Raises
        ------
        InputError
            The topic has no such field.
        """
        if field not in TOPICS.get(topic, {}):
            known = ", ".join(TOPICS[topic]) if topic in TOPICS else "no such topic"
            raise InputError(f"{topic} has no field {field!r}.", f"It has: {known}.")
        values = [m[field] for m in self._messages.get(topic, ())]
        kind = TOPICS[topic][field]["type"]
        if kind == "boolean":
            return np.array(values, dtype=bool)
        if kind == "string":
            return np.array(values, dtype=str)
        return np.array(values, dtype=float)

    def events(self, *names: str) -> list[Event]:
        """Messages of ``/experiment``, all or those with one of the names."""
        return [
            Event(time_us=m["time_us"], name=m["event"], data=m["data"] or {})
            for m in self._messages.get("/experiment", ())
            if not names or m["event"] in names
        ]


def read(path: str | Path) -> Log:
    """Read a log, whole or cut.

    A file that ends in the middle, or is broken in the middle, is read as far
    as it goes; `Log.damage` then says what was lost.

    Raises
    ------
    LogError
        The file can't be opened, isn't an MCAP file, or isn't one of setae's.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path} can't be read: {error.strerror}.", "Check the name.") from error
    if not data.startswith(_MAGIC):
        raise LogError(f"{path} is no log: it doesn't start as an MCAP file does.")
    reading = _Reading(data)
    reading.run()
    if not reading.profile_seen:
        raise LogError(f"{path} is an MCAP file, but not a log of setae.")
    return Log(path, reading.metadata, reading.messages, reading.damage())


class _Reading:
    """One pass over a file's bytes. Needs no index, so it reads cut files."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.metadata: dict[str, Any] = {}
        self.messages: dict[str, list[Mapping[str, Any]]] = {}
        self.profile_seen = False
        self._topics: dict[int, str] = {}
        self._problem = ""
        self._bytes_lost = 0
        self._chunks_lost = 0
        self._last_time_us = 0

    def run(self) -> None:
        closed = False
        for opcode, offset, size in self._records():
            body = self.data[offset : offset + size]
            closed = closed or opcode == Opcode.FOOTER
            try:
                self._take(opcode, body)
            except _BROKEN:
                self._problem = "The log is broken in the middle"
                self._bytes_lost += size
                self._chunks_lost += opcode == Opcode.CHUNK
        if not closed and not self._problem:
            self._problem = "The run ended without closing the log"

    def _records(self) -> Iterator[tuple[int, int, int]]:
        """Yield (opcode, offset of the body, size of the body) of whole records."""
        offset = len(_MAGIC)
        end = len(self.data)
        while offset < end:
            size = int.from_bytes(self.data[offset + 1 : offset + 9], "little")
            if offset + 9 + size > end:
                if self.data[offset:] != _MAGIC:
                    self._problem = "The log is cut"
                    self._bytes_lost += end - offset
                return
            yield self.data[offset], offset + 9, size
            offset += 9 + size

    def _take(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.HEADER:
            self.profile_seen = stream.read_prefixed_string() == PROFILE
        elif opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            decode: Callable[[str], Any] = json.loads if record.name == _JSON_RECORD else str
            if record.name in (_TEXT_RECORD, _JSON_RECORD):
                self.metadata.update({key: decode(text) for key, text in record.metadata.items()})
        elif opcode == Opcode.CHUNK:
            for item in breakup_chunk(Chunk.read(stream), validate_crc=True):
                if isinstance(item, Channel):
                    self._topics[item.id] = item.topic
                elif isinstance(item, Message):
                    self._take_message(item)

    def _take_message(self, item: Message) -> None:
        # Channels are numbered in the order of TOPICS, should their own records be lost.
        topic = self._topics.get(item.channel_id) or list(TOPICS)[item.channel_id - 1]
        message = json.loads(item.data)
        self._last_time_us = max(self._last_time_us, message["time_us"])
        self.messages.setdefault(topic, []).append(message)

    def damage(self) -> Damage | None:
        if not self._problem:
            return None
        return Damage(
            reason=self._problem,
            bytes_lost=self._bytes_lost,
            chunks_lost=self._chunks_lost,
            last_time_us=self._last_time_us,
        )


_BROKEN = (
    McapError,
    ValueError,  # a wrong CRC, JSON or UTF-8
    LookupError,
    MemoryError,  # a broken size
    struct.error,
    zstandard.ZstdError,
)
