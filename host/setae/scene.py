"""The tube that is explored, and what may sit in it.

The paper prints a tube of 174 mm inner radius, and its bristle reaches 45.6 mm
from the robot's axis at the scan's targets: a 40 mm cube at the wall could not
be touched from the tube's own axis. So the robot goes down eccentrically here:
the tube's axis lies `axis_offset_mm` from the robot's, away from the obstacle.

The world's origin is the origin of frame D at the arm's start; z points up.
Frame D hangs: x_D = x, y_D = -y, z_D = -z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from setae.config import Config
from setae.errors import ConfigError, InputError
from setae.solids import Box, Point, Solid, Tube


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A cube flush with the tube's wall.

    Parameters
    ----------
    below_tip_mm
        Height between the compressed bristle's tip, at the arm's start, and the
        cube's top face.
    azimuth_deg
        Direction in which the cube lies, as the angle α of frame D.
    edge_mm
        Edge length.

    Raises
    ------
    InputError
        A value is not finite or no angle, the edge is not positive, or the cube
        would reach the start pose.

    Examples
    --------
    >>> Obstacle(below_tip_mm=35).edge_mm
    40.0
    """

    below_tip_mm: float
    azimuth_deg: float = 0.0
    edge_mm: float = 40.0

    def __post_init__(self) -> None:
        for name in ("below_tip_mm", "azimuth_deg", "edge_mm"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise InputError(f"obstacle: {name} is {value}.", "Give a finite number.")
        if abs(self.azimuth_deg) > 360:
            raise InputError(
                f"obstacle: azimuth_deg is {self.azimuth_deg:g}.", "Give an angle from -360 to 360."
            )
        if self.below_tip_mm <= 0:
            raise InputError(
                f"obstacle: {self.below_tip_mm:g} mm below the tip would be beside the robot "
                "at the start.",
                "Give a height above 0 mm; the paper's are 35, 55, 75 and 95.",
            )
        if self.edge_mm <= 0:
            raise InputError(
                f"obstacle: an edge of {self.edge_mm:g} mm is no cube.",
                "Give an edge above 0 mm; the paper's is 40.",
            )


class Scene(Protocol):
    """What the robot hangs in."""

    @property
    def solids(self) -> tuple[Solid, ...]:
        """What the bristle can touch, in the world."""
        ...

    def describe(self) -> dict[str, Any]:
        """For a log's metadata; JSON-ready."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeScene:
    """Tube and obstacle, placed in the world.

    Attributes
    ----------
    tube_axis_mm
        A point on the tube's axis, which is parallel to z.
    tube_inner_radius_mm
        Inner radius.
    obstacle
        What is in the tube, or None.
    box
        The obstacle as a solid in the world, or None.
    """

    tube_axis_mm: Point
    tube_inner_radius_mm: float
    obstacle: Obstacle | None = None
    box: Box | None = None

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Tube and cube."""
        tube = Tube(axis_mm=self.tube_axis_mm, inner_radius_mm=self.tube_inner_radius_mm)
        return (tube,) if self.box is None else (tube, self.box)

    def describe(self) -> dict[str, Any]:
        """For a log's metadata; JSON-ready."""
        box = self.box
        return {
            "obstacle_below_tip_mm": self.obstacle and self.obstacle.below_tip_mm,
            "scene": {
                "tube": {
                    "axis_mm": list(self.tube_axis_mm[:2]),
                    "inner_radius_mm": self.tube_inner_radius_mm,
                },
                "cube": None
                if box is None
                else {
                    "centre_mm": list(box.centre_mm),
                    "edge_mm": box.edges_mm[0],
                    "yaw_rad": box.yaw_rad,
                },
            },
        }


def tube_scene(config: Config, obstacle: Obstacle | None = None) -> TubeScene:
    """Place the configured tube, and an obstacle at its wall.

    Parameters
    ----------
    config
        Gives tube, tip and the compressed length.
    obstacle
        The cube, or None for the empty tube.

    Raises
    ------
    ConfigError
        The robot would hang in the tube's wall.
    InputError
        The cube would fill the robot's own path.

    Examples
    --------
    >>> from setae.config import load
    >>> scene = tube_scene(load(), Obstacle(below_tip_mm=35))
    >>> scene.box.centre_mm
    (50.0, 0.0, -165.0)
    """
    tube = config.tube
    wall_mm = tube.inner_radius_mm - tube.axis_offset_mm
    if wall_mm <= config.geometry.spring_outer_diameter_mm / 2:
        raise ConfigError(
            f"The tube's wall would be {wall_mm:g} mm from the robot's axis, and the spring is "
            f"{config.geometry.spring_outer_diameter_mm:g} mm thick.",
            "Give [tube] a larger inner_radius_mm, or a smaller axis_offset_mm.",
        )
    azimuth_rad = math.radians(obstacle.azimuth_deg if obstacle else 0.0)
    # Frame D's y is the world's -y.
    towards = (math.cos(azimuth_rad), -math.sin(azimuth_rad))
    box = None
    if obstacle is not None:
        inner_face_mm = wall_mm - obstacle.edge_mm
        if inner_face_mm <= 0:
            raise InputError(
                f"obstacle: a cube of {obstacle.edge_mm:g} mm at a wall {wall_mm:g} mm away "
                "blocks the robot's own axis.",
                f"Give an edge below {wall_mm:g} mm.",
            )
        tip_z_mm = -(config.explore.compressed_length_mm + config.geometry.tip_offset_mm)
        radial_mm = wall_mm - obstacle.edge_mm / 2
        box = Box(
            centre_mm=(
                radial_mm * towards[0],
                radial_mm * towards[1] + 0.0,
                tip_z_mm - obstacle.below_tip_mm - obstacle.edge_mm / 2,
            ),
            edges_mm=(obstacle.edge_mm, obstacle.edge_mm, obstacle.edge_mm),
            yaw_rad=-azimuth_rad + 0.0,
        )
    return TubeScene(
        tube_axis_mm=(-tube.axis_offset_mm * towards[0], -tube.axis_offset_mm * towards[1], 0.0),
        tube_inner_radius_mm=tube.inner_radius_mm,
        obstacle=obstacle,
        box=box,
    )


def open_scene(surface_below_mm: float | None = None) -> TubeScene:
    """Place nothing within reach, or only a flat surface below the robot.

    Parameters
    ----------
    surface_below_mm
        How far below the origin of frame D the surface is; None: none.

    Examples
    --------
    >>> open_scene().tube_inner_radius_mm, open_scene(127.0).box.edges_mm
    (10000.0, (400.0, 400.0, 40.0))
    """
    box = None
    if surface_below_mm is not None:
        wide_mm, thick_mm = 400.0, 40.0
        box = Box(
            centre_mm=(0.0, 0.0, -surface_below_mm - thick_mm / 2),
            edges_mm=(wide_mm, wide_mm, thick_mm),
            yaw_rad=0.0,
        )
    # Every scene has walls; these are too far away to matter.
    return TubeScene(tube_axis_mm=(0.0, 0.0, 0.0), tube_inner_radius_mm=10_000.0, box=box)
