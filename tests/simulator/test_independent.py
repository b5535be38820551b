"""The plant against calculations that share nothing with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest

if TYPE_CHECKING:
    from tests.simulator.conftest import MakeDriver

Array = npt.NDArray[np.float64]

AXIAL_N = 0.22 * 70
BENDING = AXIAL_N * 19.5**2 * 1.3 / (2 * 2.3)
TORSION = AXIAL_N * 19.5**2 * 1.3 / 4
SHEAR_N = 2 * 1.3 * AXIAL_N
TENDON_N_PER_MM = 10.0
HOLES = 8.3 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])


def _rotation(q: Array) -> Array:
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _slope(state: Array, force: Array) -> Array:
    """Cosserat rod in strong form: position, quaternion, moment by reference length."""
    q, moment = state[3:7], state[7:10]
    rotation = _rotation(q)
    stretch = rotation.T @ force / [SHEAR_N, SHEAR_N, AXIAL_N] + [0, 0, 1]
    u = rotation.T @ moment / [BENDING, BENDING, TORSION]
    x, y, z, w = q
    turn = 0.5 * np.array(
        [
            w * u[0] + y * u[2] - z * u[1],
            w * u[1] + z * u[0] - x * u[2],
            w * u[2] + x * u[1] - y * u[0],
            -x * u[0] - y * u[1] - z * u[2],
        ]
    )
    climb = rotation @ stretch
    return np.concatenate([climb, turn, -np.cross(climb, force)])


def _shoot(wrench: Array, lengths_mm: Array) -> tuple[Array, Array, Array]:
    """Mismatch at the top, top position and tensions for a wrench at the base."""
    force, moment = wrench[:3], 10 * wrench[3:]
    state = np.concatenate([np.zeros(3), [0, 0, 0, 1], moment])
    steps = 40
    h = 70 / steps
    for _ in range(steps):  # Runge and Kutta
        a = _slope(state, force)
        b = _slope(state + 0.5 * h * a, force)
        c = _slope(state + 0.5 * h * b, force)
        d = _slope(state + h * c, force)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
    top, rotation = state[:3], _rotation(state[3:7])
    pull, twist = np.zeros(3), np.zeros(3)
    tensions = np.zeros(4)
    for i, hole in enumerate(HOLES):
        arm = rotation @ hole
        string = hole - (top + arm)
        length = float(np.linalg.norm(string))
        tensions[i] = TENDON_N_PER_MM * max(0.0, length - lengths_mm[i])
        pull += tensions[i] * string / length
        twist += np.cross(arm, tensions[i] * string / length)
    return np.concatenate([force - pull, 0.1 * (state[7:10] - twist)]), top, tensions


def _boundary_value(wrench: Array, lengths_mm: Array) -> tuple[Array, Array]:
    wrong, top, tensions = _shoot(wrench, lengths_mm)
    for _ in range(40):
        if np.abs(wrong).max() < 1e-7:
            return top, tensions
        columns = [
            (_shoot(wrench + nudge, lengths_mm)[0] - wrong) / 1e-6 for nudge in 1e-6 * np.eye(6)
        ]
        step = np.linalg.solve(np.array(columns).T, wrong)
        fraction = 1.0
        while fraction > 1e-4:
            trial = _shoot(wrench - fraction * step, lengths_mm)
            if np.linalg.norm(trial[0]) < np.linalg.norm(wrong):
                break
            fraction *= 0.5
        wrench = wrench - fraction * step
        wrong, top, tensions = trial
    raise AssertionError("the shooting method found no solution")


@pytest.mark.parametrize(
    "lengths_mm",
    [
        (50.0, 50.0, 50.0, 50.0),
        (48.0, 55.0, 62.0, 55.0),
        (60.0, 52.0, 50.0, 58.0),
        (40.0, 45.0, 50.0, 45.0),
        (52.0, 52.0, 70.0, 70.0),
        (44.0, 50.0, 62.0, 56.0),
    ],
)
def test_agrees_with_a_shooting_solver(
    make_driver: MakeDriver, lengths_mm: tuple[float, float, float, float]
) -> None:
    """Tendons free of the bore and no weight, as the strong form can say it.

    Measured: at most 0.008 mm at the tip and 0.03 N.
    """
    driver = make_driver(
        {"spring.bore_radius_mm": 60.0, "spring.solid_length_mm": 1.0, "plant.gravity_m_s2": 0.0}
    )
    truth = driver.pull(lengths_mm)
    top, rotation = truth.backbone_mm[-1], truth.rotation
    # The wrench at the base follows from the tensions; the solver only refines it.
    force, moment = np.zeros(3), np.zeros(3)
    for hole, tension in zip(HOLES, truth.tension_n, strict=True):
        at = top + rotation @ hole
        pull = tension * (hole - at) / np.linalg.norm(hole - at)
        force += pull
        moment += np.cross(at, pull)
    expected, tensions = _boundary_value(
        np.concatenate([force, 0.1 * moment]), truth.servo_length_mm
    )
    assert np.linalg.norm(top - expected) < 0.02
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
