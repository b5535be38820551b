"""The adaptive scan on the simulated robot: what it makes of what slips away."""

from __future__ import annotations

from setae.config import load
from setae.experiments import scan
from setae.objects import random_object, table_scene


def test_what_was_touched_in_haste_and_not_found_again_is_lost() -> None:
    # On the edge of a coil, the bristle slid off when it came to measure: the place was empty, as
    # if nothing had been touched there.
    config = load()
    scene = table_scene(config, random_object("coil", 2))
    mark = scan.simulate(config, scene, mode="adaptive").height_map.mark
    assert [mark[row, column] for column, row in ((7, 14), (12, 13), (11, 16))] == ["lost"] * 3
