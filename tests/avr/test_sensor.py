"""The LPS33HW on the bus: its samples, and what is wrong with it."""

from __future__ import annotations

import pytest
from tests.avr.driver import Driver
from tests.avr.simavr import CYCLES_PER_US, Uno

from setae.errors import RefusedError
from setae_protocol.frame import encode_host
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    Fault,
    Guard,
    ReadLimits,
    Sensor,
    State,
)

POSE = (1700, 1800, 1900, 2000)


def _told_raw(driver: Driver) -> list[int]:
    return [
        sample.pressure_raw
        for event in driver.reports
        for sample in event.telemetry.samples[: event.telemetry.sample_count]
    ]


@pytest.mark.parametrize("wired", [False, True], ids=["polled", "data_ready"])
@pytest.mark.parametrize("rate", [0.97, 1.0, 1.03])
def test_every_sample_arrives_once_and_in_time(uno: Uno, rate: float, wired: bool) -> None:
    """The looks at the sensor fell behind it, 0.06 ms each time, until one sample was lost.

    Up to then each was told a period late, as if it were new.
    """
    uno.set_sensor_rate(rate)
    uno.wire_data_ready(wired)
    for number in range(300):
        uno.set_pressure(1000 + number / 64, from_cycle=number * 12_900 * CYCLES_PER_US)
    driver = Driver(uno)
    driver.open()
    # What falls behind a slow or a fast sensor is lost after two seconds.
    driver.session.run_for(1_000_000 if wired or rate == 1.0 else 2_500_000)

    ready_us = {sample.raw: sample.ready / CYCLES_PER_US for sample in driver.samples()}
    told: list[int] = []
    # At first the looks may begin anywhere in the sensor's period.
    for event in driver.reports[10:]:
        report = event.telemetry
        assert report.sensor is Sensor.OK
        for sample in report.samples[: report.sample_count]:
            told.append(sample.pressure_raw)
            told_us = driver.frame_zero_us + 20_000 * report.frame + report.phase_us - sample.age_us
            # Looked for every 0.2 ms; the clock is up to 0.7 ms late.
            assert 0 < told_us - ready_us[sample.pressure_raw] < 1_000
    expected = [raw for raw in ready_us if told[0] <= raw <= told[-1]]
    assert told == expected
    assert len(told) == pytest.approx(75 * rate * len(driver.reports[10:]) / 50, abs=2)


def test_a_sensor_with_the_other_address_is_found(uno: Uno) -> None:
    uno.set_sensor_address(0x5C)
    driver = Driver(uno)
    driver.open()
    driver.session.run_for(300_000)
    assert driver.reports[-1].telemetry.sensor is Sensor.OK


def test_no_sensor_is_told(uno: Uno) -> None:
    uno.set_sensor_present(False)
    driver = Driver(uno)
    driver.open()
    assert driver.reports[-1].telemetry.sensor is Sensor.ABSENT
    driver.enable(POSE)
    with pytest.raises(RefusedError, match="sensor"):
        driver.guard(15)


def test_another_chip_is_told(uno: Uno) -> None:
    uno.set_sensor_identity(0x58)
    driver = Driver(uno)
    driver.open()
    assert driver.reports[-1].telemetry.sensor is Sensor.WRONG


def test_a_sensor_that_is_plugged_in_later_works(uno: Uno) -> None:
    uno.set_sensor_present(False)
    driver = Driver(uno)
    driver.open()
    uno.set_sensor_present(True)
    driver.session.run_for(500_000)
    assert driver.reports[-1].telemetry.sensor is Sensor.OK


def test_pressure_out_of_range_is_told(driver: Driver) -> None:
    driver.uno.set_pressure(1300)
    driver.session.run_for(200_000)
    assert driver.reports[-1].telemetry.sensor is Sensor.RANGE


def test_a_stuck_bus_is_freed(driver: Driver) -> None:
    driver.uno.stick_bus(clocks=7)
    driver.session.run_for(60_000)
    driver.session.run_for(300_000)
    assert driver.reports[-1].telemetry.sensor is Sensor.OK
    assert len(_told_raw(driver)) > 20


def _arm(driver: Driver) -> None:
    driver.enable(POSE)
    driver.guard(15)
    driver.session.run_until(
        lambda: driver.reports[-1].telemetry.guard is Guard.ARMED, 1_000_000, what="armed"
    )


def test_a_sensor_that_falls_silent_while_armed_is_a_fault(driver: Driver) -> None:
    _arm(driver)
    driver.uno.set_sensor_silent(True)
    driver.wait_for(State.FAULT)
    driver.session.run_for(100_000)
    assert driver.faults[-1].record.fault is Fault.SENSOR_SILENT


def test_a_plug_that_comes_off_while_armed_is_a_fault(driver: Driver) -> None:
    _arm(driver)
    driver.uno.set_sensor_present(False)
    driver.wait_for(State.FAULT)
    driver.session.run_for(100_000)
    assert driver.faults[-1].record.fault is Fault.SENSOR_ABSENT


def test_pressure_is_read_to_the_last_bit(driver: Driver) -> None:
    for raw in (1_064_961, 4_150_271, 5_160_959):
        driver.uno.set_pressure(raw / PRESSURE_LSB_PER_HPA)
        driver.session.run_for(100_000)
        # The simulated part never shows a value twice in a row: it turns the last bit.
        assert set(_told_raw(driver)[-3:]) == {raw, raw ^ 1}


def test_a_busy_loop_is_no_broken_bus(driver: Driver) -> None:
    """A transfer had 1 ms in all; with messages to decode it took longer: a fault where armed."""
    _arm(driver)
    before = len(driver.reports)
    # The line is full in both directions.
    question = encode_host(ReadLimits(token=0), session=driver.session_id)
    driver.uno.send(question * 1000)
    driver.session.run_for(500_000)
    assert {event.telemetry.sensor for event in driver.reports[before:]} == {Sensor.OK}
    assert driver.faults == []
