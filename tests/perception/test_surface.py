"""The true surface, against the simulator's own solids, and what a scan is worth against it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.perception.synthetic import CONFIG, REACH_MM, felt

from setae.experiments.scan.quality import Surface
from setae.objects import SHAPES, ScanObject, random_object, table_scene
from setae.perception.measures import away_from_edges, nearness
from setae.perception.surface import height_mm
from setae.sim import World, add_solid


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
