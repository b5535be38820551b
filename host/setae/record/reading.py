"""Reading a log: whole, cut or broken."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import orjson
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Metadata
from mcap.stream_reader import breakup_chunk

from setae.errors import LogError
from setae.record.log import Damage, Log
from setae.record.topics import JSON_RECORD, PROFILE, TEXT_RECORD, TOPICS, fits

_MAGIC: Final = b"\x89MCAP0\r\n"


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
        with path.open("rb") as file:
            # Before the rest: whatever isn't a log may be larger than the memory.
            start = file.read(len(_MAGIC))
            data = start + file.read() if start == _MAGIC else b""
    except IsADirectoryError as error:
        raise LogError(f"{path} is a folder.", "Give one of the logs in it.") from error
    except OSError as error:
        raise LogError(f"{path} can't be read: {error.strerror}.", "Check the name.") from error
    if not data:
        raise LogError(
            f"{path} is no log: it doesn't start as an MCAP file does.",
            "Give a file that an experiment wrote.",
        )
    reading = _Reading(data)
    reading.run()
    if not reading.profile_seen:
        raise LogError(
            f"{path} is an MCAP file, but not a log of setae.",
            "Give a file that an experiment wrote.",
        )
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
            decode: Callable[[str], Any] = json.loads if record.name == JSON_RECORD else str
            if record.name in (TEXT_RECORD, JSON_RECORD):
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
        message = orjson.loads(item.data)
        if not fits(topic, message):
            raise ValueError(f"no message of {topic}")
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
    OverflowError,  # one beyond any memory
    RecursionError,  # JSON that is nested too deep
    struct.error,
    zstandard.ZstdError,
)
