"""What an imperfection did to the tip, where the simulated spring finds no equilibrium."""

from __future__ import annotations

import dataclasses

import pytest

from setae.experiments import shifts
from setae.sim import SimulationError, Truth, World

PULSES_US = [[850.0] * 4] * 5
LOAD = {"plant.load_x_n": 0.2}
truth = World.truth


def test_a_replay_that_ends_unsolved_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the spring was then counted as where it hung; and the cause was not named."""

    def unsolved_by_load_alone(world: World) -> Truth:
        found = truth(world)
        lost = world.get("plant.load_x_n") and not world.get("tendon.winding_error_0")
        return dataclasses.replace(found, plant_residual=0.5) if lost else found

    monkeypatch.setattr(World, "truth", unsolved_by_load_alone)
    with pytest.raises(SimulationError, match="no equilibrium"):
        shifts.find(LOAD, 0, PULSES_US)
    found = shifts.find({**LOAD, "tendon.winding_error_0": 0.01}, 0, PULSES_US)
    assert found.each == ()
    assert set(found.untold) == {"weight and load", "winding gain"}
