"""How exact the simulated spring is, and how fast."""

from __future__ import annotations

import time

import numpy as np
from tests.simulator import bore, shooting
from tests.simulator.conftest import QUIET, Driver

from setae.sim import World, plants

SAMPLES_PER_S = 75
TRAJECTORY_MM = ((20.0, 0.0, 50.0), (0.0, -25.0, 45.0), (10.0, 10.0, 60.0), (-15.0, 5.0, 40.0))


def worst_against_shooting_mm() -> tuple[float, int]:
    """Largest distance of the tip from the strong form's, and over how many poses."""
    errors_mm = []
    for parameters in (shooting.FREE, {**shooting.FREE, **shooting.UNEVEN}):
        with World(seed=1, parameters={**QUIET, **parameters}) as world:
            world.start()
            driver = Driver(world)
            for lengths_mm in shooting.POSES_MM:
                truth = driver.pull(lengths_mm, rest_s=0.5)
                expected_mm, _ = shooting.solve(parameters, truth)
                errors_mm.append(float(np.linalg.norm(truth.backbone_mm[-1] - expected_mm)))
    return max(errors_mm), len(errors_mm)


def worst_in_bore_mm() -> float:
    """Largest distance of the tip from the strong form's with tendons along the bore's wall."""
    errors_mm = []
    for parameters in (bore.EVEN, bore.UNEVEN):
        with World(seed=1, parameters={**QUIET, **parameters}) as world:
            world.start()
            truth = Driver(world).pull(bore.POSE_MM, rest_s=0.5)
            expected_mm, *_ = bore.solve(parameters, truth)
            errors_mm.append(float(np.linalg.norm(truth.backbone_mm[-1] - expected_mm)))
    return max(errors_mm)


def step_ms() -> float:
    """Processor time of a sample, along a trajectory of the robot with all imperfections."""
    with World(seed=1, parameters={**QUIET, **plants.parameters("paper_like")}) as world:
        world.start()
        driver = Driver(world)
        start_s, start_us = time.process_time(), world.now_us
        for position_mm in TRAJECTORY_MM:
            driver.reach(position_mm, duration_s=1.0)
        spent_s = time.process_time() - start_s
        return spent_s * 1e9 / ((world.now_us - start_us) * SAMPLES_PER_S)
