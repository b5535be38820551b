"""`setae cloud`, `setae cluster` and `setae classify`: what scans show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.table import Table

from setae.cli import tell
from setae.cli.common import Flag, app, console, new_folder
from setae.cli.runs import say
from setae.errors import ExtraMissingError, InputError
from setae.experiments import samples, shapes
from setae.experiments.samples import Sample
from setae.perception import classifier, features, maps
from setae.perception import cloud as clouds
from setae.wording import counted

Format = Literal["ply", "csv", "npy", "npz", "map"]


@app.command
def cloud(
    run: Path,
    *more: Path,
    form: Annotated[list[Format] | None, Parameter(name="--format", negative="")] = None,
    out: Path | None = None,
    force: Flag = False,
) -> None:
    """Write the points that scans touched as files for other programs.

    Parameters
    ----------
    run
        A scan's log or folder, a study's folder, or a height map (.npz).
    more
        Further ones.
    form
        ply, csv, npy (the points alone) or npz (points and marks); map: the height map, as npz.
        Several times: several files. Without it ply and csv.
    out
        Folder for the files; the default is the next free runs/cloud-N.
    force
        Use --out though it holds files; those of the same names are replaced.
    """
    found = _read(run, *more)
    folder = new_folder("cloud", out, force=force)
    names: set[str] = set()
    for sample in found:
        name = _free(sample.name, names)
        points = clouds.of_map(sample.heights)
        for kind in dict.fromkeys(form or ("ply", "csv")):
            if kind == "map":
                path = maps.write(folder / f"{name}-map.npz", sample.heights)
            else:
                path = clouds.write(folder / f"{name}.{kind}", points)
            say(f"{path}: {counted(len(points.points_mm), 'point')}")


@app.command
def cluster(
    run: Path,
    *more: Path,
    out: Path | None = None,
    model: Path | None = None,
    force: Flag = False,
    report: bool = True,
) -> None:
    """Compare scans of several objects: t-SNE as in the paper, and which are told apart.

    Parameters
    ----------
    run
        A scan's log or folder, a study's folder, or a height map (.npz). NAME=PATH says what was
        scanned; simulated scans know it themselves.
    more
        Further ones: best five of each object.
    out
        Folder for report, pictures and tables; the default is the next free runs/cluster-N.
    model
        Where to write what was learned of the objects, for `setae classify`.
    force
        Use --out though it holds files; those of the same names are replaced.
    report
        Write the report.
    """
    found = shapes.compare(_read(run, *more))
    for line in found.left_out:
        tell(line)
    _print_comparison(found)
    if model is not None:
        say(f"Model: {classifier.save(model, found.model)}")
    if report:
        from setae.report import cluster as pages

        folder = new_folder("cluster", out, force=force)
        try:
            say(f"Report: {pages.write(found, folder).page}")
        except ExtraMissingError as error:
            console.print(f"No report: {error}", style="yellow", markup=False, soft_wrap=True)


@app.command
def classify(run: Path, *more: Path, model: Path) -> None:
    """Say which known object a scan is of, how sure that is, or that it is none of them.

    Parameters
    ----------
    run
        A scan's log or folder, a study's folder, or a height map (.npz).
    more
        Further ones.
    model
        What `setae cluster --model` wrote.
    """
    known = classifier.load(model)
    table = Table(box=None, padding=(0, 3, 0, 0))
    for name in ("scan", "is", "sure", "fits", "else"):
        table.add_column(name, justify="right" if name in ("sure", "fits") else "left")
    left_out = []
    for sample in _read(run, *more):
        try:
            answer = known.answer(features.described(sample.heights))
        except InputError as error:
            left_out.append(f"{sample.name} is left out: {error}")
            continue
        others = sorted(answer.shares.items(), key=lambda pair: -pair[1])
        second = next(((name, share) for name, share in others if name != answer.nearest), None)
        if answer.known:
            other = f"{second[0]} {second[1]:.0%}" if second and second[1] >= 0.05 else ""
            table.add_row(sample.name, answer.nearest, f"{answer.confidence:.0%}",
                          f"{answer.fit:.0%}", other)  # fmt: skip
        else:
            table.add_row(sample.name, "unknown", "", f"{answer.fit:.1%}",
                          f"likest {answer.nearest}")  # fmt: skip
    if not table.row_count:
        raise InputError(
            " ".join(["There is nothing to name.", *left_out]), "Give scans of an object."
        )
    for line in left_out:
        tell(line)
    console.print(table, soft_wrap=True)


def _read(*paths: Path) -> list[Sample]:
    """Read the scans; one that ended early is told, and taken as far as it goes."""
    found = samples.read_all(paths)
    for sample in found:
        unvisited = int((sample.heights.mark == "unvisited").sum())
        if unvisited:
            tell(
                f"{sample.name} is not whole: {unvisited} of {sample.heights.mark.size} "
                "places were not visited."
            )
    return found


def _free(name: str, taken: set[str]) -> str:
    """The name, with a number where two scans have it."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}-{number}", number + 1
    taken.add(free)
    return free


def _print_comparison(found: shapes.Comparison) -> None:
    table = Table(box=None, padding=(0, 3, 0, 0))
    for name in ("object", "scans", "named right", "unknown, if never met"):
        table.add_column(name, justify="left" if name == "object" else "right")
    for shape in found.shapes:
        some = [i for i, label in enumerate(found.labels) if label == shape]
        table.add_row(
            shape,
            str(len(some)),
            str(sum(found.answers[i].shape == shape for i in some)),
            str(sum(not found.strangers[i].known for i in some)),
        )
    console.print(table)
    say(
        f"Named right {found.accuracy:.0%}, unknown if never met {found.unknown:.0%}. Silhouette "
        f"{found.silhouette:.2f} of the descriptions, {found.silhouette_paper:.2f} of the "
        f"heights as the paper aligns them, {found.silhouette_plane:.2f} of their t-SNE."
    )
