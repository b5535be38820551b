"""No parameter is a dead letter: whatever is changed, the robot does something else."""

from __future__ import annotations

from functools import cache

import pytest
from tests.simulator.conftest import Driver

from setae.errors import SetaeError
from setae.sim import World, parameter_names
from setae_protocol.frame import encode_host
from setae_protocol.messages import PROTOCOL_VERSION, SCHEMA_HASH, Hello, StoreLimits

NAMES = parameter_names()
HELLO = encode_host(
    Hello(protocol_version=PROTOCOL_VERSION, schema_hash=SCHEMA_HASH, new_session=9, token=77),
    session=0,
)

# What others need in order to matter: unevenness has an axis, a load has a lever.
SHARED = {
    "plant.gravity_tilt_deg": 20.0,
    "plant.load_x_n": 0.05,
    "spring.bending_scale_x": 0.8,
    "spring.solid_length_mm": 30.0,
    "tendon.friction": 0.1,
    "tendon.winding_slip": 0.02,
}
# Of the others a tenth more, or 0.1 where they are 0.
CHANGED = {
    "board.clock_rate_ppm": 5000.0,
    "board.poll_us": 5000.0,
    "board.pose_known": 0.0,
    "bristle.filament_bow_angle_deg": 90.0,
    "line.byte_us": 40.0,
    "line.down_latency_us": 6000.0,
    "plant.rod_elements": 10.0,
    "plant.rod_extra_modes": 1.0,
    "servo.dead_band_us": 20.0,
    "servo.stiffness_n_per_mm": 20.0,
    "spring.mean_diameter_mm": 19.0,
    "tendon.radius_mm": 8.0,
    **{f"servo.direction_{i}": -1.0 for i in range(4)},
}
EXTRA = {"plant.rod_extra_modes": {"plant.rod_elements": 10.0}}


@pytest.mark.parametrize("name", NAMES)
def test_it_changes_what_the_robot_does(name: str) -> None:
    """A value that was refused at the start counted as an effect."""
    default = World(parameters=SHARED).get(name)
    changed = CHANGED.get(name, 1.1 * default if default else 0.1)
    extra = tuple(EXTRA.get(name, {}).items())
    assert _deeds(((name, changed), *extra)) != _deeds(extra)


@cache
def _deeds(parameters: tuple[tuple[str, float], ...]) -> str:
    """What is seen of a robot that bends, goes down onto a floor, is reset, and stores limits."""
    with World(seed=3, parameters={**SHARED, **dict(parameters)}) as world:
        world.add_box((0.0, 0.0, -150.0), (200.0, 200.0, 40.0))
        world.start()
        try:
            seen: list[object] = [_greeted(world)]
            driver = Driver(world)
            world.arm_move((0.0, 0.0, -4.0), 100.0, 1000.0)
            for lengths_mm in ((28.0, 40.0, 52.0, 40.0), (66.0, 68.0, 69.0, 68.0)):
                truth = driver.pull(lengths_mm, duration_s=0.2, rest_s=0.04)
                seen.append(truth.backbone_mm.tolist())
        except SetaeError as error:  # such as a jump that the board refuses
            return str(error)
        world.reset_board()
        seen.append(_greeted(world))
        Driver(world, enable=False).session.request(StoreLimits(reserved=0))
        end_us = world.now_us + 200_000
        while world.now_us < end_us:
            seen.append((world.run(end_us), world.now_us))
        return repr((seen, driver.samples))


def _greeted(world: World) -> tuple[bytes, int]:
    """The board's answer, and when it came."""
    for _ in range(100):
        world.send(HELLO)
        if reply := world.run(world.now_us + 10_000):
            return reply, world.now_us
    raise AssertionError
