"""How fast positions become tendon lengths."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray
from setae.config import Geometry

POSES = 100_000
RUNS = 21
SINGLE_CALLS = 1000
SEED = 20250102

GEOMETRY = Geometry()


def poses_per_s(model: str) -> float:
    """Inverse kinematics and tendon lengths of an array of poses, median of `RUNS`."""
    positions = _positions()

    def run() -> None:
        tendons.lengths(kinematics.inverse(positions), GEOMETRY, model)

    return POSES / _median_s(run)


def single_us(model: str) -> float:
    """The same for one pose, from a tuple of three numbers, median of `RUNS`."""
    position = (15.0, 4.0, 60.0)

    def run() -> None:
        for _ in range(SINGLE_CALLS):
            tendons.lengths(kinematics.inverse(position), GEOMETRY, model)

    return _median_s(run) / SINGLE_CALLS * 1e6


def _positions() -> FloatArray:
    """Poses all over the workspace, shape (POSES, 3)."""
    random = np.random.default_rng(SEED)
    arc = Arc.from_angles(
        length_mm=random.uniform(GEOMETRY.min_length_mm, GEOMETRY.free_length_mm, POSES),
        theta_rad=random.uniform(0.0, GEOMETRY.max_bend_rad, POSES),
        alpha_rad=random.uniform(-np.pi, np.pi, POSES),
    )
    return kinematics.position(arc)


def _median_s(run: Callable[[], None]) -> float:
    with _one_core():
        run()  # tables are made, memory is there
        times = []
        for _ in range(RUNS):
            start = time.perf_counter()
            run()
            times.append(time.perf_counter() - start)
    return statistics.median(times)


@contextmanager
def _one_core() -> Iterator[None]:
    """Keep this process on one core, where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
