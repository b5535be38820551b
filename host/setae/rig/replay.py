"""The simulated spring without board, arm and solids, driven by pulses from a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from setae.sim import SimulationError, World
from setae_protocol.messages import SERVO_FRAME_US

__all__ = ["Played", "play"]

_LATELY_S = 0.5
_QUIET = {"sensor.noise_hpa": 0.0, "sensor.drift_hpa_per_sqrt_s": 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """What the pulses led to.

    Attributes
    ----------
    tip_mm
        (3,) the undeformed bristle's tip in frame D.
    loudest_hpa
        The largest pressure of the last half second, either way, that motion alone made.
    """

    tip_mm: NDArray[np.float64]
    loudest_hpa: float


def play(parameters: Mapping[str, float], seed: int, pulse_us: ArrayLike) -> Played:
    """Play pulses on a simulated robot that stands straight, and look what came of it.

    Parameters
    ----------
    parameters
        Of the simulator, by its own names.
    seed
        The run's; it draws the slip of each winding.
    pulse_us
        (n, 4) widths, a row each servo frame, from power-on to the moment in question; 0 for
        none. All of them, since friction, backlash and slip remember.

    Raises
    ------
    SimulationError
        The spring has no equilibrium, on the way or in the end.
    """
    with World(seed=seed, parameters={**dict(parameters), **_QUIET}) as world:
        world.start()
        world.remove_board()
        ambient_hpa = world.get("sensor.ambient_hpa")
        sample_us = 1e6 / world.get("sensor.rate_hz")
        heard_hpa = [0.0]
        for number, row in enumerate(np.asarray(pulse_us, dtype=float).tolist(), start=1):
            end_us = number * SERVO_FRAME_US
            while len(heard_hpa) * sample_us <= end_us:
                world.run(round(len(heard_hpa) * sample_us))
                heard_hpa.append(abs(world.sense() - ambient_hpa))
            world.run(end_us)
            for servo, width_us in enumerate(row):
                world.pulse(servo, width_us)
        lately = round(_LATELY_S * 1e6 / sample_us)
        truth = world.truth()
        if not truth.solved:  # then the tip is anywhere
            raise SimulationError(
                "The spring has no equilibrium where these pulses end.",
                "Play more of them, or fewer.",
            )
        return Played(tip_mm=np.array(truth.filament_mm[1]), loudest_hpa=max(heard_hpa[-lately:]))
