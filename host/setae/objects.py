"""Objects whose surface is scanned: five shapes like the paper's, on a table.

The world begins where the scan does: frame D's origin above the first point of the scanned
square, whose sides go along +x and +y.
"""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from setae.config import Config
from setae.errors import InputError
from setae.solids import Box, Ellipsoid, Point, Prism, Ring, Solid

__all__ = [
    "SHAPES",
    "ScanObject",
    "TableScene",
    "UnknownScene",
    "of_description",
    "random_object",
    "table_scene",
]

SCALE_MIN, SCALE_MAX = 0.8, 1.2

# Between the extended tip and the table.
_TABLE_GAP_MM: Final = 3.0
_TABLE_FAR_MM: Final = 5000.0  # longer than any configured robot
_TABLE_EDGE_MM: Final = 5000.0  # below the largest area that may be scanned, and around it
_TABLE_THICKNESS_MM: Final = 40.0


def _lidded_container(scale: float, foot: Point, yaw_rad: float) -> tuple[Solid, ...]:
    """A food container with its lid on: the lid juts out."""
    x, y, z = foot
    body_mm, lid_mm = 34.0 * scale, 8.0 * scale
    return (
        Prism(
            centre_mm=(x, y, z + body_mm / 2),
            edges_mm=(118.0 * scale, 78.0 * scale, body_mm),
            corner_mm=12.0 * scale,
            yaw_rad=yaw_rad,
        ),
        Prism(
            centre_mm=(x, y, z + body_mm + lid_mm / 2),
            edges_mm=(126.0 * scale, 86.0 * scale, lid_mm),
            corner_mm=15.0 * scale,
            yaw_rad=yaw_rad,
        ),
    )


def _open_container(scale: float, foot: Point, yaw_rad: float) -> tuple[Solid, ...]:
    """The same without its lid: four walls."""
    x, y, z = foot
    height_mm = 38.0 * scale
    return (
        Prism(
            centre_mm=(x, y, z + height_mm / 2),
            edges_mm=(122.0 * scale, 82.0 * scale, height_mm),
            corner_mm=13.0 * scale,
            wall_mm=5.0,
            yaw_rad=yaw_rad,
        ),
    )


def _eraser(scale: float, foot: Point, yaw_rad: float) -> tuple[Solid, ...]:
    """A board eraser: long and narrow, its handle on top."""
    x, y, z = foot
    felt_mm, handle_mm = 20.0 * scale, 12.0 * scale
    return (
        Prism(
            centre_mm=(x, y, z + felt_mm / 2),
            edges_mm=(140.0 * scale, 52.0 * scale, felt_mm),
            corner_mm=3.0,
            yaw_rad=yaw_rad,
        ),
        Prism(
            centre_mm=(x, y, z + felt_mm + handle_mm / 2),
            edges_mm=(126.0 * scale, 30.0 * scale, handle_mm),
            corner_mm=3.0,
            yaw_rad=yaw_rad,
        ),
    )


def _coil(scale: float, foot: Point, yaw_rad: float) -> tuple[Solid, ...]:
    """A coil of wire, lying: a ring with a hole."""
    del yaw_rad  # round
    x, y, z = foot
    section_mm = 14.0 * scale
    return (
        Ring(
            centre_mm=(x, y, z + section_mm),
            ring_radius_mm=46.0 * scale,
            section_radius_mm=section_mm,
        ),
    )


def _orange(scale: float, foot: Point, yaw_rad: float) -> tuple[Solid, ...]:
    """An orange, a little flat."""
    x, y, z = foot
    half_mm = 34.0 * scale
    return (
        Ellipsoid(
            centre_mm=(x, y, z + half_mm),
            semi_axes_mm=(37.0 * scale, 36.0 * scale, half_mm),
            yaw_rad=yaw_rad,
        ),
    )


_BUILDERS: Mapping[str, Callable[[float, Point, float], tuple[Solid, ...]]] = {
    "lidded_container": _lidded_container,
    "open_container": _open_container,
    "eraser": _eraser,
    "coil": _coil,
    "orange": _orange,
}
# Largest distance from the middle, and height, at scale 1.
_RADIUS_MM = {
    "lidded_container": 72.0, "open_container": 70.0, "eraser": 75.0, "coil": 60.0, "orange": 37.0,
}  # fmt: skip
_HEIGHT_MM = {
    "lidded_container": 42.0, "open_container": 38.0, "eraser": 32.0, "coil": 28.0, "orange": 68.0,
}  # fmt: skip

SHAPES: Final = tuple(_BUILDERS)
"""Names of the shapes; the paper's figure 5 has them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanObject:
    """An object on the table.

    Parameters
    ----------
    shape
        One of `SHAPES`.
    scale
        Its size against the usual one, 0.8 to 1.2.
    x_mm, y_mm
        Its middle, in the scanned square.
    yaw_deg
        Turned about z.

    Raises
    ------
    InputError
        No shape has that name, or a number is no good.
    """

    shape: str
    scale: float = 1.0
    x_mm: float = 100.0
    y_mm: float = 100.0
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError(
                f"There is no object {self.shape!r}.", f"Give one of {', '.join(SHAPES)}."
            )
        for name in ("scale", "x_mm", "y_mm", "yaw_deg"):
            _require_number(f"object: {name}", getattr(self, name))
        if not SCALE_MIN <= self.scale <= SCALE_MAX:
            raise InputError(
                f"object: its scale is {self.scale:g}.",
                f"Give a number from {SCALE_MIN:g} to {SCALE_MAX:g}.",
            )

    @property
    def height_mm(self) -> float:
        """Of its top above the table."""
        return _HEIGHT_MM[self.shape] * self.scale

    @property
    def radius_mm(self) -> float:
        """No part of it is farther from its middle, seen from above."""
        return _RADIUS_MM[self.shape] * self.scale

    def solids(self, table_z_mm: float) -> tuple[Solid, ...]:
        """What it is made of, standing on the table."""
        foot = (self.x_mm, self.y_mm, table_z_mm)
        return _BUILDERS[self.shape](self.scale, foot, math.radians(self.yaw_deg))


def random_object(shape: str, seed: int, *, area_mm: ArrayLike = 200.0) -> ScanObject:
    """An object of random size, place and yaw, wholly in the scanned area.

    Parameters
    ----------
    shape
        One of `SHAPES`.
    seed
        Of size, place and yaw; the size is the same in every area.
    area_mm
        Sides along x and y, (2,), or one for both.

    Raises
    ------
    InputError
        There is no such shape, or the area is too small to have it wholly inside however turned.

    Examples
    --------
    >>> random_object("orange", 1) == random_object("orange", 1)
    True
    >>> random_object("orange", 1, area_mm=(120, 90)).y_mm < 90
    True
    """
    rng = random.Random(f"{shape} {seed}")
    scale = round(rng.uniform(SCALE_MIN, SCALE_MAX), 3)
    radius_mm = ScanObject(shape=shape, scale=scale).radius_mm
    x_mm, y_mm = (float(side_mm) for side_mm in np.broadcast_to(area_mm, 2))
    if min(x_mm, y_mm) < 2 * radius_mm:
        raise InputError(
            f"{shape}:{seed} doesn't fit into the scanned {x_mm:g} x {y_mm:g} mm.",
            f"Scan {math.ceil(2 * radius_mm)} mm or more along both sides, take another object, "
            "or have one stand where you like: --scene of `setae scan`.",
        )
    middles_mm = []
    for side_mm in (x_mm, y_mm):
        free_mm = side_mm / 2 - radius_mm
        middles_mm.append(round(side_mm / 2 + rng.uniform(-free_mm, free_mm), 1))
    return ScanObject(
        shape=shape,
        scale=scale,
        x_mm=middles_mm[0],
        y_mm=middles_mm[1],
        yaw_deg=round(rng.uniform(-180.0, 180.0), 1),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TableScene:
    """A table below the robot, and what stands on it.

    Attributes
    ----------
    table_z_mm
        Height of the table in the world, which begins at frame D's origin at the start.
    object
        What stands on it, or None.

    Raises
    ------
    InputError
        The table is nowhere, or out of all reach.
    """

    table_z_mm: float
    object: ScanObject | None = None

    def __post_init__(self) -> None:
        _require_number("table_z_mm", self.table_z_mm)
        if abs(self.table_z_mm) > _TABLE_FAR_MM:
            raise InputError(
                f"table_z_mm is {self.table_z_mm:g}.",
                f"Give mm from {-_TABLE_FAR_MM:g} to {_TABLE_FAR_MM:g}.",
            )

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Table and object."""
        table = Box(
            centre_mm=(0.0, 0.0, self.table_z_mm - _TABLE_THICKNESS_MM / 2),
            edges_mm=(_TABLE_EDGE_MM, _TABLE_EDGE_MM, _TABLE_THICKNESS_MM),
            yaw_rad=0.0,
        )
        return (table, *(self.object.solids(self.table_z_mm) if self.object else ()))

    def describe(self) -> dict[str, Any]:
        """For a log's metadata; JSON-ready."""
        what = self.object
        return {
            "scene": {
                "table_z_mm": self.table_z_mm,
                "object": None
                if what is None
                else {
                    "shape": what.shape,
                    "scale": what.scale,
                    "x_mm": what.x_mm,
                    "y_mm": what.y_mm,
                    "yaw_deg": what.yaw_deg,
                },
            }
        }


def table_scene(config: Config, what: ScanObject | None = None) -> TableScene:
    """Place the table as a person would who brings the arm to its start.

    The tip of the robot at rest, at its free length, stays just above the table: it would press
    before anything has begun, and so only the object is touched. The arm is higher where the
    retracted tip would not clear the object otherwise.

    Examples
    --------
    >>> from setae.config import load
    >>> table_scene(load(), ScanObject(shape="eraser")).table_z_mm
    -138.0
    >>> table_scene(load(), ScanObject(shape="orange")).table_z_mm
    -158.0
    """
    short_mm, _ = config.scan_lengths_mm
    over_table_mm = _TABLE_GAP_MM - config.rest_reach_mm
    tallest_mm = what.height_mm if what else 0.0
    tip_mm = short_mm + config.geometry.tip_offset_mm
    over_object_mm = tallest_mm + tip_mm + config.scan.clearance_mm
    return TableScene(table_z_mm=-max(over_table_mm, over_object_mm), object=what)


def of_description(scene: Mapping[str, Any]) -> TableScene:
    """Make the scene again from what a log says of it.

    Parameters
    ----------
    scene
        `TableScene.describe` wrote it, under ``scene``.

    Raises
    ------
    InputError
        It describes no table, or no object that there can be.

    Examples
    --------
    >>> scene = TableScene(table_z_mm=-138.0, object=ScanObject(shape="coil"))
    >>> of_description(scene.describe()["scene"]) == scene
    True
    """
    if "table_z_mm" not in scene:
        raise InputError("The scene has no table_z_mm.", "Give the table's height.")
    table_z_mm, what = scene["table_z_mm"], scene.get("object")
    if what is None:
        return TableScene(table_z_mm=table_z_mm)
    names = [field.name for field in dataclasses.fields(ScanObject)]
    if not isinstance(what, Mapping) or "shape" not in what:
        raise InputError(f"object is {what!r}.", f"Give [object] with {', '.join(names)}.")
    if unknown := sorted(set(what) - set(names)):
        raise InputError(f"object: there is no {unknown[0]!r}.", f"It has {', '.join(names)}.")
    return TableScene(table_z_mm=table_z_mm, object=ScanObject(**what))


def _require_number(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name} is {value!r}.", "Give a number.")


class UnknownScene:
    """What is in front of a real robot."""

    solids: tuple[Solid, ...] = ()

    def describe(self) -> dict[str, Any]:
        """For a log's metadata: nothing is known."""
        return {"scene": {}}
