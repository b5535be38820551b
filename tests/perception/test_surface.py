"""The true surface, against the simulator's own solids, and what a scan is worth against it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.perception.synthetic import CONFIG, REACH_MM, felt

from setae.experiments.scan import ScanResult
from setae.experiments.scan.quality import Surface, agreement, quality
from setae.heightmap import HeightMap
from setae.objects import SHAPES, ScanObject, random_object, table_scene
from setae.perception.measures import away_from_edges, nearness
from setae.perception.surface import height_mm
from setae.sim import World, add_solid
from setae.solids import Prism


@pytest.mark.parametrize("shape", SHAPES)
def test_it_is_where_the_simulator_has_it(shape: str) -> None:
    solids = table_scene(CONFIG, random_object(shape, 7)).solids
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 200, (2, 300))
    ours = height_mm(solids, x, y)
    with World() as world:
        for solid in solids:
            add_solid(world, solid)
        theirs = [
            world.surface_mm(a, b, bottom_mm=-300.0, top_mm=0.0) for a, b in zip(x, y, strict=True)
        ]
    assert ours == pytest.approx(theirs, abs=1e-3)


def test_a_perfect_scan_is_near_and_a_shifted_one_is_not() -> None:
    what = ScanObject(shape="lidded_container", yaw_deg=20)
    solids = table_scene(CONFIG, what).solids
    perfect = nearness(felt(what, noise_mm=0.0, ragged=0.0), solids, reach_mm=REACH_MM)
    assert perfect.height_rms_mm == pytest.approx(0, abs=1e-9)
    # The true surface is sampled a millimetre apart.
    assert perfect.chamfer_mm < 0.5
    higher = felt(what, noise_mm=0.0, ragged=0.0)
    raised = type(higher)(
        x_mm=higher.x_mm, y_mm=higher.y_mm, height_mm=higher.height_mm + 3.0, mark=higher.mark
    )
    moved = nearness(raised, solids, reach_mm=REACH_MM)
    assert moved.height_bias_mm == pytest.approx(3)
    assert moved.height_rms_mm == pytest.approx(3)
    assert moved.chamfer_mm > 2


def test_a_half_felt_object_is_not_complete() -> None:
    what = ScanObject(shape="eraser")
    solids = table_scene(CONFIG, what).solids
    whole = felt(what, noise_mm=0.0, ragged=0.0)
    height, mark = whole.height_mm.copy(), whole.mark.copy()
    height[:, 11:], mark[:, 11:] = np.nan, "empty"
    half = type(whole)(x_mm=whole.x_mm, y_mm=whole.y_mm, height_mm=height, mark=mark)
    near = nearness(half, solids, reach_mm=REACH_MM)
    assert near.height_rms_mm < 1e-9
    assert near.to_surface_mm < 0.5
    assert near.from_surface_mm > 10


def test_a_point_on_a_wall_is_on_the_surface_and_one_in_the_solid_is_not() -> None:
    # Of what reaches beyond the square a wall was made at its border, if nothing stands at the
    # opposite one: points 10 mm inside of a solid counted as touched. And walls that are there
    # could have been left out without a test.
    table, *_ = table_scene(CONFIG).solids
    block = Prism(centre_mm=(0.0, 100.0, -110.0), edges_mm=(100.0, 80.0, 40.0))
    places = np.arange(0.0, 201.0, 10.0)
    height_mm = np.full((21, 21), np.nan)
    mark = np.full((21, 21), "empty")
    distances_mm = {}
    for name, column in (("border", 0), ("wall", 5)):
        one_mm, one_mark = height_mm.copy(), mark.copy()
        one_mm[10, column], one_mark[10, column] = -100.0, "felt"
        grid = HeightMap(x_mm=places, y_mm=places, height_mm=one_mm, mark=one_mark)
        distances_mm[name] = nearness(grid, [table, block], reach_mm=REACH_MM).to_surface_mm
    assert distances_mm["wall"] < 0.5
    assert distances_mm["border"] == pytest.approx(10.0)


def test_a_height_that_was_felt_where_nothing_is_in_reach_is_no_height_error() -> None:
    # What is not judged was never looked at.
    what = ScanObject(shape="lidded_container")
    solids = table_scene(CONFIG, what).solids
    heights = felt(what, noise_mm=0.0, ragged=0.0)
    height_mm, mark = heights.height_mm.copy(), heights.mark.copy()
    height_mm[0, 0], mark[0, 0] = -100.0, "felt"
    grid = HeightMap(x_mm=heights.x_mm, y_mm=heights.y_mm, height_mm=height_mm, mark=mark)
    near, right = (nearness(one, solids, reach_mm=REACH_MM) for one in (grid, heights))
    assert near.places == right.places
    assert near.height_rms_mm < 1e-9
    assert near.to_surface_mm > right.to_surface_mm + 0.2


@pytest.mark.parametrize("shape", ["eraser", "orange"])
def test_a_scan_and_a_comparison_leave_out_the_same_edges(shape: str) -> None:
    # Each had a rule of its own, so two errors of one scan differed.
    what = random_object(shape, 7)
    solids, heights = table_scene(CONFIG, what).solids, felt(what)
    fine_mm = np.arange(0.0, 201.0, 2.5)
    surface = Surface(step_mm=2.5, height_mm=height_mm(solids, *np.meshgrid(fine_mm, fine_mm)))
    places = np.meshgrid(heights.x_mm, heights.y_mm)
    edges = surface.edges(heights)
    assert edges.any()
    assert (edges == ~away_from_edges(solids, *places)).all()


def test_the_quality_of_a_scan_is_its_errors_and_what_it_missed_and_made_up() -> None:
    # Nothing looked at these numbers, which reports and figures tell: an error of zero would do.
    # A step of 20 mm across the middle, and a table that is out of reach below the last rows.
    fine_mm = np.where(np.arange(41)[:, np.newaxis] < 32, -100.0, -150.0) + np.zeros((41, 41))
    fine_mm[:, 20:] -= 20.0
    surface = Surface(step_mm=2.5, height_mm=fine_mm)
    places = np.arange(0.0, 101.0, 10.0)
    true_mm = fine_mm[::4, ::4]
    there = true_mm > -135.0
    height_mm = np.where(there, true_mm + 0.3, np.nan)
    height_mm[there & (places < 20)] += 1.0
    height_mm[0, 5] = -100.0  # beside the edge, 20 mm too high
    height_mm[2, 2] = np.nan  # missed
    height_mm[10, 1] = -130.0  # made up
    mark = np.where(np.isfinite(height_mm), "felt", "empty")
    grid = HeightMap(x_mm=places, y_mm=places, height_mm=height_mm, mark=mark)
    result = ScanResult(height_map=grid, places=(), mode="paper", duration_s=0.0, complete=True)
    found = quality(result, surface, lowest_mm=-135.0)
    inner = there & ~surface.edges(grid) & np.isfinite(height_mm)
    raised = int((inner & (places < 20)).sum())
    assert (found.places, found.missed, found.invented) == (int(inner.sum()), 1, 1)
    assert found.places > 50
    assert found.bias_mm == pytest.approx(0.3 + raised / found.places)
    square_mm2 = (raised * 1.3**2 + (found.places - raised) * 0.3**2) / found.places
    assert found.rms_mm == pytest.approx(np.sqrt(square_mm2))
    assert found.edge_places > 0
    assert found.edge_rms_mm > 5
    other = HeightMap(x_mm=places, y_mm=places, height_mm=true_mm, mark=np.full_like(mark, "felt"))
    assert agreement(grid, other) == pytest.approx(np.isfinite(height_mm).mean())
