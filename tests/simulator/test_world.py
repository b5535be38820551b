"""Virtual time: repeatable, independent, and with the line's true delays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from tests.simulator.conftest import Driver

from setae.config import load
from setae.errors import InputError, LinkLostError, StageError
from setae.sim import SensorFault, SimTransport, SimulatedStage, SimulationError, World
from setae.stage import Stage
from setae_protocol.frame import BoardDecoder, encode_host
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Hello,
    HelloReply,
    ResetCause,
    Sensor,
    State,
    Telemetry,
)

HELLO = encode_host(
    Hello(protocol_version=PROTOCOL_VERSION, schema_hash=SCHEMA_HASH, new_session=9, token=77),
    session=0,
)


def started(seed: int = 1, **parameters: float) -> World:
    world = World(seed=seed, parameters={k.replace("__", "."): v for k, v in parameters.items()})
    world.add_box((0.0, 0.0, -180.0), (60.0, 60.0, 60.0))
    world.start()
    return world


def listen(world: World, until_us: int, slice_us: int) -> bytes:
    data = b""
    while world.now_us < until_us:
        data += world.run(min(until_us, world.now_us + slice_us))
    return data


def story(world: World, slice_us: int = 1_000_000, look: bool = False) -> bytes:
    """Hello, a second of telemetry while the arm pushes the bristle down, a reset."""
    world.send(HELLO)
    data = listen(world, 300_000, slice_us)
    world.arm_move((0.0, 0.0, -20.0), 40.0, 200.0)
    for end_us in (600_000, 900_000, 1_300_000):
        data += listen(world, end_us, slice_us)
        if look:
            world.truth()
    world.reset_board()
    data += listen(world, 2_000_000, slice_us)
    world.send(HELLO)
    return data + listen(world, 2_500_000, slice_us)


def test_same_seed_same_bytes_however_the_time_is_cut() -> None:
    whole = story(started())
    assert len(whole) > 2000
    assert story(started()) == whole
    assert story(started(), slice_us=777) == whole
    assert story(started(), slice_us=20_000, look=True) == whole
    assert story(started(seed=2)) != whole


def test_worlds_side_by_side_do_not_touch_each_other() -> None:
    alone = story(started(seed=4))
    one, other = started(seed=4), started(seed=5)
    one.send(HELLO)
    data = b""
    while one.now_us < 300_000:
        data += one.run(one.now_us + 5_000)
        other.run(other.now_us + 7_000)
    assert alone.startswith(data)
    assert len(data) > 300


@pytest.mark.parametrize("byte_us", [20, 40, 200])
def test_a_byte_takes_the_time_that_it_takes(byte_us: int) -> None:
    world = started(line__byte_us=byte_us)
    listen(world, 9_500, 1_000_000)
    world.send(HELLO)
    reply = b""
    while not (frames := BoardDecoder().feed(reply)):
        reply += world.run(1_000_000)
    assert isinstance(frames[0].message, HelloReply)
    # 1 ms in the USB chip, each byte both ways, handed over on its 4 ms grid.
    earliest_us = 9_500 + 1_000 + byte_us * (len(HELLO) + len(reply))
    assert world.now_us >= earliest_us
    assert world.now_us % 4_000 == 0
    assert world.now_us - earliest_us < 4_000 + byte_us


def test_telemetry_comes_with_every_frame_of_the_board_s_own_clock() -> None:
    counts = {}
    for ppm in (-5000.0, 0.0, 5000.0):
        world = started(board__clock_rate_ppm=ppm)
        world.send(HELLO)
        data = listen(world, 20_000_000, 1_000_000)
        frames = [f.message for f in BoardDecoder().feed(data)]
        counts[ppm] = sum(isinstance(message, Telemetry) for message in frames)
    assert counts[0.0] == pytest.approx(999, abs=1)
    assert counts[5000.0] - counts[0.0] == pytest.approx(5, abs=1)
    assert counts[0.0] - counts[-5000.0] == pytest.approx(5, abs=1)


def test_reset_loses_the_session_and_keeps_the_pose(driver: Driver) -> None:
    held = driver.pull(55.0)
    driver.world.reset_board()
    world = driver.world
    world.send(HELLO)  # into the bootloader: nobody listens
    listen(world, world.now_us + 1_000_000, 1_000_000)
    world.send(HELLO)
    frames = BoardDecoder().feed(listen(world, world.now_us + 60_000, 1_000_000))
    reply = frames[0].message
    assert isinstance(reply, HelloReply)
    assert reply.reset_cause == ResetCause.EXTERNAL
    assert frames[0].header.state == State.RELAXED
    assert world.truth().backbone_mm[-1] == pytest.approx(held.backbone_mm[-1], abs=0.05)


@pytest.mark.parametrize(
    ("fault", "shown"),
    [
        (SensorFault.ABSENT, Sensor.ABSENT),
        (SensorFault.BUS, Sensor.BUS),
        (SensorFault.SILENT, Sensor.SILENT),
        (SensorFault.WRONG, Sensor.WRONG),
        (SensorFault.STUCK, Sensor.STUCK),
        (SensorFault.RANGE, Sensor.RANGE),
        (SensorFault.NOISY, Sensor.NOISY),
    ],
)
def test_a_broken_sensor_is_seen_by_the_board(
    driver: Driver, fault: SensorFault, shown: Sensor
) -> None:
    driver.world.sensor_fault(fault)
    driver.wait(0.5)
    assert driver.session.telemetry is not None
    assert driver.session.telemetry.sensor == shown
    driver.world.sensor_fault(SensorFault.NONE)
    driver.wait(0.6)
    assert driver.session.telemetry.sensor == Sensor.OK


def test_the_transport_waits_in_virtual_time_only() -> None:
    world = started()
    transport = SimTransport(world)
    assert transport.receive(250_000) is None
    assert transport.now_us() == 250_000
    transport.send(HELLO)
    received = transport.receive(1_000_000)
    assert received is not None
    assert received[1] == world.now_us < 260_000
    transport.close()
    transport.close()
    with pytest.raises(LinkLostError):
        transport.receive(2_000_000)


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_pace_must_be_one(speed: float) -> None:
    with pytest.raises(InputError, match="speed"):
        SimTransport(started(), speed=speed)


def test_the_arm_goes_straight_and_never_too_fast() -> None:
    world = started()
    stage = SimulatedStage(world, load().stage)
    assert isinstance(stage, Stage)
    stage.move_to((30.0, 0.0, -40.0), speed_mm_s=25.0, acceleration_mm_s2=100.0)
    positions = []
    while stage.moving:
        world.run(world.now_us + 10_000)
        positions.append(stage.position_mm)
    assert stage.position_mm == (30.0, 0.0, -40.0)
    path = np.array(positions)
    assert len(path) > 100
    assert np.abs(np.cross(path, [0.6, 0.0, -0.8])).max() < 1e-9
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.01
    assert speed.max() == pytest.approx(25.0)
    assert np.abs(np.diff(speed)).max() < 100 * 0.01 + 1e-6
    assert world.now_us == pytest.approx(1e6 * (50 / 25 + 25 / 100), abs=10_000)


def test_the_arm_brakes_on_its_line_and_takes_a_new_target() -> None:
    world = started()
    stage = SimulatedStage(world, load().stage)
    stage.move_to((100.0, 0.0, 0.0))
    world.run(1_000_000)
    with pytest.raises(StageError, match="moving"):
        stage.move_to((0.0, 0.0, 0.0))
    before = stage.position_mm[0]
    stage.stop()
    world.run(2_000_000)
    assert stage.position_mm[0] - before == pytest.approx(50**2 / (2 * 200))
    assert stage.position_mm[1:] == (0.0, 0.0)
    stage.stop()
    stage.move_to((0.0, 0.0, 0.0))
    world.run(10_000_000)
    assert stage.position_mm == (0.0, 0.0, 0.0)
    with pytest.raises(StageError, match="speed_mm_s"):
        stage.move_to((1.0, 0.0, 0.0), speed_mm_s=float("nan"))
    with pytest.raises(StageError, match="three finite"):
        stage.move_to((1.0, float("inf"), 0.0))


def test_a_world_says_when_it_is_used_at_the_wrong_time() -> None:
    world = World()
    with pytest.raises(SimulationError, match="not been started"):
        world.run(1_000)
    world.start()
    with pytest.raises(SimulationError, match="started already"):
        world.start()
    with pytest.raises(SimulationError, match="started already"):
        world.set("sensor.noise_hpa", 0.1)
    with pytest.raises(SimulationError, match="started already"):
        world.add_tube((0.0, 0.0, 0.0), 10.0)
    world.close()
    world.close()
    with pytest.raises(SimulationError, match="closed"):
        world.run(1_000)


def test_the_truth_is_never_an_old_one() -> None:
    """The world is asked once between two changes, so each change has to count as one."""
    world = started()
    before = world.truth()
    world.arm_move((0.0, 0.0, -20.0), 40.0, 200.0)
    assert world.arm_moving
    assert not before.arm_moving
    world.run(500_000)
    assert world.arm_mm[2] < -1.0
    assert world.truth().arm_mm.tolist() == list(world.arm_mm)
    assert before.arm_mm.tolist() == [0.0, 0.0, 0.0]
    world.close()
    with pytest.raises(SimulationError):
        world.truth()


def test_an_arm_that_is_stopped_too_late_for_its_braking_ends_at_its_target() -> None:
    # One that went on beyond, as far as the asked braking took it, passed all tests.
    with World(seed=1) as world:
        world.start()
        world.arm_move((0.0, 0.0, -20.0), 50.0, 400.0)
        while world.arm_mm[2] > -18.5:
            world.run(world.now_us + 1000)
        world.arm_stop(10.0)
        while world.arm_moving:
            world.run(world.now_us + 1000)
        assert world.arm_mm == pytest.approx((0, 0, -20))
