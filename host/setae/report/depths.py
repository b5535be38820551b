"""How deep the trials of a run went, beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from setae.report import extras, palette, style
from setae.report.tables import compare
from setae.report.trial import Trial, origin_note


def trials_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Show how far down each trial went, beside the paper's."""
    with style.used():
        height = 2.1 + 0.62 * len(trials)
        figure = style.figure(9.0, height)
        top = style.headline(
            figure, "How deep it went before it stopped",
            f"This run ({origin_note(trials)}) beside the paper's experiment.",
        )  # fmt: skip
        bottom = 0.65 / height
        axes = figure.add_axes((0.22, bottom, 0.745, top - 0.4 / height - bottom))
        trials_axes(axes, trials)
        figure.legend(
            handles=trials_handles(), loc="upper right", bbox_to_anchor=(0.985, top), ncols=3,
            frameon=False, fontsize=9.5,
        )  # fmt: skip
        style.save(figure, path)


def trials_axes(axes: Any, trials: Sequence[Trial]) -> None:
    """Draw one bar a trial, and a mark where the paper's robot stopped."""
    rows = compare(trials)
    for row, item in enumerate(rows):
        trial = item.trial
        colour = palette.CONTACT if trial.touched else palette.PRESSURE
        if not trial.complete:
            colour = palette.MUTED
        axes.barh(row, trial.descent_mm, height=0.36, color=colour, alpha=0.88, zorder=2)
        axes.text(
            trial.descent_mm + 1.5, row,
            f"{trial.descent_mm:.0f} mm" + ("" if trial.complete else ", ended early"),
            va="center", weight="bold", color=colour,
        )  # fmt: skip
        if item.theirs is not None:
            axes.plot(
                [item.theirs.descent_mm] * 2, [row - 0.36, row + 0.36], color=palette.INK,
                linewidth=2.4, zorder=3,
            )  # fmt: skip
    axes.set_yticks(
        range(len(rows)),
        [row.trial.label.replace(" at α", "\nat α") for row in rows],
        color=palette.INK,
    )
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    deepest = [row.trial.descent_mm for row in rows]
    deepest += [row.theirs.descent_mm for row in rows if row.theirs is not None]
    axes.set_xlim(0, 1.22 * max(deepest, default=0.0) or 1.0)
    axes.set_xlabel("descent of the arm (mm)")
    axes.grid(axis="x", color=palette.GRID, zorder=0)
    axes.spines["left"].set_visible(False)


def trials_handles() -> list[Any]:
    """Legend of `trials_axes`."""
    patches = extras.load("matplotlib.patches")
    lines = extras.load("matplotlib.lines")
    return [
        patches.Patch(color=palette.CONTACT, label="stopped by a touch"),
        patches.Patch(color=palette.PRESSURE, label="no touch, all steps"),
        lines.Line2D([], [], color=palette.INK, lw=2.4, label="the paper's robot"),
    ]
