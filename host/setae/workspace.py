"""What the robot can reach, what its tendons can hold, and why not.

Reaching is geometry: the spring's length, the bending angle, the servos' travel.
Holding is statics: tendons only pull, and bending costs compression, so some
poses that geometry allows need a tendon to push. Those are told apart: the
paper commands such poses, and the robot takes a shape near them.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from setae import tendons
from setae.arc import Arc, FloatArray
from setae.config import Config, Geometry
from setae.errors import UnreachableError

__all__ = [
    "Reach",
    "Reason",
    "check",
    "reachable_lengths_mm",
    "require",
    "servo_range_mm",
    "tensions_n",
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
    def holdable(self) -> npt.NDArray[np.bool_]:
        """Whether tendons that only pull can hold the pose, shape (...)."""
        return np.asarray((self.reasons & int(STATIC)) == 0)

    def explain(self, index: int | tuple[int, ...] = ()) -> tuple[str, ...]:
        """Say what is wrong with one pose, a sentence a reason, with figures."""
        index = index if isinstance(index, tuple) else (index,)
        geometry, servo = self.config.geometry, self.config.servo
        reasons = Reason(int(self.reasons[index]))
        length = float(self.arc.length_mm[index])
        bend = math.degrees(float(self.arc.theta_rad[index]))
        q, low, high = self.lengths_mm[index], *_tendon_range_mm(self.config)
        short, long = int(np.argmax(low - q)), int(np.argmax(q - high))
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
                f"A tendon would need {np.max(self.tensions_n[index]):.1f} N, and its servo "
                f"holds {servo.max_tension_n:g} N."
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
    servo = config.servo
    per_mm = us_per_mm(config) * np.array(servo.direction)
    free_us = np.array(servo.pulse_free_us)
    ends = np.stack(
        [
            config.geometry.free_length_mm - (np.array(end) - free_us) / per_mm
            for end in (servo.pulse_min_us, servo.pulse_max_us)
        ]
    )
    return ends.min(axis=0), ends.max(axis=0)


def us_per_mm(config: Config) -> FloatArray:
    """Find the change of each servo's pulse for a millimetre of tendon, shape (4,)."""
    mm_per_degree = config.geometry.pulley_radius_mm * math.pi / 180
    return np.array(config.servo.us_per_degree) / mm_per_degree


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
    tensions = tensions_n(arc, config)
    reasons |= np.where(np.isnan(tensions).any(axis=-1), int(Reason.NEEDS_PUSH), 0)
    with np.errstate(invalid="ignore"):
        tense = (tensions > config.servo.max_tension_n).any(axis=-1)
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


# ------------------------------------------------------------------------ statics


def tensions_n(arc: Arc, config: Config) -> FloatArray:
    """Compute the least tensions that hold poses, shape (..., n); NaN where none do.

    The spring as a linear beam, its stiffnesses constant per free length L₀, without
    weight or contact. The tendons' sum compresses it and their moment bends it::

        Σ T = k (L₀ − L)        Σ T d u = B Δ / L₀        T ≥ the least tension

    with B = k L₀ D²(1+ν) / (2(2+ν)), times the configuration's `bending_factor`. Of
    all solutions this is the one with the least sum of squares.

    Parameters
    ----------
    arc
        Of shape (...).
    config
        The robot.

    Examples
    --------
    >>> from setae import config
    >>> tensions_n(Arc(length_mm=50, bend_rad=(0, 0)), config.load()).round(6)
    array([1.1, 1.1, 1.1, 1.1])
    """
    geometry, spring = config.geometry, config.spring
    rate_n = spring.axial_rate_n_per_mm * geometry.free_length_mm
    nu = spring.poisson_ratio
    bending_n_mm2 = (
        spring.bending_factor * rate_n * spring.mean_diameter_mm**2 * (1 + nu) / (2 * (2 + nu))
    )
    moment_n_mm = bending_n_mm2 * arc.bend_rad / geometry.free_length_mm
    sum_n = spring.axial_rate_n_per_mm * (geometry.free_length_mm - arc.length_mm)

    angles = np.array(geometry.tendon_angles_rad)
    # Rows: sum, and the moment over d, so that all are in N.
    matrix = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)])
    load = np.concatenate([sum_n[..., np.newaxis], moment_n_mm / geometry.tendon_radius_mm], -1)
    # What is left once every tendon has its least tension.
    load = load - matrix.sum(axis=1) * config.servo.min_tension_n
    tolerance = 1e-9 * rate_n

    best = np.full((*arc.shape, len(angles)), np.nan)
    best_square = np.full(arc.shape, np.inf)
    for inverse, fit in _supports(geometry):
        candidate = load @ inverse.T
        miss = np.abs(load @ fit.T - load).max(axis=-1)
        square = np.sum(candidate**2, axis=-1)
        better = (
            (miss <= tolerance) & (candidate >= -tolerance).all(axis=-1) & (square < best_square)
        )
        best_square = np.where(better, square, best_square)
        best = np.where(better[..., np.newaxis], np.maximum(candidate, 0.0), best)
    return best + config.servo.min_tension_n


@lru_cache(maxsize=16)
def _supports(geometry: Geometry) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """The sets of tendons that may carry load alone, for the solution of least squares.

    It has the form T = max(0, λ₀ + λ·u), so the loaded tendons are neighbours on the
    circle: n² sets instead of 2ⁿ. For each, the matrix (n, 3) from load to tensions,
    and the one (3, 3) from load to the load that these tensions carry.
    """
    angles = np.array(geometry.tendon_angles_rad) % (2 * math.pi)
    order = np.argsort(angles, kind="stable")
    n = len(order)
    sets = {
        tuple(sorted(int(order[(first + i) % n]) for i in range(count)))
        for count in range(1, n + 1)
        for first in range(n)
    }
    supports = []
    for members in sorted(sets, key=lambda s: (len(s), s)):
        index = list(members)
        part = np.stack([np.ones(len(index)), np.cos(angles[index]), np.sin(angles[index])])
        inverse = np.zeros((n, 3))
        inverse[index] = np.linalg.pinv(part, rcond=1e-9)
        supports.append((inverse, part @ inverse[index]))
    return tuple(supports)
