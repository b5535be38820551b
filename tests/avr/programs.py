"""Programs of a few instructions, for the simulated UNO; all of them use r16 and r24 to r25."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

from tests.avr.simavr import Uno

# Data space addresses of the registers that the tests use.
PIND, DDRB, PORTB = 0x29, 0x24, 0x25
EIMSK, EICRA = 0x3D, 0x69
EECR, EEDR, EEARL = 0x3F, 0x40, 0x41
TIFR0, TIFR1, TIFR2, TCCR0A, TCCR0B, TCNT0, OCR0A = 0x35, 0x36, 0x37, 0x44, 0x45, 0x46, 0x47
TIMSK1 = 0x6F
GTCCR, MCUSR, SPMCSR, WDTCSR = 0x43, 0x54, 0x57, 0x60
ADCL, ADCH, ADCSRA, ADMUX = 0x78, 0x79, 0x7A, 0x7C
TCCR1A, TCCR1B, TCCR1C, TCNT1L, TCNT1H, OCR1AL, OCR1AH = 0x80, 0x81, 0x82, 0x84, 0x85, 0x88, 0x89
TCCR2A, TCCR2B, TCNT2, OCR2A = 0xB0, 0xB1, 0xB2, 0xB3
TWBR, TWSR, TWDR, TWCR = 0xB8, 0xB9, 0xBB, 0xBC
UCSR0A, UCSR0B, UBRR0L, UDR0 = 0xC0, 0xC1, 0xC4, 0xC6
RAM = 0x200

INT0, WDT, TIMER1_COMPA, ADC, EE_READY = 1, 6, 11, 21, 22
_VECTORS = 26

NOP, SEI, CLI, RETI, WDR, PUSH = 0x0000, 0x9478, 0x94F8, 0x9518, 0x95A8, 0x930F
_HERE = 0xCFFF
STORE_CYCLES = 3  # LDI and STS


def store(*pairs: tuple[int, int]) -> list[int]:
    """LDI r16 and STS for each (address, value)."""
    words = []
    for address, value in pairs:
        words += [0xE000 | (value & 0xF0) << 4 | value & 0x0F, 0x9300, address]
    return words


def copy(source: int, target: int) -> list[int]:
    """LDS and STS."""
    return [0x9100, source, 0x9300, target]


def wait_for(address: int, bit: int, *, high: bool = True) -> list[int]:
    """Read until a bit is there; 6 cycles at most from its change to the next instruction."""
    return [0x9100, address, (0xFF00 if high else 0xFD00) | bit, 0xCFFC]


def delay(cycles: int) -> list[int]:
    """Spend that time, to four cycles."""
    words = []
    while cycles > 0:
        turns = min(cycles, 200_000) // 4
        low, high = turns & 0xFF, turns >> 8
        words += [0xE080 | (low & 0xF0) << 4 | low & 0x0F, 0xE090 | (high & 0xF0) << 4 | high & 15]
        words += [0x9701, 0xF7F1]
        cycles -= 200_000
    return words


def with_handlers(main: list[int], handlers: Mapping[int, list[int]]) -> list[int]:
    """Put a table of interrupt vectors before a program. Handlers end in RETI by themselves."""
    table = []
    code: list[int] = []
    first = 2 * _VECTORS
    bodies = {0: [*main, _HERE], **{vector: [*body, RETI] for vector, body in handlers.items()}}
    for vector in range(_VECTORS):
        if vector not in bodies:
            table += [RETI, NOP]
            continue
        table += [0x940C, first + len(code)]
        code += bodies[vector]
    return table + code


# -------------------------------------------------------------------------- the I2C bus


def _step(control: int) -> list[int]:
    return [*store((TWCR, control)), *wait_for(TWCR, 7)]


def start() -> list[int]:
    """START, or a repeated one."""
    return _step(0xA4)


def put(value: int) -> list[int]:
    """Send a byte."""
    return [*store((TWDR, value)), *_step(0x84)]


def get(target: int, *, last: bool) -> list[int]:
    """Receive a byte."""
    return [*_step(0x84 if last else 0xC4), *copy(TWDR, target)]


def stop() -> list[int]:
    """STOP, and wait until it is out."""
    return [*store((TWCR, 0x94)), *wait_for(TWCR, 4, high=False)]


def write_register(address: int, register: int, value: int) -> list[int]:
    """Set a slave's register."""
    return [*start(), *put(address << 1), *put(register), *put(value), *stop()]


def read_registers(address: int, register: int, targets: list[int]) -> list[int]:
    """Read registers one after the other."""
    words = [*start(), *put(address << 1), *put(register), *start(), *put(address << 1 | 1)]
    for number, target in enumerate(targets):
        words += get(target, last=number == len(targets) - 1)
    return words + stop()


# ------------------------------------------------------------------------------- running


def boot(folder: Path, words: list[int]) -> Uno:
    """Run a program, which ends in an endless loop, from address 0."""
    code = struct.pack(f"<{len(words) + 1}H", *words, _HERE)
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


def cycle_when(uno: Uno, address: int, mask: int, value: int, *, within: int = 200_000) -> int:
    """Run until a register shows something; return the cycle, late by an instruction at most."""
    end = uno.cycle + within
    while uno.peek(address) & mask != value:
        assert uno.cycle < end, f"register 0x{address:02X} is still 0x{uno.peek(address):02X}"
        uno.run_to(uno.cycle + 1)
    return uno.cycle
