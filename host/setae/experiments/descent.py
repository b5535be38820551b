"""Where an exploration goes: what is put into the tube, the arm's steps, the scans' targets."""

from __future__ import annotations

import math
from collections.abc import Sequence

from setae import kinematics, workspace
from setae.config import Config
from setae.scene import Obstacle

Point = tuple[float, float, float]

PAPER_DESCENTS_MM = (40.0, 60.0, 80.0, 100.0, 100.0)
"""How far the paper's arm went down: obstacles at 35, 55, 75, 95 mm, then none."""


def paper_obstacles(config: Config) -> tuple[Obstacle | None, ...]:
    """The paper's trials: the cube at each configured height, then the empty tube.

    Examples
    --------
    >>> from setae.config import load
    >>> [what and what.below_tip_mm for what in paper_obstacles(load())]
    [35.0, 55.0, 75.0, 95.0, None]
    """
    tube = config.tube
    cubes = [
        Obstacle(below_tip_mm=below_tip_mm, edge_mm=tube.cube_edge_mm)
        for below_tip_mm in tube.obstacle_below_tip_mm
    ]
    return (*cubes, None)


def tip_in_world(tip_mm: Sequence[float], stage_mm: Sequence[float]) -> Point:
    """From frame D, which hangs from the arm, to the world.

    Parameters
    ----------
    tip_mm
        Point in frame D, (3,).
    stage_mm
        Origin of frame D in the world, (3,).

    Examples
    --------
    >>> tip_in_world((1.0, 2.0, 110.0), (0.0, 0.0, -40.0))
    (1.0, -2.0, -150.0)
    """
    return (
        float(stage_mm[0] + tip_mm[0]),
        float(stage_mm[1] - tip_mm[1]),
        float(stage_mm[2] - tip_mm[2]),
    )


def scan_directions_deg(count: int) -> tuple[float, ...]:
    """Angles α of one scan, evenly spread from 0.

    Examples
    --------
    >>> scan_directions_deg(8)[:3]
    (0.0, 45.0, 90.0)
    """
    return tuple(360.0 * index / count for index in range(count))


def targets_mm(config: Config) -> tuple[Point, ...]:
    """Where one scan extends to in frame D, in its order.

    Raises
    ------
    UnreachableError
        The robot can't reach a target, or its compressed pose.

    Examples
    --------
    >>> from setae.config import load
    >>> targets_mm(load())[0]
    (15.0, 0.0, 60.0)
    """
    settings = config.explore
    targets = []
    for alpha_deg in scan_directions_deg(settings.directions):
        alpha_rad = math.radians(alpha_deg)
        targets.append(
            (
                settings.target_radius_mm * math.cos(alpha_rad),
                settings.target_radius_mm * math.sin(alpha_rad),
                settings.target_height_mm,
            )
        )
    for point in ((0.0, 0.0, settings.compressed_length_mm), *targets):
        workspace.require(kinematics.inverse(point), config)
    return tuple(targets)


def arm_targets_mm(config: Config) -> tuple[Point, ...]:
    """Where the arm goes in the world, from its start at the origin to the deepest step.

    Examples
    --------
    >>> from setae.config import load
    >>> arm_targets_mm(load())[-1]
    (0.0, 0.0, -100.0)
    """
    settings = config.explore
    return tuple((0.0, 0.0, 0.0 - level * settings.step_mm) for level in range(settings.steps + 1))


def reach_below_tip_mm(config: Config) -> float:
    """How far below the compressed tip, at the arm's start, the last scan's tip gets.

    Examples
    --------
    >>> from setae.config import load
    >>> round(reach_below_tip_mm(load()))
    107
    """
    settings, tip_offset_mm = config.explore, config.geometry.tip_offset_mm
    tips = kinematics.position(kinematics.inverse(targets_mm(config)), tip_offset_mm=tip_offset_mm)
    start_mm = settings.compressed_length_mm + tip_offset_mm
    return settings.steps * settings.step_mm + float(tips[:, 2].max()) - start_mm
