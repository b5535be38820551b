"""The paper's 145 targets, on which it measured how exactly the robot goes where it is sent.

Nine straight poses, 30 to 70 mm long, and in each of the directions +X, -X, +Y and
-Y those of 63 combinations of height (40 to 70 mm) and bending (10° to 90°) that the
robot reaches. The paper tested 34 of the 63 and doesn't say which; with the tendons
8.3 mm from the axis exactly 34 need no tendon longer than the free spring
(`setae.workspace`). That is an inference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from setae import kinematics, tendons, workspace
from setae.arc import Arc, FloatArray
from setae.config import Config
from setae.errors import InputError

__all__ = [
    "COMPRESSION",
    "COUPLED",
    "GROUPS",
    "Target",
    "choose",
    "combinations",
    "commanded_lengths_mm",
    "find",
    "paper_targets",
]

COMPRESSION: Final = "compression"
COUPLED: Final = ("+X", "-X", "+Y", "-Y")
GROUPS: Final = (COMPRESSION, *COUPLED)

_ALPHA_RAD: Final = dict(zip(COUPLED, (0.0, math.pi, math.pi / 2, 1.5 * math.pi), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One commanded pose.

    Attributes
    ----------
    group
        One of `GROUPS`.
    height_mm
        Height z of the spring's top in frame D.
    bend_deg
        Bending angle θ.
    position_mm
        Of the spring's top in frame D.
    """

    group: str
    height_mm: float
    bend_deg: float
    position_mm: tuple[float, float, float]

    @property
    def label(self) -> str:
        """Name in logs, tables and files of measurements, such as ``+X z40 b10``."""
        if self.group == COMPRESSION:
            return f"C z{self.height_mm:g}"
        return f"{self.group} z{self.height_mm:g} b{self.bend_deg:g}"

    @property
    def lateral_axis(self) -> int:
        """Axis of frame D in which it bends: 0 for x, 1 for y. Straight poses count as x."""
        return 1 if self.group in ("+Y", "-Y") else 0


def combinations() -> Arc:
    """The paper's 63 combinations of height and bending, shape (7, 9), towards α = 0."""
    z, theta = np.meshgrid(
        np.arange(40.0, 71.0, 5.0), np.radians(np.arange(10, 91, 10)), indexing="ij"
    )
    return Arc.from_angles(length_mm=z * theta / np.sin(theta), theta_rad=theta, alpha_rad=0.0)


def paper_targets(config: Config) -> tuple[Target, ...]:
    """All targets, by group, then height, then bending.

    Raises
    ------
    InputError
        The robot reaches none of the bent ones.

    Examples
    --------
    >>> from setae.config import load
    >>> targets = paper_targets(load())
    >>> len(targets), targets[0].label, targets[9].label, targets[-1].label
    (145, 'C z30', '+X z40 b10', '-Y z65 b20')
    """
    straight = [
        Target(group=COMPRESSION, height_mm=z, bend_deg=0.0, position_mm=(0.0, 0.0, z))
        for z in (30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0)
    ]
    arc = combinations()
    reached = workspace.check(arc, config, "paper").reachable
    if not reached.any():
        raise InputError(
            "This robot reaches none of the paper's bent targets.", "Check its [geometry]."
        )
    bent = [
        Target(
            group=group,
            height_mm=float(round(top[2], 6)),
            bend_deg=float(round(math.degrees(theta), 6)),
            position_mm=_towards(group, float(top[0]), float(top[2])),
        )
        for group in COUPLED
        for top, theta in zip(arc.top_mm[reached], arc.theta_rad[reached], strict=True)
    ]
    return (*straight, *bent)


def _towards(group: str, lateral_mm: float, height_mm: float) -> tuple[float, float, float]:
    aside = lateral_mm if group[0] == "+" else -lateral_mm
    return (aside, 0.0, height_mm) if group[1] == "X" else (0.0, aside, height_mm)


# Bending by pull alone compresses the spring, by so much a radian (stiffness of bending over
# that of the spring's length and the tendons' distance from the axis).
_COMPRESSED_MM_PER_RAD: Final = 13.0

# Where each group begins to sample its targets, in parts of the way from one to the next: one
# behind the other, so that few of each direction still stand for easy and hard ones together.
_PHASES: Final = dict(zip(GROUPS, (0.5, 0.625, 0.875, 0.125, 0.375), strict=True))


def choose(targets: Sequence[Target], count: int) -> tuple[Target, ...]:
    """Choose so many targets that stand for all; a group keeps one at least.

    What a target costs follows from how far a pull alone falls short of it: two of the 34 bent
    poses err by 15 to 20 mm where the others err by 4. So each group is sorted by that and
    sampled at equal steps, the groups out of step with one another.

    Raises
    ------
    InputError
        Fewer than one a group, or more than there are.

    Examples
    --------
    >>> from setae.config import load
    >>> [target.label for target in choose(paper_targets(load()), 5)]
    ['C z50', '+X z40 b70', '-X z60 b40', '+Y z45 b20', '-Y z50 b30']
    """
    if count < len(GROUPS):
        raise InputError(f"{count} targets are too few.", f"Give {len(GROUPS)} or more.")
    if count > len(targets):
        raise InputError(
            f"{count} targets are too many.", f"There are {len(targets)}: give no more."
        )
    by_group = {group: [target for target in targets if target.group == group] for group in GROUPS}
    shares = np.array([count * len(part) / len(targets) for part in by_group.values()])
    sizes = np.ones(len(GROUPS), dtype=int)
    while sizes.sum() < count:
        sizes[np.argmax(shares - sizes)] += 1  # to the group that lacks most
    chosen: set[str] = set()
    for (group, part), some in zip(by_group.items(), sizes, strict=True):
        by_demand = sorted(part, key=_demand_mm)
        step = len(part) / some
        chosen.update(by_demand[int((k + _PHASES[group]) * step)].label for k in range(some))
    return tuple(target for target in targets if target.label in chosen)


def _demand_mm(target: Target) -> float:
    """How long the spring would have to be for tendons that only pull to hold a target."""
    bend_rad = math.radians(target.bend_deg)
    arc_mm = target.height_mm / float(np.sinc(bend_rad / math.pi))
    return arc_mm + _COMPRESSED_MM_PER_RAD * bend_rad


def find(label: str, targets: Sequence[Target]) -> Target | None:
    """Return the target of this label; None where there is none."""
    return next((target for target in targets if target.label == label), None)


def commanded_lengths_mm(
    targets: Sequence[Target], config: Config, model: str
) -> tuple[FloatArray, FloatArray]:
    """Compute the tendon lengths that the robot is sent to, and what was cut from them.

    A model that asks for a tendon longer than the free spring gets the free spring's
    length: a longer tendon would only hang.

    Returns
    -------
    lengths_mm, cut_mm : ndarray, shapes (p, n)
    """
    arc = kinematics.inverse(np.array([target.position_mm for target in targets]))
    wanted = np.asarray(tendons.lengths(arc, config.geometry, model), dtype=float)
    lengths = np.minimum(wanted, config.geometry.free_length_mm)
    return lengths, wanted - lengths
