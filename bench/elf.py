"""Sizes of a built firmware, read from its ELF file."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_SECTION_HEADER = struct.Struct("<10I")
_SYMBOL = struct.Struct("<IIIBBH")
_SYMBOL_TABLE, _NOBITS = 2, 8
# Where avr-gcc puts the data space.
_DATA_OFFSET = 0x800000
_WRITE, _ALLOC = 1, 2


@dataclass(frozen=True)
class Sizes:
    """Bytes of memory that a firmware takes.

    Attributes
    ----------
    flash_bytes
        Code, constants, and the initial values of variables.
    ram_static_bytes
        Variables; the stack comes on top.
    """

    flash_bytes: int
    ram_static_bytes: int


def sizes(path: Path) -> Sizes:
    """Read the sections of a 32-bit little-endian ELF file, as avr-gcc makes it."""
    flash = ram = 0
    for section in _sections(_read(path)):
        kind, flags, length = section[1], section[2], section[5]
        if not flags & _ALLOC:
            continue
        if kind != _NOBITS:
            flash += length
        if flags & _WRITE:
            ram += length
    return Sizes(flash_bytes=flash, ram_static_bytes=ram)


def symbol_address(path: Path, pattern: str) -> int:
    """Find a variable by a pattern of its mangled name; return its address in the data space."""
    data = _read(path)
    sections = list(_sections(data))
    for section in sections:
        if section[1] != _SYMBOL_TABLE:
            continue
        names_at = sections[section[6]][4]
        for name, value, *_ in _SYMBOL.iter_unpack(data[section[4] : section[4] + section[5]]):
            text = data[names_at + name : data.index(0, names_at + name)].decode()
            if re.search(pattern, text):
                return int(value) - _DATA_OFFSET
    raise ValueError(f"{path} has no variable like {pattern}")


def _read(path: Path) -> bytes:
    data = path.read_bytes()
    if data[:6] != b"\x7fELF\x01\x01":
        raise ValueError(f"{path} is no 32-bit little-endian ELF file")
    return data


def _sections(data: bytes) -> Iterator[tuple[int, ...]]:
    table = struct.unpack_from("<I", data, 32)[0]
    size, count = struct.unpack_from("<HH", data, 46)
    for index in range(count):
        yield _SECTION_HEADER.unpack_from(data, table + index * size)
