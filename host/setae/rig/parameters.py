"""Every number of a simulated robot, as a table."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

from setae.config import Config
from setae.rig.assembly import simulator_parameters
from setae.sim import World, parameter_ranges

__all__ = ["ParameterRow", "simulator_table"]


class ParameterRow(NamedTuple):
    """One parameter of a simulated robot: what it is, is by default, and may be."""

    name: str
    value: float
    default: float
    least: float
    most: float


def simulator_table(config: Config, plant: str | None = None) -> tuple[ParameterRow, ...]:
    """List all parameters of a simulated robot, the configuration's or a named one.

    Raises
    ------
    InputError
        There is no such plant.
    SimulatorMissingError
        The simulator was not compiled.
    """
    named = config if plant is None else dataclasses.replace(config, plant=plant)
    values = simulator_parameters(named, 0)
    with World() as world:
        return tuple(
            ParameterRow(name, values.get(name, world.get(name)), world.get(name), least, most)
            for name, (least, most) in parameter_ranges().items()
        )
