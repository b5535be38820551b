"""Where tube and cube stand in the world."""

from __future__ import annotations

import math

import pytest

from setae.config import load, loads
from setae.errors import ConfigError, InputError
from setae.scene import Obstacle, tube_scene


@pytest.mark.parametrize("azimuth_deg", [0.0, 45.0, 90.0, 200.0])
def test_the_cube_lies_in_its_direction_and_touches_the_wall(azimuth_deg: float) -> None:
    scene = tube_scene(load(), Obstacle(below_tip_mm=35.0, azimuth_deg=azimuth_deg))
    assert scene.box is not None
    x, y, z = scene.box.centre_mm
    # Frame D's y is the world's -y.
    assert math.degrees(math.atan2(-y, x)) % 360 == pytest.approx(azimuth_deg)
    assert math.hypot(x, y) == pytest.approx(50.0)
    assert z == pytest.approx(-110.0 - 35.0 - 20.0)
    # The face away from the robot meets the wall.
    outer_mm = math.dist((x, y), scene.tube_axis_mm[:2]) + 20.0
    assert outer_mm == pytest.approx(scene.tube_inner_radius_mm)


def test_the_wall_on_the_other_side_is_out_of_reach() -> None:
    scene = tube_scene(load())
    assert scene.box is None
    x, y, _ = scene.tube_axis_mm
    nearest_mm = scene.tube_inner_radius_mm - math.hypot(x, y)
    assert nearest_mm == pytest.approx(70.0)


@pytest.mark.parametrize(
    "values",
    [
        {"below_tip_mm": math.nan},
        {"below_tip_mm": 0.0},
        {"below_tip_mm": -1.0},
        {"below_tip_mm": 35.0, "edge_mm": 0.0},
        {"below_tip_mm": 35.0, "azimuth_deg": math.inf},
    ],
)
def test_obstacles_that_can_not_be_are_refused(values: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Obstacle(**values)


def test_a_cube_that_fills_the_robots_own_way_is_refused() -> None:
    with pytest.raises(InputError, match="axis"):
        tube_scene(load(), Obstacle(below_tip_mm=35.0, edge_mm=70.0))


def test_a_tube_that_the_robot_does_not_fit_into_is_refused() -> None:
    """It hung inside of the wall, and reported an empty tube."""
    with pytest.raises(ConfigError, match="wall"):
        tube_scene(loads("[tube]\ninner_radius_mm = 110.0\n"))
