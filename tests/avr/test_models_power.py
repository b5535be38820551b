"""EEPROM, ADC, watchdog and the supply against the data sheet."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.avr.programs import (
    ADC,
    ADCH,
    ADCL,
    ADCSRA,
    ADMUX,
    DDRB,
    EE_READY,
    EEARL,
    EECR,
    EEDR,
    MCUSR,
    NOP,
    PORTB,
    RAM,
    SEI,
    WDR,
    WDT,
    WDTCSR,
    boot,
    copy,
    cycle_when,
    delay,
    store,
    wait_for,
    with_handlers,
)

BUSY, ARM, READ, READY_INTERRUPT = 0x02, 0x04, 0x01, 0x08
MS = 16_000


def eeprom_write(address: int, value: int, *, mode: int = 0) -> list[int]:
    return [
        *wait_for(EECR, 1, high=False),
        *store((EEARL, address), (EEDR, value), (EECR, mode | ARM), (EECR, mode | ARM | BUSY)),
    ]


# ------------------------------------------------------------------------------- EEPROM


@pytest.mark.parametrize(
    ("mode", "duration_ms", "becomes"), [(0x00, 3.4, 0x0F), (0x10, 1.8, 0xFF), (0x20, 1.8, 0x05)]
)
def test_a_write_takes_its_time(
    tmp_path: Path, mode: int, duration_ms: float, becomes: int
) -> None:
    """Table 8-1: erase and write, erase only, write only."""
    with boot(tmp_path, eeprom_write(3, 0x0F, mode=mode)) as uno:
        uno.set_eeprom(3, b"\x35")
        began = cycle_when(uno, EECR, BUSY, BUSY)
        assert uno.eeprom(3, 1) == b"\x35"
        ended = cycle_when(uno, EECR, BUSY, 0)
        assert ended - began == pytest.approx(duration_ms * MS, abs=4)
        assert uno.eeprom(3, 1) == bytes([becomes])


def test_a_write_needs_its_timed_sequence(tmp_path: Path) -> None:
    """Section 8.6.3: EEPE within four cycles of EEMPE."""
    setup = store((EEARL, 3), (EEDR, 0x0F))
    with boot(tmp_path, [*setup, *store((EECR, ARM)), NOP, NOP, NOP, *store((EECR, BUSY))]) as uno:
        uno.run_to(8 * MS)
        assert uno.eeprom(3, 1) == b"\xff"
        assert uno.statistics().eeprom_writes == 0


def test_a_byte_can_be_read_back(tmp_path: Path) -> None:
    program = [
        *eeprom_write(3, 0x0F),
        *store((EEDR, 0)),
        *wait_for(EECR, 1, high=False),
        *store((EECR, READ)),
        *copy(EEDR, RAM),
    ]
    with boot(tmp_path, program) as uno:
        uno.run_to(4 * MS)
        assert uno.peek(RAM) == 0x0F


def test_the_ready_interrupt_comes_as_long_as_nothing_is_written(tmp_path: Path) -> None:
    main = [*eeprom_write(3, 0x0F), *store((EECR, READY_INTERRUPT)), SEI]
    with boot(tmp_path, with_handlers(main, {EE_READY: []})) as uno:
        uno.run_to(3 * MS)
        assert uno.handler(EE_READY).count == 0
        uno.run_to(4 * MS)
        assert uno.handler(EE_READY).count > 100


@pytest.mark.parametrize(
    ("at_ms", "left"), [(3.0, b"\xa5\xff"), (5.0, b"\x11\xa5"), (8.0, b"\x11\x22")]
)
def test_a_power_cut_tears_the_byte_that_is_written(
    tmp_path: Path, at_ms: float, left: bytes
) -> None:
    with boot(tmp_path, [*eeprom_write(0, 0x11), *eeprom_write(1, 0x22)]) as uno:
        uno.run_to(round(at_ms * MS))
        uno.cycle_power(torn=0xA5)
        assert uno.eeprom(0, 2) == left
        assert uno.peek(MCUSR) == 0x01


def test_a_reset_lets_a_write_end(tmp_path: Path) -> None:
    """Section 8.4: it is completed, if the supply is there."""
    with boot(tmp_path, eeprom_write(3, 0x0F)) as uno:
        uno.run_to(1 * MS)
        uno.press_reset()
        assert uno.peek(EECR) & BUSY
        uno.run_to(4 * MS)
        assert uno.eeprom(3, 1) == b"\x0f"


# ---------------------------------------------------------------------------------- ADC


@pytest.mark.parametrize(("volts", "counts"), [(5.0, 225), (4.5, 250), (3.8, 296)])
def test_the_bandgap_tells_the_supply(tmp_path: Path, volts: float, counts: int) -> None:
    """Section 24.7: 1024 V_bandgap / AVCC; the first conversion takes 25 ADC clocks."""
    program = [*store((ADMUX, 0x4E), (ADCSRA, 0xC7)), *wait_for(ADCSRA, 6, high=False)]
    program += [*copy(ADCL, RAM), *copy(ADCH, RAM + 1)]
    with boot(tmp_path, program) as uno:
        uno.set_supply(volts)
        began = cycle_when(uno, ADCSRA, 0x40, 0x40)
        assert cycle_when(uno, ADCSRA, 0x40, 0) - began == pytest.approx(25 * 128, abs=4)
        uno.run_to(uno.cycle + 100)
        assert uno.peek(RAM, 2) == counts


def test_the_bandgap_needs_its_time_after_it_was_chosen(tmp_path: Path) -> None:
    """Table 29-13: 70 us. A conversion before that is too low, as on the part."""
    convert = [*store((ADCSRA, 0xC2)), *wait_for(ADCSRA, 6, high=False)]
    program = [*store((ADMUX, 0x4E)), *convert, *copy(ADCL, RAM)]
    program += [*delay(80 * 16), *convert, *copy(ADCL, RAM + 1)]
    with boot(tmp_path, program) as uno:
        uno.run_to(4_000)
        assert uno.peek(RAM) < 225
        assert uno.peek(RAM + 1) == 225


def test_a_conversion_can_interrupt(tmp_path: Path) -> None:
    main = [*store((ADMUX, 0x4E)), SEI, *store((ADCSRA, 0xCF))]
    with boot(tmp_path, with_handlers(main, {ADC: []})) as uno:
        uno.run_to(3_000)
        assert uno.handler(ADC).count == 0
        uno.run_to(10_000)
        assert uno.handler(ADC).count == 1


# ----------------------------------------------------------------------------- watchdog

CHANGE = (WDTCSR, 0x18)
INTERRUPT_AND_RESET_16_MS = (WDTCSR, 0x48)


def test_the_watchdog_interrupts_first_and_resets_then(tmp_path: Path) -> None:
    """Table 11-2: the interrupt clears its own enable bit."""
    main = [*copy(MCUSR, RAM), SEI, *store(CHANGE, INTERRUPT_AND_RESET_16_MS)]
    with boot(tmp_path, with_handlers(main, {WDT: store((RAM + 1, 0x77))})) as uno:
        uno.run_to(17 * MS)
        assert uno.handler(WDT).count == 1
        assert uno.peek(RAM + 1) == 0x77
        assert uno.peek(WDTCSR) & 0x40 == 0
        assert uno.statistics().resets == 0
        uno.run_to(33 * MS)
        assert uno.statistics().resets == 1
        assert uno.peek(RAM) & 0x08


def test_a_loop_that_hangs_with_interrupts_off_is_reset(tmp_path: Path) -> None:
    with boot(tmp_path, store(CHANGE, INTERRUPT_AND_RESET_16_MS)) as uno:
        uno.run_to(31 * MS)
        assert uno.statistics().resets == 0
        uno.run_to(33 * MS)
        assert uno.statistics().resets == 1


def test_a_fed_watchdog_keeps_still(tmp_path: Path) -> None:
    program = store(CHANGE, INTERRUPT_AND_RESET_16_MS)
    for _ in range(5):
        program += [*delay(10 * MS), WDR]
    with boot(tmp_path, program) as uno:
        uno.run_to(51 * MS)
        assert uno.handler(WDT).count == 0
        assert uno.statistics().turns == 5
        uno.run_to(90 * MS)
        assert uno.statistics().resets > 0


def test_the_watchdog_can_be_switched_off_by_its_timed_sequence_only(tmp_path: Path) -> None:
    """Section 11.8.2."""
    on = store(CHANGE, INTERRUPT_AND_RESET_16_MS)
    with boot(tmp_path, [*on, *store((WDTCSR, 0x00))]) as uno:
        uno.run_to(50)
        assert uno.peek(WDTCSR) & 0x08
    with boot(tmp_path, [*on, *store(CHANGE), NOP, NOP, NOP, *store((WDTCSR, 0x00))]) as uno:
        uno.run_to(50)
        assert uno.peek(WDTCSR) & 0x08
    with boot(tmp_path, [*on, *store(CHANGE, (WDTCSR, 0x00))]) as uno:
        uno.run_to(50)
        assert uno.peek(WDTCSR) == 0


def test_after_its_reset_the_watchdog_runs_on_until_its_flag_is_cleared(tmp_path: Path) -> None:
    """Section 11.9.1: WDE is overridden by WDRF."""
    program = [*store((WDTCSR, 0x18), (WDTCSR, 0x08))]
    with boot(tmp_path, program) as uno:
        uno.run_to(17 * MS)
        assert uno.statistics().resets == 1
        assert uno.peek(WDTCSR) & 0x08
    again = [*store((MCUSR, 0), CHANGE, (WDTCSR, 0)), *delay(20 * MS)]
    with boot(tmp_path, [*again, *store((WDTCSR, 0x18), (WDTCSR, 0x08))]) as uno:
        uno.run_to(37 * MS)
        assert uno.statistics().resets == 1
        uno.run_to(57 * MS)
        assert uno.statistics().resets == 1


# ------------------------------------------------------------------------------- supply


def test_a_low_supply_holds_the_chip_in_reset(tmp_path: Path) -> None:
    program = [*store((DDRB, 2), (PORTB, 2)), *delay(2 * MS), *store((PORTB, 0))]
    with boot(tmp_path, program) as uno:
        uno.run_to(1 * MS)
        uno.set_supply(2.6)
        uno.run_to(10 * MS)
        levels = [edge.level for edge in uno.edges()]
        assert levels == [1, 0]
        uno.set_supply(5.0)
        uno.run_to(11 * MS)
        assert [edge.level for edge in uno.edges()] == [1]
        assert uno.peek(MCUSR) & 0x04
        assert uno.statistics().resets == 1
