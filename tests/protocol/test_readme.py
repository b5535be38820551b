"""The bytes in the protocol's README are those that the code sends."""

from __future__ import annotations

from pathlib import Path

import pytest

from setae_protocol.frame import cobs_decode, encode_board, encode_host
from setae_protocol.messages import (
    BOARD_OVERHEAD_BYTES,
    HOST_OVERHEAD_BYTES,
    Enable,
    Receipt,
    Stop,
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


def test_overhead() -> None:
    text = README.read_text(encoding="utf-8")
    together = f"**{HOST_OVERHEAD_BYTES}** | **{BOARD_OVERHEAD_BYTES}**"
    assert f"| **together, bytes** | {together} |" in text
