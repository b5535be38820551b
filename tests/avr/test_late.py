"""Edges that are armed too late, as something keeps interrupts off: counted, no pulse is cut."""

from __future__ import annotations

from collections.abc import Iterable

from tests.avr.driver import Driver, Ticks
from tests.avr.simavr import CYCLES_PER_TICK, CYCLES_PER_US, FRAME_CYCLES, by_servo

from setae.link.events import StatusReceived

POSE: Ticks = (1700, 2600, 2400, 3500)
# Nothing in the firmware keeps interrupts off for a sixth of that.
HOLD_CYCLES = 130 * CYCLES_PER_US


def hold(driver: Driver, phases_us: Iterable[int]) -> None:
    """Hold the program for a while, frame after frame, from those times after the rise."""
    rise = driver.frames()[-1].first_rise
    for phase_us in phases_us:
        frames = (driver.uno.cycle - rise) // FRAME_CYCLES + 2
        start = rise + frames * FRAME_CYCLES + phase_us * CYCLES_PER_US
        driver.uno.hold_program(start, HOLD_CYCLES)
        driver.session.run_for(60_000)


def counts(driver: Driver) -> list[int]:
    """What the board says of late armings, once a second."""
    driver.session.run_for(1_000_000)
    return [
        event.status.late_pulses for event in driver.events if isinstance(event, StatusReceived)
    ]


def test_what_is_late_for_the_rise_is_counted_and_leaves_whole_pulses(driver: Driver) -> None:
    """They were ended 0.1 ms after their rise: no servo knows what to do with such a pulse."""
    driver.enable(POSE)
    driver.session.run_for(60_000)
    before = driver.frames()[-1].frame
    hold(driver, range(-200, 60, 20))
    shown = [frame for frame in driver.frames() if frame.frame > before]
    assert {frame.ticks for frame in shown} == {tuple(map(float, POSE))}
    missing = shown[-1].frame - before - len(shown)
    told = counts(driver)
    assert told[0] == 0
    assert 0 < missing < told[-1] < 13


def test_what_is_late_for_a_fall_is_counted_and_ends_the_pulse(driver: Driver) -> None:
    driver.enable(POSE)
    driver.session.run_for(60_000)
    hold(driver, [POSE[servo] // 2 - 105 for servo in (2, 3)])
    for servo, pulses in enumerate(by_servo(driver.pulses())):
        widths = sorted(pulse.width for pulse in pulses)
        told = POSE[servo] * CYCLES_PER_TICK
        late = widths.pop() if servo >= 2 else told + 1
        assert told < late < told + HOLD_CYCLES
        assert set(widths) == {told}
    assert counts(driver)[-1] == 2
