"""A Cosserat rod in strong form between straight tendons, solved by shooting.

Shares nothing with the simulator: other unknowns, other equations, no energy. It knows
no bore, no touching coils and no friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from setae.sim import Truth

Array = npt.NDArray[np.float64]

LENGTH_MM = 70.0
AXIAL_N = 0.22 * LENGTH_MM
BENDING = AXIAL_N * 19.5**2 * 1.3 / (2 * 2.3)
TORSION = AXIAL_N * 19.5**2 * 1.3 / 4
SHEAR_N = 2 * 1.3 * AXIAL_N
STEPS = 40

#: What the strong form can't say, switched off in the simulator.
FREE = {
    "spring.bore_radius_mm": 60.0,
    "spring.solid_length_mm": 1.0,
    "tendon.friction": 0.0,
}

# Tendon lengths: straight, bent in and out of the planes of the tendons, some slack.
POSES_MM = (
    (50.0, 50.0, 50.0, 50.0), (35.0, 35.0, 35.0, 35.0), (48.0, 55.0, 62.0, 55.0),
    (60.0, 52.0, 50.0, 58.0), (40.0, 45.0, 50.0, 45.0), (52.0, 52.0, 70.0, 70.0),
    (45.0, 50.0, 60.0, 55.0), (66.0, 60.0, 54.0, 60.0), (55.0, 62.0, 65.0, 58.0),
    (46.0, 46.0, 54.0, 54.0), (58.0, 50.0, 50.0, 58.0), (50.0, 60.0, 68.0, 60.0),
    (44.0, 50.0, 62.0, 56.0),  # one tendon on the edge of slack
    (45.0, 60.0, 70.0, 60.0),  # bent by 75 degrees, the uneven robot by 86
    (35.2, 42.7, 38.8, 31.3),  # short, all four taut: bent in an S
)  # fmt: skip

# The same on a robot that is nowhere symmetric, with gravity from aside and a load beyond its tip.
UNEVEN = {
    "spring.bending_scale_x": 0.7, "spring.bending_scale_y": 0.9, "spring.bending_axis_deg": 30.0,
    "spring.stiffness_gradient": 0.2, "spring.shear_scale": 0.8, "servo.stiffness_n_per_mm": 15.0,
    "plant.load_x_n": 0.03, "plant.load_y_n": -0.02, "plant.load_z_n": 0.1,
    "plant.load_offset_mm": 20.0,
    "plant.gravity_tilt_deg": 60.0, "plant.gravity_azimuth_deg": 40.0,
    "tendon.base_radial_mm_0": -0.5, "tendon.base_tangential_mm_1": 0.4,
    "tendon.top_radial_mm_2": 0.3, "tendon.top_tangential_mm_3": -0.6,
}  # fmt: skip


@dataclass(frozen=True)
class Robot:
    """What the strong form needs of a robot, from the simulator's parameters."""

    bending: Array  # (2, 2), in the middle
    torsion: float
    shear_n: float
    gradient: float
    base: Array  # holes, (4, 3)
    top: Array
    tendon_n_per_mm: float
    load_n: Array
    load_offset_mm: float
    weight_n: Array  # of the spring, (3,)
    tip_weight_n: Array

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> Robot:
        """The default robot with some parameters changed."""
        axis = np.radians(parameters.get("spring.bending_axis_deg", 0.0))
        turn = np.array([[np.cos(axis), -np.sin(axis)], [np.sin(axis), np.cos(axis)]])
        scales = [parameters.get(f"spring.bending_scale_{axis}", 1.0) for axis in "xy"]

        def holes(plate: str) -> Array:
            result = np.zeros((4, 3))
            for i in range(4):
                out = np.array([np.cos(i * np.pi / 2), np.sin(i * np.pi / 2), 0.0])
                radial = parameters.get(f"tendon.{plate}_radial_mm_{i}", 0.0)
                tangential = parameters.get(f"tendon.{plate}_tangential_mm_{i}", 0.0)
                result[i] = (8.3 + radial) * out + tangential * np.array([-out[1], out[0], 0])
            return result

        tilt, azimuth = (
            np.radians(parameters.get(f"plant.gravity_{angle}_deg", 0.0))
            for angle in ("tilt", "azimuth")
        )
        down = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth),
                         np.cos(tilt)])  # fmt: skip
        gravity_n_per_g = 1e-3 * parameters.get("plant.gravity_m_s2", 9.81) * down
        line, servo = 10.0, parameters.get("servo.stiffness_n_per_mm", 1e6)
        return cls(
            bending=turn @ np.diag(BENDING * np.array(scales)) @ turn.T,
            torsion=TORSION,
            shear_n=SHEAR_N * parameters.get("spring.shear_scale", 1.0),
            gradient=parameters.get("spring.stiffness_gradient", 0.0),
            base=holes("base"),
            top=holes("top"),
            tendon_n_per_mm=line * servo / (line + servo),
            load_n=np.array([parameters.get(f"plant.load_{axis}_n", 0.0) for axis in "xyz"]),
            load_offset_mm=parameters.get("plant.load_offset_mm", 0.0),
            weight_n=25.0 * gravity_n_per_g,
            tip_weight_n=15.0 * gravity_n_per_g,
        )


def rotation_of(q: Array) -> Array:
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def slope(robot: Robot, compliance: Array, along: float, state: Array, force: Array) -> Array:
    """Position, quaternion and moment by reference length."""
    q, moment = state[3:7], state[7:10]
    rotation = rotation_of(q)
    force = force - along / LENGTH_MM * robot.weight_n  # what is above carries no more
    weight = 1 + robot.gradient * (2 * along / LENGTH_MM - 1)
    stretch = rotation.T @ force / [robot.shear_n, robot.shear_n, AXIAL_N] / weight + [0, 0, 1]
    u = compliance @ (rotation.T @ moment) / weight
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


def compliance_of(robot: Robot) -> Array:
    """Curvatures and twist by moments, in the middle of the rod."""
    compliance = np.zeros((3, 3))
    compliance[:2, :2] = np.linalg.inv(robot.bending)
    compliance[2, 2] = 1 / robot.torsion
    return compliance


def advanced(
    robot: Robot, compliance: Array, at_mm: float, step_mm: float, state: Array, force: Array
) -> Array:
    """The state a step of Runge and Kutta further up."""
    half_mm = 0.5 * step_mm
    a = slope(robot, compliance, at_mm, state, force)
    b = slope(robot, compliance, at_mm + half_mm, state + half_mm * a, force)
    c = slope(robot, compliance, at_mm + half_mm, state + half_mm * b, force)
    d = slope(robot, compliance, at_mm + step_mm, state + step_mm * c, force)
    return np.asarray(state + step_mm / 6 * (a + 2 * b + 2 * c + d))


def _shoot(
    robot: Robot, wrench: Array, lengths_mm: Array, rounding_mm: float = 0.0
) -> tuple[Array, Array, Array]:
    """Mismatch at the top, top position and tensions for a wrench at the base."""
    force, moment = wrench[:3], 10 * wrench[3:]
    compliance = compliance_of(robot)
    state = np.concatenate([np.zeros(3), [0, 0, 0, 1], moment])
    h = LENGTH_MM / STEPS
    for step in range(STEPS):
        state = advanced(robot, compliance, step * h, h, state, force)
    top, rotation = state[:3], rotation_of(state[3:7])
    pull = robot.load_n + robot.tip_weight_n
    twist = np.cross(robot.load_offset_mm * rotation[:, 2], robot.load_n)
    tensions = np.zeros(4)
    for i in range(4):
        arm = rotation @ robot.top[i]
        string = robot.base[i] - (top + arm)
        length = float(np.linalg.norm(string))
        stretch = length - lengths_mm[i]
        taut = rounding_mm * np.logaddexp(0.0, stretch / rounding_mm) if rounding_mm else stretch
        tensions[i] = robot.tendon_n_per_mm * max(0.0, taut)
        pull += tensions[i] * string / length
        twist += np.cross(arm, tensions[i] * string / length)
    force = force - robot.weight_n
    return np.concatenate([force - pull, 0.1 * (state[7:10] - twist)]), top, tensions


def solve(parameters: Mapping[str, float], truth: Truth) -> tuple[Array, Array]:
    """Position of the top, (3,), and tensions, (4,), at the lengths that the servos leave.

    The simulator's answer is only where the search starts: the wrench at the base
    follows from its tensions.
    """
    robot = Robot.of(parameters)
    lengths_mm = truth.servo_length_mm
    top, rotation = truth.backbone_mm[-1], truth.rotation
    force = robot.load_n + robot.tip_weight_n + robot.weight_n
    moment = np.cross(top + robot.load_offset_mm * rotation[:, 2], robot.load_n)
    moment += np.cross(top, robot.tip_weight_n)
    moment += np.cross(truth.backbone_mm.mean(axis=0), robot.weight_n)
    for base, hole, tension in zip(robot.base, robot.top, truth.tension_n, strict=True):
        at = top + rotation @ hole
        pull = tension * (base - at) / np.linalg.norm(base - at)
        force += pull
        moment += np.cross(at, pull)
    wrench = np.concatenate([force, 0.1 * moment])
    found = _newton(robot, wrench, lengths_mm, 0.0)
    if found is None:
        # Where a tendon is on the edge of slack Newton's steps go back and forth over it:
        # begin with that edge rounded.
        for rounding_mm in (0.03, 0.003, 0.0):
            found = _newton(robot, wrench, lengths_mm, rounding_mm)
            wrench = wrench if found is None else found[0]
    if found is None:
        raise AssertionError("the shooting method found no solution")
    return found[1:]


def _newton(
    robot: Robot, wrench: Array, lengths_mm: Array, rounding_mm: float
) -> tuple[Array, Array, Array] | None:
    """Wrench at the base, position of the top and tensions; None where it does not settle."""

    def shoot(wrench: Array) -> tuple[Array, Array, Array]:
        return _shoot(robot, wrench, lengths_mm, rounding_mm)

    wrong, expected, tensions = shoot(wrench)
    for _ in range(25):
        if np.abs(wrong).max() < 1e-6:
            return wrench, expected, tensions
        columns = [(shoot(wrench + nudge)[0] - wrong) / 1e-6 for nudge in 1e-6 * np.eye(6)]
        step = np.linalg.solve(np.array(columns).T, wrong)
        fraction = 1.0
        while fraction > 1e-4:
            trial = shoot(wrench - fraction * step)
            if np.linalg.norm(trial[0]) < np.linalg.norm(wrong):
                break
            fraction *= 0.5
        wrench = wrench - fraction * step
        wrong, expected, tensions = trial
    return None
