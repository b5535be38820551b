"""Pictures of a validation: box plots, bubbles, where the robot went, and the workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from setae import workspace
from setae.experiments.accuracy import in_plane_mm
from setae.experiments.runs import Run
from setae.experiments.targets import COMPRESSION, GROUPS, combinations
from setae.report import extras, palette, paper, style
from setae.report import workspace as workspace_pictures
from setae.volume import Fate

__all__ = ["COLOURS", "origin_note", "write_all"]

COLOURS: Final[Mapping[str, str]] = {
    "paper": palette.PRESSURE,
    "parallel": palette.BRISTLE,
    "taut": palette.TENDON,
}


def write_all(folder: Path, runs: Sequence[Run]) -> tuple[Path, ...]:
    """Write all pictures of some runs, each with something measured."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, draw in (
        ("boxes", boxes_picture),
        ("bubbles", bubbles_picture),
        ("places", places_picture),
        ("targets", targets_picture),
    ):
        draw(folder / f"{name}.png", runs)
        written.append(folder / f"{name}.png")
    return tuple(written)


def origin_note(runs: Sequence[Run]) -> str:
    """Say where the data come from, in one line."""
    notes = dict.fromkeys(_origin(run) for run in runs)
    return "; ".join(notes)


def _origin(run: Run) -> str:
    if not run.simulated:
        return "measured on the robot"
    parts = ["simulated"]
    if plant := run.metadata.get("plant"):
        parts.append(f"plant {plant}")
    if run.metadata.get("seed") is not None:
        parts.append(f"seed {run.metadata['seed']}")
    if run.noise_sd_mm:
        parts.append(f"noise of {run.noise_sd_mm:g} mm")
    return ", ".join(parts)


# ------------------------------------------------------------------------------- boxes


def boxes_picture(path: Path, runs: Sequence[Run]) -> None:
    """Box plots of the five groups, the paper's mean and standard deviation beside them."""
    with style.used():
        figure = style.figure(10.5, 5.4)
        axes = figure.add_axes((0.07, 0.11, 0.915, 0.67))
        style.headline(
            figure,
            "Distance between where it was sent and where it came to",
            f"{origin_note(runs).capitalize()}. Boxes: quartiles; whiskers: up to 1.5 boxes; dots: "
            "beyond.",
        )
        _boxes(axes, runs)
        figure.legend(
            handles=_box_handles(runs), loc="upper right", frameon=False, ncols=len(runs) + 1,
            bbox_to_anchor=(0.99, 1 - 0.72 / figure.get_figheight()), fontsize=10,
        )  # fmt: skip
        style.save(figure, path)


def _boxes(axes: Any, runs: Sequence[Run]) -> None:
    width = 0.66 / len(runs)
    theirs = paper.validation()
    highest = max(row.distance.mean_mm + row.distance.sd_mm for row in theirs.values())
    for number, run in enumerate(runs):
        colour = COLOURS.get(run.model, palette.INK)
        shift = (number - (len(runs) - 1) / 2) * width - 0.06
        for place, group in enumerate(GROUPS):
            errors = [pose.in_plane_mm for pose in run.poses if pose.target.group == group]
            if not errors:
                continue
            highest = max(highest, *errors)
            axes.boxplot(
                [errors], positions=[place + shift], widths=0.8 * width, patch_artist=True,
                manage_ticks=False,
                boxprops={"facecolor": palette.mix(colour, "#ffffff", 0.72), "edgecolor": colour},
                medianprops={"color": colour, "linewidth": 2.2},
                whiskerprops={"color": colour}, capprops={"color": colour},
                flierprops={"marker": "o", "markersize": 3.5, "markerfacecolor": colour,
                            "markeredgecolor": "none", "alpha": 0.6},
            )  # fmt: skip
            axes.plot(
                place + shift, np.mean(errors), marker="D", ms=5.5, color="white", mec=colour,
                mew=1.4, zorder=5,
            )  # fmt: skip
    for place, group in enumerate(GROUPS):
        row = theirs[group].distance
        axes.errorbar(
            place + 0.4, row.mean_mm, row.sd_mm, fmt="D", color=palette.INK, ms=5.5, capsize=4,
            lw=1.5, zorder=6,
        )  # fmt: skip
    axes.set_xticks(
        range(len(GROUPS)),
        [_group_name(group) for group in GROUPS],
        color=palette.INK,
        fontsize=11,
    )
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.55, len(GROUPS) - 0.4)
    axes.set_ylim(0, 1.05 * highest)
    axes.set_ylabel("error in the bending plane (mm)")
    axes.grid(axis="y", color=palette.GRID, zorder=0)
    axes.set_axisbelow(True)


def _group_name(group: str) -> str:
    return "compression" if group == COMPRESSION else f"bent to {group.replace('-', '−')}"


def _box_handles(runs: Sequence[Run]) -> list[Any]:
    patches, lines = extras.load("matplotlib.patches"), extras.load("matplotlib.lines")
    handles = [
        patches.Patch(
            facecolor=palette.mix(colour, "#ffffff", 0.72), edgecolor=colour,
            label=f"model {run.model} (◇ mean)",
        )
        for run in runs
        for colour in [COLOURS.get(run.model, palette.INK)]
    ]  # fmt: skip
    return [
        *handles,
        lines.Line2D([], [], marker="D", color=palette.INK, lw=1.5, label="the paper: mean ± SD"),
    ]


# ----------------------------------------------------------------------------- bubbles


def bubbles_picture(path: Path, runs: Sequence[Run]) -> None:
    """Mean error over the directions at each of the 34 positions, as bubbles."""
    with style.used():
        figure = style.figure(9.6, 4.6 * len(runs) + 1.0)
        high = figure.get_figheight()
        style.headline(
            figure,
            "Mean error at each position, over the four directions",
            f"{origin_note(runs).capitalize()}. The number and the area: mm. Hollow: tendons that "
            "only pull can’t hold it. Cross: combination out of reach, so no target.",
        )
        for number, run in enumerate(runs):
            bottom = (0.65 + 4.6 * (len(runs) - 1 - number)) / high
            axes = figure.add_axes((0.065, bottom, 0.8, 3.6 / high))
            _bubbles(axes, run)
            axes.set_title(f"Model {run.model}", color=COLOURS.get(run.model, palette.INK), pad=8)
            _error_bar(figure, (0.9, bottom, 0.017, 3.6 / high))
        style.save(figure, path)


def _bubbles(axes: Any, run: Run) -> None:
    errors = in_plane_mm(run.poses)
    places = {
        (target.height_mm, target.bend_deg): target
        for target in run.targets
        if target.group == "+X"
    }
    arc = combinations()
    beyond = ~workspace.check(arc, run.config, "paper").reachable
    top = arc.top_mm[beyond]
    axes.scatter(top[:, 0], top[:, 2], s=16, marker="x", color=palette.MUTED, lw=1.0, zorder=1)
    shown = [places[place] for place in errors]
    holds = run.held(shown)
    for target, error, good in zip(shown, errors.values(), holds, strict=True):
        x, z = target.position_mm[0], target.position_mm[2]
        colour = _heat(error)
        axes.scatter(
            x, z, s=62.0 * error + 6.0, facecolors=colour if good else "none", edgecolors=colour,
            linewidths=0.8 if good else 2.0, alpha=0.75 if good else 1.0, zorder=2,
        )  # fmt: skip
        axes.annotate(
            f"{error:.1f}", (x, z), xytext=(0, 0 if error > 2.4 else 9),
            textcoords="offset points", ha="center",
            va="center", fontsize=7.5, zorder=3,
            color=palette.PAPER if good and error > 0.75 * _most_mm() else palette.INK,
        )  # fmt: skip
    axes.set_xlim(0, 3 + max([top[:, 0].max(), *(target.position_mm[0] for target in shown)]))
    axes.set_ylim(36, 75)
    axes.set_xlabel("desired x or y (mm)")
    axes.set_ylabel("desired z (mm)")
    axes.grid(color=palette.GRID, zorder=0)
    axes.set_axisbelow(True)


def _heat(error_mm: float) -> str:
    return palette.at(palette.AMOUNTS, error_mm / _most_mm())


def _most_mm() -> float:
    """Error with the scale's last colour: its middle is the paper's mean."""
    return 2 * paper.validation()["all"].distance.mean_mm


def _error_bar(figure: Any, place: tuple[float, float, float, float]) -> None:
    scale = extras.load("matplotlib.cm").ScalarMappable(cmap=style.colours(palette.AMOUNTS))
    scale.set_clim(0.0, _most_mm())
    bar = figure.colorbar(scale, cax=figure.add_axes(place), extend="max")
    bar.set_label("error in the bending plane (mm)")


# ------------------------------------------------------------------------------ places


def places_picture(path: Path, runs: Sequence[Run]) -> None:
    """In each bending plane: every target, and an arrow to where the robot came to."""
    with style.used():
        figure = style.figure(12.4, 0.95 + 3.45 * len(runs))
        style.headline(
            figure,
            "Where it came to",
            f"{origin_note(runs).capitalize()}. Rings: targets, dashed where tendons can’t hold "
            "them; points: where the spring’s top was.",
        )
        high = figure.get_figheight()
        for row, run in enumerate(runs):
            for column, plane in enumerate("XY"):
                bottom = (high - 0.85 - 3.45 * (row + 1) + 0.5) / high
                axes = figure.add_axes((0.055 + 0.46 * column, bottom, 0.405, 2.5 / high))
                _places(axes, run, plane)
                axes.set_title(f"Plane of {plane} and Z, model {run.model}", pad=6)
        bottom = 1 - (0.85 + 2.95) / high
        _error_bar(figure, (0.94, bottom, 0.013, 2.5 / high))
        style.save(figure, path)


def _places(axes: Any, run: Run, plane: str) -> None:
    collections = extras.load("matplotlib.collections")
    groups = (f"+{plane}", f"-{plane}") + ((COMPRESSION,) if plane == "X" else ())
    poses = [pose for pose in run.poses if pose.target.group in groups]
    if not poses:
        axes.text(0.5, 0.5, "not measured", ha="center", transform=axes.transAxes,
                  color=palette.MUTED)  # fmt: skip
        return
    holds = run.held([pose.target for pose in poses])
    wanted = np.array(
        [[pose.target.position_mm[pose.target.lateral_axis], pose.target.position_mm[2]]
         for pose in poses]
    )  # fmt: skip
    found = wanted + np.array([[pose.lateral_mm, pose.height_mm] for pose in poses])
    colours = [_heat(pose.in_plane_mm) for pose in poses]
    axes.add_collection(
        collections.LineCollection(
            np.stack([wanted, found], axis=1), colors=colours, linewidths=1.5, zorder=2
        )
    )
    axes.scatter(*found.T, s=13, c=colours, zorder=3)
    for good, dash in ((True, "-"), (False, (0, (2, 1.2)))):
        some = holds == good
        axes.scatter(*wanted[some].T, s=26, facecolors="none", edgecolors=palette.INK,
                     linewidths=0.9, linestyles=[dash], zorder=4)  # fmt: skip
    axes.set_xlim(-56, 56)
    axes.set_ylim(24, 78)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{plane.lower()} (mm)")
    axes.set_ylabel("z (mm)")
    axes.grid(color=palette.GRID, zorder=0)
    axes.set_axisbelow(True)


# ----------------------------------------------------------------------------- targets


def targets_picture(path: Path, runs: Sequence[Run]) -> None:
    """The targets in the workspace: reached, held or not, and those that are out of reach."""
    run = runs[0]
    patches, lines = extras.load("matplotlib.patches"), extras.load("matplotlib.lines")
    with style.used():
        figure = style.figure(9.6, 6.6)
        axes = figure.add_axes((0.075, 0.18, 0.9, 0.65))
        workspace_pictures.draw_section(axes, run.config, "paper", 0.0)
        axes.set_title("")
        arc = combinations()
        reach = workspace.check(arc, run.config, "paper")
        top = arc.top_mm
        straight = [t.position_mm[2] for t in run.targets if t.group == COMPRESSION]
        kinds = (
            (reach.reachable & reach.holdable, palette.INK, "o"),
            (reach.reachable & ~reach.holdable, palette.PAPER, "o"),
            (~reach.reachable, palette.MUTED, "x"),
        )
        for some, colour, marker in kinds:
            for side in (1, -1):
                axes.scatter(
                    side * top[some][:, 0], top[some][:, 2], s=22, marker=marker, color=colour,
                    edgecolors=None if marker == "x" else palette.INK, linewidths=0.9, zorder=5,
                )  # fmt: skip
        side_mm = 3 + float(np.abs(top[:, 0]).max())
        axes.set(xlim=(-side_mm, side_mm), ylim=(12, 73))
        axes.scatter(np.zeros(len(straight)), straight, s=22, color=palette.INK, zorder=5)
        held_count = int(kinds[0][0].sum())
        style.headline(
            figure,
            "The targets in the workspace",
            f"Computed, not measured. Of {reach.reachable.size} combinations of height and bending "
            f"{int(reach.reachable.sum())} are reached: the targets. {held_count} of them can be "
            "held by tendons that only pull.",
        )

        def dot(face: str, marker: str, label: str) -> Any:
            return lines.Line2D([], [], marker=marker, ls="", ms=5, mfc=face, label=label,
                                mec=palette.MUTED if marker == "x" else palette.INK)  # fmt: skip

        figure.legend(
            handles=[
                *(patches.Patch(fc=workspace_pictures.COLOURS[kind], ec=palette.MUTED, lw=0.4,
                                label=workspace_pictures.NAMES[kind])
                  for kind in (Fate.HELD, Fate.SLACK, Fate.LONG)),
                dot(palette.INK, "o", "target, held"),
                dot(palette.PAPER, "o", "target, needs a tendon that pushes"),
                dot(palette.MUTED, "x", "combination out of reach: no target"),
            ],
            loc="lower center", ncols=3, frameon=False, fontsize=9,
        )  # fmt: skip
        style.save(figure, path)
