"""Solids that can be touched: their surface is where their numbers say."""

from __future__ import annotations

import math

import pytest

from setae.errors import InputError
from setae.sim import World

TOP_MM, BOTTOM_MM = 100.0, -100.0


def surface_mm(world: World, x_mm: float, y_mm: float) -> float:
    return world.surface_mm(x_mm, y_mm, bottom_mm=BOTTOM_MM, top_mm=TOP_MM)


@pytest.fixture
def world() -> World:
    return World(seed=1)


def test_nothing_has_no_surface(world: World) -> None:
    assert surface_mm(world, 0, 0) == -math.inf


def test_a_box_turned_by_yaw(world: World) -> None:
    world.add_box((10, 0, -20), (40, 20, 10), yaw_rad=math.pi / 2)
    assert surface_mm(world, 10, 19) == pytest.approx(-15, abs=1e-4)
    assert surface_mm(world, 10, 21) == -math.inf
    assert surface_mm(world, 21, 0) == -math.inf


def test_a_prism_has_round_corners(world: World) -> None:
    world.add_prism((0, 0, 0), (40, 40, 10), corner_mm=10)
    assert surface_mm(world, 19, 0) == pytest.approx(5, abs=1e-4)
    inside = 10 + 10 * math.sqrt(0.5)  # where the diagonal leaves the corner's arc
    assert surface_mm(world, inside - 0.1, inside - 0.1) == pytest.approx(5, abs=1e-4)
    assert surface_mm(world, inside + 0.1, inside + 0.1) == -math.inf


def test_a_hollow_prism_is_open_at_the_top(world: World) -> None:
    world.add_prism((0, 0, 0), (40, 40, 30), wall_mm=3)
    assert surface_mm(world, 18, 0) == pytest.approx(15, abs=1e-4)
    assert surface_mm(world, 0, 0) == pytest.approx(-12, abs=1e-4)


def test_a_ring_has_a_hole(world: World) -> None:
    world.add_ring((0, 0, 0), 40, 10)
    assert surface_mm(world, 40, 0) == pytest.approx(10, abs=1e-4)
    assert surface_mm(world, 0, 46) == pytest.approx(8, abs=1e-4)
    assert surface_mm(world, 0, 0) == -math.inf


def test_an_ellipsoid(world: World) -> None:
    world.add_ellipsoid((0, 0, -50), (30, 20, 25), yaw_rad=math.pi / 2)
    assert surface_mm(world, 0, 0) == pytest.approx(-25, abs=1e-4)
    assert surface_mm(world, 0, 18) == pytest.approx(-50 + 25 * 0.8, abs=1e-4)
    assert surface_mm(world, 21, 0) == -math.inf


def test_the_topmost_of_several_counts(world: World) -> None:
    world.add_box((0, 0, -50), (200, 200, 10))
    world.add_ring((0, 0, -40), 40, 5)
    assert surface_mm(world, 40, 0) == pytest.approx(-35, abs=1e-4)
    assert surface_mm(world, 0, 0) == pytest.approx(-45, abs=1e-4)


def test_solids_that_make_no_sense_are_refused(world: World) -> None:
    with pytest.raises(InputError, match="corner_mm"):
        world.add_prism((0, 0, 0), (40, 40, 10), corner_mm=21)
    with pytest.raises(InputError, match="wall_mm"):
        world.add_prism((0, 0, 0), (40, 40, 10), wall_mm=10)
    with pytest.raises(InputError, match="radii"):
        world.add_ring((0, 0, 0), 40, 0)
    with pytest.raises(InputError, match="semi_axes_mm"):
        world.add_ellipsoid((0, 0, 0), (1, 0, 1))
