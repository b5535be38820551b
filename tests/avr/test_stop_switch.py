"""A servo's spark on D4 is no open stop switch, however fast the loop turns."""

from __future__ import annotations

from dataclasses import replace

from tests.avr.driver import WIDE_LIMITS, Driver

from setae_protocol.messages import State


def test_a_spark_stops_nothing_and_an_open_switch_does(driver: Driver) -> None:
    """An idle loop took 0.06 ms for a stop."""
    driver.uno.close_stop_switch()
    driver.session.request(replace(WIDE_LIMITS, stop_switch=1))
    for _ in range(5):
        driver.uno.close_stop_switch(False)
        driver.uno.run_for_us(150)
        driver.uno.close_stop_switch()
        driver.session.run_for(33_000)
    assert driver.session.state is State.RELAXED

    driver.uno.close_stop_switch(False)
    driver.uno.run_for_us(5_000)
    driver.uno.close_stop_switch()
    driver.wait_for(State.STOPPED)
