"""The still pictures of a scan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from setae.heightmap import TOUCHED
from setae.report import extras, palette, style
from setae.report.scan_reading import Scan, origin_note

_FLAGS = {"slipped": "s", "double": "D", "lost": "X"}
_ERROR_MM = 5.0
# Of the pressure's close view.
_CLOSE_S = 24.0


def write_all(folder: Path, scans: Sequence[Scan]) -> tuple[Path, ...]:
    """Write the pictures of some scans into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {
        "heights": heights_picture,
        "clouds": clouds_picture,
        "paths": paths_picture,
        "pressure": pressure_picture,
    }
    for name, draw in pictures.items():
        draw(folder / f"{name}.png", scans)
    return tuple(folder / f"{name}.png" for name in pictures)


def heights_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Height maps with their flags; in the simulator also the true surface and the errors."""
    columns = 3 if any(scan.surface for scan in scans) else 1
    rows = len(scans)
    with style.used():
        figure = style.figure(4.6 * columns + 0.6, 4.15 * rows + 0.8)
        axes = figure.subplots(rows, columns, squeeze=False)
        for scan, row in zip(scans, axes, strict=True):
            high_mm = top_mm(scan)
            _height_axes(figure, row[0], scan, high_mm)
            if scan.surface is not None and columns > 1:
                _truth_axes(figure, row[1], scan, high_mm)
                _error_axes(figure, row[2], scan)
        handles = [
            extras.load("matplotlib.lines").Line2D(
                [], [], marker=sign, linestyle="", color=palette.INK, label=name, markersize=6
            )
            for name, sign in [*_FLAGS.items(), ("inferred", "+")]
        ]
        figure.legend(handles=handles, loc="lower left", ncols=4, frameon=False, fontsize=9.5)
        figure.text(0.99, 0.012, origin_note(scans), fontsize=9, color=palette.MUTED, ha="right")
        figure.tight_layout(rect=(0, 0.04, 1, 1))
        style.save(figure, path, dpi=120)


def clouds_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Points in space, coloured by their distance from the robot, as the paper has them."""
    extras.load("mpl_toolkits.mplot3d")
    with style.used():
        figure = style.figure(6.4 * len(scans), 5.4)
        for index, scan in enumerate(scans, start=1):
            axes = figure.add_subplot(1, len(scans), index, projection="3d")
            cloud_axes(axes, scan)
        figure.text(0.99, 0.012, origin_note(scans), fontsize=9, color=palette.MUTED, ha="right")
        style.save(figure, path, dpi=120)


def cloud_axes(axes: Any, scan: Scan) -> None:
    """Draw the cloud of a scan into three-dimensional axes."""
    points, inferred = cloud(scan)
    if len(points):
        colours = [palette.heat(share) for share in _shares(scan, points[:, 2])]
        for chosen, marker, size in ((~inferred, "o", 26), (inferred, "o", 9)):
            axes.scatter(
                *points[chosen].T, c=[c for c, one in zip(colours, chosen, strict=True) if one],
                s=size, marker=marker, depthshade=False,
                edgecolors=palette.PAPER, linewidths=0.3,
            )  # fmt: skip
    low, high = _box(scan, points)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(tuple(high - low), zoom=0.88)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
    axes.tick_params(labelsize=8.5)
    axes.set_title(_title(scan))
    axes.patch.set_alpha(0.0)
    axes.view_init(elev=28, azim=-60)
    for pane in (axes.xaxis, axes.yaxis, axes.zaxis):
        pane.set_pane_color(palette.PANEL)


def _box(
    scan: Scan, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of what is shown of a cloud: the points, with some room around them."""
    grid = scan.result.height_map
    square = np.array([[grid.x_mm[0], grid.y_mm[0]], [grid.x_mm[-1], grid.y_mm[-1]]])
    shown = points[:, :2] if len(points) else square
    low, high = shown.min(axis=0), shown.max(axis=0)
    half = max(float((high - low).max()) / 2 + scan.config.scan.step_mm, 10.0)
    middle = (low + high) / 2
    return np.array([*(middle - half), 0.0]), np.array([*(middle + half), max(top_mm(scan), 10.0)])


def cloud(scan: Scan) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points of a scan, heights above its base, (n, 3), and which of them were only inferred."""
    grid = scan.result.height_map
    rows, columns = np.nonzero(np.isfinite(grid.height_mm))
    points = np.stack(
        [grid.x_mm[columns], grid.y_mm[rows], grid.height_mm[rows, columns] - scan.base_mm], axis=1
    )
    return points, ~np.isin(grid.mark[rows, columns], TOUCHED)


def paths_picture(path: Path, scans: Sequence[Scan]) -> None:
    """The arm's way from above, coloured by time, with the contacts that stopped it."""
    collections = extras.load("matplotlib.collections")
    colours = extras.load("matplotlib.colors").LinearSegmentedColormap.from_list(
        "time", palette.HEAT
    )
    with style.used():
        figure = style.figure(6.2 * len(scans), 5.5)
        for axes, scan in zip(figure.subplots(1, len(scans), squeeze=False)[0], scans, strict=True):
            way = scan.path.value[:, :2]
            lines = collections.LineCollection(
                np.stack([way[:-1], way[1:]], axis=1), cmap=colours, linewidths=1.6
            )
            lines.set_array(scan.path.time_s[:-1])
            axes.add_collection(lines)
            bar = figure.colorbar(lines, ax=axes, shrink=0.8)
            bar.set_label("time since the scan began (s)")
            touched = np.array([[p.x_mm, p.y_mm] for p in scan.result.places if p.mark in TOUCHED])
            if len(touched):
                axes.scatter(*touched.T, s=13, color=palette.INK, zorder=3, label="touched")
            stops = scan.step_contacts.value
            if len(stops):
                axes.scatter(
                    *stops.T, s=34, marker="x", color=palette.CONTACT, zorder=4,
                    label="a contact stopped the arm",
                )  # fmt: skip
            _square(axes, scan)
            axes.set_title(f"{_title(scan)}, {scan.result.duration_s:.0f} s")
            if len(touched) or len(stops):
                axes.legend(
                    frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0, -0.12), ncols=2
                )
        figure.tight_layout()
        style.save(figure, path, dpi=120)


def pressure_picture(path: Path, scans: Sequence[Scan]) -> None:
    """The pressure over the whole scan, and around its first touch."""
    with style.used():
        figure = style.figure(12.4, 2.7 * len(scans) + 0.5)
        axes = figure.subplots(
            len(scans), 2, squeeze=False, gridspec_kw={"width_ratios": [1.7, 1.0]}
        )
        for scan, (whole, close) in zip(scans, axes, strict=True):
            first_s = next(
                (
                    float(time_s)
                    for time_s, place in zip(scan.place_s, scan.result.places, strict=False)
                    if place.mark in TOUCHED
                ),
                float(scan.pressure.time_s[0]) if len(scan.pressure.time_s) else 0.0,
            )
            begin_s = max(0.0, first_s - _CLOSE_S / 3)
            for part, limits in (
                (whole, (0.0, max(scan.result.duration_s, 1.0))),
                (close, (begin_s, begin_s + _CLOSE_S)),
            ):
                part.plot(
                    scan.pressure.time_s, scan.pressure.value[:, 0], color=palette.PRESSURE,
                    linewidth=0.6 if part is whole else 1.1,
                )  # fmt: skip
                part.set_xlim(*limits)
                part.set_xlabel("time since the scan began (s)")
                part.grid(color=palette.GRID)
            times_s = scan.step_contacts.time_s
            for time_s in times_s[(times_s > begin_s) & (times_s < begin_s + _CLOSE_S)]:
                close.axvline(time_s, color=palette.CONTACT, linewidth=1.0)
            whole.set_title(f"{_title(scan)}: pressure")
            close.set_title("around the first touch")
            whole.set_ylabel("hPa")
        figure.tight_layout()
        style.save(figure, path, dpi=120)


def overview_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Clouds of the scans side by side, and what they took: for the documentation."""
    extras.load("mpl_toolkits.mplot3d")
    with style.used():
        figure = style.figure(13.2, 5.2)
        for index, scan in enumerate(scans[:2]):
            axes = figure.add_axes((0.01 + 0.375 * index, 0.0, 0.36, 0.98), projection="3d")
            cloud_axes(axes, scan)
        bars = figure.add_axes((0.81, 0.16, 0.17, 0.66))
        names = [scan.result.mode for scan in scans]
        times_s = [scan.result.duration_s for scan in scans]
        bars.bar(
            names, times_s, color=[palette.PRESSURE, palette.BRISTLE, palette.TENDON][: len(names)]
        )
        for index, time_s in enumerate(times_s):
            bars.text(index, time_s, f"{time_s:.0f} s", ha="center", va="bottom")
        bars.set_title("robot time")
        bars.set_yticks([])
        bars.spines["left"].set_visible(False)
        figure.text(0.985, 0.012, origin_note(scans), fontsize=9, color=palette.MUTED, ha="right")
        style.save(figure, path, dpi=130)


def _height_axes(figure: Any, axes: Any, scan: Scan, high_mm: float) -> None:
    grid = scan.result.height_map
    _image(
        figure,
        axes,
        scan,
        grid.height_mm - scan.base_mm,
        (scan.lowest_mm - scan.base_mm, high_mm),
        f"{scan.above} (mm)",
    )
    axes.set_title(f"{_title(scan)}: heights")
    for flag, sign in _FLAGS.items():
        rows, columns = np.nonzero(grid.mark == flag)
        axes.scatter(
            grid.x_mm[columns],
            grid.y_mm[rows],
            marker=sign,
            s=20,
            color=palette.INK,
            edgecolors=palette.PAPER,
            linewidths=0.6,
        )
    rows, columns = np.nonzero((grid.mark == "inferred") & np.isfinite(grid.height_mm))
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker="+", s=14, linewidths=0.7,
                 color=palette.INK)  # fmt: skip
    rows, columns = np.nonzero(grid.mark == "unvisited")
    axes.scatter(grid.x_mm[columns], grid.y_mm[rows], marker=".", s=4, color=palette.HOLDER)


def _truth_axes(figure: Any, axes: Any, scan: Scan, high_mm: float) -> None:
    surface = scan.surface
    assert surface is not None
    height_mm = np.where(surface.height_mm > scan.lowest_mm, surface.height_mm, np.nan)
    image = axes.imshow(
        height_mm - scan.base_mm, origin="lower", cmap=_heat(),
        vmin=scan.lowest_mm - scan.base_mm, vmax=high_mm,
        extent=_extent(surface.step_mm, height_mm.shape, surface.step_mm),
    )  # fmt: skip
    figure.colorbar(image, ax=axes, shrink=0.8).set_label(f"{scan.above} (mm)")
    axes.set_title("true surface, where it is in reach")
    _square(axes, scan)


def _error_axes(figure: Any, axes: Any, scan: Scan) -> None:
    surface, found = scan.surface, scan.quality
    assert surface is not None
    assert found is not None
    grid = scan.result.height_map
    error_mm = grid.height_mm - surface.at(grid)
    cmap = extras.load("matplotlib.colors").LinearSegmentedColormap.from_list(
        "error", [palette.HEAT[0], "#ffffff", palette.HEAT[-1]]
    )
    step_mm = scan.config.scan.step_mm
    image = axes.imshow(
        error_mm, origin="lower", cmap=cmap, vmin=-_ERROR_MM, vmax=_ERROR_MM,
        extent=_extent(step_mm, error_mm.shape, step_mm),
    )  # fmt: skip
    axes.set_facecolor(palette.PANEL)
    figure.colorbar(image, ax=axes, shrink=0.8, extend="both").set_label("error (mm)")
    rms = f"{found.rms_mm:.2f} mm RMS" if found.places else "no place"
    axes.set_title(f"error: {rms} away from edges")
    _square(axes, scan)


def _image(
    figure: Any, axes: Any, scan: Scan, values: NDArray[np.float64],
    limits: tuple[float, float], label: str,
) -> None:  # fmt: skip
    step_mm = scan.config.scan.step_mm
    image = axes.imshow(
        values, origin="lower", cmap=_heat(), vmin=limits[0], vmax=limits[1],
        extent=_extent(step_mm, values.shape, step_mm),
    )  # fmt: skip
    axes.set_facecolor(palette.PANEL)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label(label)
    _square(axes, scan)


def _square(axes: Any, scan: Scan) -> None:
    grid = scan.result.height_map
    edge_mm = 0.75 * scan.config.scan.step_mm
    axes.set(
        xlim=(-edge_mm, grid.x_mm[-1] + edge_mm), ylim=(-edge_mm, grid.y_mm[-1] + edge_mm),
        xlabel="x (mm)", ylabel="y (mm)", aspect="equal",
    )  # fmt: skip


def _extent(
    step_mm: float, shape: tuple[int, ...], cell_mm: float
) -> tuple[float, float, float, float]:
    half = cell_mm / 2
    return (-half, (shape[1] - 1) * step_mm + half, -half, (shape[0] - 1) * step_mm + half)


def _heat() -> Any:
    colours = extras.load("matplotlib.colors")
    return colours.LinearSegmentedColormap.from_list("heat", palette.HEAT[::-1])


def _shares(scan: Scan, heights_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """From the nearest to the robot, 0, to the farthest that it reaches, 1; heights from base."""
    high_mm, low_mm = top_mm(scan), scan.lowest_mm - scan.base_mm
    shares: NDArray[np.float64] = (high_mm - heights_mm) / max(high_mm - low_mm, 1.0)
    return shares


def top_mm(scan: Scan) -> float:
    """Highest of what was found, and of what is there, above the base."""
    heights = scan.result.height_map.height_mm
    found = heights[np.isfinite(heights)]
    tops = [float(found.max())] if len(found) else []
    if scan.surface is not None:
        tops.append(float(scan.surface.height_mm.max()))
    return max([*(top - scan.base_mm for top in tops), 1.0])


def _title(scan: Scan) -> str:
    return f"{scan.result.mode}" + ("" if scan.result.complete else " (not complete)")
