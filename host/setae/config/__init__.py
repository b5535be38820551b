"""The robot's description: what it measures, how its servos are set up, how it moves.

`load` reads TOML. A user's file gives only what differs from the paper's robot,
``robots/paper.toml``. Every key is checked; the unit is part of its name.
"""

from __future__ import annotations

from setae.config.experiments import Explore, Scan, Tube
from setae.config.geometry import Geometry
from setae.config.reading import load, loads, replaced
from setae.config.sections import (
    SERVOS,
    TENDON_MODELS,
    Bristle,
    Config,
    Motion,
    Servo,
    Spring,
    Stage,
    Ur,
)

__all__ = [
    "SERVOS",
    "TENDON_MODELS",
    "Bristle",
    "Config",
    "Explore",
    "Geometry",
    "Motion",
    "Scan",
    "Servo",
    "Spring",
    "Stage",
    "Tube",
    "Ur",
    "load",
    "loads",
    "replaced",
]
