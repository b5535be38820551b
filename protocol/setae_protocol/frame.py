"""Frames: messages to bytes on the wire, and back out of any stream of bytes.

A frame is ``COBS(header, payload, CRC-32C) 0x00``. The zero appears nowhere
else, so a decoder that lost its place finds it again at the next zero. A
damaged frame is dropped and counted by its cause, never repaired.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum
from typing import Final, Generic, TypeVar

from setae_protocol.cobs import cobs_decode, cobs_encode
from setae_protocol.crc import crc32c
from setae_protocol.messages import (
    BOARD_MESSAGES,
    CRC_BYTES,
    FRAME_WIRE_BYTES_MAX,
    HOST_MESSAGES,
    REFUSAL_WAITS,
    BoardHeader,
    BoardMessage,
    HelloReply,
    HostHeader,
    HostMessage,
    State,
)

__all__ = [
    "BoardDecoder",
    "BoardFrame",
    "Damage",
    "Decoder",
    "HostDecoder",
    "HostFrame",
    "cobs_decode",
    "cobs_encode",
    "crc32c",
    "encode",
    "encode_board",
    "encode_host",
]

DELIMITER: Final = b"\0"
_STATES: Final = len(State)


class Damage(Enum):
    """Why a frame was dropped."""

    BAD_COBS = "bad_cobs"
    SHORT = "short"
    BAD_CRC = "bad_crc"
    UNKNOWN_TYPE = "unknown_type"
    WRONG_LENGTH = "wrong_length"
    OVER_LONG = "over_long"
    BAD_VALUE = "bad_value"
    """The frame is whole, but a field holds a code that this version doesn't have."""


@dataclass(frozen=True, slots=True)
class HostFrame:
    """A valid frame from the host."""

    header: HostHeader
    message: HostMessage


@dataclass(frozen=True, slots=True)
class BoardFrame:
    """A valid frame from the board."""

    header: BoardHeader
    message: BoardMessage

    @property
    def state(self) -> State:
        """The board's state; ValueError in a hello's answer from a version that has others."""
        return State(self.header.state & ~REFUSAL_WAITS)

    @property
    def refusal_waits(self) -> bool:
        """Whether a refusal waits to be acknowledged."""
        return bool(self.header.state & REFUSAL_WAITS)


def encode(inside: bytes) -> bytes:
    """Return header and payload as a frame on the wire."""
    return cobs_encode(inside + crc32c(inside).to_bytes(CRC_BYTES, "little")) + DELIMITER


def encode_host(message: HostMessage, *, session: int, sequence: int = 0) -> bytes:
    """Return a frame from the host, as it goes on the wire."""
    header = HostHeader(type=message.TYPE, session=session, sequence=sequence)
    return encode(header.pack() + message.pack())


def encode_board(
    message: BoardMessage,
    *,
    session: int,
    sequence: int = 0,
    expected: int = 0,
    credit: int = 0,
    epoch: int = 0,
    state: int = 0,
) -> bytes:
    """Return a frame from the board, as it goes on the wire."""
    header = BoardHeader(
        type=message.TYPE,
        session=session,
        sequence=sequence,
        expected=expected,
        credit=credit,
        epoch=epoch,
        state=state,
    )
    return encode(header.pack() + message.pack())


FrameT = TypeVar("FrameT", HostFrame, BoardFrame)


class Decoder(ABC, Generic[FrameT]):
    """Finds the frames in a stream of bytes, however it is cut into pieces.

    Attributes
    ----------
    damage
        Frames dropped so far, by cause.
    """

    def __init__(self) -> None:
        self.damage: dict[Damage, int] = dict.fromkeys(Damage, 0)
        self._partial = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> list[FrameT]:
        """Take the next bytes of the stream; return the frames that they complete."""
        frames: list[FrameT] = []
        *ended, rest = data.split(DELIMITER)
        for piece in ended:
            stuffed = bytes(self._partial) + piece if self._partial else piece
            self._partial.clear()
            if self._skipping or len(stuffed) >= FRAME_WIRE_BYTES_MAX:
                self._skipping = False
                self.damage[Damage.OVER_LONG] += 1
            elif stuffed:  # delimiters in a row are idle line, not damage
                frame = self._decode(stuffed)
                if isinstance(frame, Damage):
                    self.damage[frame] += 1
                else:
                    frames.append(frame)
        if not self._skipping:
            self._partial += rest
            if len(self._partial) >= FRAME_WIRE_BYTES_MAX:
                self._partial.clear()
                self._skipping = True
        return frames

    def _decode(self, stuffed: bytes) -> FrameT | Damage:
        inside = cobs_decode(stuffed)
        if inside is None:
            return Damage.BAD_COBS
        if len(inside) < self._header_size + CRC_BYTES:
            return Damage.SHORT
        body = inside[:-CRC_BYTES]
        if crc32c(body).to_bytes(CRC_BYTES, "little") != inside[-CRC_BYTES:]:
            return Damage.BAD_CRC
        return self._parse(body)

    _header_size: int

    @abstractmethod
    def _parse(self, body: bytes) -> FrameT | Damage: ...


class HostDecoder(Decoder[HostFrame]):
    """Decodes what a host sends."""

    _header_size = HostHeader.SIZE

    def _parse(self, body: bytes) -> HostFrame | Damage:
        kind = HOST_MESSAGES.get(body[0])
        if kind is None:
            return Damage.UNKNOWN_TYPE
        if len(body) != HostHeader.SIZE + kind.SIZE:
            return Damage.WRONG_LENGTH
        try:
            message = kind.unpack(body[HostHeader.SIZE :])
        except ValueError:
            return Damage.BAD_VALUE
        return HostFrame(HostHeader.unpack(body[: HostHeader.SIZE]), message)


class BoardDecoder(Decoder[BoardFrame]):
    """Decodes what a board sends."""

    _header_size = BoardHeader.SIZE

    def _parse(self, body: bytes) -> BoardFrame | Damage:
        kind = BOARD_MESSAGES.get(body[0])
        if kind is None:
            return Damage.UNKNOWN_TYPE
        if len(body) != BoardHeader.SIZE + kind.SIZE:
            return Damage.WRONG_LENGTH
        try:
            message = kind.unpack(body[BoardHeader.SIZE :])
        except ValueError:
            return Damage.BAD_VALUE
        header = BoardHeader.unpack(body[: BoardHeader.SIZE])
        # An answer to hello must be readable whatever states another version has.
        if header.state & ~REFUSAL_WAITS >= _STATES and kind is not HelloReply:
            return Damage.BAD_VALUE
        return BoardFrame(header, message)
