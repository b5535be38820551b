"""Strings along the wall of a bore, and the rod between them, found without the simulator.

Each string is the shortest through many discs of the bore, by a general minimiser. What it
presses on the wall loads the rod of `shooting`, which takes another shape: again, until both
stay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.simulator import shooting
from tests.simulator.shooting import LENGTH_MM, Robot, advanced, compliance_of, rotation_of

from setae.sim import Truth

Array = npt.NDArray[np.float64]

_interpolate: Any = import_module("scipy.interpolate")  # without types
_optimize: Any = import_module("scipy.optimize")

STATIONS = 40
"""Discs, where the wall can press: four times as many as the simulator's."""

RADIUS_MM = 9.0

#: Touching coils are what the strong form can't say. Gravity is on.
EVEN = {"spring.solid_length_mm": 1.0}
UNEVEN = EVEN | {
    name: value
    for name, value in shooting.UNEVEN.items()
    if not name.startswith(("servo.", "tendon."))
}
#: One tendon pulls, and bends it by 75 to 85 degrees.
POSE_MM = (40.0, 60.0, 75.0, 60.0)

_ROUNDS = 40
_SETTLED_MM = 3e-3


@dataclass(frozen=True)
class Rod:
    """Centres, (n + 1, 3), and axes as columns, (n + 1, 3, 3), of the stations."""

    centre_mm: Array
    axes: Array


@dataclass(frozen=True)
class String:
    """The points of a string on the stations, (n + 1, 3), in each station's own frame."""

    local_mm: Array

    def points(self, rod: Rod) -> Array:
        """In frame D, (n + 1, 3)."""
        return np.asarray(rod.centre_mm + np.einsum("nij,nj->ni", rod.axes, self.local_mm))

    def length_mm(self, rod: Rod) -> float:
        """Its length."""
        return float(np.linalg.norm(np.diff(self.points(rod), axis=0), axis=1).sum())

    def pulls(self, rod: Rod) -> Array:
        """Force on each station for a tension of 1, in frame D, (n + 1, 3)."""
        pieces = np.diff(self.points(rod), axis=0)
        pieces /= np.linalg.norm(pieces, axis=1, keepdims=True)
        return np.vstack([pieces[:1], pieces[1:] - pieces[:-1], -pieces[-1:]])


def shortest(rod: Rod, base: Array, top: Array, start: Array | None) -> String:
    """The shortest string between two holes that passes each disc within its radius."""
    count = len(rod.centre_mm) - 2
    first = rod.centre_mm[0] + rod.axes[0] @ base
    last = rod.centre_mm[-1] + rod.axes[-1] @ top
    centre, axes = rod.centre_mm[1:-1], rod.axes[1:-1, :, :2]

    def points(where: Array) -> tuple[Array, Array, Array]:
        r, angle = where[:count], where[count:]
        out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        across = np.stack([-out[:, 1], out[:, 0]], axis=1)
        place = centre + np.einsum("nij,nj->ni", axes, r[:, None] * out)
        return np.vstack([first, place, last]), out, across

    def length(where: Array) -> tuple[float, Array]:
        string, out, across = points(where)
        pieces = np.diff(string, axis=0)
        size = np.linalg.norm(pieces, axis=1, keepdims=True)
        unit = pieces / size
        local = np.einsum("nij,ni->nj", axes, unit[:-1] - unit[1:])
        by_angle = where[:count] * (local * across).sum(axis=1)
        return float(size.sum()), np.concatenate([(local * out).sum(axis=1), by_angle])

    if start is None:
        angle = np.full(count, np.arctan2(base[1], base[0]))
        start = np.concatenate([np.full(count, 0.98 * np.hypot(*base[:2])), angle])
    bounds = [(0.5, RADIUS_MM)] * count + [(None, None)] * count
    found = _optimize.minimize(length, start, jac=True, method="L-BFGS-B", bounds=bounds,
                     options={"maxiter": 4000, "maxfun": 8000, "ftol": 1e-15, "gtol": 1e-7,
                              "maxcor": 40})  # fmt: skip
    r, angle = found.x[:count], found.x[count:]
    inner = np.stack([r * np.cos(angle), r * np.sin(angle), np.zeros(count)], axis=1)
    return String(np.vstack([base, inner, top]))


def polar(string: String) -> Array:
    """A start for `shortest` near a known string."""
    inner = string.local_mm[1:-1]
    return np.concatenate(
        [np.hypot(inner[:, 0], inner[:, 1]), np.arctan2(inner[:, 1], inner[:, 0])]
    )


def _integrate(robot: Robot, wrench: Array, loads: Array) -> tuple[Rod, Array, Array]:
    """The rod from its base, with a wrench on each station in its own frame, (n + 1, 6).

    Also force and moment that are left at its top: what pulls there must be as much.
    """
    force, moment = wrench[:3], wrench[3:]
    state = np.concatenate([np.zeros(3), [0, 0, 0, 1], moment])
    compliance = compliance_of(robot)
    h = LENGTH_MM / STATIONS
    centre, axes = np.zeros((STATIONS + 1, 3)), np.zeros((STATIONS + 1, 3, 3))
    axes[0] = np.eye(3)
    for step in range(STATIONS):
        state = advanced(robot, compliance, step * h, h, state, force)
        turn = rotation_of(state[3:7])
        centre[step + 1], axes[step + 1] = state[:3], turn
        if step + 1 < STATIONS:  # what the wall takes here, no station above has to carry
            force = force - turn @ loads[step + 1, :3]
            state[7:10] -= turn @ loads[step + 1, 3:]
    return Rod(centre, axes), force - robot.weight_n, state[7:10]


def _top(robot: Robot, rod: Rod, strings: list[String], tensions: Array) -> tuple[Array, Array]:
    """Force and moment about its centre that pull at the top."""
    turn = rod.axes[-1]
    pull = robot.load_n + robot.tip_weight_n
    twist = np.cross(robot.load_offset_mm * turn[:, 2], robot.load_n)
    for string, tension in zip(strings, tensions, strict=True):
        last = tension * string.pulls(rod)[-1]
        pull = pull + last
        twist = twist + np.cross(turn @ string.local_mm[-1], last)
    return pull, twist


def _loads(rod: Rod, strings: list[String], tensions: Array) -> Array:
    """What the strings do on each inner station, in its own frame, (n + 1, 6)."""
    loads = np.zeros((STATIONS + 1, 6))
    for string, tension in zip(strings, tensions, strict=True):
        force = tension * np.einsum("nji,nj->ni", rod.axes, string.pulls(rod))
        loads[1:-1, :3] += force[1:-1]
        loads[1:-1, 3:] += np.cross(string.local_mm, force)[1:-1]
    return loads


def _from(truth: Truth) -> Rod:
    """About the simulator's rod, where the search starts: its line, turned along without twist."""
    known = np.linspace(0, 1, len(truth.backbone_mm))
    where = np.linspace(0, 1, STATIONS + 1)
    spline = _interpolate.CubicSpline(known, truth.backbone_mm)
    centre, along = spline(where), spline(where, 1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axes = np.zeros((STATIONS + 1, 3, 3))
    x = np.array([1.0, 0.0, 0.0])
    for place, z in enumerate(along):
        x = x - (x @ z) * z
        x /= np.linalg.norm(x)
        axes[place] = np.stack([x, np.cross(z, x), z], axis=1)
    return Rod(centre, axes)


def solve(parameters: Mapping[str, float], truth: Truth) -> tuple[Array, Array, list[String], Rod]:
    """Position of the top, tensions, strings and rod at the lengths that the servos leave.

    The simulator's answer is only where the search starts.
    """
    robot, lengths_mm = Robot.of(parameters), truth.servo_length_mm
    rod = _from(truth)
    tensions = truth.tension_n.copy()
    strings = [shortest(rod, *ends, None) for ends in zip(robot.base, robot.top, strict=True)]
    wrench = np.zeros(6)
    wrench[:3] = robot.load_n + robot.tip_weight_n + robot.weight_n
    wrench[3:] = np.cross(rod.centre_mm[-1], robot.load_n + robot.tip_weight_n)
    wrench[3:] += np.cross(rod.centre_mm.mean(axis=0), robot.weight_n)
    for string, tension in zip(strings, tensions, strict=True):
        pull = tension * string.pulls(rod)[0]
        wrench -= np.concatenate([pull, np.cross(string.local_mm[0], pull)])
    unknown = np.concatenate([wrench, tensions])
    slopes: Array | None = None
    for _ in range(_ROUNDS):
        units = [_loads(rod, [string], np.ones(1)) for string in strings]

        def wrong(
            unknown: Array, strings: list[String] = strings, units: list[Array] = units
        ) -> tuple[Array, Rod]:
            wrench, tensions = unknown[:6], unknown[6:]
            loads = sum((t * unit for t, unit in zip(tensions, units, strict=True)), np.zeros(1))
            found, force, moment = _integrate(robot, wrench, loads)
            pull, twist = _top(robot, found, strings, tensions)
            long_mm = np.array([string.length_mm(found) for string in strings]) - lengths_mm
            slack = tensions - robot.tendon_n_per_mm * np.maximum(long_mm, 0)
            return np.concatenate([force - pull, 0.1 * (moment - twist), slack]), found

        unknown, found, slopes = _newton(wrong, unknown, slopes)
        moved_mm = np.abs(found.centre_mm - rod.centre_mm).max()
        rod, tensions = found, unknown[6:]
        strings = [
            shortest(rod, base, top, polar(string)) if tension > 0 else string
            for base, top, string, tension in zip(
                robot.base, robot.top, strings, tensions, strict=True
            )
        ]
        if moved_mm < _SETTLED_MM:
            return rod.centre_mm[-1], tensions, strings, rod
    raise AssertionError(f"the strings and the rod did not settle: {moved_mm:.4f} mm")


def _newton(
    wrong: Callable[[Array], tuple[Array, Rod]], unknown: Array, slopes: Array | None
) -> tuple[Array, Rod, Array]:
    """Newton's method, with the slopes of an earlier round as long as they do."""
    residual, rod = wrong(unknown)
    for _ in range(40):
        if np.abs(residual).max() < 1e-7:
            assert slopes is not None
            return unknown, rod, slopes
        if slopes is None:
            nudges = 1e-6 * np.eye(len(unknown))
            slopes = np.array([(wrong(unknown + nudge)[0] - residual) / 1e-6 for nudge in nudges]).T
            fresh = True
        else:
            fresh = False
        step = np.linalg.solve(slopes, residual)
        fraction = 1.0
        trial = wrong(unknown - step)
        if not fresh and not np.linalg.norm(trial[0]) < 0.3 * np.linalg.norm(residual):
            slopes = None
            continue
        while np.linalg.norm(trial[0]) >= np.linalg.norm(residual) and fraction > 1e-4:
            fraction *= 0.5
            trial = wrong(unknown - fraction * step)
        unknown = unknown - fraction * step
        residual, rod = trial
    raise AssertionError("the shooting method found no solution")
