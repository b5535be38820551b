"""What the board keeps through a reset, as a host sees it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.system.robots import compressed

from setae import rig
from setae.errors import FaultError, RefusedError
from setae.link.events import Event, FaultReported, StatusReceived
from setae.link.session import Session
from setae.sim import SimTransport, World
from setae_protocol.crc import crc32c
from setae_protocol.messages import Enable, Fault, SetLimits, State, StoreLimits

POSE = (1700, 1700, 1700, 1700)


def opened(world: World) -> tuple[Session, list[Event]]:
    """A new host's session, and what it is told."""
    session = Session(SimTransport(world))
    events: list[Event] = []
    session.subscribe(events.append)
    session.open()
    return session, events


def test_stored_limits_are_in_force_after_a_reset_and_set_ones_are_not() -> None:
    world = World(seed=1)
    world.start()
    session, events = opened(world)
    held = session.read_limits()
    stored = replace(SetLimits.unpack(held.pack()), slew_ticks=77)
    session.request(stored)
    session.request(StoreLimits(reserved=0))
    session.run_for(400_000)
    told = [event.status for event in events if isinstance(event, StatusReceived)]
    assert told[-1].stored_crc == crc32c(stored.pack())
    assert not told[-1].storing
    session.request(replace(stored, slew_ticks=88))
    world.reset_board()
    later, _ = opened(world)
    assert later.hello is not None
    assert later.hello.limits_crc == crc32c(stored.pack())


def test_a_low_supply_is_a_fault_that_a_host_reads_after_a_reset() -> None:
    world = World(seed=1)
    world.start()
    session, _ = opened(world)
    world.supply(3600)
    world.run(world.now_us + 60_000)
    world.supply(5000)
    world.reset_board()
    later, events = opened(world)
    faults = [event for event in events if isinstance(event, FaultReported)]
    assert [fault.record.fault for fault in faults] == [Fault.SUPPLY_LOW]
    assert faults[0].earlier
    assert later.state is State.RELAXED
    later.request(Enable(pulse_ticks=POSE))
    del session


def test_the_robot_says_what_is_stored_and_refuses_to_store_while_on() -> None:
    with rig.connect("sim://") as robot:
        before = robot.limits_stored
        assert before is None
        robot.store_limits()
        assert robot.limits_stored
        robot.enable()
        with pytest.raises(RefusedError, match="already_enabled"):
            robot.store_limits()


def test_a_low_supply_ends_a_move_with_what_to_do() -> None:
    with compressed() as made:
        made.at(made.robot.now_us + 200_000, lambda: made.world.supply(3500))
        with pytest.raises(FaultError, match="supply of their own"):
            made.robot.move_to((10, 0, 60), duration_s=1.0)
        made.world.supply(5000)
        made.run(0.1)
        made.robot.resume()
        assert made.robot.state is State.HOLDING
