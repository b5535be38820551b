"""The firmware that users flash starts, says who it is, and remembers its pose."""

from __future__ import annotations

import pytest
from tests.avr.driver import Driver
from tests.avr.simavr import (
    CYCLES_PER_TICK,
    CYCLES_PER_US,
    AvrTransport,
    Uno,
    by_servo,
)

from setae import __version__
from setae.errors import BoardResetError
from setae.link.session import Session
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Fault,
    ResetCause,
    Sensor,
    State,
)

POSE = (1700, 1800, 1900, 2000)


def test_it_boots_and_says_which_firmware_it_is(uno: Uno) -> None:
    hello = Session(AvrTransport(uno), session_id=7).open()

    version = f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"
    assert version == __version__
    assert hello.protocol_version == PROTOCOL_VERSION
    assert hello.schema_hash == SCHEMA_HASH
    assert hello.reset_cause == ResetCause.POWER_ON
    assert hello.pose_known == 0
    assert hello.sensor == Sensor.OK


def test_no_servo_moves_at_power_on(uno: Uno) -> None:
    uno.run_for_us(500_000)
    assert uno.edges() == []


def test_the_first_servo_frame_is_no_longer_than_the_others(driver: Driver) -> None:
    """It took 53 ms: its handler waited for edges that were over."""
    driver.session.run_for(40_000)
    assert driver.frame_zero_us < 5_000


def test_a_reset_ends_the_pulses_and_keeps_the_pose(driver: Driver) -> None:
    driver.enable(POSE)
    driver.session.run_for(100_000)

    driver.uno.press_reset()
    driver.uno.run_for_us(100_000)
    before = driver.pulses()
    driver.uno.run_for_us(500_000)
    hello = Session(AvrTransport(driver.uno), session_id=8).open()

    assert driver.pulses() == before
    assert hello.reset_cause == ResetCause.EXTERNAL
    assert hello.pose_known == 1
    assert hello.pulse_ticks == POSE


def test_a_host_that_comes_back_finds_the_robot_holding(driver: Driver) -> None:
    driver.enable(POSE)
    again = Session(AvrTransport(driver.uno), session_id=9)
    again.open()
    assert again.state is State.HOLDING


def test_a_loop_that_hangs_is_reset_and_says_so_and_its_last_pulses_are_whole(
    driver: Driver,
) -> None:
    """The bootloader clears the reset flags: only the watchdog's own interrupt can tell."""
    uno = driver.uno
    uno.install_bootloader()
    driver.enable(POSE)
    driver.session.run_for(60_000)
    resets = uno.statistics().resets
    hung_at = uno.cycle
    address, before = uno.hang()
    while uno.statistics().resets == resets:
        uno.run_for_us(1_000)
    assert 240_000 < (uno.cycle - hung_at) / CYCLES_PER_US < 520_000
    uno.load(address, before)
    uno.run_for_us(300_000)

    for servo, pulses in enumerate(by_servo(driver.pulses())):
        assert {pulse.width for pulse in pulses} == {POSE[servo] * CYCLES_PER_TICK}
        # From the watchdog's interrupt on there are none.
        assert pulses[-1].rise < hung_at + 300_000 * CYCLES_PER_US
    hello = Session(AvrTransport(uno), session_id=9).open()
    assert hello.reset_cause == ResetCause.WATCHDOG
    assert hello.pose_known == 1
    assert hello.pulse_ticks == POSE


def test_a_hang_with_interrupts_off_is_a_watchdog_reset_by_the_flag_alone(driver: Driver) -> None:
    """It was told as the button's."""
    uno = driver.uno
    driver.session.run_for(60_000)
    resets = uno.statistics().resets
    address, before = uno.hang(interrupts=False)
    while uno.statistics().resets == resets:
        uno.run_for_us(1_000)
    uno.load(address, before)

    again = Driver(uno, session_id=9)
    again.session.open()
    again.session.run_for(100_000)
    assert again.session.hello is not None
    assert again.session.hello.reset_cause == ResetCause.WATCHDOG
    assert [fault.record.fault for fault in again.faults] == [Fault.WATCHDOG]


@pytest.mark.parametrize("lost_power", [True, False])
def test_the_bootloader_does_not_hide_whether_power_was_lost(
    driver: Driver, lost_power: bool
) -> None:
    """It clears the flags, and power-on was told as unknown."""
    uno = driver.uno
    uno.install_bootloader()
    if lost_power:
        uno.cycle_power()
    else:
        uno.press_reset()
    hello = Session(AvrTransport(uno), session_id=9).open()
    assert hello.reset_cause == (ResetCause.POWER_ON if lost_power else ResetCause.EXTERNAL)


def test_what_happened_is_read_through_the_reset_of_a_new_connection(driver: Driver) -> None:
    """Opening the port pulls DTR, that resets the board, and the bootloader waits for a program."""
    uno = driver.uno
    uno.install_bootloader()
    driver.enable(POSE)
    driver.guard(15)
    driver.session.run_for(400_000)
    uno.set_pressure(1040.0)
    driver.wait_for(State.TRIPPED)
    driver.session.run_for(60_000)
    last = driver.reports[-1].telemetry.pulse_ticks

    uno.press_reset()
    opened_at = uno.cycle
    again = Driver(uno, session_id=9)
    again.session.open()
    again.session.run_for(100_000)

    assert (uno.cycle - opened_at) / CYCLES_PER_US < 2_500_000
    assert again.session.hello is not None
    assert again.session.hello.pulse_ticks == last
    assert [trip.record for trip in again.trips] == [driver.trips[-1].record]
    assert again.trips[0].earlier
    assert again.session.state is State.RELAXED
    assert [edge for edge in uno.edges() if edge.cycle > opened_at + CYCLES_PER_US] == []


def test_a_board_that_lost_its_power_knows_nothing_and_keeps_still(driver: Driver) -> None:
    uno = driver.uno
    driver.enable(POSE)
    driver.guard(15, deadline_frames=10)
    driver.wait_for(State.TRIPPED)
    driver.session.run_for(60_000)
    uno.edges()
    uno.cycle_power()
    with pytest.raises(BoardResetError, match="started anew"):
        driver.session.run_for(5_000_000)

    again = Driver(uno, session_id=9)
    again.session.open()
    again.session.run_for(100_000)
    hello = again.session.hello
    assert hello is not None
    assert hello.reset_cause == ResetCause.POWER_ON
    assert hello.pose_known == 0
    assert again.trips == []
    assert again.session.state is State.RELAXED
    assert len(uno.edges()) <= 4, "the pulses that the cut ended"
