"""Another plant in the place of the built-in spring: another simulator, or a robot elsewhere.

A plug-in is named ``python:module:factory``. The factory is called with the
configuration and the seed, and gives an object with a `Plant.step`. What the
board's own code does with the servos goes in, where the spring's top is comes out;
board, line, sensor, arm and solids stay the simulator's.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from setae.config import Config
from setae.errors import SetaeError

__all__ = ["PREFIX", "Answer", "Drive", "Factory", "Plant", "PluginError", "load"]

#: What the name of a plug-in begins with.
PREFIX = "python:"

Array = NDArray[np.float64]

# A rotation's columns may be this far from orthonormal: rounding, not a mistake.
_ORTHONORMAL = 1e-6


class PluginError(SetaeError):
    """A plant that was plugged in can't be used.

    Examples of when it happens: no such module or factory, an exception in it, an
    answer that is no pose.
    """

    default_remedy = "Mend the plug-in; `setae.sim.plugin` says what it has to do."


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What the servos do now.

    Attributes
    ----------
    time_s
        Virtual time since power-on; never goes back.
    attached
        Whether each servo has pulses, (4,).
    pulse_us
        What the board puts out, (4,); 0 where a servo has no pulses.
    pull_mm
        Tendon that simulated servos have wound up by now, (4,): with their speed,
        dead band and the named plant's imperfections.
    """

    time_s: float
    attached: tuple[bool, bool, bool, bool]
    pulse_us: Array
    pull_mm: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Where that brings the robot.

    Attributes
    ----------
    position_mm
        The spring's top U in frame D, (3,).
    rotation
        Frame U in frame D, (3, 3): its third column is where the bristle points.
    tension_n
        Tension of each tendon, (4,); None where nobody knows: zeros.
    pressure_hpa
        At the bristle's sensor against rest; None: the simulated bristle feels the
        simulated solids at this pose.
    """

    position_mm: Array
    rotation: Array
    tension_n: Array | None = None
    pressure_hpa: float | None = None


class Plant(Protocol):
    """What a factory makes."""

    def step(self, drive: Drive) -> Answer:
        """Go on to the drive's time and say where the robot is then.

        Called at power-on and at each sample of the pressure sensor, 75 a second.
        The answer holds until the next call. The simulator waits for it: a plant
        that is hardware sleeps until its own clock has come to ``time_s``.
        """


Factory: TypeAlias = Callable[[Config, int], Plant]


def load(name: str) -> Factory:
    """Find the factory that ``python:module:factory`` names.

    The module may lie in the present folder, or wherever Python finds modules.

    Raises
    ------
    PluginError
        The name, the module or the factory in it is no good; the message says which.
    """
    module_name, separator, factory_name = name.removeprefix(PREFIX).partition(":")
    if not (name.startswith(PREFIX) and separator and module_name and factory_name):
        raise PluginError(
            f"{name!r} names no plant.",
            "Give python:module:factory, such as python:my_robot:make.",
        )
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # whatever a foreign module does when it is imported
        raise PluginError(
            f"{name}: the module {module_name} can't be imported: {_told(error)}.",
            "Start setae in the module's folder, or name that in PYTHONPATH.",
        ) from error
    factory = getattr(module, factory_name, None)
    if not callable(factory):
        raise PluginError(
            f"{name}: the module {module_name} has no function {factory_name}.",
            "Give a function that is called with the configuration and the seed.",
        )
    made: Factory = factory
    return made


def make(name: str, config: Config, seed: int) -> Plant:
    """Make the plant that ``python:module:factory`` names.

    Raises
    ------
    PluginError
        As in `load`, or the factory fails.
    """
    factory = load(name)
    try:
        plant = factory(config, seed)
    except SetaeError:
        raise
    except Exception as error:  # whatever a foreign factory does
        raise PluginError(f"{name}: the factory failed: {_told(error)}.") from error
    if not callable(getattr(plant, "step", None)):
        raise PluginError(f"{name}: what the factory made, a {type(plant).__name__}, has no step.")
    return plant


def checked(answer: Answer) -> tuple[Array, Array, Array, float]:
    """Position, rotation, tensions and pressure (NaN for None) of an answer.

    Raises
    ------
    PluginError
        Something in it has a wrong shape, isn't finite, or is no rotation.
    """
    position = _array("position_mm", answer.position_mm, (3,))
    rotation = _array("rotation", answer.rotation, (3, 3))
    skew = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if skew > _ORTHONORMAL or np.linalg.det(rotation) < 0:
        raise PluginError("rotation is no rotation: its columns must be orthonormal, right-handed.")
    tension = np.zeros(4) if answer.tension_n is None else answer.tension_n
    pressure = answer.pressure_hpa
    if pressure is None:
        return position, rotation, _array("tension_n", tension, (4,)), np.nan
    return (
        position,
        rotation,
        _array("tension_n", tension, (4,)),
        float(_array("pressure_hpa", pressure, ())),
    )


def _array(name: str, value: object, shape: tuple[int, ...]) -> Array:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise PluginError(f"{name} is {value!r}: it must be numbers.") from None
    if array.shape != shape:
        raise PluginError(f"{name} has shape {array.shape}: it must be {shape}.")
    if not np.isfinite(array).all():
        raise PluginError(f"{name} is {array}: it must be finite.")
    return array


def _told(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".rstrip(".: ")
