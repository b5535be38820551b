"""The serial line, with all it can carry."""

from __future__ import annotations

from tests.avr.driver import Driver, Ticks, ramp
from tests.avr.simavr import CYCLES_PER_US

from setae_protocol.frame import encode_host
from setae_protocol.messages import Ping

LOW: Ticks = (1000, 1200, 1400, 1600)
HIGH: Ticks = (4000, 3800, 3600, 3400)


def ping_wire(driver: Driver, token: int) -> bytes:
    return encode_host(Ping(token=token), session=driver.session_id)


def test_nothing_is_lost_with_the_line_full_and_all_servos_moving(driver: Driver) -> None:
    driver.enable(LOW)
    driver.queue(ramp(LOW, HIGH, 50))
    driver.session.run_for(100_000)
    damaged = driver.reports[-1].telemetry.rx_damaged
    driver.uno.watch_interrupts()
    # More bytes than a second has room for.
    driver.uno.send(b"".join(ping_wire(driver, token) for token in range(1600)))
    driver.session.run_for(900_000)

    statistics = driver.uno.statistics()
    assert statistics.receive_overruns == 0
    assert driver.reports[-1].telemetry.rx_damaged == damaged
    # A byte on this line takes 20 us, and the chip holds two more.
    assert statistics.receive_longest_wait_cycles < 40 * CYCLES_PER_US
    assert statistics.interrupts_off_cycles < 20 * CYCLES_PER_US
    # Pulses are exact under load, too.
    shown = {frame.frame: frame.ticks for frame in driver.frames()}
    for event in driver.reports[:-2]:
        if event.telemetry.attached == 15:
            assert shown[event.telemetry.frame] == event.telemetry.pulse_ticks


def test_bytes_at_a_wrong_rate_are_counted_and_do_no_harm(driver: Driver) -> None:
    before = driver.reports[-1].telemetry.rx_damaged
    driver.uno.send(ping_wire(driver, 1) * 3, bit_cycles=16e6 / 115_200)
    driver.session.run_for(100_000)
    assert driver.uno.statistics().receive_frame_errors > 0
    assert driver.reports[-1].telemetry.rx_damaged != before
    driver.enable(LOW)


def test_the_stack_leaves_room(driver: Driver) -> None:
    driver.enable(LOW)
    driver.play(ramp(LOW, HIGH, 50))
    assert driver.uno.statistics().stack_bytes < 400
    assert driver.uno.statistics().resets == 0
