"""Self-programming against the data sheet, section 27, and the timers' overflow, by programs."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from tests.avr.programs import (
    MCUSR,
    NOP,
    RAM,
    SPMCSR,
    TCCR1B,
    TCNT1H,
    TCNT1L,
    TIFR1,
    boot,
    copy,
    cycle_when,
    store,
    wait_for,
)
from tests.avr.simavr import BOOT_START, BOOTLOADER, Uno

ENABLE, ERASE, WRITE, READ_AGAIN, FILL = 0x01, 0x03, 0x05, 0x11, 0x01
SPM = 0x95E8
PAGE, PAGE_BYTES = 0x0180, 128
NOT_WHILE_WRITING = 0x7000
MS = 16_000
OLD, NEW = 0x3C, 0x0F


def _set(register: int, value: int) -> list[int]:
    """LDI, for r16 and up."""
    return [0xE000 | (value & 0xF0) << 4 | (register - 16) << 4 | value & 0x0F]


def _point(address: int) -> list[int]:
    return [*_set(30, address & 0xFF), *_set(31, address >> 8)]


def _spm(command: int, late: int = 0) -> list[int]:
    return [*store((SPMCSR, command)), *[NOP] * late, SPM]


def _fill(address: int, low: int, high: int) -> list[int]:
    """R1:R0 into the page buffer."""
    words = [*_point(address)]
    for value, move in ((low, 0x2E00), (high, 0x2E10)):  # MOV r0, r16 and MOV r1, r16
        words += [*_set(16, value), move]
    return [*words, *_spm(FILL)]


def _done() -> list[int]:
    return wait_for(SPMCSR, 0, high=False)


def in_boot_section(folder: Path, words: list[int]) -> Uno:
    """Run a program from the boot section, over a flash whose pages hold OLD."""
    uno = boot(folder, [])
    words = [*words, 0xCFFF]
    uno.load(BOOT_START, struct.pack(f"<{len(words)}H", *words))
    uno.load(PAGE, bytes([OLD]) * PAGE_BYTES)
    uno.load(NOT_WHILE_WRITING, bytes([OLD]) * PAGE_BYTES)
    uno.set_start(BOOT_START)
    return uno


def test_a_page_is_erased_and_written_in_its_time(tmp_path: Path) -> None:
    """Section 27.8: erase, fill, write; 3.7 to 4.5 ms each, while the program goes on."""
    program = [*_point(PAGE), *_spm(ERASE), *_done()]
    program += [*_fill(PAGE, NEW, 0x11), *_fill(PAGE + 2, 0x22, 0x33), *_fill(PAGE, 0x77, 0x77)]
    program += [*_spm(WRITE), *copy(SPMCSR, RAM), *_done(), *copy(SPMCSR, RAM + 1)]
    program += [*_spm(READ_AGAIN), *copy(SPMCSR, RAM + 2)]
    with in_boot_section(tmp_path, program) as uno:
        began = cycle_when(uno, SPMCSR, 0x41, 0x41)
        uno.run_to(began + 3 * MS)
        assert uno.peek(SPMCSR) & 0x01
        ended = cycle_when(uno, SPMCSR, 0x01, 0x00)
        assert 3.7 * MS <= ended - began <= 4.5 * MS + 4
        assert uno.flash(PAGE, 4) == b"\xff\xff\xff\xff"
        uno.run_to(20 * MS)
        # A word of the buffer is filled once: the second time to the same place did nothing.
        assert uno.flash(PAGE, 6) == bytes([NEW, 0x11, 0x22, 0x33, 0xFF, 0xFF])
        assert uno.flash(PAGE + PAGE_BYTES, 2) != bytes([NEW, 0x11])
        busy, done, readable = (uno.peek(RAM + i) for i in range(3))
    assert busy & 0x41 == 0x41
    assert done == 0x40  # the section is closed to reading until it is opened again
    assert readable == 0


def test_to_write_without_erasing_can_only_clear_bits(tmp_path: Path) -> None:
    program = [*_fill(PAGE, NEW, NEW), *_spm(WRITE)]
    with in_boot_section(tmp_path, program) as uno:
        uno.run_to(10 * MS)
        assert uno.flash(PAGE, 3) == bytes([OLD & NEW, OLD & NEW, OLD])


def test_behind_the_read_while_write_section_the_processor_waits(tmp_path: Path) -> None:
    program = [*_point(NOT_WHILE_WRITING), *_spm(ERASE), *store((RAM, 0x77))]
    with in_boot_section(tmp_path, program) as uno:
        uno.run_to(100)
        assert uno.cycle >= 3.7 * MS
        uno.run_to(uno.cycle + 20)
        assert uno.flash(NOT_WHILE_WRITING, 1) == b"\xff"


@pytest.mark.parametrize(("late", "erased"), [(0, True), (2, True), (5, False)])
def test_spm_comes_within_four_cycles(tmp_path: Path, late: int, erased: bool) -> None:
    """Section 27.9.1, SPMEN."""
    with in_boot_section(tmp_path, [*_point(PAGE), *_spm(ERASE, late)]) as uno:
        uno.run_to(6 * MS)
        assert (uno.flash(PAGE, 1) == b"\xff") is erased


def test_a_program_outside_the_boot_section_writes_nothing(tmp_path: Path) -> None:
    """Section 27.3."""
    with boot(tmp_path, [*_point(PAGE), *_spm(ERASE)]) as uno:
        uno.load(PAGE, bytes([OLD]))
        uno.run_to(6 * MS)
        assert uno.flash(PAGE, 1) == bytes([OLD])


def test_an_overflow_is_told_until_it_is_cleared(tmp_path: Path) -> None:
    """Section 16.9.1: at the clock at which the counter becomes 0."""
    program = [
        *store((TCNT1H, 0xFF), (TCNT1L, 0xF0), (TCCR1B, 1)),
        *copy(TIFR1, RAM),
        *wait_for(TIFR1, 0),
        *copy(TCNT1L, RAM + 1),
        *store((TIFR1, 0x01)),
        *copy(TIFR1, RAM + 2),
    ]
    with boot(tmp_path, program) as uno:
        uno.run_to(200)
        before, count, after = (uno.peek(RAM + i) for i in range(3))
    assert (before & 1, after & 1) == (0, 0)
    assert count < 10


def test_the_bootloader_starts_the_program_after_any_other_reset(tmp_path: Path) -> None:
    """And clears the reset flags, which is why the firmware keeps its own."""
    with boot(tmp_path, [*copy(MCUSR, RAM), *store((RAM + 1, 0x77))]) as uno:
        uno.install_bootloader()
        uno.cycle_power()
        uno.run_to(200)
        assert uno.peek(RAM + 1) == 0x77
        assert uno.peek(RAM) == 0
    assert len(BOOTLOADER.read_bytes()) == 512
