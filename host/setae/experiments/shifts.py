"""Which imperfection moved the tip or jerked it: the same pulses on other robots.

On robots that lack one imperfection, and on robots that have only one: as in
`setae.experiments.causes`, these are two questions. What a robot without the one would do
differently is what a lab would see; what the one does alone tells which hide each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from setae.errors import SetaeError
from setae.rig import plants, replay
from setae.rig.replay import Played

__all__ = ["Shift", "Shifts", "find"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """What one imperfection does to the tip.

    Attributes
    ----------
    cause
        Its name, one of `setae.rig.plants.CAUSES`.
    here_mm
        (3,) frame D: from where the tip would be without it to where it is.
    alone_mm
        (3,) frame D: from where the robot ``ideal`` has its tip to where it has it
        with this alone.
    without_hpa
        `setae.rig.replay.Played.loudest_hpa` of the robot without it.
    """

    cause: str
    here_mm: Floats
    alone_mm: Floats
    without_hpa: float

    @property
    def size_mm(self) -> float:
        """How far it moves the tip."""
        return float(np.linalg.norm(self.here_mm))


@dataclass(frozen=True, slots=True, kw_only=True)
class Shifts:
    """What all of them do, at one moment.

    Attributes
    ----------
    here, ideal
        What the pulses led to on the robot itself, and on the robot ``ideal``.
    each
        What moves it furthest first.
    untold
        Causes of which nothing is known: without them, or with them alone, the simulated spring
        finds no equilibrium.
    """

    here: Played
    ideal: Played
    each: tuple[Shift, ...]
    untold: tuple[str, ...] = ()


def find(parameters: Mapping[str, float], seed: int, pulse_us: ArrayLike) -> Shifts:
    """Play pulses on a simulated robot, and on robots with other imperfections.

    Parameters
    ----------
    parameters
        The simulated robot's, by the simulator's own names. Those that belong to no cause
        are kept in all robots.
    seed
        The run's.
    pulse_us
        (n, 4) as in `setae.rig.replay.play`.

    Returns
    -------
    Shifts
        With the causes of which it can tell nothing by name.

    Raises
    ------
    SetaeError
        There is no simulator, or the robot itself finds no equilibrium.

    Examples
    --------
    >>> found = find({"plant.load_x_n": 0.2}, 0, [[850.0] * 4] * 20)
    >>> [shift.cause for shift in found.each], bool(found.each[0].here_mm[0] > 1)
    (['weight and load'], True)
    """
    parts = plants.by_cause(dict(parameters))
    imperfect = {name for part in parts.values() for name in part}
    common = {name: value for name, value in parameters.items() if name not in imperfect}
    here = replay.play(parameters, seed, pulse_us)
    ideal = replay.play(common, seed, pulse_us)
    each = []
    untold = []
    for cause, part in parts.items():
        without = {name: value for name, value in parameters.items() if name not in part}
        try:
            mended = replay.play(without, seed, pulse_us)
            alone = replay.play({**common, **part}, seed, pulse_us)
        except SetaeError:
            untold.append(cause)
            continue
        each.append(
            Shift(
                cause=cause,
                here_mm=here.tip_mm - mended.tip_mm,
                alone_mm=alone.tip_mm - ideal.tip_mm,
                without_hpa=mended.loudest_hpa,
            )
        )
    each.sort(key=lambda shift: -shift.size_mm)
    return Shifts(
        here=here,
        ideal=ideal,
        each=tuple(each),
        untold=tuple(untold),
    )
