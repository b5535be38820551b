"""From the pressure to frozen pulses."""

from __future__ import annotations

import random

from tests.avr.driver import Driver, Load, Ticks, first_still, ramp
from tests.avr.simavr import CYCLES_PER_US, FRAME_CYCLES

from setae_protocol.messages import Guard, State, TripCause

START: Ticks = (1500, 1500, 1500, 1500)
END: Ticks = (3000, 3000, 3000, 3000)
REST_HPA = 1013.25
TOUCH_HPA = 1040.0


def touch(driver: Driver, rng: random.Random) -> int:
    """Move with a guard, touch at a random moment; return the cycle of the touch."""
    driver.guard(15)
    driver.queue(ramp(START, END, 45))
    driver.wait_for(State.MOVING)
    driver.session.run_until(
        lambda: driver.reports[-1].telemetry.guard is Guard.ARMED, 100_000, what="armed"
    )
    touched = driver.uno.cycle + rng.randrange(20_000, 300_000) * CYCLES_PER_US
    driver.uno.set_pressure(TOUCH_HPA, from_cycle=touched)
    driver.wait_for(State.TRIPPED)
    driver.session.run_for(60_000)
    return touched


def test_a_contact_freezes_the_next_frame_and_its_record_arrives(driver: Driver) -> None:
    rng = random.Random(5)
    driver.enable(START)
    for rate in (0.97, 1.0, 1.03):
        driver.uno.set_sensor_rate(rate)
        touched = touch(driver, rng)

        record = driver.trips[-1].record
        assert record.cause is TripCause.CONTACT

        frames = driver.frames()
        frozen = frames[-1].ticks
        assert frozen not in (tuple(map(float, START)), tuple(map(float, END)))
        assert tuple(map(float, record.pulse_ticks[-1])) == frozen
        samples = driver.samples()
        index = next(i for i, sample in enumerate(samples) if sample.ready >= touched)
        sample = samples[index]
        assert record.pressure_raw == sample.raw
        # The tare's samples: one or the other of two values, in turn.
        rest = {sample.raw for sample in samples[index - 2 : index]}
        assert record.baseline_raw == min(rest)
        assert max(rest) - min(rest) == 1
        # The frame in which the sample is read is shown again by the next one. The bus takes
        # its time, and the first edge comes 0.1 ms after the frame's start.
        assert first_still(frames).first_rise - sample.ready < FRAME_CYCLES + 2_000 * CYCLES_PER_US

        driver.uno.set_pressure(REST_HPA)
        driver.session.run_for(100_000)
        driver.resume()
        driver.play([START], frames_each=5)


def test_a_touch_that_is_too_weak_does_not_stop(driver: Driver) -> None:
    driver.enable(START)
    driver.guard(15)
    driver.queue(ramp(START, END, 45))
    driver.uno.set_pressure(REST_HPA + 14.5, from_cycle=driver.uno.cycle + 8_000_000)
    driver.wait_for(State.MOVING)
    driver.wait_for(State.HOLDING)
    driver.session.run_for(60_000)
    assert driver.trips == []
    assert driver.frames()[-1].ticks == tuple(map(float, END))


def test_a_contact_is_as_fast_with_the_line_full(driver: Driver) -> None:
    """The loop moved each byte on the sensor's bus: busy, it read samples 10 ms late."""
    rng = random.Random(4)
    driver.enable(START)
    Load(driver)
    for rate in (0.97, 1.0, 1.03):
        driver.uno.set_sensor_rate(rate)
        touched = touch(driver, rng)
        sample = next(sample for sample in driver.samples() if sample.ready >= touched)
        frozen_after = first_still(driver.frames()).first_rise - sample.ready
        assert frozen_after < FRAME_CYCLES + 3_000 * CYCLES_PER_US
        driver.uno.set_pressure(REST_HPA)
        driver.session.run_for(100_000)
        driver.resume()
        driver.play([START], frames_each=5)


def test_a_record_gets_through_a_line_that_is_full(driver: Driver) -> None:
    """Small answers kept the line from ever having room for it, and nothing could resume."""
    driver.enable(START)
    Load(driver)
    touch(driver, random.Random(3))
    assert driver.trips[-1].record.cause is TripCause.CONTACT
    driver.resume()
