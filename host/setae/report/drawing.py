"""The robot in its tube, drawn flat: a parallel projection for still pictures.

Matplotlib's own 3D axes can't sort lines by depth, so the projection and the
order of painting are done here.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from setae.report import extras, palette, shapes
from setae.report.trial import Contact, Cube, Floats, Tube

SPRING_RADIUS_MM = 9.75
TENDON_RADIUS_MM = 8.3
HOLDER_RADIUS_MM = 27.0
HOLDER_HEIGHT_MM = 70.0


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Direction from which the scene is seen; angles of the eye, in degrees."""

    azimuth_deg: float = shapes.EYE_DEG
    elevation_deg: float = 20.0

    @classmethod
    def into(cls, tube: Tube | None) -> View:
        """Look into the tube from its open side."""
        return cls(azimuth_deg=shapes.EYE_DEG + np.degrees(shapes.towards_wall_rad(tube)))

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Unit vectors to the right, up, and towards the eye, (3,) each."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        eye = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return right, np.cross(eye, right), eye

    def flat(self, points_mm: Floats) -> Floats:
        """Project (..., 3) to the picture's plane, (..., 2)."""
        right, up, _ = self.axes()
        return np.stack([points_mm @ right, points_mm @ up], axis=-1)

    def depth(self, points_mm: Floats) -> Floats:
        """Distance towards the eye, (...); what is larger hides what is smaller."""
        return np.asarray(points_mm @ self.axes()[2])


def tube(axes: Any, view: View, tube: Tube, bottom_mm: float, top_mm: float) -> None:
    """Draw the part of the tube's wall around the robot, with a ring every 20 mm."""
    collections = extras.load("matplotlib.collections")
    wall = shapes.shell(tube, bottom_mm, top_mm)
    flat = view.flat(wall)
    quads = np.stack([flat[0, :-1], flat[0, 1:], flat[1, 1:], flat[1, :-1]], axis=1)
    middle = (wall[0, :-1] + wall[0, 1:]) / 2
    inward = np.array([*tube.axis_mm, 0.0]) - middle
    inward[:, 2] = 0.0
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    right, _, eye = view.axes()
    light = np.clip(inward @ (0.8 * eye + 0.6 * right), 0.0, 1.0)
    faces = [palette.mix(palette.TUBE, "#ffffff", 0.52 + 0.42 * share) for share in light]
    axes.add_collection(
        collections.PolyCollection(
            quads, facecolors=faces, edgecolors=faces, linewidths=0.4, zorder=1
        )
    )
    for height in np.arange(np.ceil(bottom_mm / 20) * 20, top_mm, 20):
        line = view.flat(shapes.shell(tube, height, height)[0])
        axes.plot(*line.T, color="white", linewidth=0.9, alpha=0.8, zorder=1)
    edge = palette.mix(palette.TUBE, palette.INK, 0.25)
    for line in (flat[0], flat[1], flat[:, 0], flat[:, -1]):
        axes.plot(*line.T, color=edge, linewidth=1.2, solid_capstyle="round", zorder=1)


def cube(axes: Any, view: View, cube: Cube) -> None:
    """Draw the obstacle, opaque."""
    collections = extras.load("matplotlib.collections")
    corners = shapes.cube_corners(cube)
    faces = []
    colours = []
    for face in shapes.CUBE_FACES:
        points = corners[face]
        normal = points.mean(axis=0) - np.array(cube.centre_mm)
        normal /= np.linalg.norm(normal)
        if view.depth(normal) <= 0:
            continue
        faces.append(view.flat(points))
        right, up, eye = view.axes()
        share = 0.5 + 0.5 * float(normal @ (0.75 * up + 0.5 * eye - 0.43 * right))
        colours.append(palette.mix(palette.mix(palette.CUBE, palette.INK, 0.25), "#fff3de", share))
    axes.add_collection(
        collections.PolyCollection(
            faces,
            facecolors=colours,
            edgecolors=palette.mix(palette.CUBE, palette.INK, 0.45),
            linewidths=1.0,
            joinstyle="round",
            zorder=2,
        )
    )


def holder(axes: Any, view: View, arm_mm: Floats) -> None:
    """Draw the housing of the servos, which the arm carries."""
    patches = extras.load("matplotlib.patches")
    first, second = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    edge = palette.mix(palette.HOLDER, palette.INK, 0.35)
    levels = (
        (0.0, HOLDER_HEIGHT_MM, HOLDER_RADIUS_MM, palette.HOLDER),
        (HOLDER_HEIGHT_MM, HOLDER_HEIGHT_MM + 26.0, 0.62 * HOLDER_RADIUS_MM, "#dfe4e9"),
    )
    for bottom, top, radius, colour in levels:
        up = np.array([0.0, 0.0, 1.0])
        low = view.flat(shapes.ring(arm_mm + bottom * up, first, second, radius))
        high = view.flat(shapes.ring(arm_mm + top * up, first, second, radius))
        left, right = low[:, 0].min(), low[:, 0].max()
        # Vertical strips, shaded like a cylinder that is lit from the left.
        for start, end in pairwise(np.linspace(-1.0, 1.0, 41)):
            middle = (start + end) / 2
            light = 0.1 + 0.75 * np.cos(np.arcsin(middle) + 0.6) ** 2
            x = np.array([start, end]) * (right - left) / 2 + (right + left) / 2
            drop = np.ptp(low[:, 1]) / 2 * np.sqrt(np.clip(1 - np.array([start, end]) ** 2, 0, 1))
            bottom_y = low[:, 1].mean() - drop
            top_y = high[:, 1].mean() - drop
            colour_here = palette.mix(palette.mix(colour, palette.INK, 0.28), "#ffffff", light)
            axes.add_patch(
                patches.Polygon(
                    [(x[0], bottom_y[0]), (x[1], bottom_y[1]), (x[1], top_y[1]), (x[0], top_y[0])],
                    facecolor=colour_here,
                    edgecolor=colour_here,
                    linewidth=0.4,
                    zorder=4,
                )
            )
        axes.add_patch(patches.Polygon(high, fc="#eef1f4", ec=edge, lw=0.8, zorder=4))
        lower_half = low[low[:, 1] <= low[:, 1].mean() + 1e-9]
        lower_half = lower_half[np.argsort(lower_half[:, 0])]
        axes.plot(*lower_half.T, color=edge, linewidth=0.8, zorder=4)
        for x in (left, right):
            axes.plot([x, x], [low[:, 1].mean(), high[:, 1].mean()], c=edge, lw=0.8, zorder=4)


def robot(
    axes: Any, view: View, backbone_mm: Floats, filament_mm: Floats, *, scale: float = 1.0
) -> None:
    """Draw spring, tendons, the holder at the spring's top, and the bristle.

    `scale` widens all lines, for pictures that show the robot larger.
    """
    collections = extras.load("matplotlib.collections")
    segments: list[Floats] = []
    depths: list[float] = []
    colours: list[str] = []
    widths: list[float] = []

    def add(curve: Floats, colour: str, width: float, fade: float) -> None:
        depth = view.depth(curve)
        span = max(float(np.ptp(depth)), 1e-9)
        for start, end in zip(range(len(curve) - 1), range(1, len(curve)), strict=True):
            near = (depth[start] - depth.min()) / span
            segments.append(view.flat(curve[[start, end]]))
            depths.append(float(depth[start] + depth[end]) / 2)
            colours.append(palette.mix(colour, "#ffffff", fade * (1 - near)))
            widths.append(width)

    add(shapes.helix(backbone_mm, SPRING_RADIUS_MM), palette.SPRING, 2.3 * scale, 0.5)
    for tendon in shapes.tendons(backbone_mm, TENDON_RADIUS_MM):
        smooth = shapes.along(tendon, np.linspace(0.0, 1.0, 41))
        add(smooth, palette.TENDON, 1.5 * scale, 0.25)
    order = np.argsort(depths)
    axes.add_collection(
        collections.LineCollection(
            [segments[i] for i in order],
            colors=[colours[i] for i in order],
            linewidths=[widths[i] for i in order],
            capstyle="round",
            zorder=3,
        )
    )

    patches = extras.load("matplotlib.patches")
    tangent, first, second = shapes.frames(backbone_mm)
    bristle = view.flat(filament_mm)
    cap = view.flat(shapes.ring(backbone_mm[-1], first[-1], second[-1], SPRING_RADIUS_MM + 1.0))
    root = backbone_mm[-1] + 0.5 * (filament_mm[0] - backbone_mm[-1])
    pad = view.flat(shapes.ring(root, first[-1], second[-1], 5.0))
    edge = palette.mix(palette.HOLDER, palette.INK, 0.4)
    silicone_edge = palette.mix(palette.SILICONE, palette.INK, 0.35)
    looking_at_us = float(view.depth(tangent[-1])) > 0

    def draw_bristle() -> None:
        axes.plot(
            *np.stack([view.flat(root), bristle[0]]).T,
            color=palette.SILICONE,
            linewidth=7.0 * scale,
            solid_capstyle="round",
            zorder=3,
        )
        axes.add_patch(
            patches.Polygon(pad, fc=palette.SILICONE, ec=silicone_edge, lw=0.5 * scale, zorder=3)
        )
        axes.plot(
            *bristle.T,
            color=palette.BRISTLE,
            linewidth=2.6 * scale,
            solid_capstyle="round",
            zorder=3,
        )

    if not looking_at_us:
        draw_bristle()
    axes.add_patch(patches.Polygon(cap, fc="#e4e9ee", ec=edge, lw=0.9 * scale, zorder=3))
    if looking_at_us:
        draw_bristle()


def contact_point_mm(contact: Contact) -> Floats:
    """Return where a touch is drawn: its true place if known, else the estimate."""
    known = np.isfinite(contact.true_point_mm).all()
    return contact.true_point_mm if known else contact.point_mm


def contact(axes: Any, view: View, contact: Contact, *, scale: float = 1.0) -> None:
    """Mark where the bristle touched: the true point if known, else the estimate."""
    point = contact_point_mm(contact)
    if not np.isfinite(point).all():
        return
    x, y = view.flat(point)
    for size, alpha in ((420, 0.13), (190, 0.22)):
        axes.scatter(
            x, y, s=size * scale**2, color=palette.CONTACT, alpha=alpha, linewidths=0, zorder=6
        )
    axes.scatter(
        x, y, s=52 * scale**2, color=palette.CONTACT, edgecolors="white", linewidths=1.1, zorder=7
    )
