"""Does the firmware fit the ATmega328P, with room for the stack?

PlatformIO only warns where RAM overflows, and leaves out the stack. after_build.py runs
this after each build; by hand: ``python firmware/check_size.py firmware.elf``.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

FLASH_BYTES_MAX = 32_256  # 32 KB less the bootloader's 512 bytes
RAM_BYTES_MAX = 2_048
STACK_BYTES_MIN = 300  # 273 were in use at most, on a simulated UNO under a full line

FLASH_SECTIONS = (".text", ".data")
RAM_SECTIONS = (".data", ".bss", ".noinit")


def section_sizes(elf: bytes) -> dict[str, int]:
    """Sizes in bytes of an ELF32 little-endian file's sections, by name."""
    if elf[:6] != b"\x7fELF\x01\x01":
        raise ValueError("not an ELF32 little-endian file")
    (table_at,) = struct.unpack_from("<I", elf, 32)
    entry_size, entries, names_index = struct.unpack_from("<HHH", elf, 46)
    headers = [struct.unpack_from("<10I", elf, table_at + i * entry_size) for i in range(entries)]
    names_at = headers[names_index][4]
    sizes = {}
    for header in headers:
        start = names_at + header[0]
        sizes[elf[start : elf.index(b"\0", start)].decode()] = header[5]
    return sizes


def report(path: Path) -> list[str]:
    """Print the figures; return what is wrong with them."""
    sizes = section_sizes(path.read_bytes())
    flash = sum(sizes.get(name, 0) for name in FLASH_SECTIONS)
    ram = sum(sizes.get(name, 0) for name in RAM_SECTIONS)
    stack = RAM_BYTES_MAX - ram
    print(f"flash_bytes {flash}")
    print(f"ram_static_bytes {ram}")
    print(f"ram_stack_bytes {stack}")
    wrong = []
    if flash > FLASH_BYTES_MAX:
        wrong.append(f"flash: {flash} bytes of {FLASH_BYTES_MAX}")
    if stack < STACK_BYTES_MIN:
        wrong.append(f"RAM: {stack} bytes are left for the stack, {STACK_BYTES_MIN} needed")
    return wrong


def main(path: str) -> int:
    """Check one file; the exit status says whether it fits."""
    wrong = report(Path(path))
    for line in wrong:
        print(f"firmware does not fit: {line}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
