"""The peripherals' models against the data sheet, by programs of a few instructions."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from tests.avr.simavr import Uno

DDRB, GTCCR = 0x24, 0x43
TCCR1A, TCCR1B, TCCR1C, TCNT1L, TCNT1H, OCR1AL, OCR1AH = 0x80, 0x81, 0x82, 0x84, 0x85, 0x88, 0x89
TCCR2A, TCCR2B, TCNT2, OCR2A = 0xB0, 0xB1, 0xB2, 0xB3
UCSR0B, UBRR0L, UDR0 = 0xC1, 0xC4, 0xC6

D9, D11 = 0, 2  # as servos
PRESCALER = 8
MATCH = 100
STORE_CYCLES = 3  # LDI and STS


def store(*pairs: tuple[int, int]) -> list[int]:
    """LDI r16 and STS for each (address, value)."""
    words = []
    for address, value in pairs:
        words += [0xE000 | (value & 0xF0) << 4 | value & 0x0F, 0x9300, address]
    return words


def boot(folder: Path, words: list[int]) -> Uno:
    """Run a program, which ends in an endless loop, from address 0."""
    code = struct.pack(f"<{len(words) + 1}H", *words, 0xCFFF)
    names = b"\0.text\0.shstrtab\0"
    header_bytes, section_bytes = 52, 40
    sections_at = header_bytes + len(code) + len(names)
    elf = struct.pack(
        "<16sHHIIIIIHHHHHH",
        b"\x7fELF\x01\x01\x01", 2, 83, 1, 0, 0, sections_at, 0, header_bytes, 0, 0,
        section_bytes, 3, 2,
    )  # fmt: skip
    elf += code + names + bytes(section_bytes)
    elf += struct.pack("<10I", 1, 1, 6, 0, header_bytes, len(code), 0, 0, 2, 0)
    elf += struct.pack("<10I", 7, 3, 0, 0, header_bytes + len(code), len(names), 0, 0, 1, 0)
    path = folder / "program.elf"
    path.write_bytes(elf)
    return Uno(path)


def test_force_compare_acts_at_once_and_a_match_one_clock_after_it(tmp_path: Path) -> None:
    """Sections 16.8 and 16.10; 17.3 for both prescalers let go in the same cycle."""
    program = store(
        (DDRB, 0b1010),
        (GTCCR, 0x83),  # TSM, both prescalers held
        (TCCR1A, 0xC0),  # set on match
        (TCCR1C, 0x80),  # forced
        (TCCR2A, 0xC0),
        (TCCR2B, 0x80),
        (TCCR1A, 0x80),  # clear on match
        (TCCR2A, 0x80),
        (OCR1AH, 0),
        (OCR1AL, MATCH),
        (OCR2A, MATCH),
        (TCCR1B, 2),
        (TCCR2B, 2),
        (TCNT1H, 0),
        (TCNT1L, 0),
        (TCNT2, 0),
        (GTCCR, 0),
    )
    with boot(tmp_path, program) as uno:
        uno.run_to(5_000)
        edges = uno.edges()
    rises = {edge.servo: edge.cycle for edge in edges if edge.level}
    falls = {edge.servo: edge.cycle for edge in edges if not edge.level}
    assert rises[D11] - rises[D9] == 2 * STORE_CYCLES
    released = rises[D9] + 13 * STORE_CYCLES
    assert falls == {
        D9: released + (MATCH + 1) * PRESCALER,
        D11: released + (MATCH + 1) * PRESCALER,
    }


def test_a_wide_register_is_written_as_a_whole(tmp_path: Path) -> None:
    """Section 16.3: the high byte waits in TEMP for the low one."""
    program = store(
        (DDRB, 0b0010),
        (TCCR1A, 0xC0),
        (OCR1AH, 0x01),
        (OCR1AL, 0x40),
        (OCR1AH, 0x7F),  # never completed
        (TCCR1B, 1),
    )
    with boot(tmp_path, program) as uno:
        uno.run_to(2_000)
        (edge,) = uno.edges()
    started = 6 * STORE_CYCLES - 2  # the last STS begins there
    assert edge.cycle == started + 0x141


@pytest.mark.parametrize(("sent", "lost"), [(3, 0), (4, 1), (5, 2)])
def test_the_receiver_holds_three_bytes(tmp_path: Path, sent: int, lost: int) -> None:
    """Section 20.7.4: two in the buffer, one in the shift register."""
    with boot(tmp_path, store((UBRR0L, 3), (UCSR0B, 0x10))) as uno:
        uno.run_to(100)
        uno.send(bytes(range(sent)))
        uno.run_to(100_000)
        assert uno.statistics().receive_overruns == lost


def test_a_byte_takes_ten_bits(tmp_path: Path) -> None:
    """Section 20.4; two bytes follow each other without a gap."""
    program = store((UBRR0L, 3), (UCSR0B, 0x08), (UDR0, 0x55), (UDR0, 0xAA))
    with boot(tmp_path, program) as uno:
        uno.run_to(100_000)
        data, end = uno.receive()
    assert data == b"\x55\xaa"
    written = 3 * STORE_CYCLES - 2
    assert end == written + 2 * 10 * 64
