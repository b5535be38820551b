"""The still pictures of a scan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from setae.heightmap import TOUCHED
from setae.report import extras, palette, style
from setae.report.scan_maps import MODES, heights_picture, square, title, top_mm
from setae.report.scan_notes import each, note
from setae.report.scan_reading import Scan

__all__ = ["cloud", "overview_picture", "write_all"]

# Of the pressure's close view.
_CLOSE_S: Final = 24.0


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


# ------------------------------------------------------------------------------ clouds


def clouds_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Points in space, coloured by their height."""
    extras.load("mpl_toolkits.mplot3d")
    with style.used():
        figure = style.figure(6.0 * len(scans) + 1.2, 5.6)
        points = "Small points were not visited: the places around leave no doubt."
        style.headline(figure, "Points that the bristle felt", f"{note(scans)} {points}")
        width = 6.0 / figure.get_figwidth()
        for index, scan in enumerate(scans):
            axes = figure.add_axes((index * width, 0.0, width, 0.84), projection="3d")
            cloud_axes(axes, scan, scans)
            axes.set_title(title(scan), y=0.96)
        _height_bar(figure, 1 - 0.95 / figure.get_figwidth(), scans)
        style.save(figure, path, dpi=120)


def overview_picture(path: Path, scans: Sequence[Scan]) -> None:
    """Clouds of the scans side by side, and what they took: for the documentation."""
    extras.load("mpl_toolkits.mplot3d")
    with style.used():
        figure = style.figure(13.2, 5.2)
        points = "Small points: not visited, the places around leave no doubt."
        style.headline(figure, "The same object felt in two modes", f"{note(scans)} {points}")
        for index, scan in enumerate(scans[:2]):
            axes = figure.add_axes((0.36 * index, -0.03, 0.36, 0.92), projection="3d")
            cloud_axes(axes, scan, scans)
            axes.set_title(title(scan), y=0.93)
        _height_bar(figure, 0.755, scans)
        bars = figure.add_axes((0.85, 0.16, 0.14, 0.62))
        times_s = [scan.result.duration_s for scan in scans]
        names = [MODES[scan.result.mode].replace(" ", "\n") for scan in scans]
        bars.bar(
            names, times_s, color=[palette.PRESSURE, palette.BRISTLE, palette.TENDON][: len(names)]
        )
        for index, time_s in enumerate(times_s):
            bars.text(index, time_s, f"{time_s:.0f} s", ha="center", va="bottom")
        bars.set_title("Robot's time (s)")
        bars.set_ylim(0, 1.08 * max(times_s))
        style.save(figure, path, dpi=130)


def cloud_axes(axes: Any, scan: Scan, beside: Sequence[Scan]) -> None:
    """Draw the cloud of a scan into three-dimensional axes, with the axes and colours of all."""
    points, inferred = cloud(scan)
    range_mm = _range_mm(beside)
    for chosen, size in ((~inferred, 26), (inferred, 9)):
        axes.scatter(
            *points[chosen].T, c=points[chosen, 2], s=size, depthshade=False,
            cmap=style.colours(palette.HEIGHTS), vmin=range_mm[0], vmax=range_mm[1],
            edgecolors=palette.PAPER, linewidths=0.3,
        )  # fmt: skip
    low, high = _box(beside)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(tuple(high - low), zoom=0.88)
    axes.set_xlabel("x (mm)", labelpad=6)
    axes.set_ylabel("y (mm)", labelpad=6)
    axes.set_zlabel("z (mm)", labelpad=0)
    axes.locator_params(nbins=5)
    axes.locator_params(axis="z", nbins=3)
    axes.tick_params(labelsize=8.5, pad=0)
    axes.patch.set_alpha(0.0)
    axes.view_init(elev=28, azim=-60)
    for pane in (axes.xaxis, axes.yaxis, axes.zaxis):
        pane.set_pane_color(palette.PANEL)
        pane._axinfo["grid"].update(color=palette.HOLDER, linewidth=0.7)
    if not len(points):
        axes.text2D(0.5, 0.5, "nothing touched", transform=axes.transAxes, ha="center",
                    color=palette.MUTED)  # fmt: skip


def _range_mm(scans: Sequence[Scan]) -> tuple[float, float]:
    """Heights that the colours span: from the deepest reach to the top."""
    return (
        min(scan.lowest_mm - scan.base_mm for scan in scans),
        max(top_mm(scan) for scan in scans),
    )


def _height_bar(figure: Any, left: float, scans: Sequence[Scan]) -> None:
    """Draw the heights' colour bar, if any scan has heights."""
    if not any(len(cloud(scan)[0]) for scan in scans):
        return
    low_mm, high_mm = _range_mm(scans)
    scale = extras.load("matplotlib.cm").ScalarMappable(cmap=style.colours(palette.HEIGHTS))
    scale.set_clim(low_mm, high_mm)
    axes = figure.add_axes((left, 0.2, 0.16 / figure.get_figwidth(), 0.5))
    figure.colorbar(scale, cax=axes).set_label(
        f"height {each(scans, lambda scan: scan.above)} (mm)"
    )


def _box(scans: Sequence[Scan]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of what is shown of clouds side by side: all points, with some room around them."""
    shown = np.concatenate([cloud(scan)[0][:, :2] for scan in scans])
    if not len(shown):
        grids = [scan.result.height_map for scan in scans]
        ends = [[(grid.x_mm[i], grid.y_mm[i]) for i in (0, -1)] for grid in grids]
        shown = np.concatenate([np.array(some) for some in ends])
    low, high = shown.min(axis=0), shown.max(axis=0)
    step_mm = max(scan.config.scan.step_mm for scan in scans)
    half = max(float((high - low).max()) / 2 + step_mm, 10.0)
    middle = (low + high) / 2
    top = max(10.0, *(top_mm(scan) for scan in scans))
    return np.array([*(middle - half), 0.0]), np.array([*(middle + half), top])


def cloud(scan: Scan) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points of a scan, heights above its base, (n, 3), and which of them were only inferred."""
    grid = scan.result.height_map
    rows, columns = np.nonzero(np.isfinite(grid.height_mm))
    points = np.stack(
        [grid.x_mm[columns], grid.y_mm[rows], grid.height_mm[rows, columns] - scan.base_mm], axis=1
    )
    return points, ~np.isin(grid.mark[rows, columns], TOUCHED)


# ----------------------------------------------------------------------- way and pressure


def paths_picture(path: Path, scans: Sequence[Scan]) -> None:
    """The arm's way from above, coloured by time, with the contacts that stopped it."""
    collections = extras.load("matplotlib.collections")
    with style.used():
        figure = style.figure(6.4 * len(scans), 6.0)
        top = style.headline(figure, "The arm's way from above", note(scans))
        style.arrange(figure, bottom=0.36 / figure.get_figheight(), top=top)
        for axes, scan in zip(figure.subplots(1, len(scans), squeeze=False)[0], scans, strict=True):
            way = scan.path.value[:, :2]
            lines = collections.LineCollection(
                np.stack([way[:-1], way[1:]], axis=1), cmap=style.colours(palette.HEIGHTS),
                linewidths=1.6,
            )  # fmt: skip
            lines.set_array(scan.path.time_s[:-1])
            lines.set_clim(0.0, max(scan.result.duration_s, 1.0))
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
            square(axes, scan)
            axes.set_title(f"{title(scan)}: {scan.result.duration_s:.0f} s")
        _legend(figure)
        style.save(figure, path, dpi=120)


def pressure_picture(path: Path, scans: Sequence[Scan]) -> None:
    """The pressure over the whole scan, and around its first touch."""
    with style.used():
        figure = style.figure(12.4, 2.8 * len(scans) + 1.7)
        top = style.headline(figure, "What the bristle felt", note(scans))
        style.arrange(figure, bottom=0.36 / figure.get_figheight(), top=top)
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
                None,
            )
            begin_s = max(0.0, (first_s or 0.0) - _CLOSE_S / 3)
            _pressure_axes(whole, scan, 0.0, max(scan.result.duration_s, 1.0), 0.6)
            _pressure_axes(close, scan, begin_s, begin_s + _CLOSE_S, 1.1)
            whole.set_title(title(scan))
            close.set_title("The beginning" if first_s is None else "Around the first touch")
        _legend(figure)
        style.save(figure, path, dpi=120)


def _legend(figure: Any) -> None:
    """Draw one legend of all axes below them."""
    handles = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=3, frameon=False)


def _pressure_axes(axes: Any, scan: Scan, begin_s: float, end_s: float, width: float) -> None:
    threshold_hpa = scan.config.bristle.threshold_hpa
    time_s = scan.pressure.time_s
    pressure_hpa, baseline_hpa = scan.pressure.value.T
    axes.fill_between(
        time_s, baseline_hpa - threshold_hpa, baseline_hpa + threshold_hpa, color=palette.INK,
        alpha=0.12, linewidth=0, label=f"baseline ± {threshold_hpa:g} hPa while watching",
    )  # fmt: skip
    axes.plot(time_s, pressure_hpa, color=palette.PRESSURE, linewidth=width, label="pressure")
    stops_s = scan.step_contacts.time_s
    close = end_s - begin_s <= _CLOSE_S
    for number, stop_s in enumerate(stops_s[(stops_s > begin_s) & (stops_s < end_s)]):
        if close:
            axes.axvline(
                stop_s, color=palette.CONTACT, linewidth=1.0,
                label="a contact stopped the arm" if number == 0 else None,
            )  # fmt: skip
    axes.set(xlim=(begin_s, end_s), xlabel="time since the scan began (s)", ylabel="pressure (hPa)")
    axes.ticklabel_format(useOffset=False)
    axes.grid(color=palette.GRID)
