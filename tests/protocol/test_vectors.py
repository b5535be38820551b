"""The shared vectors: Python decodes and encodes the bytes that C++ is tested with too."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from setae_protocol import messages
from setae_protocol.frame import (
    BoardDecoder,
    BoardFrame,
    Decoder,
    HostDecoder,
    HostFrame,
    cobs_decode,
    cobs_encode,
    crc32c,
    encode,
)

ROOT = Path(__file__).resolve().parents[2]
VECTORS: dict[str, Any] = json.loads((ROOT / "protocol/vectors.json").read_text())


def name_of(vector: dict[str, Any]) -> str:
    return str(vector["name"])


def decoder_for(side: str) -> Decoder[HostFrame] | Decoder[BoardFrame]:
    return HostDecoder() if side == "host" else BoardDecoder()


def plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    return [plain(item) for item in value] if isinstance(value, tuple) else value


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=name_of)
def test_frame(vector: dict[str, Any]) -> None:
    wire = bytes.fromhex(vector["wire_hex"])
    [frame] = decoder_for(vector["from"]).feed(wire)
    assert plain(frame.header) == vector["header"]
    assert plain(frame.message) == vector["fields"]
    assert frame.message.pack().hex() == vector["payload_hex"]
    assert encode(frame.header.pack() + frame.message.pack()) == wire
    assert len(wire) <= messages.FRAME_WIRE_BYTES_MAX


@pytest.mark.parametrize("vector", VECTORS["damaged"], ids=name_of)
def test_damaged_frame_is_counted_by_its_cause(vector: dict[str, Any]) -> None:
    decoder = decoder_for(vector["from"])
    assert decoder.feed(bytes.fromhex(vector["wire_hex"])) == []
    counted = {cause.value: count for cause, count in decoder.damage.items() if count}
    assert counted == {vector["verdict"]: 1}


@pytest.mark.parametrize("vector", VECTORS["cobs"], ids=lambda v: str(v["data_hex"][:16]))
def test_cobs(vector: dict[str, str]) -> None:
    data, encoded = bytes.fromhex(vector["data_hex"]), bytes.fromhex(vector["encoded_hex"])
    assert cobs_encode(data) == encoded
    assert cobs_decode(encoded) == data


def slow_crc32c(data: bytes) -> int:
    """The definition, bit by bit: shares nothing with the table."""
    crc = 0xFFFFFFFF
    for byte in data:
        for bit in range(8):
            feedback = (crc ^ (byte >> bit)) & 1
            crc = (crc >> 1) ^ (0x82F63B78 if feedback else 0)
    return crc ^ 0xFFFFFFFF


@pytest.mark.parametrize("vector", VECTORS["crc"], ids=lambda v: str(v["data_hex"][:16]))
def test_crc(vector: dict[str, str]) -> None:
    data = bytes.fromhex(vector["data_hex"])
    assert f"{crc32c(data):08x}" == vector["crc32c"] == f"{slow_crc32c(data):08x}"


def test_crc_is_the_catalogued_one() -> None:
    """CRC-32/ISCSI in the catalogue of CRCs; RFC 3720, B.4: 32 bytes of zeros, and of ones."""
    assert crc32c(b"123456789") == 0xE3069283
    assert crc32c(bytes(32)) == 0x8A9136AA
    assert crc32c(b"\xff" * 32) == 0x62A8AB43
