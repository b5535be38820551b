"""The generated files are what the schema gives, and the check notices where they aren't."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import generate
from generator import layout
from setae_protocol import messages, schema

ROOT = Path(__file__).resolve().parents[2]


def test_committed_files_are_what_the_schema_gives() -> None:
    assert generate.drift(ROOT) == []


def test_drift_names_file_line_and_cure(tmp_path: Path) -> None:
    for name in generate.OUTPUTS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    header = tmp_path / "firmware/lib/protocol/src/protocol/messages.h"
    header.write_text(header.read_text().replace("kBaud = 500000", "kBaud = 115200"))
    (tmp_path / "protocol/REFERENCE.md").unlink()
    first, second = generate.drift(tmp_path)
    assert "messages.h" in first
    assert "python protocol/generate.py" in first
    assert "115200" in first
    assert "REFERENCE.md is missing" in second


def test_hash_is_of_layout_not_of_prose() -> None:
    text = layout.canonical_text()
    assert messages.SCHEMA_HASH == layout.SCHEMA_HASH
    for doc in (
        schema.CONSTANTS[0].doc,
        schema.HOST_MESSAGES[0].doc,
        schema.FAULT.values[1].remedy,
    ):
        assert doc not in text
    assert "message stop 2 plain stop_number:u8" in text.splitlines()
    assert "code Refusal pair_limit 7" in text.splitlines()


def test_frozen_handshake_keeps_its_bytes() -> None:
    """Hosts and boards of all versions read these; a change here can't be undone by flashing."""
    hello = messages.Hello(
        protocol_version=0x0102, schema_hash=0x03040506, new_session=7, token=0x08090A0B
    )
    assert messages.Hello.TYPE == 0x01
    assert hello.pack().hex(" ") == "02 01 06 05 04 03 07 0b 0a 09 08"
    reply = messages.HelloReply(
        protocol_version=0x0102, schema_hash=0x03040506, token=0x0708090A, firmware_major=0x0B,
        firmware_minor=0x0C, firmware_patch=0x0D, previous_session=0x0E, reset_cause=0x0F,
        limits_crc=0x10111213, pose_known=0x14,
        pulse_ticks=(0x1516, 0x1718, 0x191A, 0x1B1C), sensor=0x1D,
    )  # fmt: skip
    assert messages.HelloReply.TYPE == 0x81
    assert reply.pack().hex() == ("0201060504030a0908070b0c0d0e0f1312111014161518171a191c1b1d")
    assert messages.HostHeader(type=1, session=2, sequence=3).pack().hex() == "010203"
    header = messages.BoardHeader(
        type=1, session=2, sequence=3, expected=4, credit=5, epoch=6, state=7
    )
    assert header.pack().hex() == "01020304050607"


def test_schema_that_cannot_work_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    doubled = (*layout.MESSAGES, layout.MESSAGES[0])
    monkeypatch.setattr(layout, "MESSAGES", doubled)
    with pytest.raises(AssertionError, match="used twice"):
        layout.check_schema()
