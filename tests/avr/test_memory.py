"""Records and limits on the chip itself, through resets at any moment."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.avr.driver import WIDE_LIMITS, Driver
from tests.avr.simavr import AvrTransport

from setae.link.events import Event, StatusReceived, Tripped
from setae.link.session import Session
from setae_protocol.crc import crc32c
from setae_protocol.messages import SetLimits, State, StoreLimits, TripCause


def again(driver: Driver, session_id: int) -> tuple[Session, list[Event]]:
    """Reset the board and open another host's session."""
    driver.uno.press_reset()
    session = Session(AvrTransport(driver.uno), session_id=session_id)
    events: list[Event] = []
    session.subscribe(events.append)
    session.open()
    return session, events


def test_a_trip_is_read_after_a_reset(driver: Driver) -> None:
    driver.enable((1700, 1700, 1700, 1700))
    driver.guard(15)
    driver.session.run_for(300_000)
    driver.uno.set_pressure(1040.0)
    driver.wait_for(State.TRIPPED)
    driver.session.run_for(60_000)
    record = driver.trips[-1].record
    _, events = again(driver, 9)
    told = [event for event in events if isinstance(event, Tripped)]
    assert [trip.record for trip in told] == [record]
    assert told[0].earlier
    assert record.cause is TripCause.CONTACT


@pytest.mark.parametrize("cut_us", [1_000, 40_000, 90_000, 140_000, 155_000, 400_000])
def test_a_reset_while_limits_are_stored_leaves_the_old_or_the_new(
    driver: Driver, cut_us: int
) -> None:
    def store(session: Session, limits: SetLimits, duration_us: int) -> None:
        session.request(limits)
        session.send(StoreLimits(reserved=0))
        session.run_for(duration_us)

    old, new = (replace(WIDE_LIMITS, slew_ticks=slew) for slew in (111, 222))
    store(driver.session, old, 400_000)
    assert driver.session.telemetry is not None
    session, events = again(driver, 9)
    assert session.hello is not None
    assert session.hello.limits_crc == crc32c(old.pack())
    store(session, new, cut_us)
    session, events = again(driver, 10)
    session.run_for(50_000)
    assert session.hello is not None
    # Where the simulator's EEPROM is faster than the chip's, the earlier cuts are too late.
    assert session.hello.limits_crc in (crc32c(old.pack()), crc32c(new.pack()))
    if cut_us >= 400_000:
        assert session.hello.limits_crc == crc32c(new.pack())
    told = [event.status for event in events if isinstance(event, StatusReceived)]
    assert told[-1].stored_crc == session.hello.limits_crc
    assert 4_900 < told[-1].supply_mv < 5_100
