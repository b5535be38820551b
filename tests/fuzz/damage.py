"""Damaged frames by the million, through both decoders."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.fuzz import building
from tests.fuzz.building import BUILD, HERE, ROOT

from setae_protocol.frame import BoardDecoder, Damage, HostDecoder

PATTERNS: Final = (
    "bits_1", "bits_2", "bits_3", "burst", "byte_lost", "byte_doubled", "byte_inserted",
    "byte_replaced", "splice", "delimiter_hit",
)  # fmt: skip
SEED: Final = 20261122


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What became of the damaged frames of one pattern."""

    damaged: int
    harmless: int
    """Handed out just as they were sent."""
    undetected: int


def tool() -> Path:
    """Return the compiled tool."""
    return building.build(building.FAST, "damage", [HERE / "damage.cpp"], tag="fast")


def count(pattern: str, frames: int) -> Counts:
    """Put damaged frames of one pattern through the C++ decoder."""
    done = subprocess.run(
        [tool(), "count", pattern, str(frames), str(SEED)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    damaged, harmless, undetected = map(int, done.stdout.split())
    return Counts(damaged=damaged, harmless=harmless, undetected=undetected)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A stream of bytes, and what the C++ decoder made of it."""

    from_board: bool
    stream: bytes
    damaged: int
    accepted: list[bytes]


def verdicts(pattern: str, frames: int) -> Iterator[Verdict]:
    """Yield the C++ decoder's verdicts on damaged frames, and on whole ones among them."""
    pool = BUILD / "pool.txt"
    vectors = json.loads((ROOT / "protocol" / "vectors.json").read_text())["frames"]
    pool.parent.mkdir(parents=True, exist_ok=True)
    pool.write_text("".join(f"{item['from']} {_inside(item)}\n" for item in vectors))
    command = [str(tool()), "dump", pattern, str(frames), str(SEED), str(pool)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as running:
        assert running.stdout is not None
        read = running.stdout.read
        while head := read(3):
            from_board, damaged, size = head
            stream = read(size)
            rest = read(read(1)[0])
            accepted = []
            while rest:
                accepted.append(rest[1 : 1 + rest[0]])
                rest = rest[1 + rest[0] :]
            yield Verdict(
                from_board=bool(from_board), stream=stream, damaged=damaged, accepted=accepted
            )
    if running.returncode != 0:
        raise RuntimeError(f"{command} failed")


def _inside(vector: dict[str, str]) -> str:
    decoder = BoardDecoder() if vector["from"] == "board" else HostDecoder()
    [frame] = decoder.feed(bytes.fromhex(vector["wire_hex"]))
    return (frame.header.pack() + frame.message.pack()).hex()


def disagreement(pattern: str, frames: int) -> str:
    """Compare the decoders; return what the first stream is that they differ on, or ""."""
    decoders: dict[bool, BoardDecoder | HostDecoder] = {False: HostDecoder(), True: BoardDecoder()}
    before = {False: 0, True: 0}
    for verdict in verdicts(pattern, frames):
        decoder = decoders[verdict.from_board]
        found = decoder.feed(verdict.stream)
        damaged = sum(decoder.damage.values())
        accepted = [frame.header.pack() + frame.message.pack() for frame in found]
        if (
            accepted != verdict.accepted
            or (damaged - before[verdict.from_board]) & 0xFF != verdict.damaged
            or decoder.damage[Damage.BAD_VALUE]
        ):
            return f"{verdict}: Python accepts {accepted} and has counted {decoder.damage}"
        before[verdict.from_board] = damaged
    return ""
