"""How large the workspace is, and what takes poses away from it.

All shapes that the spring itself can have, from its shortest to its free length and
bent up to its limit, fill a body. Of that the robot loses what its servos' travel, the
length of its tendons, their tension and their slackness don't allow.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from setae import workspace
from setae.arc import Arc, FloatArray
from setae.config import Config
from setae.errors import InputError
from setae.workspace import Reach, Reason

__all__ = ["Fate", "Volume", "Volumes", "fates", "grid", "measure", "section"]

FateArray = npt.NDArray[np.int64]


class Fate(enum.IntEnum):
    """What becomes of a shape that the spring can have; the first that applies."""

    HELD = 0
    """Reached, and held by tendons that only pull."""
    SLACK = 1
    """Reached, but only a tendon that pushes could hold it: one would hang slack."""
    TENSION = 2
    """Reached, but a servo can't hold the tension for long."""
    LONG = 3
    """A tendon would have to be longer than the free spring: it would hang loose."""
    TRAVEL = 4
    """A servo can't wind, or give, that much tendon."""


@dataclass(frozen=True, slots=True)
class Volume:
    """A volume with the standard error of its sampling, both in cm³."""

    cm3: float
    error_cm3: float


@dataclass(frozen=True, slots=True)
class Volumes:
    """What `measure` found.

    Attributes
    ----------
    spring
        All that the spring's top can take.
    reachable
        Of that, what geometry and servos allow.
    held
        Of that, what tendons that only pull can hold.
    lost
        By what the rest is lost: every `Fate` but HELD.
    samples
        Number of poses that were looked at.
    """

    spring: Volume
    reachable: Volume
    held: Volume
    lost: Mapping[Fate, Volume]
    samples: int


def fates(reach: Reach) -> FateArray:
    """Tell the fate of poses that the spring can have, shape (...)."""
    config = reach.config
    low, high = workspace.servo_range_mm(config)
    q, reasons = reach.lengths_mm, reach.reasons
    # A tendon longer than the free spring is none that a servo should have given.
    high = np.where(high < config.geometry.free_length_mm, high, np.inf)
    beyond = ((q < low - workspace.TOLERANCE) | (q > high + workspace.TOLERANCE)).any(axis=-1)
    result = np.full(reasons.shape, int(Fate.HELD))
    for fate, found in (
        (Fate.SLACK, reasons & int(Reason.NEEDS_PUSH) != 0),
        (Fate.TENSION, reasons & int(Reason.TOO_TENSE) != 0),
        (Fate.LONG, reasons & int(Reason.TENDON_TOO_LONG) != 0),
        (Fate.TRAVEL, beyond),
    ):
        result = np.where(found, int(fate), result)
    return result


def measure(
    config: Config,
    model: str | None = None,
    *,
    cells: tuple[int, int, int] = (32, 28, 64),
    seed: int = 0,
) -> Volumes:
    """Measure the workspace of the spring's top by sampling.

    Length, bending and direction are cut into cells, and two random poses are taken
    in each: what the two differ by gives the error. A pose stands for
    L² (1 − cos θ)² / θ³ dL dθ dα of volume.

    Parameters
    ----------
    config
        The robot.
    model
        Tendon model; None takes the configuration's.
    cells
        Number along length, bending and direction.
    seed
        Of the random poses.

    Examples
    --------
    >>> from setae import config
    >>> volumes = measure(config.load(), "parallel", cells=(16, 12, 24))
    >>> round(volumes.spring.cm3), round(volumes.held.cm3)
    (177, 80)
    """
    if min(cells) < 1:
        raise InputError(f"cells is {cells}.", "Give three numbers from 1.")
    geometry = config.geometry
    random = np.random.default_rng(seed)
    place = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1)
    low = np.array([geometry.min_length_mm, 0.0, 0.0])
    width = np.array([geometry.free_length_mm, geometry.max_bend_rad, 2 * math.pi]) - low
    part = (place + random.random((2, *place.shape))) / np.array(cells)
    length, theta, alpha = np.moveaxis(low + part * width, -1, 0)
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    fate = fates(workspace.check(arc, config, model))
    # (1 − cos θ)² / θ³, without the loss of digits near 0.
    share = 2 * np.sin(theta / 2) ** 2
    weight = length**2 * share**2 / np.maximum(theta, 1e-9) ** 3
    weight *= np.prod(width / np.array(cells)) / 1e3

    def volume(counts: npt.NDArray[np.bool_]) -> Volume:
        value = np.where(counts, weight, 0.0)
        error = math.sqrt(float(np.sum((value[0] - value[1]) ** 2))) / 2
        return Volume(float(value.sum()) / 2, error)

    return Volumes(
        spring=volume(np.ones_like(fate, dtype=bool)),
        reachable=volume(fate <= int(Fate.TENSION)),
        held=volume(fate == int(Fate.HELD)),
        lost={kind: volume(fate == int(kind)) for kind in Fate if kind is not Fate.HELD},
        samples=fate.size,
    )


def grid(
    config: Config,
    alpha_rad: FloatArray,
    model: str | None = None,
    *,
    lengths: int = 40,
    bends: int = 32,
) -> tuple[FloatArray, FateArray]:
    """Find the fates of cells between bending directions.

    Parameters
    ----------
    config, model
        As in `measure`.
    alpha_rad : ndarray, shape (k + 1,)
        Where the cells begin and end.
    lengths, bends
        Cells along length and bending.

    Returns
    -------
    corners_mm : ndarray, shape (lengths + 1, bends + 1, k + 1, 3)
        Positions of the spring's top.
    fates : ndarray, shape (lengths, bends, k)
        Of the cells' middles.
    """
    geometry = config.geometry
    length = np.linspace(geometry.min_length_mm, geometry.free_length_mm, lengths + 1)
    theta = np.linspace(0.0, geometry.max_bend_rad, bends + 1)

    def arcs(*axes: FloatArray) -> Arc:
        values = np.meshgrid(*axes, indexing="ij")
        return Arc.from_angles(length_mm=values[0], theta_rad=values[1], alpha_rad=values[2])

    middles = arcs(*((axis[1:] + axis[:-1]) / 2 for axis in (length, theta, alpha_rad)))
    return arcs(length, theta, alpha_rad).top_mm, fates(workspace.check(middles, config, model))


def section(
    config: Config,
    alpha_rad: float,
    model: str | None = None,
    *,
    lengths: int = 150,
    bends: int = 120,
) -> tuple[FloatArray, FateArray]:
    """Cut the workspace in the plane of one bending direction, one side of the axis.

    Parameters
    ----------
    config, model, lengths, bends
        As in `grid`.
    alpha_rad
        Direction of the plane.

    Returns
    -------
    corners_mm : ndarray, shape (lengths + 1, bends + 1, 2)
        Distance from the axis, and height.
    fates : ndarray, shape (lengths, bends)
        Of the cells between.

    Examples
    --------
    >>> from setae import config
    >>> corners, fate = section(config.load(), 0.0, lengths=5, bends=4)
    >>> corners.shape, fate.shape, int(fate[0, 0])
    ((6, 5, 2), (5, 4), 0)
    """
    beside = np.array([alpha_rad - 1e-9, alpha_rad + 1e-9])
    corners, fate = grid(config, beside, model, lengths=lengths, bends=bends)
    corners = (corners[:, :, 0] + corners[:, :, 1]) / 2
    out = corners[..., 0] * math.cos(alpha_rad) + corners[..., 1] * math.sin(alpha_rad)
    return np.stack([out, corners[..., 2]], axis=-1), fate[..., 0]
