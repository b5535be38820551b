"""Records and limits on the chip itself, through resets at any moment."""

from __future__ import annotations

from dataclasses import replace

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


def test_a_reset_while_limits_are_stored_leaves_the_old_or_the_new(driver: Driver) -> None:
    def store(session: Session, limits: SetLimits, duration_us: int) -> None:
        session.request(limits)
        session.send(StoreLimits(reserved=0))
        session.run_for(duration_us)

    session, events = driver.session, list(driver.events)
    held = None
    cuts_us = (400_000, 1_000, 40_000, 90_000, 140_000, 155_000, 300_000)
    for number, cut_us in enumerate(cuts_us):
        limits = replace(WIDE_LIMITS, slew_ticks=111 + number)
        new = crc32c(limits.pack())
        store(session, limits, cut_us)
        session, events = again(driver, 9 + number)
        session.run_for(50_000)
        assert session.hello is not None
        found = session.hello.limits_crc
        assert found in ((new,) if cut_us >= 300_000 else (held, new))
        told = [event.status for event in events if isinstance(event, StatusReceived)]
        assert told[-1].stored_crc == found
        assert 4_900 < told[-1].supply_mv < 5_100
        held = found
