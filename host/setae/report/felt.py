"""What the bristle felt in a run: its pressure over time, and the directions of its touches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from setae.report import extras, palette, style
from setae.report.trial import Level, Trial, origin_note


def pressure_picture(path: Path, trial: Trial) -> None:
    """Pressure over a trial, and a closer look at the level where it ended."""
    level = next(
        (level for level in trial.levels if any(d.touched for d in level.directions)),
        trial.levels[-1] if trial.levels else None,
    )
    with style.used():
        figure = style.figure(11.0, 6.6)
        whole, close = figure.subplots(2, 1, height_ratios=(1.0, 1.25))
        figure.subplots_adjust(left=0.075, right=0.985, top=0.8, bottom=0.085, hspace=0.5)
        figure.text(0.02, 0.955, "What the bristle felt", fontsize=17, weight="bold", va="center")
        figure.text(
            0.02, 0.905,
            f"Trial {trial.number}, {origin_note([trial])}. A touch is a change of more than "
            f"{trial.threshold_hpa:g} hPa against the pressure just before each reach. Colours: "
            "direction α.",
            fontsize=10.5, color=palette.MUTED, va="center",
        )  # fmt: skip
        pressure_axes(whole, trial, trial.start_us, trial.end_us)
        for step in trial.levels:
            whole.annotate(
                f"{step.descent_mm:.0f} mm",
                (float(trial.seconds((step.start_us + step.end_us) / 2)), 1.02),
                xycoords=("data", "axes fraction"),
                ha="center",
                fontsize=9.5,
                color=palette.MUTED,
            )
        whole.set_title("The whole trial, and how deep the arm was", pad=20)
        if level is not None:
            pressure_axes(close, trial, level.start_us, level.end_us)
            name_directions(close, trial)
            close.set_title(f"At {level.descent_mm:.0f} mm of descent", pad=20)
        close.set_xlabel("time since the trial began (s)")
        handles, labels = whole.get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="upper right", bbox_to_anchor=(0.99, 0.985), ncols=3, frameon=False
        )
        style.save(figure, path)


def name_directions(axes: Any, trial: Trial) -> None:
    """Write the direction α above each coloured band that `pressure_axes` drew."""
    begin_s, end_s = axes.get_xlim()
    shown = [
        (max(float(start_s), begin_s), min(float(stop_s), end_s), direction)
        for level in trial.levels
        for direction in level.directions
        for start_s, stop_s in [trial.seconds([direction.start_us, direction.end_us])]
        if stop_s > begin_s and start_s < end_s
    ]
    for start_s, stop_s, direction in shown:
        # Where the bands are wide it says what the number is.
        name = "α = " if stop_s - start_s > 0.2 * (end_s - begin_s) else ""
        axes.annotate(
            f"{name}{direction.alpha_deg:.0f}°",
            ((start_s + stop_s) / 2, 1.02),
            xycoords=("data", "axes fraction"),
            ha="center",
            fontsize=9.5,
            weight="bold" if direction.touched else "normal",
            color=palette.CONTACT if direction.touched else palette.MUTED,
        )


def pressure_axes(axes: Any, trial: Trial, start_us: int, end_us: int) -> None:
    """Draw a stretch of the pressure, with the band it was watched in and the touches."""
    pressure = trial.pressure.between(start_us, end_us)
    seconds = trial.seconds(pressure.time_us)
    for level in trial.levels:
        for direction in level.directions:
            if direction.end_us >= start_us and direction.start_us <= end_us:
                axes.axvspan(
                    *trial.seconds([direction.start_us, direction.end_us]),
                    color=palette.direction(direction.alpha_deg),
                    linewidth=0,
                    zorder=0,
                )
    axes.fill_between(
        seconds,
        pressure.baseline_hpa - trial.threshold_hpa,
        pressure.baseline_hpa + trial.threshold_hpa,
        color=palette.INK,
        alpha=0.10,
        linewidth=0,
        label=f"baseline ± {trial.threshold_hpa:g} hPa while watching",
        zorder=1,
    )
    axes.plot(
        seconds,
        pressure.pressure_hpa,
        color=palette.PRESSURE,
        linewidth=0.9,
        label="pressure",
        zorder=2,
    )
    shown = [c for c in trial.contacts if start_us <= c.time_us <= end_us]
    if shown:
        axes.scatter(
            [float(trial.seconds(c.time_us)) for c in shown],
            [c.pressure_hpa for c in shown],
            s=46,
            color=palette.CONTACT,
            edgecolors="white",
            linewidths=1.0,
            label="touch",
            zorder=4,
        )
    axes.set_xlim(*trial.seconds([start_us, end_us]))
    axes.set_ylabel("pressure (hPa)")
    axes.ticklabel_format(useOffset=False)


def directions_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Draw, per trial, a rose of the directions felt at each depth; red where it touched."""
    depths = sorted({level.descent_mm for trial in trials for level in trial.levels})
    with style.used():
        # Three roses' width at least, or the line below the title needs too many lines.
        figure = style.figure(2.9 * max(len(trials), 3) + 0.4, 4.7)
        style.headline(
            figure, "Where the bristle touched",
            f"{origin_note(trials).capitalize()}. Looking down the tube. One ring a depth, the "
            "outermost the deepest: its number is the arm's descent in mm. One sector a "
            "direction α.",
        )  # fmt: skip
        width = 1.0 / len(trials)
        for position, trial in enumerate(trials):
            axes = figure.add_axes(
                (position * width + 0.1 * width, 0.12, 0.8 * width, 0.55), projection="polar"
            )
            _rose(axes, trial, depths)
            figure.text(
                (position + 0.5) * width, 0.755, f"Trial {trial.number}: {trial.label}",
                ha="center", fontsize=10.5, weight="bold",
            )  # fmt: skip
        _legend(figure)
        style.save(figure, path)


def _legend(figure: Any) -> None:
    patches = extras.load("matplotlib.patches")
    figure.legend(
        handles=[
            patches.Patch(color=palette.CONTACT, label="touched"),
            patches.Patch(color=palette.CLEAR, label="felt, nothing there"),
            patches.Patch(fc="white", ec="#c5ced6", ls="--", label="not reached: stopped before"),
        ],
        loc="lower center",
        ncols=3,
        frameon=False,
    )


def _rose(axes: Any, trial: Trial, depths: Sequence[float]) -> None:
    by_depth = {level.descent_mm: level for level in trial.levels}
    alphas = sorted({d.alpha_deg for level in trial.levels for d in level.directions})
    width = 2 * np.pi / max(len(alphas), 1)
    # Seen from above with the world's x to the right, frame D's α runs clockwise.
    axes.set_theta_direction(-1)
    for ring, depth in enumerate(depths):
        level: Level | None = by_depth.get(depth)
        felt = {d.alpha_deg: d.touched for d in level.directions} if level else {}
        for alpha in alphas:
            touched = felt.get(alpha)
            axes.bar(
                np.radians(alpha),
                0.9,
                width - 0.12 / (ring + 1.65),
                bottom=ring + 1.2,
                color="white" if touched is None else palette.CONTACT if touched else palette.CLEAR,
                edgecolor="#d5dce2" if touched is None else "white",
                linestyle="--" if touched is None else "-",
                linewidth=0.7,
            )
        axes.text(
            width / 2, ring + 1.65, f"{depth:.0f}", fontsize=6.5, ha="center", va="center",
            color=palette.MUTED, bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none"},
        )  # fmt: skip
    axes.set_ylim(0, len(depths) + 1.3)
    axes.set_yticks([])
    axes.set_xticks(np.radians(alphas), [f"{alpha:.0f}°" for alpha in alphas], fontsize=7.5)
    axes.tick_params(pad=-2)
    axes.grid(visible=False)
    axes.spines["polar"].set_visible(False)
