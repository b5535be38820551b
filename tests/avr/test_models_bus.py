"""The I2C master and the pressure sensor against their data sheets."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.avr.programs import (
    EICRA,
    EIMSK,
    INT0,
    PIND,
    RAM,
    SEI,
    TWBR,
    TWCR,
    TWDR,
    TWSR,
    boot,
    copy,
    cycle_when,
    delay,
    get,
    put,
    read_registers,
    start,
    stop,
    store,
    with_handlers,
    write_register,
)
from tests.avr.simavr import Uno

SENSOR = 0x5D
WHO_AM_I, CTRL_REG1, CTRL_REG2, CTRL_REG3, STATUS, PRESS_OUT_XL = 0x0F, 0x10, 0x11, 0x12, 0x27, 0x28
RATE_75, BDU, NO_INCREMENT, RESET = 0x50, 0x02, 0x00, 0x14
FAST = store((TWBR, 2))
SAMPLE_CYCLES = 16_000_000 // 75
OLD_RAW, NEW_RAW = 0x3F1122, 0x3F7788


def results(uno: Uno, count: int) -> list[int]:
    return [uno.peek(RAM + i) for i in range(count)]


# ------------------------------------------------------------------------------- master


def test_the_master_tells_each_step_of_a_read(tmp_path: Path) -> None:
    """Tables 22-2 and 22-3: START, SLA+W, data, repeated START, SLA+R, data without ACK."""
    program = [*FAST]
    for number, step in enumerate(
        (start(), put(SENSOR << 1), put(WHO_AM_I), start(), put(SENSOR << 1 | 1))
    ):
        program += [*step, *copy(TWSR, RAM + number)]
    program += [*get(RAM + 6, last=True), *copy(TWSR, RAM + 5), *stop(), *copy(TWSR, RAM + 7)]
    with boot(tmp_path, program) as uno:
        uno.run_to(20_000)
        assert results(uno, 8) == [0x08, 0x18, 0x28, 0x10, 0x40, 0x58, 0xB1, 0xF8]


@pytest.mark.parametrize(("bit", "status"), [(0, 0x20), (1, 0x48)])
def test_nobody_at_an_address_is_told(tmp_path: Path, bit: int, status: int) -> None:
    with boot(tmp_path, [*FAST, *start(), *put(0x10 << 1 | bit), *copy(TWSR, RAM)]) as uno:
        uno.run_to(20_000)
        assert uno.peek(RAM) == status


@pytest.mark.parametrize(
    ("twbr", "prescaler", "clock_cycles"), [(2, 0, 20), (12, 0, 40), (72, 0, 160), (3, 1, 40)]
)
def test_a_byte_takes_nine_clocks(
    tmp_path: Path, twbr: int, prescaler: int, clock_cycles: int
) -> None:
    """Section 22.5.2: F_CPU / (16 + 2 TWBR 4^TWPS)."""
    program = [*store((TWBR, twbr), (TWSR, prescaler)), *start()]
    program += store((TWDR, SENSOR << 1), (TWCR, 0x84))
    with boot(tmp_path, program) as uno:
        cycle_when(uno, TWSR, 0xF8, 0x08)
        began = cycle_when(uno, TWCR, 0x80, 0x00)
        ended = cycle_when(uno, TWCR, 0x80, 0x80)
    assert ended - began == pytest.approx(9 * clock_cycles, abs=3)


def test_a_write_while_a_byte_is_on_its_way_is_a_collision(tmp_path: Path) -> None:
    """Section 22.9.2, TWWC."""
    program = [*FAST, *start(), *store((TWDR, SENSOR << 1), (TWCR, 0x84), (TWDR, 0x55))]
    with boot(tmp_path, program) as uno:
        uno.run_to(400)
        assert uno.peek(TWCR) & 0x08
        assert uno.peek(TWDR) == SENSOR << 1


# ------------------------------------------------------------------------------- sensor


@pytest.mark.parametrize(("code", "rate_hz"), [(0, 0), (2, 10), (3, 25), (4, 50), (5, 75)])
def test_the_sensor_keeps_its_rate(tmp_path: Path, code: int, rate_hz: int) -> None:
    """LPS33HW, table 17."""
    with boot(tmp_path, [*FAST, *write_register(SENSOR, CTRL_REG1, code << 4)]) as uno:
        uno.run_to(3_200_000 + 10_000)
        assert len(uno.samples()) == rate_hz // 5


def with_samples(folder: Path, program: list[int], *, control: int = RATE_75 | BDU) -> Uno:
    """Run with the sensor at 75 Hz; the pressure changes between its first and second sample."""
    uno = boot(folder, [*FAST, *write_register(SENSOR, CTRL_REG1, control), *program])
    uno.set_pressure(OLD_RAW / 4096)
    uno.set_pressure(NEW_RAW / 4096, from_cycle=SAMPLE_CYCLES * 3 // 2)
    uno.run_to(6 * SAMPLE_CYCLES)
    return uno


def test_reading_the_high_byte_clears_the_status(tmp_path: Path) -> None:
    program = [
        *read_registers(SENSOR, STATUS, [RAM]),
        *delay(SAMPLE_CYCLES + 8_000),
        *read_registers(SENSOR, STATUS, [RAM + 1]),
        *read_registers(SENSOR, PRESS_OUT_XL, [RAM + 2, RAM + 3]),
        *read_registers(SENSOR, STATUS, [RAM + 4]),
        *read_registers(SENSOR, PRESS_OUT_XL + 2, [RAM + 5]),
        *read_registers(SENSOR, STATUS, [RAM + 6]),
    ]
    with with_samples(tmp_path, program) as uno:
        assert results(uno, 7) == [0x00, 0x01, 0x22, 0x11, 0x01, 0x3F, 0x00]


def test_a_sample_that_nobody_read_is_an_overrun(tmp_path: Path) -> None:
    program = [*delay(2 * SAMPLE_CYCLES + 8_000), *read_registers(SENSOR, STATUS, [RAM])]
    with with_samples(tmp_path, program) as uno:
        assert uno.peek(RAM) == 0x11


@pytest.mark.parametrize(
    ("control", "seen"),
    [(RATE_75 | BDU, [0x22, 0x11, 0x3F, 0x88, 0x77, 0x3F]), (RATE_75, [0x22, 0x77, 0x3F])],
)
def test_block_data_update_keeps_a_sample_whole(
    tmp_path: Path, control: int, seen: list[int]
) -> None:
    """Section 9.3, BDU: the next sample waits until the high byte was read."""
    program = [
        *delay(SAMPLE_CYCLES + 8_000),
        *read_registers(SENSOR, PRESS_OUT_XL, [RAM]),
        *delay(SAMPLE_CYCLES),
        *read_registers(SENSOR, PRESS_OUT_XL + 1, [RAM + 1, RAM + 2]),
        *read_registers(SENSOR, PRESS_OUT_XL, [RAM + 3, RAM + 4, RAM + 5]),
    ]
    with with_samples(tmp_path, program, control=control) as uno:
        assert results(uno, len(seen)) == seen


def test_addresses_count_up_unless_switched_off(tmp_path: Path) -> None:
    program = [
        *FAST,
        *read_registers(SENSOR, WHO_AM_I, [RAM, RAM + 1, RAM + 2]),
        *write_register(SENSOR, CTRL_REG2, NO_INCREMENT),
        *read_registers(SENSOR, WHO_AM_I, [RAM + 3, RAM + 4, RAM + 5]),
    ]
    with boot(tmp_path, program) as uno:
        uno.run_to(40_000)
        assert results(uno, 6) == [0xB1, 0x00, 0x10, 0xB1, 0xB1, 0xB1]


def test_a_software_reset_brings_the_defaults_back(tmp_path: Path) -> None:
    program = [
        *FAST,
        *write_register(SENSOR, CTRL_REG1, RATE_75 | BDU),
        *write_register(SENSOR, CTRL_REG2, RESET),
        *read_registers(SENSOR, CTRL_REG1, [RAM, RAM + 1]),
    ]
    with boot(tmp_path, program) as uno:
        uno.run_to(SAMPLE_CYCLES * 2)
        assert results(uno, 2) == [0x00, 0x10]
        assert uno.samples() == []


@pytest.mark.parametrize(("control", "level_ready", "rises"), [(0x04, 1, 1), (0x84, 0, 2)])
def test_the_ready_pin_follows_the_status(
    tmp_path: Path, control: int, level_ready: int, rises: int
) -> None:
    """CTRL_REG3: DRDY and the pin's polarity, at D2, and its interrupt at a rising edge."""
    main = [
        *FAST,
        *store((EICRA, 3), (EIMSK, 1)),
        *write_register(SENSOR, CTRL_REG3, control),
        *write_register(SENSOR, CTRL_REG1, RATE_75 | BDU),
        SEI,
        *copy(PIND, RAM),
        *delay(SAMPLE_CYCLES + 8_000),
        *copy(PIND, RAM + 1),
        *read_registers(SENSOR, PRESS_OUT_XL, [RAM + 3, RAM + 4, RAM + 5]),
        *copy(PIND, RAM + 2),
    ]
    uno = boot(tmp_path, with_handlers(main, {INT0: []}))
    with uno:
        uno.wire_data_ready()
        uno.run_to(SAMPLE_CYCLES * 3 // 2)
        levels = [value >> 2 & 1 for value in results(uno, 3)]
        assert levels == [1 - level_ready, level_ready, 1 - level_ready]
        # At the sample; or when it becomes active low, and when the sample has been read.
        assert uno.handler(INT0).count == rises
