"""The bytes in the protocol's README are those that the code sends."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from setae_protocol.frame import cobs_decode, encode_board, encode_host
from setae_protocol.messages import (
    BAUD,
    BOARD_OVERHEAD_BYTES,
    FRAME_WIRE_BYTES_MAX,
    HOST_OVERHEAD_BYTES,
    WINDOW_FRAMES,
    Enable,
    Receipt,
    Segment,
    Segments,
    Stop,
    Telemetry,
)

README = Path(__file__).resolve().parents[2] / "protocol/README.md"

FRAMES = {
    "stop": encode_host(Stop(stop_number=1), session=5),
    "enable": encode_host(Enable(pulse_ticks=(1700, 1700, 1700, 1700)), session=5),
    "receipt": encode_board(
        Receipt(gap=0), session=5, sequence=33, expected=1, credit=50, epoch=2, state=2
    ),
}


@pytest.mark.parametrize("name", FRAMES)
def test_worked_bytes(name: str) -> None:
    wire = FRAMES[name]
    inside = cobs_decode(wire[:-1])
    assert inside is not None
    lines = README.read_text(encoding="utf-8").splitlines()
    assert f"    before COBS        {inside.hex(' ')}" in lines
    assert f"    on the wire        {wire.hex(' ')}" in lines


def blocks() -> list[dict[str, bytes]]:
    """Each block of worked bytes: what a line is called, and the bytes on it."""
    found = []
    for block in README.read_text(encoding="utf-8").split("\n\n"):
        lines = {}
        for line in block.splitlines():
            match = re.fullmatch(
                r"    (\S.{0,18}?) {2,}((?:[0-9a-f]{2} )*[0-9a-f]{2})(?: {2,}.*)?", line
            )
            if match:
                lines[match.group(1)] = bytes.fromhex(match.group(2))
        found.append(lines)
    return found


def test_segments_step_by_step() -> None:
    slots = (
        Segment(10, (1700, 1700, 1700, 1700)), Segment(50, (2000, 1700, 1400, 1700)),
        *[Segment(0, (0, 0, 0, 0))] * 3,
    )  # fmt: skip
    first, second, third, fourth, fifth = slots
    message = Segments(epoch=3, count=2, segments=(first, second, third, fourth, fifth))
    wire = encode_host(message, session=5, sequence=7)
    inside = cobs_decode(wire[:-1])
    fields = next(block for block in blocks() if "slot 1" in block)
    unused = fields["slots 3, 4, 5"] * 3
    told = fields["header"] + fields["epoch, count"] + fields["slot 1"] + fields["slot 2"] + unused
    assert told + fields["CRC-32C"] == inside
    runs = next(block for block in blocks() if "to the 1st zero" in block)
    assert runs["29 times"] == b"\1"
    runs["29 times"] *= 29
    assert b"".join(runs.values()) == wire


def test_crc_by_hand() -> None:
    """The register after each byte, bit by bit as the page says it."""
    text = README.read_text(encoding="utf-8")
    told = re.findall(r"^    after ([0-9a-f]{2}) +([0-9a-f]{8})$", text, re.MULTILINE)
    stop = cobs_decode(FRAMES["stop"][:-1])
    assert stop is not None
    assert bytes.fromhex("".join(byte for byte, _ in told)) == stop[:4]
    register = 0xFFFFFFFF
    for byte, after in told:
        register ^= int(byte, 16)
        for _ in range(8):
            register = register >> 1 ^ (0x82F63B78 if register & 1 else 0)
        assert f"{register:08x}" == after
    assert (register ^ 0xFFFFFFFF).to_bytes(4, "little") == stop[4:]


def test_overhead() -> None:
    text = README.read_text(encoding="utf-8")
    together = f"**{HOST_OVERHEAD_BYTES}** | **{BOARD_OVERHEAD_BYTES}**"
    assert f"| **together, bytes** | {together} |" in text


def test_times_on_the_line() -> None:
    """They were still those of half the rate."""
    text = " ".join(README.read_text(encoding="utf-8").split())
    byte_ms = 10_000 / BAUD

    def ms(count: int) -> str:
        return f"{count * byte_ms:.1f} ms"

    window = WINDOW_FRAMES * (HOST_OVERHEAD_BYTES + Segments.SIZE)
    telemetry = BOARD_OVERHEAD_BYTES + Telemetry.SIZE
    assert f"no message holds up the next for more than {ms(FRAME_WIRE_BYTES_MAX)}" in text
    assert f"a stop is delayed by {ms(window)} on the line at most" in text
    assert f"and takes {ms(len(FRAMES['stop']))} itself" in text
    assert f"telemetry is {telemetry} bytes, {ms(telemetry)} of each 20 ms" in text
