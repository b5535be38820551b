"""The report of a study: what each combination gave, every run's map, and what failed."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from setae.errors import InputError
from setae.experiments.study import MAP, RUNS, Row
from setae.heightmap import HeightMap
from setae.perception import maps
from setae.report import clouds, extras, files, palette, style, template
from setae.report.files import Report
from setae.wording import counted

__all__ = ["measures_picture", "runs_picture", "write"]

_LEAST_RANGE_MM = 20.0
_COLUMNS = 8
_ROWS = 8
_MEASURES = (
    ("robot_s", "robot’s time (s)"),
    ("height_rms_mm", "height error, RMS (mm)"),
    ("chamfer_mm", "Chamfer distance (mm)"),
)


def write(
    rows: Sequence[Row], varied: Sequence[str], out: str | Path, *, page: str = "report.html"
) -> Report:
    """Write the report of a study.

    Parameters
    ----------
    rows
        Lines of its runs.
    varied
        Keys of the configuration that it varies.
    out
        The study's folder.
    page
        Name of the page in it.

    Raises
    ------
    LogError
        The folder can't be written to.
    ExtraMissingError
        Matplotlib isn't installed.
    """
    folder = Path(out)
    # Runs of other calls in the same folder may differ in other keys: a name with a dot is one.
    keys = dict.fromkeys(key for row in rows for key in row if "." in key)
    differ = [key for key in keys if len({_shown(row.get(key)) for row in rows}) > 1]
    varied = list(dict.fromkeys([*varied, *differ]))
    drawn: list[Path] = []
    with files.writing(folder):
        pictures = files.pictures_of(folder)
        done = [row for row in rows if row["status"] == "done"]
        if done:
            drawn.append(measures_picture(pictures / "measures.png", done, varied))
            drawn.append(runs_picture(pictures / "runs.png", done, varied, folder))
        (folder / page).write_text(_page(rows, varied, drawn), encoding="utf-8")
    return Report(page=folder / page, pictures=tuple(drawn), tables=())


def _case(row: Row, varied: Sequence[str]) -> str:
    """Name of a run's combination, without object and seed."""
    changes = [f"{_short(key)} {_shown(row[key])}" for key in varied if row.get(key) is not None]
    return ", ".join([str(row["mode"]), *changes])


def _short(key: str) -> str:
    return key.removeprefix("simulator.").removesuffix("_name").rpartition(".")[2]


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return f"[{', '.join(_shown(one) for one in value)}]"
    return str(value)


# ---------------------------------------------------------------------------- pictures


def measures_picture(path: Path, done: Sequence[Row], varied: Sequence[str]) -> Path:
    """Draw each measure of every run, by object and combination."""
    shapes = list(dict.fromkeys(str(row["object"]) for row in done))
    cases = list(dict.fromkeys(_case(row, varied) for row in done))
    with style.used():
        height = 3.4 + 0.26 * len(cases)
        figure = style.figure(13.0, height)
        figure.text(0.015, 1 - 0.15 / height, "What the runs gave", fontsize=15, weight="bold",
                    va="top")  # fmt: skip
        note = f"Simulated. {counted(len(done), 'run')}; a dot is a run, a bar their median."
        figure.text(0.015, 1 - 0.5 / height, note, fontsize=10, color=palette.MUTED, va="top")
        grid = figure.add_gridspec(1, len(_MEASURES), left=0.045, right=0.99, wspace=0.2,
                                   bottom=(0.65 + 0.26 * len(cases)) / height,
                                   top=1 - 0.95 / height)  # fmt: skip
        for index, (name, title) in enumerate(_MEASURES):
            axes = figure.add_subplot(grid[index])
            _draw_measure(axes, done, varied, name, shapes, cases)
            axes.set_title(f"{title[:1].upper()}{title[1:]}", fontsize=11, pad=6)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, frameon=False, loc="lower left", ncols=1, fontsize=9,
                      bbox_to_anchor=(0.035, 0.0))  # fmt: skip
        style.save(figure, path)
    return path


def _draw_measure(
    axes: Any,
    done: Sequence[Row],
    varied: Sequence[str],
    name: str,
    shapes: Sequence[str],
    cases: Sequence[str],
) -> None:
    width = 0.8 / len(cases)
    for number, case in enumerate(cases):
        colour = clouds.SHAPE_COLOURS[number % len(clouds.SHAPE_COLOURS)]
        x, y = [], []
        for place, shape in enumerate(shapes):
            values = [
                float(row[name])
                for row in done
                if row["object"] == shape
                and _case(row, varied) == case
                and row.get(name) is not None
            ]
            middle = place - 0.4 + width * (number + 0.5)
            x += list(middle + np.linspace(-0.25, 0.25, len(values)) * width)
            y += values
            if values:
                axes.hlines(np.median(values), middle - 0.38 * width, middle + 0.38 * width,
                            color=colour, lw=2)  # fmt: skip
        # Nothing but the axes' ends would cut a dot in half.
        axes.scatter(x, y, s=14, color=colour, alpha=0.6, linewidths=0, label=case, clip_on=False)
    axes.set_xticks(range(len(shapes)), [clouds.title_of(s).replace(" ", "\n") for s in shapes],
                    fontsize=9)  # fmt: skip
    axes.set_xlim(-0.5, len(shapes) - 0.5)
    known = [float(row[name]) for row in done if row.get(name) is not None]
    axes.set_ylim(0, 1.08 * max([*known, 0.0]) or 1.0)
    axes.grid(axis="y", color=palette.GRID)
    axes.set_axisbelow(True)


def runs_picture(path: Path, done: Sequence[Row], varied: Sequence[str], folder: Path) -> Path:
    """Draw the height maps of the first runs."""
    shown: list[tuple[Row, HeightMap]] = []
    for row in done:
        if len(shown) < _COLUMNS * _ROWS:
            try:
                shown.append((row, maps.read(folder / RUNS / str(row["run"]) / MAP)))
            except InputError:
                continue  # the table has it; its map was taken away
    columns = min(_COLUMNS, max(len(shown), 1))
    count = -(-max(len(shown), 1) // columns)
    felt = [heights.height_mm[np.isfinite(heights.height_mm)] for _, heights in shown]
    tops_mm = [float(one.max()) if len(one) else 0.0 for one in felt]
    # One range for all; something flat doesn't get all colours.
    range_mm = max([_LEAST_RANGE_MM, *(float(np.ptp(one)) for one in felt if len(one))])
    with style.used():
        width, height = max(1.6 * columns + 1.3, 6.0), 1.95 * count + 1.4
        figure = style.figure(width, height)
        more = f" The first {len(shown)} of {len(done)} runs." if len(shown) < len(done) else ""
        top = style.headline(
            figure, "Height maps from above",
            "Simulated. Below each: object, seed and combination. Colours: from each map's top "
            f"down. Grey: nothing within reach. Dots: doubtful contacts.{more}",
        )  # fmt: skip
        grid = figure.add_gridspec(count, columns, left=0.2 / width, right=1 - 1.1 / width,
                                   bottom=0.4 / height, top=top - 0.1 / height, wspace=0.1,
                                   hspace=0.25)  # fmt: skip
        for index, ((row, heights), top_mm) in enumerate(zip(shown, tops_mm, strict=True)):
            axes = figure.add_subplot(grid[divmod(index, columns)])
            clouds.draw_map(axes, heights, low_mm=top_mm - range_mm, high_mm=top_mm)
            name = f"{clouds.title_of(str(row['object']))} {row['seed']}\n{_case(row, varied)}"
            axes.set_xlabel(name, fontsize=7.5)
        scale = extras.load("matplotlib.cm").ScalarMappable(cmap=style.colours(palette.HEIGHTS))
        scale.set_clim(-range_mm, 0.0)
        place = (1 - 0.9 / width, 0.4 / height, 0.16 / width, top - 0.5 / height)
        bar = figure.colorbar(scale, cax=figure.add_axes(place))
        bar.set_label("height, from the map's top (mm)", fontsize=9)
        bar.ax.tick_params(labelsize=8)
        style.save(figure, path)
    return path


# -------------------------------------------------------------------------------- page


def _page(rows: Sequence[Row], varied: Sequence[str], drawn: Sequence[Path]) -> str:
    failed = [row for row in rows if row["status"] != "done"]
    badges = '<span class="badge">Simulated: no hardware</span>'
    if failed:
        text = f"{len(failed)} of {counted(len(rows), 'run')} failed; see below"
        badges += f'<span class="badge warn">{text}</span>'
    words = ("What each measure came to, by object", "Height maps of the runs")
    pictures = [template.image(path, text) for path, text in zip(drawn, words, strict=False)] + [
        "",
        "",
    ]
    shapes = len({row["object"] for row in rows})
    seeds = len({row["seed"] for row in rows})
    return template.fill(
        "study.html",
        {
            "badges": badges,
            "finding": f"{len(rows) - len(failed)} of {counted(len(rows), 'run')} done: "
            f"{counted(shapes, 'object')}, {counted(seeds, 'seed')}, "
            f"{counted(len({_case(row, varied) for row in rows}), 'combination')}.",
            "measures": pictures[0],
            "maps": pictures[1],
            "cases": _cases(rows, varied),
            "failed": _failed(failed),
            "runs": _runs(rows, varied),
        },
    )


def _cases(rows: Sequence[Row], varied: Sequence[str]) -> str:
    lines = []
    for case in dict.fromkeys(_case(row, varied) for row in rows):
        some = [row for row in rows if _case(row, varied) == case]
        done = [row for row in some if row["status"] == "done"]
        cells = [html.escape(case), str(len(done)), str(len(some) - len(done))]
        for name, _ in _MEASURES:
            values = np.array([row[name] for row in done if row.get(name) is not None], float)
            if not len(values):
                cells.append("–")
            elif name == "height_rms_mm":
                cells.append(f"{np.sqrt(np.mean(values**2)):.2f}")
            else:
                cells.append(f"{values.mean():.3g}")
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    head = "".join(f"<th>{title}</th>" for _, title in _MEASURES)
    return (
        f"<table><thead><tr><th>combination</th><th>done</th><th>failed</th>{head}</tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table>"
    )


def _failed(failed: Sequence[Row]) -> str:
    if not failed:
        return "<p>None.</p>"
    items = "".join(
        f"<li><b>{html.escape(str(row['run']))}</b>: {html.escape(str(row['error']))}</li>"
        for row in failed
    )
    return f"<ul>{items}</ul>"


def _runs(rows: Sequence[Row], varied: Sequence[str]) -> str:
    names = ["object", "seed", "mode", *varied, "status", "touched", "doubtful",
             *(name for name, _ in _MEASURES), "wall_s"]  # fmt: skip
    lines = []
    for row in rows:
        cells = (html.escape(_shown(row[name])) if row.get(name) is not None else "–"
                 for name in names)  # fmt: skip
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
