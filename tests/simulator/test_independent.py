"""The plant against calculations that share nothing with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest
from tests.simulator import shooting

if TYPE_CHECKING:
    from tests.simulator.conftest import MakeDriver

Array = npt.NDArray[np.float64]

TENDON_N_PER_MM = 10.0


@pytest.mark.parametrize("uneven", [False, True])
def test_agrees_with_a_shooting_solver(make_driver: MakeDriver, uneven: bool) -> None:
    """24 poses, in and out of the tendons' planes, half of them of a robot without symmetry.

    Measured: at most 0.02 mm at the tip and 0.03 N.
    """
    parameters = {**shooting.FREE, **(shooting.UNEVEN if uneven else {})}
    driver = make_driver(parameters)
    for lengths_mm in shooting.POSES_MM:
        truth = driver.pull(lengths_mm)
        expected, tensions = shooting.solve(parameters, truth)
        assert np.linalg.norm(truth.backbone_mm[-1] - expected) < 0.05
        assert truth.tension_n == pytest.approx(tensions, abs=0.05)


@pytest.mark.parametrize("short_mm", [40.0, 46.0, 52.0])
def test_a_tendon_takes_the_shortest_way_through_the_bore(
    make_driver: MakeDriver, short_mm: float
) -> None:
    """Tendon 0 in the plane of bending, found again by relaxation in that plane."""
    driver = make_driver({"plant.gravity_m_s2": 0.0})
    truth = driver.pull([short_mm, 60.0, 75.0, 60.0])
    path_mm = truth.servo_length_mm[0] + truth.tension_n[0] / TENDON_N_PER_MM

    points = truth.backbone_mm[:, [0, 2]]
    inner = range(2, 20, 2)  # the stations; the points between give their directions
    centres = points[list(inner)]
    along = np.array([points[i + 1] - points[i - 1] for i in inner])
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    top = truth.rotation[[0, 2]][:, [0, 2]] @ [8.3, 0] + points[-1]
    ends = np.array([[8.3, 0.0], top])
    offset = np.full(len(centres), 8.3)

    def string(offset: Array) -> Array:
        return np.vstack([ends[:1], centres + offset[:, None] * across, ends[1:]])

    for _ in range(20_000):
        steps = np.diff(string(offset), axis=0)
        unit = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        uphill = ((unit[:-1] - unit[1:]) * across).sum(axis=1)
        offset = np.clip(offset - 1.0 * uphill, -9, 9)
    shortest_mm = np.linalg.norm(np.diff(string(offset), axis=0), axis=1).sum()
    straight_mm = np.linalg.norm(ends[1] - ends[0])
    assert shortest_mm > straight_mm + 0.05  # the bore is in the way
    assert path_mm == pytest.approx(shortest_mm, abs=0.005)
