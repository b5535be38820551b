"""Cable, board, host or a second program interrupt a session: what each side then does.

`docs/reconnect.md` says the same as a table.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import cast

import pytest
from tests.system.serial_board import SerialBoard

from setae.errors import BoardResetError, LinkLostError, PortBusyError, RefusedError
from setae.link.events import Event, TelemetryReceived, TicketState, Tripped
from setae.link.lossy import Faults, LossyTransport
from setae.link.serial_transport import SerialTransport
from setae.link.session import Session
from setae.sim import SimTransport, World
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    Enable,
    Guard,
    GuardMessage,
    Reflex,
    Resume,
    Segment,
    Segments,
    Sensor,
    State,
    Telemetry,
    TripCause,
)

SECOND_US = 1_000_000
START_TICKS = 1_800
END_TICKS = 2_300
DEAD = Faults(lose=1.0)


def pose(ticks: int) -> tuple[int, int, int, int]:
    return (ticks, ticks, ticks, ticks)


def motion(epoch: int, *, frames: int, to_ticks: int = END_TICKS) -> Segments:
    unused = Segment(0, pose(0))
    return Segments(epoch, 1, (Segment(frames, pose(to_ticks)), unused, unused, unused, unused))


class Shown:
    """All telemetry and trips of a session."""

    def __init__(self, session: Session) -> None:
        self.telemetry: list[Telemetry] = []
        self.trips: list[Tripped] = []
        session.subscribe(self._on_event)

    def _on_event(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self.telemetry.append(event.telemetry)
        elif isinstance(event, Tripped):
            self.trips.append(event)

    @property
    def poses(self) -> set[tuple[int, int, int, int]]:
        return {telemetry.pulse_ticks for telemetry in self.telemetry}


def connect(world: World, session_id: int) -> tuple[Session, Shown]:
    session = Session(SimTransport(world), session_id=session_id)
    shown = Shown(session)
    session.open()
    return session, shown


def enable(session: Session) -> None:
    session.request(Enable(pulse_ticks=pose(START_TICKS)))
    session.run_until(lambda: session.state is State.HOLDING, SECOND_US)


def guard_and_move(session: Session) -> None:
    """A motion of four seconds under a guard that trips after half of one."""
    guard = GuardMessage(
        epoch=session.epoch, threshold_raw=15 * PRESSURE_LSB_PER_HPA, consecutive=2,
        deadline_frames=25, reflex=Reflex.HOLD, retract_ticks=pose(START_TICKS),
        retract_slew_ticks=0,
    )  # fmt: skip

    session.run_until(lambda: _telemetry(session).sensor is Sensor.OK, 5 * SECOND_US)
    session.request(guard)
    session.request(motion(session.epoch, frames=200))
    session.run_until(lambda: _telemetry(session).guard is Guard.ARMED, SECOND_US)


def _telemetry(session: Session) -> Telemetry:
    assert session.telemetry is not None
    return session.telemetry


@pytest.fixture
def world() -> Iterator[World]:
    with World(seed=1) as made:
        made.start()
        yield made


def pass_time(world: World, duration_us: int) -> None:
    """Nobody listens."""
    end_us = world.now_us + duration_us
    while world.now_us < end_us:
        world.run(end_us)


# ------------------------------------------------------------------------- the host is gone


def test_killed_host_board_ends_what_it_has_and_the_next_finds_it_holding(world: World) -> None:
    first, _ = connect(world, 7)
    enable(first)
    first.request(motion(first.epoch, frames=50))
    pass_time(world, 3 * SECOND_US)
    second, shown = connect(world, 9)
    assert second.state is State.HOLDING
    second.run_for(SECOND_US)
    assert shown.poses == {pose(END_TICKS)}, "played to its end, and nothing since"


def test_new_host_in_mid_motion_freezes_it(world: World) -> None:
    first, _ = connect(world, 7)
    enable(first)
    first.request(motion(first.epoch, frames=100))
    pass_time(world, SECOND_US // 2)
    second, shown = connect(world, 9)
    second.run_for(3 * SECOND_US)
    assert second.state is State.HOLDING
    # The frame in which the session opened still shows its own pulses.
    assert len(shown.poses) <= 2
    assert shown.telemetry[-1].pulse_ticks[0] < END_TICKS


def test_what_the_dead_host_stopped_stays_stopped_until_resume(world: World) -> None:
    first, _ = connect(world, 7)
    enable(first)
    first.request(motion(first.epoch, frames=100))
    first.stop()
    second, shown = connect(world, 9)
    assert second.state is State.STOPPED
    with pytest.raises(RefusedError, match="stopped"):
        second.request(motion(second.epoch, frames=50))
    second.run_for(SECOND_US)
    assert len(shown.poses) == 1
    second.request(Resume(epoch=second.epoch))
    second.request(motion(second.epoch, frames=100))
    second.run_until(lambda: pose(END_TICKS) in shown.poses, 5 * SECOND_US)


def test_trip_without_a_host_is_read_by_the_next_as_earlier(world: World) -> None:
    """A guarded move ends by itself; nothing moves on before somebody has resumed."""
    first, _ = connect(world, 7)
    enable(first)
    guard_and_move(first)
    pass_time(world, 2 * SECOND_US)
    second, shown = connect(world, 9)
    second.run_for(SECOND_US)
    assert [(trip.earlier, trip.record.cause) for trip in shown.trips] == [
        (True, TripCause.DEADLINE)
    ]
    assert second.state is State.TRIPPED
    assert len(shown.poses) == 1
    with pytest.raises(RefusedError, match="tripped"):
        second.request(motion(second.epoch, frames=50))


# ------------------------------------------------------------------- cable, and reset button


def test_pulled_cable_ends_the_session_and_a_new_one_finds_the_board_holding(
    world: World,
) -> None:
    line = LossyTransport(SimTransport(world), seed=1)
    first = Session(line, session_id=7)
    first.open()
    enable(first)
    ticket = first.send(motion(first.epoch, frames=50))
    first.run_until(lambda: ticket.state is TicketState.EXECUTED, SECOND_US)
    line.down_faults = line.up_faults = DEAD
    unknown = first.send(motion(first.epoch, frames=50, to_ticks=START_TICKS))
    with pytest.raises(LinkLostError):
        first.run_for(10 * SECOND_US)
    assert unknown.state is TicketState.FAILED
    line.down_faults = line.up_faults = Faults()
    second = Session(line, session_id=9)
    shown = Shown(second)
    second.open()
    second.run_for(SECOND_US)
    assert second.state is State.HOLDING
    assert shown.poses == {pose(END_TICKS)}, "what was not confirmed is not sent again"


def test_reset_board_is_limp_and_stays_so_for_the_next_session(world: World) -> None:
    first, _ = connect(world, 7)
    enable(first)
    first.request(motion(first.epoch, frames=100))
    world.reset_board()
    with pytest.raises(BoardResetError, match="started anew"):
        first.run_for(10 * SECOND_US)
    second, shown = connect(world, 9)
    assert second.state is State.RELAXED
    assert second.hello is not None
    assert second.hello.pose_known, "kept in memory that a reset leaves alone"
    with pytest.raises(RefusedError, match="not_enabled"):
        second.request(motion(second.epoch, frames=50))
    second.run_for(SECOND_US)
    assert {telemetry.attached for telemetry in shown.telemetry} == {0}


def test_trip_is_read_after_the_board_was_reset(world: World) -> None:
    """Opening a UNO's port resets it: what a dead host's robot touched must survive that."""
    first, _ = connect(world, 7)
    enable(first)
    guard_and_move(first)
    pass_time(world, 2 * SECOND_US)
    world.reset_board()
    second, shown = connect(world, 9)
    second.run_for(SECOND_US)
    assert [(trip.earlier, trip.record.session, trip.record.cause) for trip in shown.trips] == [
        (True, 7, TripCause.DEADLINE)
    ]
    assert {telemetry.attached for telemetry in shown.telemetry} == {0}
    assert second.state is State.RELAXED


def test_second_program_takes_over_and_the_first_is_told(world: World) -> None:
    """Only where both got hold of the port, as through a network bridge."""
    first, _ = connect(world, 7)
    enable(first)
    first.request(motion(first.epoch, frames=200))
    second, shown = connect(world, 9)
    with pytest.raises(BoardResetError, match="Another host opened session 9"):
        first.run_for(SECOND_US)
    second.run_for(SECOND_US)
    assert second.state is State.HOLDING
    assert len(shown.poses) <= 2


class Shared:
    """A port that another program has open too: what comes is read by either, both may write."""

    simulated = True

    def __init__(self, inner: SimTransport) -> None:
        self.name, self.now_us, self.close = inner.name, inner.now_us, inner.close
        self.others_part = 0.5
        self._inner = inner
        self._rng = random.Random(1)

    def send(self, data: bytes) -> None:
        if self._rng.random() < self.others_part:
            self._inner.send(b"AT\r\n")
        self._inner.send(data)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        while True:
            received = self._inner.receive(deadline_us)
            if received is None or self._rng.random() >= self.others_part:
                return received


def test_a_port_that_another_program_reads_too_costs_frames_and_no_command(world: World) -> None:
    """Root's programs are not kept out. What they type runs into our frames."""
    port = Shared(SimTransport(world))
    session = Session(port, session_id=7)
    shown = Shown(session)
    session.open()
    enable(session)
    for step in range(40):
        session.request(motion(session.epoch, frames=2, to_ticks=START_TICKS + 10 * step))
    session.run_for(SECOND_US // 2)
    assert session.engine.statistics.frames_lost > 10
    assert session.engine.statistics.frames_retransmitted > 10
    played = [telemetry.pulse_ticks[0] for telemetry in shown.telemetry if telemetry.attached]
    assert played == sorted(played)
    assert played[-1] == START_TICKS + 10 * 39
    port.others_part = 1.0
    with pytest.raises(LinkLostError, match="silent for 4 s"):
        session.run_for(5 * SECOND_US)


# ------------------------------------------------------------------------ on a serial port

HOST = """
import sys
from setae.link.serial_transport import SerialTransport
from setae.link.session import Session
from tests.system.test_reconnect import enable, motion
session = Session(SerialTransport(sys.argv[1]), session_id=7)
session.open()
enable(session)
session.request(motion(session.epoch, frames=200))
print("moving", flush=True)
session.run_for(60_000_000)
"""


def test_killed_process_leaves_port_and_robot_to_the_next() -> None:
    with World(seed=1, parameters={"board.boot_us": 0}) as world:
        world.start()
        with SerialBoard(world) as board:
            host = subprocess.Popen(
                [sys.executable, "-c", HOST, board.port],
                stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            )  # fmt: skip
            assert host.stdout is not None
            with host.stdout:
                assert host.stdout.readline() == b"moving\n"
            with pytest.raises(PortBusyError, match="Another program holds"):
                SerialTransport(board.port)
            host.send_signal(signal.SIGKILL)
            host.wait()
            board.forget_exclusive()
            with Session(SerialTransport(board.port), session_id=9) as session:
                shown = Shown(session)
                session.open()
                session.run_for(SECOND_US // 2)
                assert session.state is State.HOLDING
                assert len(shown.poses) <= 2


def test_unplugged_port_is_lost_at_once_and_plugged_in_again_works() -> None:
    with World(seed=1, parameters={"board.boot_us": 0}) as world:
        world.start()
        with SerialBoard(world) as board:
            with Session(SerialTransport(board.port), session_id=7) as session:
                session.open()
                enable(session)
                board.unplug()
                with pytest.raises(LinkLostError, match="is gone"):
                    session.run_for(3 * SECOND_US)
            board.plug()
            with Session(SerialTransport(board.port), session_id=9) as session:
                session.open()
                assert session.state is State.HOLDING
                session.request(motion(session.epoch, frames=10, to_ticks=START_TICKS))


class Talker:
    """A world whose board says more than a port can keep."""

    now_us = 0

    def __init__(self) -> None:
        self._left = [bytes(4096)] * 100

    def run(self, _until_us: int) -> bytes:
        return self._left.pop() if self._left else b""


def test_a_port_that_nobody_reads_loses_what_comes_and_can_be_unplugged() -> None:
    """The terminal waited for a reader, and with it the world and who wanted to pull the cable."""
    with SerialBoard(cast(World, Talker())) as board:
        board.unplug()
        board.plug()
