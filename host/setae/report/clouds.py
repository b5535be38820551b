"""Point clouds and height maps, drawn the same in every picture."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from setae.arc import FloatArray
from setae.heightmap import HeightMap
from setae.perception import maps
from setae.report import palette, style

__all__ = ["SHAPE_COLOURS", "about_middle", "draw_cloud", "draw_map", "title_of"]

SHAPE_COLOURS: Final = ("#2b5c8a", "#e07b1a", "#12888a", "#8a3fa0", "#d4213d", "#7a8b1f", "#41566b")
"""One for each shape, in their order; more shapes begin anew."""

_RULER_MM = 50.0
_EYE_DEG = (28.0, -62.0)


def title_of(name: str) -> str:
    """Words instead of a name with underscores."""
    return name.replace("_", " ")


def draw_cloud(axes: Any, heights: HeightMap, most_mm: float) -> None:
    """Draw a map's points about their mean, coloured by distance to it as in the paper's figure 5.

    Parameters
    ----------
    axes
        Three-dimensional.
    heights
        The scan.
    most_mm
        Distance with the scale's last colour.
    """
    points, away = about_middle(heights)
    axes.scatter(
        *points.T, c=away, cmap=style.colours(palette.AMOUNTS), s=11, depthshade=False,
        linewidths=0, vmin=0, vmax=most_mm,
    )  # fmt: skip
    half = max(60.0, float(np.abs(points[:, :2]).max())) if len(points) else 60.0
    rise = max(25.0, float(np.abs(points[:, 2]).max())) if len(points) else 25.0
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(-rise, rise))
    axes.set_box_aspect((1, 1, rise / half), zoom=0.97)
    axes.view_init(elev=_EYE_DEG[0], azim=_EYE_DEG[1])
    axes.tick_params(labelsize=7, pad=-2)
    axes.set(xticks=(-50, 0, 50), yticks=(-50, 0, 50), zticks=(-20, 0, 20))
    axes.set_xlabel("x (mm)", labelpad=-2)
    axes.set_ylabel("y (mm)", labelpad=-2)
    axes.set_zlabel("z (mm)", labelpad=-4)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1, 1, 1, 1))
        axis._axinfo["grid"].update(color=palette.GRID, linewidth=0.6)
        axis.label.set_size(8.5)


def about_middle(heights: HeightMap) -> tuple[FloatArray, FloatArray]:
    """Points of a map about their mean, (n, 3), and their distances to it, (n,)."""
    points = maps.known(heights)
    if len(points):
        points = points - points.mean(axis=0)
    return points, np.linalg.norm(points, axis=1)


def draw_map(axes: Any, heights: HeightMap, *, low_mm: float, high_mm: float) -> None:
    """Draw a height map from above; places without a height stay grey, doubtful ones get a dot.

    Parameters
    ----------
    axes
        Where to.
    heights
        The scan.
    low_mm, high_mm
        Ends of the colours' scale, z of the world.
    """
    axes.set_facecolor(palette.UNKNOWN)
    axes.imshow(
        heights.height_mm,
        origin="lower",
        extent=_extent(heights),
        cmap=style.colours(palette.HEIGHTS),
        vmin=low_mm,
        vmax=high_mm,
        interpolation="nearest",
    )
    rows, columns = np.nonzero(np.isin(heights.mark, ("slipped", "double", "lost")))
    axes.scatter(heights.x_mm[columns], heights.y_mm[rows], s=3, color=palette.INK, linewidths=0)
    axes.set(xticks=[], yticks=[])
    left, right, bottom, top = _extent(heights)
    start_mm, at_mm = left + 0.05 * (right - left), bottom + 0.06 * (top - bottom)
    axes.plot([start_mm, start_mm + _RULER_MM], [at_mm, at_mm], color=palette.MUTED, lw=1.6,
              solid_capstyle="butt")  # fmt: skip
    axes.text(start_mm, at_mm + 0.02 * (top - bottom), f"{_RULER_MM:g} mm", fontsize=6,
              color=palette.MUTED, va="bottom")  # fmt: skip
    for side in axes.spines.values():
        side.set(visible=True, color=palette.GRID)


def _extent(heights: HeightMap) -> tuple[float, float, float, float]:
    ends = []
    for places in (heights.x_mm, heights.y_mm):
        half = _half(places)
        ends += [float(places[0]) - half, float(places[-1]) + half]
    return ends[0], ends[1], ends[2], ends[3]


def _half(places_mm: FloatArray) -> float:
    return float(np.median(np.diff(places_mm))) / 2 if len(places_mm) > 1 else 0.5
