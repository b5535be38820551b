"""The firmware that users flash starts, says who it is, and remembers its pose."""

from __future__ import annotations

from tests.avr.driver import Driver
from tests.avr.simavr import AvrTransport, Uno

from setae import __version__
from setae.link.session import Session
from setae_protocol.messages import PROTOCOL_VERSION, SCHEMA_HASH, ResetCause, Sensor, State

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
