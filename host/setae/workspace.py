"""What the robot can reach, what its tendons can hold, and why not.

Reaching is geometry: the spring's length, the bending angle, the servos' travel.
Holding is statics: tendons only pull, and bending costs compression, so some
poses that geometry allows need a tendon to push. Those are told apart: the
paper commands such poses, and the robot takes a shape near them (`setae.statics`).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from setae import kinematics, pulley, statics, tendons
from setae.arc import Arc, FloatArray
from setae.config import Config
from setae.errors import UnreachableError

__all__ = [
    "Reach",
    "Reason",
    "check",
    "nearest_holdable",
    "reachable_lengths_mm",
    "require",
    "servo_range_mm",
]

TOLERANCE = 1e-6
"""Of lengths in mm and angles in rad: a target on the border counts as inside, in float32 too."""


class Reason(enum.IntFlag):
    """Why a pose can't be taken or held."""

    TOO_SHORT = enum.auto()
    """The spring would be compressed below its shortest length."""
    TOO_LONG = enum.auto()
    """The spring would be longer than free; tendons can't pull it out."""
    OVER_BENT = enum.auto()
    """The bending angle exceeds the largest."""
    TENDON_TOO_SHORT = enum.auto()
    """A servo can't wind its tendon up that far."""
    TENDON_TOO_LONG = enum.auto()
    """A tendon would be longer than the free spring or than its servo can give."""
    NEEDS_PUSH = enum.auto()
    """Only a tendon that pushes could hold the pose."""
    TOO_TENSE = enum.auto()
    """A tendon would need more tension than its servo can hold for long."""


STATIC = Reason.NEEDS_PUSH | Reason.TOO_TENSE
"""The reasons that concern holding, not reaching."""


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """What `check` found, for poses of shape (...).

    Attributes
    ----------
    arc : Arc
        The poses.
    lengths_mm : ndarray, shape (..., n)
        Tendon lengths.
    tensions_n : ndarray, shape (..., n)
        Least tensions that hold the pose; NaN where none do.
    reasons : ndarray of int, shape (...)
        A combination of `Reason`; 0 where nothing is wrong.
    """

    arc: Arc
    lengths_mm: FloatArray
    tensions_n: FloatArray
    reasons: npt.NDArray[np.int64]
    config: Config

    @property
    def reachable(self) -> npt.NDArray[np.bool_]:
        """Whether geometry and servos allow the pose, shape (...)."""
        return np.asarray((self.reasons & ~int(STATIC)) == 0)

    @property
    def settled(self) -> statics.Settled:
        """Where the spring comes to rest with these tendon lengths, and what hangs slack."""
        return statics.settle(self.lengths_mm, self.config)

    @property
    def holdable(self) -> npt.NDArray[np.bool_]:
        """Whether tendons that only pull can hold the pose, shape (...)."""
        return np.asarray((self.reasons & int(STATIC)) == 0)

    def explain(self, index: int | tuple[int, ...] = ()) -> tuple[str, ...]:
        """Say what is wrong with one pose, a sentence a reason, with figures."""
        index = index if isinstance(index, tuple) else (index,)
        geometry = self.config.geometry
        reasons = Reason(int(self.reasons[index]))
        length = float(self.arc.length_mm[index])
        bend = math.degrees(float(self.arc.theta_rad[index]))
        q, low, high = self.lengths_mm[index], *_tendon_range_mm(self.config)
        short, long = int(np.argmax(low - q)), int(np.argmax(q - high))
        tensions, most_n = np.nan_to_num(self.tensions_n[index]), statics.max_tension_n(self.config)
        tense = int(np.argmax(tensions - most_n))
        sentences = {
            Reason.TOO_SHORT: (
                f"The spring would be {length:.2f} mm long, and its shortest length is "
                f"{geometry.min_length_mm:g} mm."
            ),
            Reason.TOO_LONG: (
                f"The spring would be {length:.2f} mm long, and it is "
                f"{geometry.free_length_mm:g} mm long when free."
            ),
            Reason.OVER_BENT: (
                f"The spring would be bent by {bend:.1f}°, and at most "
                f"{math.degrees(geometry.max_bend_rad):g}° are allowed."
            ),
            Reason.TENDON_TOO_SHORT: (
                f"Tendon {short} would be {q[short]:.2f} mm long, and its servo can wind it "
                f"to {low[short]:.2f} mm."
            ),
            Reason.TENDON_TOO_LONG: (
                f"Tendon {long} would be {q[long]:.2f} mm long, and at most "
                f"{high[long]:.2f} mm are possible."
            ),
            Reason.NEEDS_PUSH: (
                f"Bending by {bend:.1f}° compresses the spring below {length:.2f} mm: only a "
                "tendon that pushes could hold this pose."
            ),
            Reason.TOO_TENSE: (
                f"Tendon {tense} would need {tensions[tense]:.1f} N, and its servo holds "
                f"{most_n[tense]:.1f} N for long."
            ),
        }
        return tuple(text for reason, text in sentences.items() if reason in reasons)


def servo_range_mm(config: Config) -> tuple[FloatArray, FloatArray]:
    """Find the shortest and the longest tendon that each servo can give, shapes (4,).

    Examples
    --------
    >>> from setae import config
    >>> shortest, longest = servo_range_mm(config.load())
    >>> longest.round(1)
    array([71.1, 71.1, 71.1, 71.1])
    """
    least, most = pulley.travel_mm(config)
    return config.geometry.free_length_mm - most, config.geometry.free_length_mm - least


def _tendon_range_mm(config: Config) -> tuple[FloatArray, FloatArray]:
    low, high = servo_range_mm(config)
    # No pose needs a tendon longer than the free spring: it would only hang. With this
    # rule exactly 34 of the paper's 63 targets are reachable, as it reports.
    return np.maximum(low, 0.0), np.minimum(high, config.geometry.free_length_mm)


def check(arc: Arc, config: Config, model: str | None = None) -> Reach:
    """Check whether the robot can reach and hold poses.

    Parameters
    ----------
    arc
        Of shape (...).
    config
        The robot.
    model
        Tendon model; None takes the configuration's.

    Returns
    -------
    Reach
        One answer a pose, with the reasons.

    Examples
    --------
    >>> from setae import config, kinematics
    >>> reach = check(kinematics.inverse([(15, 0, 60), (0, 0, 75)]), config.load())
    >>> reach.reachable
    array([ True, False])
    >>> reach.explain(1)[0]
    'The spring would be 75.00 mm long, and it is 70 mm long when free.'
    """
    q, reasons = _reach(arc, config, model or config.motion.model)
    tensions = statics.tensions_n(arc, config)
    reasons |= np.where(np.isnan(tensions).any(axis=-1), int(Reason.NEEDS_PUSH), 0)
    with np.errstate(invalid="ignore"):
        tense = (tensions > statics.max_tension_n(config) + TOLERANCE).any(axis=-1)
    reasons |= np.where(tense, int(Reason.TOO_TENSE), 0)
    return Reach(arc, q, tensions, reasons, config)


def reachable_lengths_mm(arc: Arc, config: Config, model: str) -> FloatArray:
    """Compute the tendon lengths of those poses that are reachable, shape (p, n)."""
    q, reasons = _reach(arc, config, model)
    return np.asarray(q[reasons == 0])


def _reach(arc: Arc, config: Config, model: str) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Tendon lengths, and the reasons that concern reaching."""
    geometry = config.geometry
    q = tendons.model(model).lengths(arc, geometry)
    low, high = _tendon_range_mm(config)
    findings = {
        Reason.TOO_SHORT: arc.length_mm < geometry.min_length_mm - TOLERANCE,
        Reason.TOO_LONG: arc.length_mm > geometry.free_length_mm + TOLERANCE,
        Reason.OVER_BENT: arc.theta_rad > geometry.max_bend_rad + TOLERANCE,
        Reason.TENDON_TOO_SHORT: (q < low - TOLERANCE).any(axis=-1),
        Reason.TENDON_TOO_LONG: (q > high + TOLERANCE).any(axis=-1),
    }
    reasons = np.zeros(arc.shape, dtype=np.int64)
    for reason, found in findings.items():
        reasons |= np.where(found, int(reason), 0)
    return q, reasons


def require(
    arc: Arc, config: Config, model: str | None = None, *, holdable: bool = False
) -> FloatArray:
    """Compute tendon lengths of poses that must be reachable.

    Parameters
    ----------
    arc, config, model
        As in `check`.
    holdable
        Refuse poses too that tendons can't hold. The paper doesn't, and the
        robot then takes a shape near them.

    Returns
    -------
    ndarray, shape (..., n)
        Tendon lengths in mm.

    Raises
    ------
    UnreachableError
        Says what is wrong with the first bad pose, with figures.

    Examples
    --------
    >>> from setae import config, kinematics
    >>> require(kinematics.inverse((0, 0, 19)), config.load())
    Traceback (most recent call last):
    ...
    setae.errors.UnreachableError: The spring would be 19.00 mm long, and its shortest length is 20 mm. Choose a target inside the workspace.
    """  # noqa: E501  # the message as it is
    reach = check(arc, config, model)
    bad = ~reach.reachable
    if holdable:
        bad |= ~reach.holdable
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        where = f"Target {list(first) if len(first) > 1 else first[0]}: " if first else ""
        reasons = reach.explain(first)
        if not holdable:
            kept = len(reasons) - (Reason(int(reach.reasons[first])) & STATIC).bit_count()
            reasons = reasons[:kept]
        raise UnreachableError(where + " ".join(reasons), "Choose a target inside the workspace.")
    return reach.lengths_mm


# ------------------------------------------------------------------------- nearest


def nearest_holdable(arc: Arc, config: Config, model: str | None = None) -> Arc:
    """Find the poses nearest to given ones that the robot can reach and hold.

    Nearest by the distance of the spring's top U, from the given pose's side: where
    the workspace isn't convex there may be another pose as near.

    Parameters
    ----------
    arc, config, model
        As in `check`.

    Returns
    -------
    Arc
        Of the same shape. Poses that can be held come back as they are.

    Raises
    ------
    UnreachableError
        Not even a straight pose can be held: preload and torque leave nothing.

    Examples
    --------
    >>> from setae import config, kinematics
    >>> pose = nearest_holdable(kinematics.inverse((12, 12, 60)), config.load())
    >>> pose.top_mm.round(2)
    array([10.59, 10.59, 58.26])
    """

    def good(poses: Arc) -> npt.NDArray[np.bool_]:
        reach = check(poses, config, model)
        return np.asarray(reach.reachable & reach.holdable)

    shape = arc.shape
    flat = arc[np.newaxis] if shape == () else arc
    wanted = Arc(length_mm=flat.length_mm.ravel(), bend_rad=flat.bend_rad.reshape(-1, 2))
    point = _point(wanted)
    bad = ~good(wanted)
    if bad.any():
        start = _straight(good, config)
        found = _project(wanted[bad], config, model or config.motion.model)
        # What rounding, or a jump of the tendon rule, leaves outside, goes back inside.
        inside, outside = np.zeros(len(found)), np.ones(len(found))
        outside[good(_arc(found))] = 0.0
        inside[outside == 0] = 1.0
        for _ in range(50):
            part = (inside + outside) / 2
            ok = good(_arc(start + part[:, np.newaxis] * (found - start)))
            inside = np.where(ok & (outside > 0), part, inside)
            outside = np.where(ok, outside, np.where(outside > 0, part, 0.0))
        point[bad] = start + inside[:, np.newaxis] * (found - start)
    return Arc(length_mm=point[:, 0].reshape(shape), bend_rad=point[:, 1:].reshape(*shape, 2))


def _point(arc: Arc) -> FloatArray:
    return np.concatenate([arc.length_mm[..., np.newaxis], arc.bend_rad], axis=-1)


def _arc(point: FloatArray) -> Arc:
    return Arc(length_mm=point[..., 0], bend_rad=point[..., 1:])


def _straight(good: Callable[[Arc], npt.NDArray[np.bool_]], config: Config) -> FloatArray:
    """A straight pose that can be held, in the middle of those, as (L, Δ)."""
    length = np.linspace(config.geometry.min_length_mm, config.geometry.free_length_mm, 401)
    straight = np.stack([length, 0 * length, 0 * length], axis=-1)
    held = np.flatnonzero(good(_arc(straight)))
    if not len(held):
        raise UnreachableError(
            "No straight pose can be held.", "Check min_tension_n and stall_torque_n_m in [servo]."
        )
    return np.asarray(straight[held[len(held) // 2]])


def _project(arc: Arc, config: Config, model: str) -> FloatArray:
    """Nearest points (p, 3) of (L, Δ) within all limits, to first order at the end.

    Gauss-Newton: in each round the position and the tendon lengths count as linear
    about the last point, and the nearest one within the then linear limits is found.
    """
    geometry = config.geometry
    target = arc.top_mm
    point = _point(arc)
    point[:, 0] = np.clip(point[:, 0], geometry.min_length_mm, geometry.free_length_mm)
    low, high = _tendon_range_mm(config)
    fixed, fixed_most = statics.bounds(config)
    ends = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    ends_most = np.array([geometry.free_length_mm, -geometry.min_length_mm])
    rule = tendons.model(model)
    count = len(point)
    for _ in range(40):
        here_arc = _arc(point)
        top, lengths = here_arc.top_mm, rule.lengths(here_arc, geometry)
        by_top = kinematics.jacobian(here_arc)
        by_length = rule.derivative(here_arc, geometry)
        theta = np.hypot(point[:, 1], point[:, 2])
        out = point[:, 1:] / np.maximum(theta, 1e-12)[:, np.newaxis]
        bend = np.concatenate([np.zeros((count, 1)), out], axis=-1)
        here = np.einsum("pna,pa->pn", by_length, point)
        rows = np.concatenate(
            [
                np.broadcast_to(fixed, (count, *fixed.shape)),
                np.broadcast_to(ends, (count, 2, 3)),
                bend[:, np.newaxis],
                by_length,
                -by_length,
            ],
            axis=1,
        )
        most = np.concatenate(
            [
                np.broadcast_to(fixed_most, (count, len(fixed_most))),
                np.broadcast_to(ends_most, (count, 2)),
                np.full((count, 1), geometry.max_bend_rad),
                high - lengths + here,
                lengths - low - here,
            ],
            axis=1,
        )
        metric = np.swapaxes(by_top, -1, -2) @ by_top
        free = point + np.linalg.solve(by_top, (target - top)[..., np.newaxis])[..., 0]
        moved = _nearest_within(free, metric, rows, most)
        moved[:, 0] = np.clip(moved[:, 0], geometry.min_length_mm, geometry.free_length_mm)
        change = np.abs(moved - point).max()
        point = moved
        if change < 1e-9:
            break
    return point


def _nearest_within(
    wanted: FloatArray, metric: FloatArray, rows: FloatArray, most: FloatArray
) -> FloatArray:
    """Project onto rows @ x <= most by Hildreth's method: (p, 3), (p, 3, 3), (p, m, 3), (p, m)."""
    inverse = np.linalg.inv(metric)
    across = np.einsum("pab,pmb->pma", inverse, rows)
    size = np.maximum(np.einsum("pma,pma->pm", rows, across), 1e-300)
    force = np.zeros(most.shape)
    point = wanted.copy()
    used = np.zeros(most.shape[1], dtype=bool)
    while True:
        # Few limits matter: those that are exceeded so far.
        beyond = np.einsum("pma,pa->pm", rows, point) - most
        new = (beyond > 1e-11).any(axis=0) & ~used
        if not new.any():
            return point
        used |= new
        for _ in range(400):
            before = point.copy()
            for row in np.flatnonzero(used):
                over = (rows[:, row] * point).sum(axis=-1) - most[:, row]
                change = np.maximum(over / size[:, row], -force[:, row])
                force[:, row] += change
                point -= change[:, np.newaxis] * across[:, row]
            if np.abs(point - before).max() < 1e-12:
                break
