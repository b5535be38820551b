"""Sizes of a built firmware, read from its ELF file."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

_SECTION_HEADER = struct.Struct("<10I")
_NOBITS = 8
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
    data = path.read_bytes()
    if data[:6] != b"\x7fELF\x01\x01":
        raise ValueError(f"{path} is no 32-bit little-endian ELF file")
    table = struct.unpack_from("<I", data, 32)[0]
    size, count = struct.unpack_from("<HH", data, 46)
    flash = ram = 0
    for index in range(count):
        section = _SECTION_HEADER.unpack_from(data, table + index * size)
        kind, flags, length = section[1], section[2], section[5]
        if not flags & _ALLOC:
            continue
        if kind != _NOBITS:
            flash += length
        if flags & _WRITE:
            ram += length
    return Sizes(flash_bytes=flash, ram_static_bytes=ram)
