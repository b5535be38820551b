"""Timers, serial line and what is measured of the core, by programs of a few instructions."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.avr.programs import (
    CLI,
    DDRB,
    EE_READY,
    EECR,
    GTCCR,
    NOP,
    OCR0A,
    OCR1AH,
    OCR1AL,
    OCR2A,
    PORTB,
    PUSH,
    RAM,
    SEI,
    STORE_CYCLES,
    TCCR0B,
    TCCR1A,
    TCCR1B,
    TCCR1C,
    TCCR2A,
    TCCR2B,
    TCNT0,
    TCNT1H,
    TCNT1L,
    TCNT2,
    TIFR0,
    TIMER1_COMPA,
    TIMSK1,
    UBRR0L,
    UCSR0A,
    UCSR0B,
    UDR0,
    boot,
    copy,
    cycle_when,
    delay,
    store,
    wait_for,
    with_handlers,
)

D9, D11 = 0, 2  # as servos
PRESCALER = 8
MATCH = 100


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


@pytest.mark.parametrize(("clock_select", "divider"), [(1, 1), (2, 8), (3, 64), (4, 256)])
def test_timer_0_divides_by_the_prescaler_that_it_shares(
    tmp_path: Path, clock_select: int, divider: int
) -> None:
    """Sections 15.7 and 17: held with timer 1, it tells a match at the next clock."""
    program = store(
        (GTCCR, 0x81), (OCR0A, MATCH), (TCCR0B, clock_select), (TCNT0, 0), (GTCCR, 0), (RAM, 1)
    )  # fmt: skip
    with boot(tmp_path, program) as uno:
        released = cycle_when(uno, RAM, 0xFF, 1) - STORE_CYCLES
        matched = cycle_when(uno, TIFR0, 2, 2)
        assert matched - released == pytest.approx((MATCH + 1) * divider, abs=3)


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


FRAME = 10 * 64  # cycles of a byte at UBRR0 = 3


def test_the_usb_chip_holds_bytes_back(tmp_path: Path) -> None:
    """1 ms down; up at the next full 4 ms."""
    program = store((UBRR0L, 3), (UCSR0B, 0x18), (UDR0, 0x55), (UDR0, 0xAA))
    with boot(tmp_path, program) as uno:
        uno.set_usb_chip()
        uno.run_to(63_000)
        assert uno.receive()[0] == b""
        uno.run_to(65_000)
        assert uno.receive() == (b"\x55\xaa", 64_000)
        uno.send(b"\x01", bit_cycles=64)
        assert uno.line_free == pytest.approx(uno.cycle + 16_000 + FRAME, abs=1)


def test_the_usb_chip_hands_over_a_full_packet_at_once(tmp_path: Path) -> None:
    spaced = [word for _ in range(70) for word in [*store((UDR0, 0x55)), *delay(700)]]
    with boot(tmp_path, [*store((UBRR0L, 3), (UCSR0B, 0x18)), *spaced]) as uno:
        uno.set_usb_chip()
        uno.run_to(55_000)
        data, end = uno.receive()
    assert len(data) == 64
    assert end < 64 * 705 + 2 * FRAME


@pytest.mark.parametrize("slower", [-0.02, 0.021, 0.04])
def test_a_byte_at_nearly_the_receivers_rate_is_received(tmp_path: Path, slower: float) -> None:
    """Section 20.8.3: up to 4.5 % off; sampled at the receiver's own rate."""
    program = [*store((UBRR0L, 3), (UCSR0B, 0x10)), *wait_for(UCSR0A, 7), *copy(UDR0, RAM)]
    with boot(tmp_path, program) as uno:
        uno.run_to(100)
        uno.send(b"\x35", bit_cycles=64 * (1 + slower))
        uno.run_to(2_000)
        assert uno.peek(RAM) == 0x35
        assert uno.statistics().receive_frame_errors == 0


def test_a_byte_at_another_rate_is_broken(tmp_path: Path) -> None:
    """A sender that is a tenth slower: the receiver looks for the stop bit within the last 0."""
    with boot(tmp_path, store((UBRR0L, 3), (UCSR0B, 0x10))) as uno:
        uno.run_to(100)
        uno.send(b"\x00", bit_cycles=64 * 1.1)
        uno.run_to(3_000)
        assert uno.statistics().receive_frame_errors == 1


def test_an_interrupt_is_entered_and_left_in_four_cycles(tmp_path: Path) -> None:
    """Section 7.7.1: to the vector, over its jump, and back."""
    main = store((DDRB, 2), (OCR1AH, 0), (OCR1AL, 200), (TIMSK1, 2), (TCCR1B, 1))
    with boot(
        tmp_path, with_handlers([*main, SEI, *[NOP] * 300], {TIMER1_COMPA: store((PORTB, 2))})
    ) as uno:
        uno.run_to(500)
        (edge,) = uno.edges()
        took = uno.handler(TIMER1_COMPA)
    jump, load, write = 3, 1, 2
    started = jump + 5 * STORE_CYCLES - write
    matched = started + 200 + 1
    assert edge.cycle == matched + 4 + jump + load
    assert (took.count, took.total) == (1, 4 + jump + load + write + 4)


def test_one_instruction_runs_between_two_interrupts(tmp_path: Path) -> None:
    """Section 7.7.1. The EEPROM's interrupt comes as long as nothing is written."""
    main = [*store((EECR, 0x08)), SEI, *[NOP] * 40, *store((RAM, 1))]
    with boot(tmp_path, with_handlers(main, {EE_READY: []})) as uno:
        cycle_when(uno, RAM, 0xFF, 1)
        assert uno.handler(EE_READY).count == pytest.approx(41, abs=2)


def test_interrupts_off_is_measured_to_the_cycle(tmp_path: Path) -> None:
    """From CLI's first cycle to the end of SEI."""
    with boot(tmp_path, [SEI, *[NOP] * 20, CLI, *[NOP] * 40, SEI, NOP, CLI, NOP, SEI]) as uno:
        uno.run_to(3)
        assert uno.cycle < 20
        uno.watch_interrupts()
        uno.run_to(200)
        assert uno.statistics().interrupts_off_cycles == 42


def test_the_deepest_stack_is_seen(tmp_path: Path) -> None:
    with boot(tmp_path, [PUSH] * 17) as uno:
        uno.run_to(100)
        assert uno.statistics().stack_bytes == 17
