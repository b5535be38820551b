"""An arm that something outside the world moves."""

from __future__ import annotations

import numpy as np
import pytest

from setae.sim import World

STEP_US = 20_000


def test_it_comes_after_its_leader_smoothly() -> None:
    """Late news of a real arm's place threw the simulated one about: the bristle felt it as a
    contact.
    """
    with World(seed=1) as world:
        world.start()
        heights_mm = []
        for step in range(200):
            # 50 mm/s downwards for a second; every third report is late.
            if step % 3:
                world.arm_follow((0, 0, -min(1.0 * step, 50.0)))
            world.run(world.now_us + STEP_US)
            heights_mm.append(world.arm_mm[2])
    speed_mm_s = np.diff(heights_mm) / (STEP_US / 1e6)
    acceleration_mm_s2 = np.diff(speed_mm_s) / (STEP_US / 1e6)
    assert heights_mm[-1] == pytest.approx(-50, abs=1e-3)
    assert heights_mm[40] == pytest.approx(-41 + 50 * 2 / 15, abs=1.5), "0.13 s behind"
    assert np.abs(acceleration_mm_s2).max() < 800
    assert max(heights_mm) <= 0
    assert min(heights_mm) > -50.5
