"""Height maps of scans from above: what was felt, what is there, and the difference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from setae.report import extras, palette, style
from setae.report.scan_notes import note
from setae.report.scan_reading import Scan

__all__ = ["MODES", "heights_picture", "square", "title", "top_mm"]

MODES: Final = {"paper": "paper's cycle", "safe": "safe mode", "adaptive": "adaptive mode"}

_FLAGS: Final = {"slipped": "s", "double": "D", "lost": "X"}
_ERROR_MM = 5.0


def heights_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Height maps with their flags; in the simulator also the true surface and the errors."""
    columns = 3 if any(scan.surface for scan in scans) else 1
    rows = len(scans)
    with style.used():
        figure = style.figure(max(4.7 * columns, 6.0), 3.75 * rows + 1.5)
        about = note(scans)
        if columns > 1:
            about += (
                " The errors' colours show every place with a height; the number leaves out those "
                "with a dot: at an edge, or where nothing is in reach."
            )
        top = style.headline(figure, "Height maps from above", about)
        bottom = (0.35 if columns > 1 else 0.6) / figure.get_figheight()
        style.arrange(figure, bottom=bottom, top=top)
        axes = figure.subplots(rows, columns, squeeze=False)
        for scan, row in zip(scans, axes, strict=True):
            high_mm = top_mm(scan)
            _height_axes(figure, row[0], scan, high_mm)
            if scan.surface is not None and columns > 1:
                _truth_axes(figure, row[1], scan, high_mm)
                _error_axes(figure, row[2], scan)
            else:
                for part in row[1:]:
                    part.set_axis_off()
        figure.legend(
            handles=_handles(scans), loc="lower left", ncols=6 if columns > 1 else 3,
            frameon=False, fontsize=9.5, borderaxespad=0.8,
        )  # fmt: skip
        style.save(figure, path, dpi=120)


def _handles(scans: Sequence[Scan]) -> list[Any]:
    """Legend: only of what is drawn."""
    marks: set[str] = set()
    for grid in (scan.result.height_map for scan in scans):
        drawn = (grid.mark != "inferred") | np.isfinite(grid.height_mm)
        marks.update(grid.mark[drawn].tolist())
    signs = {
        **{name: (sign, 6.0) for name, sign in _FLAGS.items()},
        "inferred": ("+", 6.0),
        "unvisited": (".", 3.0),
    }
    lines, patches = extras.load("matplotlib.lines"), extras.load("matplotlib.patches")
    return [
        patches.Patch(color=palette.UNKNOWN, label="nothing within reach"),
        *(
            lines.Line2D([], [], marker=sign, ls="", color=palette.INK, label=name, ms=size)
            for name, (sign, size) in signs.items()
            if name in marks
        ),
    ]


def _height_axes(figure: Any, axes: Any, scan: Scan, high_mm: float) -> None:
    grid = scan.result.height_map
    step_mm = scan.config.scan.step_mm
    _heights(figure, axes, scan, grid.height_mm, high_mm, step_mm, "nothing touched")
    axes.set_title(f"{title(scan)}: felt")
    for flag, sign in _FLAGS.items():
        rows, columns = np.nonzero(grid.mark == flag)
        axes.scatter(
            grid.x_mm[columns], grid.y_mm[rows], marker=sign, s=20, color=palette.INK,
            edgecolors=palette.PAPER, linewidths=0.6,
        )  # fmt: skip
    rows, columns = np.nonzero((grid.mark == "inferred") & np.isfinite(grid.height_mm))
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker="+", s=16, linewidths=1.8,
                 color=palette.PAPER)  # fmt: skip
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker="+", s=14, linewidths=0.8,
                 color=palette.INK)  # fmt: skip
    rows, columns = np.nonzero(grid.mark == "unvisited")
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker=".", s=4, color=palette.INK)


def _truth_axes(figure: Any, axes: Any, scan: Scan, high_mm: float) -> None:
    surface = scan.surface
    assert surface is not None
    height_mm = np.where(surface.height_mm > scan.lowest_mm, surface.height_mm, np.nan)
    _heights(figure, axes, scan, height_mm, high_mm, surface.step_mm, "nothing in reach")
    axes.set_title("True surface within reach")


def _heights(
    figure: Any, axes: Any, scan: Scan, height_mm: NDArray[np.float64], high_mm: float,
    cell_mm: float, empty: str,
) -> None:  # fmt: skip
    """Draw heights in the world as colours, with their scale if there is any height."""
    low_mm = scan.lowest_mm - scan.base_mm
    image = axes.imshow(
        height_mm - scan.base_mm, origin="lower", cmap=style.colours(palette.HEIGHTS),
        vmin=low_mm, vmax=high_mm, extent=_extent(height_mm.shape, cell_mm),
    )  # fmt: skip
    axes.set_facecolor(palette.UNKNOWN)
    if np.isfinite(height_mm).any():
        figure.colorbar(image, ax=axes, shrink=0.85).set_label(f"height {scan.above} (mm)")
    else:
        _say(axes, empty)
    square(axes, scan)


def _error_axes(figure: Any, axes: Any, scan: Scan) -> None:
    surface, found = scan.surface, scan.quality
    assert surface is not None
    assert found is not None
    grid = scan.result.height_map
    true_mm = surface.at(grid)
    error_mm = grid.height_mm - true_mm
    image = axes.imshow(
        error_mm, origin="lower", cmap=style.colours(palette.DIFFERENCES), vmin=-_ERROR_MM,
        vmax=_ERROR_MM, extent=_extent(error_mm.shape, scan.config.scan.step_mm),
    )  # fmt: skip
    axes.set_facecolor(palette.UNKNOWN)
    felt = np.isfinite(error_mm)
    rows, columns = np.nonzero(felt & (surface.edges(grid) | (true_mm <= scan.lowest_mm)))
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker=".", s=9, color=palette.INK,
                 linewidths=0)  # fmt: skip
    if felt.any():
        bar = figure.colorbar(image, ax=axes, shrink=0.85, extend="both")
        bar.set_label("felt less true height (mm)")
    else:
        _say(axes, "nothing touched")
    axes.set_title(f"Error: {found.rms_mm:.2f} mm RMS" if found.places else "Error")
    square(axes, scan)


def _say(axes: Any, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center",
              color=palette.MUTED)  # fmt: skip


def square(axes: Any, scan: Scan) -> None:
    """Give axes the scanned area, from above."""
    grid = scan.result.height_map
    edge_mm = 0.75 * scan.config.scan.step_mm
    axes.set(
        xlim=(-edge_mm, grid.x_mm[-1] + edge_mm), ylim=(-edge_mm, grid.y_mm[-1] + edge_mm),
        xlabel="x (mm)", ylabel="y (mm)", aspect="equal",
    )  # fmt: skip


def _extent(shape: tuple[int, ...], cell_mm: float) -> tuple[float, float, float, float]:
    """Ends of an image whose cells lie about a grid that begins at the first place."""
    half = cell_mm / 2
    return (-half, (shape[1] - 1) * cell_mm + half, -half, (shape[0] - 1) * cell_mm + half)


def top_mm(scan: Scan) -> float:
    """Highest of what was found, and of what is there, above the base."""
    heights = scan.result.height_map.height_mm
    found = heights[np.isfinite(heights)]
    tops = [float(found.max())] if len(found) else []
    if scan.surface is not None:
        tops.append(float(scan.surface.height_mm.max()))
    # Something to span with colours, though nothing may reach up to the tip.
    least_mm = max(scan.lowest_mm - scan.base_mm, 0.0) + 1.0
    return max([*(top - scan.base_mm for top in tops), least_mm])


def title(scan: Scan) -> str:
    """Name a scan by its mode."""
    name = MODES[scan.result.mode]
    return f"{name[:1].upper()}{name[1:]}" + ("" if scan.result.complete else " (not complete)")
