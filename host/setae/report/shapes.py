"""Curves and surfaces of the drawing: spring, tendons, holder, tube, cube.

Pure geometry in the world frame, mm; nothing here knows how it is drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from setae.report.trial import Cube, Floats, Tube

SPRING_COILS = 13  # fewer than the real spring's, so that the eye can follow the wire


def frames(backbone_mm: Floats) -> tuple[Floats, Floats, Floats]:
    """Directions along a curve that do not twist about it.

    Parameters
    ----------
    backbone_mm
        (n, 3) points, the first at the base, in the world.

    Returns
    -------
    tangent, first, second
        (n, 3) each. At the base `first` is frame D's x and `second` its y
        (x and -y of the world), as far as the tangent allows; from there they
        are carried along without twist.
    """
    tangent = np.gradient(backbone_mm, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    first = np.empty_like(tangent)
    axis = np.array([1.0, 0.0, 0.0])
    for index, along in enumerate(tangent):
        axis = axis - along * (axis @ along)
        axis = axis / np.linalg.norm(axis)
        first[index] = axis
    return tangent, first, np.cross(tangent, first)


def along(curve: Floats, positions: Floats) -> Floats:
    """Values (n, k) of a curve at fractional positions 0…1 (m,), linearly: (m, k)."""
    source = np.linspace(0.0, 1.0, len(curve))
    return np.stack([np.interp(positions, source, column) for column in curve.T], axis=1)


def helix(backbone_mm: Floats, radius_mm: float, *, coils: float = SPRING_COILS) -> Floats:
    """Wire of the spring around the backbone, (m, 3)."""
    _, first, second = frames(backbone_mm)
    positions = np.linspace(0.0, 1.0, int(coils * 28) + 1)
    angle = (2 * np.pi * coils * positions)[:, None]
    return along(backbone_mm, positions) + radius_mm * (
        np.cos(angle) * along(first, positions) + np.sin(angle) * along(second, positions)
    )


def tendons(backbone_mm: Floats, radius_mm: float, *, count: int = 4) -> Floats:
    """Tendons drawn at their radius beside the backbone, (count, n, 3)."""
    _, first, second = frames(backbone_mm)
    angles = np.arange(count) * 2 * np.pi / count
    return np.stack(
        [
            backbone_mm + radius_mm * (np.cos(angle) * first + np.sin(angle) * second)
            for angle in angles
        ]
    )


def ring(centre_mm: Floats, first: Floats, second: Floats, radius_mm: float) -> Floats:
    """Return a closed circle, (49, 3)."""
    angle = np.linspace(0.0, 2 * np.pi, 49)[:, None]
    return centre_mm + radius_mm * (np.cos(angle) * first + np.sin(angle) * second)


def towards_wall_rad(tube: Tube | None) -> float:
    """Direction (world) from the tube's axis to the robot, where the wall is near."""
    return 0.0 if tube is None else float(np.arctan2(-tube.axis_mm[1], -tube.axis_mm[0]))


# Seen from 225 degrees, the wall's outline is at -45: no part of it hides another.
EYE_DEG = 225.0
WALL_DEG = (-45.0, 65.0)


def shell(tube: Tube, bottom_mm: float, top_mm: float) -> Floats:
    """Part of the tube's wall nearest to the robot, (2, 61, 3): lower and upper edge."""
    angle = towards_wall_rad(tube) + np.radians(np.linspace(*WALL_DEG, 61))
    x = tube.axis_mm[0] + tube.inner_radius_mm * np.cos(angle)
    y = tube.axis_mm[1] + tube.inner_radius_mm * np.sin(angle)
    return np.stack([np.stack([x, y, np.full_like(x, z)], axis=1) for z in (bottom_mm, top_mm)])


CUBE_FACES: NDArray[np.int64] = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


def cube_corners(cube: Cube) -> Floats:
    """Corners (8, 3); index bits 2, 1, 0 say +x, +y, +z of the cube."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    c, s = np.cos(cube.yaw_rad), np.sin(cube.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(signs * (cube.edge_mm / 2) @ turn.T + np.array(cube.centre_mm))
