"""The report of scans side by side: clouds as in the paper's figure 5, t-SNE, who is told apart."""

from __future__ import annotations

import csv
import html
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from setae.experiments.shapes import Comparison
from setae.perception.features import FEATURES
from setae.perception.measures import Nearness
from setae.report import clouds, extras, files, palette, style, template
from setae.report.files import Report

__all__ = ["clouds_picture", "finding", "trials_picture", "write"]

_TRIALS_SHOWN = 8


def write(found: Comparison, out: str | Path, *, page: str = "report.html") -> Report:
    """Write the report of a comparison.

    Parameters
    ----------
    found
        What `setae.experiments.shapes.compare` found.
    out
        The folder to write to; made if it isn't there.
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
    with files.writing(folder):
        pictures = files.pictures_of(folder)
        drawn = (
            clouds_picture(pictures / "clouds.png", found),
            trials_picture(pictures / "maps.png", found),
        )
        table = _csv(folder / "trials.csv", found)
        (folder / page).write_text(_page(found, drawn), encoding="utf-8")
    return Report(page=folder / page, pictures=drawn, tables=(table,))


def finding(found: Comparison) -> str:
    """Say in a few sentences what came out."""
    right = round(found.accuracy * len(found.labels))
    unknown = round(found.unknown * len(found.labels))
    return (
        f"{right} of {len(found.labels)} scans are named right by a model of all the others; "
        f"{unknown} of {len(found.labels)} are unknown to a model that never met their shape. "
        + " ".join(found.left_out)
    ).strip()


# ---------------------------------------------------------------------------- pictures


def clouds_picture(path: Path, found: Comparison) -> Path:
    """Draw one cloud of each shape, and all trials in the plane of t-SNE."""
    shapes = found.shapes
    first = [found.samples[found.labels.index(shape)] for shape in shapes]
    away = [clouds.about_middle(sample.heights)[1] for sample in first]
    most_mm = max([1.0, *(float(one.max()) for one in away if len(one))])
    plane = chr(97 + len(shapes))
    columns = 3 if len(shapes) <= 5 else 4
    rows = -(-(len(shapes) + 1) // columns)
    with style.used():
        width, height = 4.1 * columns, 3.5 * rows + 1.6
        figure = style.figure(width, height)
        top = style.headline(
            figure, "What the bristle felt of each object",
            f"{_origin(found)}. (a) to ({chr(96 + len(shapes))}): the first of the scans of each, "
            f"about the middle of its points. ({plane}): all {len(found.samples)} scans, as in the "
            "paper.",
        )  # fmt: skip
        grid = figure.add_gridspec(rows, columns, left=0.01, right=0.985, bottom=0.85 / height,
                                   top=top - 0.32 / height, wspace=0.1, hspace=0.16)  # fmt: skip
        places = [grid[divmod(index, columns)] for index in range(rows * columns)]
        for index, (shape, sample) in enumerate(zip(shapes, first, strict=True)):
            axes = figure.add_subplot(places[index], projection="3d")
            clouds.draw_cloud(axes, sample.heights, most_mm)
            axes.set_title(f"({chr(97 + index)}) {clouds.title_of(shape)}", pad=0)
        axes = figure.add_subplot(places[len(shapes)])
        _draw_plane(axes, found)
        axes.set_title(f"({plane}) t-SNE of all scans", pad=8, loc="center")
        scale = extras.load("matplotlib.cm").ScalarMappable(cmap=style.colours(palette.AMOUNTS))
        scale.set_clim(0.0, most_mm)
        bar = figure.add_axes((0.06, 0.6 / height, 1.4 / columns - 0.06, 0.15 / height))
        figure.colorbar(scale, cax=bar, orientation="horizontal").set_label(
            "distance from the middle of the points (mm)", fontsize=9.5
        )
        bar.tick_params(labelsize=8.5)
        style.save(figure, path)
    return path


def _draw_plane(axes: Any, found: Comparison) -> None:
    labels = np.asarray(found.labels)
    for index, shape in enumerate(found.shapes):
        some = found.plane[labels == shape]
        axes.scatter(
            *some.T, s=42, linewidths=0.8, edgecolors="white", label=clouds.title_of(shape),
            color=clouds.SHAPE_COLOURS[index % len(clouds.SHAPE_COLOURS)],
        )  # fmt: skip
    axes.set(xticks=[], yticks=[], xlabel="t-SNE 1", ylabel="t-SNE 2")
    axes.margins(0.12)
    for side in axes.spines.values():
        side.set(visible=True, color=palette.GRID)
    axes.legend(frameon=False, fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.08),
                ncols=3, handletextpad=0.1, columnspacing=0.8)  # fmt: skip


def trials_picture(path: Path, found: Comparison) -> Path:
    """Draw every trial's height map, what a model of the others says of it below."""
    shapes = found.shapes
    by_shape = {s: [i for i, label in enumerate(found.labels) if label == s] for s in shapes}
    columns = min(_TRIALS_SHOWN, max(len(some) for some in by_shape.values()))
    bases_mm, above = _bases(found)
    heights = np.concatenate(
        [
            sample.heights.height_mm.ravel() - base_mm
            for sample, base_mm in zip(found.samples, bases_mm, strict=True)
        ]
    )
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    with style.used():
        width, height = 1.75 * columns + 1.9, 2.0 * len(shapes) + 1.9
        figure = style.figure(width, height)
        top = style.headline(
            figure, "Height maps from above",
            f"{_origin(found)}. Below each: what a model of all the others says, and how sure it "
            "is. Grey: nothing within reach. Dots: doubtful (slipped, double or lost contacts).",
        )  # fmt: skip
        grid = figure.add_gridspec(len(shapes), columns, left=0.45 / width,
                                   right=1 - 1.15 / width, bottom=0.3 / height,
                                   top=top - 0.12 / height, wspace=0.1, hspace=0.3)  # fmt: skip
        for row, (shape, some) in enumerate(by_shape.items()):
            for column, index in enumerate(some[:columns]):
                axes = figure.add_subplot(grid[row, column])
                base_mm = bases_mm[index]
                clouds.draw_map(axes, found.samples[index].heights, low_mm=low + base_mm,
                                high_mm=high + base_mm)  # fmt: skip
                answer = found.answers[index]
                said = "unknown"
                if answer.known:
                    said = f"{clouds.title_of(answer.nearest)}, {answer.confidence:.0%}"
                right = answer.shape == shape
                axes.set_xlabel(said, fontsize=8,
                                color=palette.AGREES if right else palette.CONTACT)  # fmt: skip
                if column == 0:
                    axes.set_ylabel(clouds.title_of(shape), fontsize=10, weight="bold")
        scale = extras.load("matplotlib.cm").ScalarMappable(cmap=style.colours(palette.HEIGHTS))
        scale.set_clim(low, high)
        place = (1 - 0.85 / width, 0.3 / height, 0.16 / width, top - 0.42 / height)
        bar = figure.colorbar(scale, cax=figure.add_axes(place))
        bar.set_label(f"height {above} (mm)", fontsize=9)
        bar.ax.tick_params(labelsize=8)
        style.save(figure, path)
    return path


def _bases(found: Comparison) -> tuple[list[float], str]:
    """Where heights are told from, z of the world, and in words: the tables if all are known."""
    tables_mm = [sample.scene.table_z_mm for sample in found.samples if sample.scene]
    if len(tables_mm) == len(found.samples):
        return tables_mm, "above the table"
    return [0.0] * len(found.samples), "from the arm's start"


def _origin(found: Comparison) -> str:
    origins = dict.fromkeys(sample.origin for sample in found.samples)
    text = "; ".join(origins) if len(origins) <= 2 else f"{len(origins)} kinds of scans"
    return f"{text[:1].upper()}{text[1:]}"


# -------------------------------------------------------------------------------- page


def _page(found: Comparison, drawn: tuple[Path, ...]) -> str:
    simulated = all(sample.scene is not None for sample in found.samples)
    badge = (
        '<span class="badge">Simulated: no hardware</span>'
        if simulated
        else '<span class="badge real">Scans from files and logs</span>'
    )
    meanings = "".join(
        f"<li><b>{html.escape(feature.name)}</b>: {html.escape(feature.meaning)} "
        f"(expected spread {feature.spread:g})</li>"
        for feature in FEATURES
    )
    return template.fill(
        "cluster.html",
        {
            "badges": badge,
            "finding": html.escape(finding(found)),
            "clouds": template.image(drawn[0], "Point clouds and their t-SNE"),
            "maps": template.image(drawn[1], "Height maps of all trials"),
            "measures": _measures(found),
            "shapes": _shapes(found),
            "trials": _trials(found),
            "features": meanings,
        },
    )


def _measures(found: Comparison) -> str:
    rows = [
        ("named right, of all scans, each by a model of the others", f"{found.accuracy:.0%}"),
        ("unknown to a model without their shape", f"{found.unknown:.0%}"),
        ("silhouette of the descriptions, in units of expected spread", f"{found.silhouette:.2f}"),
        (
            "silhouette of the 20 × 15 heights, aligned as in the paper",
            f"{found.silhouette_paper:.2f}",
        ),
        ("silhouette of these in the plane of t-SNE", f"{found.silhouette_plane:.2f}"),
    ]
    near = [one for one in found.nearness if one is not None]
    if near:
        rms, chamfer = _together(near)
        rows.append(("height error away from edges, root mean square of all places", rms))
        rows.append(("Chamfer distance to the true surface, mean", chamfer))
    body = "".join(f"<tr><td>{name}</td><td><b>{value}</b></td></tr>" for name, value in rows)
    return f"<table><tbody>{body}</tbody></table>"


def _shapes(found: Comparison) -> str:
    lines = []
    for shape in found.shapes:
        some = [i for i, label in enumerate(found.labels) if label == shape]
        right = sum(found.answers[i].shape == shape for i in some)
        unknown = sum(not found.strangers[i].known for i in some)
        near = [one for i in some if (one := found.nearness[i]) is not None]
        cells = [
            clouds.title_of(shape),
            f"{right} of {len(some)}",
            f"{unknown} of {len(some)}",
            *_together(near),
        ]
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return (
        "<table><thead><tr><th>object</th><th>named right</th><th>unknown, when never met</th>"
        "<th>height RMS</th><th>Chamfer</th></tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table>"
    )


def _together(near: Sequence[Nearness]) -> tuple[str, str]:
    """Height error and Chamfer distance of some scans, in words."""
    places = sum(one.places for one in near)
    # A scan without a place away from edges has no height error, and one with many counts more.
    square_mm2 = sum(one.places * one.height_rms_mm**2 for one in near if one.places)
    chamfer_mm = [one.chamfer_mm for one in near if math.isfinite(one.chamfer_mm)]
    return (
        f"{math.sqrt(square_mm2 / places):.2f} mm" if places else "–",
        f"{sum(chamfer_mm) / len(chamfer_mm):.2f} mm" if chamfer_mm else "–",
    )


def _trials(found: Comparison) -> str:
    lines = []
    for sample, label, answer, stranger, vector in zip(
        found.samples, found.labels, found.answers, found.strangers, found.vectors, strict=True
    ):
        right = answer.shape == label
        said = html.escape(clouds.title_of(answer.shape or "unknown"))
        shown = f'<span class="{"same" if right else "other"}">{said}</span>'
        never = "unknown" if not stranger.known else clouds.title_of(stranger.nearest)
        cells = [
            html.escape(sample.name), html.escape(clouds.title_of(label)), shown,
            f"{answer.confidence:.0%}" if answer.known else "–", html.escape(never),
            *(f"{value:.2f}" for value in vector),
        ]  # fmt: skip
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    head = "".join(f"<th>{html.escape(feature.name)}</th>" for feature in FEATURES)
    return (
        "<table><thead><tr><th>scan</th><th>object</th><th>named</th><th>sure</th>"
        f"<th>shape never met</th>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
    )


def _numbers(near: Nearness | None) -> tuple[str, str]:
    values = (near.height_rms_mm, near.chamfer_mm) if near else (math.nan, math.nan)
    height_rms_mm, chamfer_mm = (f"{one:.4f}" if math.isfinite(one) else "" for one in values)
    return height_rms_mm, chamfer_mm


def _csv(path: Path, found: Comparison) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ("scan", "object", "named", "confidence", "fit", "known_without_its_shape",
             "tsne_1", "tsne_2", "height_rms_mm", "chamfer_mm",
             *(feature.name for feature in FEATURES))
        )  # fmt: skip
        for index, sample in enumerate(found.samples):
            answer, near = found.answers[index], found.nearness[index]
            writer.writerow(
                (sample.name, found.labels[index], answer.shape or "unknown",
                 f"{answer.confidence:.4f}" if answer.known else "", f"{answer.fit:.3g}",
                 "yes" if found.strangers[index].known else "no",
                 *(f"{value:.4f}" for value in found.plane[index]),
                 *_numbers(near),
                 *(f"{value:.5f}" for value in found.vectors[index]))
            )  # fmt: skip
    return path
