"""What comes just before a servo frame still freezes that frame, however busy the line is."""

from __future__ import annotations

import random

import pytest
from tests.avr.aimed import Range
from tests.avr.driver import Driver, Load
from tests.avr.simavr import CYCLES_PER_US, FRAME_CYCLES

from setae.link.events import StatusReceived


@pytest.fixture
def aim(driver: Driver) -> Range:
    """Four servos that move, under load."""
    return Range(driver, random.Random(3))


def test_a_sample_that_is_ready_half_a_millisecond_before_a_frame_freezes_it(aim: Range) -> None:
    """A sample that came between two looks at it waited behind 0.6 ms of bytes and reports."""
    found = [aim.contact((500, 900)) for _ in range(15)]
    assert [contact for contact in found if contact.frames_late] == []


def test_a_stop_half_a_millisecond_before_a_frame_freezes_it_while_a_sample_is_fetched(
    aim: Range,
) -> None:
    """It waited until the sample was there: up to 20.8 ms until the pulses stood still."""
    found = [aim.stop((500, 800), (-300, 600)) for _ in range(15)]
    assert [stop for stop in found if stop.frames_late] == []


@pytest.mark.parametrize("rate", [0.99, 1.03])
def test_no_sample_waits_for_a_look_at_the_sensor(driver: Driver, rate: float) -> None:
    """Now and then Timer0 matched a turn too soon: looks went in vain, and the phase was lost."""
    uno = driver.uno
    uno.set_sensor_rate(rate)
    Load(driver)
    driver.enable((1500, 1500, 1500, 1500))
    driver.session.run_for(300_000)
    first = len(driver.reports)
    driver.session.run_for(1_000_000)
    a_frame = driver.pulses()[-1].rise - 60 * CYCLES_PER_US

    ready = [sample.ready for sample in driver.samples()]
    told = [
        a_frame + (event.telemetry.phase_us - sample.age_us) * CYCLES_PER_US
        for event in driver.reports[first:]
        for sample in event.telemetry.samples[: event.telemetry.sample_count]
    ]
    assert len(told) > 70
    # Which frame it was is clear from the order: a sample is never a frame late.
    last = (
        len(ready)
        - 1
        - next(
            back
            for back in range(3)
            if (told[-1] - ready[-1 - back] + 8_000) % FRAME_CYCLES < 16_000
        )
    )
    waits_us = [
        ((at - ready[last - back] + 8_000) % FRAME_CYCLES - 8_000) / CYCLES_PER_US
        for back, at in enumerate(reversed(told))
    ]
    assert max(waits_us) < 250


def test_status_comes_at_its_pace_beside_a_host_that_asks_without_a_break(driver: Driver) -> None:
    """Answers went first, and left it no room."""
    Load(driver)
    driver.session.run_for(100_000)
    driver.events.clear()
    driver.session.run_for(3_000_000)
    assert sum(isinstance(event, StatusReceived) for event in driver.events) >= 2
