"""Objects that are scanned: where they stand, and that the robot can reach their top."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from setae.config import load, replaced
from setae.errors import ConfigError, InputError
from setae.objects import SHAPES, ScanObject, of_description, random_object, table_scene
from setae.perception import surface
from setae.sim import World, add_solid

AREA_MM = 200.0


@given(st.sampled_from(SHAPES), st.integers(0, 10_000))
def test_random_objects_lie_wholly_in_the_square(shape: str, seed: int) -> None:
    what = random_object(shape, seed, area_mm=AREA_MM)
    for middle_mm in (what.x_mm, what.y_mm):
        assert what.radius_mm - 0.1 <= middle_mm <= AREA_MM - what.radius_mm + 0.1


def test_a_random_object_lies_in_the_area_that_is_scanned_or_is_refused() -> None:
    # Objects stood in 200 x 200 mm, whatever was scanned: a smaller area found nothing, silently.
    what = random_object("orange", 2, area_mm=(140.0, 100.0))
    assert what.x_mm + what.radius_mm <= 140.1
    assert what.y_mm + what.radius_mm <= 100.1
    with pytest.raises(InputError, match=r"eraser:1 doesn't fit .* 60 x 60 mm\. Scan 132 mm or"):
        random_object("eraser", 1, area_mm=60.0)
    # As ever in the paper's square: figures hang on it.
    assert random_object("orange", 2) == ScanObject(
        shape="orange", scale=1.13, x_mm=119.7, y_mm=147.9, yaw_deg=-116.2
    )


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ({}, "no table_z_mm"),
        ({"table_z_mm": "low"}, "table_z_mm is 'low'. Give a number."),
        ({"table_z_mm": math.nan}, "table_z_mm is nan"),  # the simulator told of a box's centre
        ({"table_z_mm": -1e9}, "from -5000 to 5000"),  # the scan took for ever
        ({"table_z_mm": -138.0, "object": "coil"}, "Give [object] with shape, scale, x_mm"),
        ({"table_z_mm": -138.0, "object": {"x_mm": 3.0}}, "Give [object] with shape"),
        ({"table_z_mm": -138.0, "object": {"shape": "coil", "hue": 3}}, "there is no 'hue'"),
        ({"table_z_mm": -138.0, "object": {"shape": "coil", "x_mm": "a"}}, "x_mm is 'a'."),
    ],
)
def test_what_is_wrong_with_a_scene_is_named(scene: dict[str, object], said: str) -> None:
    # All of it was told, with a table that nobody had given, and not what was wrong.
    with pytest.raises(InputError, match=re.escape(said)):
        of_description(scene)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.2])
def test_the_robot_reaches_the_top_but_not_the_table(shape: str, scale: float) -> None:
    config = load()
    what = ScanObject(shape=shape, scale=scale, yaw_deg=30)
    scene = table_scene(config, what)
    tip_mm = config.geometry.tip_offset_mm
    with World(seed=1) as world:
        for solid in scene.solids:
            add_solid(world, solid)
        heights = {
            (x, y): world.surface_mm(x, y, bottom_mm=scene.table_z_mm - 1, top_mm=0)
            for x in range(0, 201, 4)
            for y in range(0, 201, 4)
        }
    top_mm = max(heights.values())
    assert top_mm == pytest.approx(scene.table_z_mm + what.height_mm, abs=0.5)
    assert -(config.geometry.free_length_mm + tip_mm) < top_mm
    assert top_mm < -(config.geometry.min_length_mm + tip_mm)
    # Away from the object there is only the table, and that is out of reach.
    assert heights[0, 0] == pytest.approx(scene.table_z_mm, abs=1e-3)
    assert heights[0, 0] < -(config.geometry.free_length_mm + tip_mm)
    for (x, y), z_mm in heights.items():
        if math.dist((x, y), (what.x_mm, what.y_mm)) > what.radius_mm:
            assert z_mm == pytest.approx(scene.table_z_mm, abs=1e-3), "the object is that small"


@pytest.mark.parametrize("shape", ["eraser", "orange"])
@pytest.mark.parametrize(
    ("extended_mm", "retracted_mm", "clearance_mm"), [(60.0, 0.0, 5.0), (0.0, 30.0, 8.0)]
)
def test_the_table_goes_with_the_lengths_of_the_scan(
    shape: str, extended_mm: float, retracted_mm: float, clearance_mm: float
) -> None:
    # The table stood just below the scan's extended tip: with a shorter extended_length_mm the
    # robot, which hangs at its free length first, pressed into it, and every scan was refused.
    config = load()
    lengths = dataclasses.replace(
        config.scan,
        extended_length_mm=extended_mm,
        retracted_length_mm=retracted_mm,
        clearance_mm=clearance_mm,
    )
    config = dataclasses.replace(config, scan=lengths)
    scene = table_scene(config, ScanObject(shape=shape))
    assert scene.object is not None
    over_table_mm = config.rest_reach_mm - scene.table_z_mm
    top_mm = scene.table_z_mm + scene.object.height_mm
    spare_mm = -(config.scan_lengths_mm[0] + config.geometry.tip_offset_mm) - top_mm
    assert over_table_mm == pytest.approx(3.0) or spare_mm == pytest.approx(clearance_mm)
    assert over_table_mm >= 3.0 - 1e-9
    assert spare_mm >= clearance_mm - 1e-9


def test_the_table_lies_below_the_largest_area_that_may_be_scanned() -> None:
    # It ended 500 mm from the first place. Beyond there was nothing, as deep as one may look, and
    # a study told "invalid value encountered in subtract".
    config = replaced(load(), {"scan.area_mm": [2000, 2000], "scan.step_mm": 100})
    scene = table_scene(config)
    far_mm = np.array(config.scan.area_mm[:1])
    assert surface.height_mm(scene.solids, far_mm, far_mm)[0] == scene.table_z_mm
    with pytest.raises(ConfigError, match="area_mm"):
        replaced(config, {"scan.area_mm": [2001, 2000]})


def test_an_area_may_be_an_array() -> None:
    # It ended with "truth value of an array is ambiguous".
    assert random_object("orange", 2, area_mm=np.array([140, 100])) == random_object(
        "orange", 2, area_mm=(140.0, 100.0)
    )


def test_bad_objects_are_refused() -> None:
    with pytest.raises(InputError, match="no object 'apple'"):
        ScanObject(shape="apple")
    with pytest.raises(InputError, match="its scale is 2"):
        ScanObject(shape="orange", scale=2)
    with pytest.raises(InputError, match="x_mm is nan"):
        dataclasses.replace(ScanObject(shape="orange"), x_mm=math.nan)
