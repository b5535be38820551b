"""Draw the theory page's pictures of workspace, holding and motions into docs/pictures.

    python docs/motion_pictures.py

`make_pictures.py` does it too.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from theory_pictures import STYLE

from setae import kinematics, packing, tendons, trajectory, volume, workspace
from setae.config import load
from setae.experiments.targets import combinations
from setae.report import palette
from setae.report import workspace as workspace_pictures
from setae.servo import ServoModel
from setae.trajectory import Limits

PICTURES = Path(__file__).resolve().parent / "pictures"
CONFIG = load()
SERVOS = ServoModel(CONFIG)


def draw(folder: Path) -> None:
    """Draw all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    measured = volume.measure(CONFIG, "paper")
    workspace_pictures.picture(folder / "workspace.png", CONFIG, "paper", measured)
    with mpl.rc_context(STYLE):
        holding(folder / "holding.png")
        packed(folder / "packing.png")
        paths(folder / "paths.png")


def holding(path: Path) -> None:
    """Where the spring rests for the paper's targets, and what hangs slack."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    where, slack = figure.subplots(1, 2, width_ratios=(1.25, 1))
    arc = combinations()
    reach = workspace.check(arc, CONFIG, "paper")
    lost = reach.reachable & ~reach.holdable
    for model, colour in (("paper", palette.CONTACT), ("parallel", palette.PRESSURE)):
        rest = workspace.check(arc, CONFIG, model).settled
        for goal, end in zip(arc.top_mm[lost], rest.arc.top_mm[lost], strict=True):
            where.annotate(
                "",
                (end[0], end[2]),
                (goal[0], goal[2]),
                arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.5},
            )
        where.plot([], [], color=colour, label=f"comes to rest, lengths of {model}")
        away = np.linalg.norm(rest.arc.top_mm - arc.top_mm, axis=-1)[lost]
        slack.scatter(
            away,
            rest.slack_mm.max(axis=-1)[lost],
            color=colour,
            label=f"lengths of {model}",
            zorder=3,
        )
    nearest = workspace.nearest_holdable(arc[lost], CONFIG, "paper").top_mm
    where.scatter(
        nearest[:, 0], nearest[:, 2], s=26, marker="x", color=palette.INK, label="nearest held pose"
    )
    held = reach.reachable & reach.holdable
    where.scatter(
        arc.top_mm[held, 0], arc.top_mm[held, 2], s=12, color=palette.MUTED, label="target, held"
    )
    where.scatter(
        arc.top_mm[lost, 0],
        arc.top_mm[lost, 2],
        s=30,
        facecolor=palette.PAPER,
        edgecolor=palette.INK,
        label="target, not held",
        zorder=3,
    )
    where.set(
        title="Computed: the paper's 34 targets", xlabel="x (mm)", ylabel="z (mm)", aspect="equal"
    )
    where.set_ylim(15, 68)
    where.legend(frameon=False, fontsize=8.5, loc="lower left")
    slack.set(
        title="Computed: the eight that can't be held",
        xlabel="spring's top, from the target (mm)",
        ylabel="slack of the loosest tendon (mm)",
    )
    slack.grid(color=palette.GRID)
    slack.legend(frameon=False)
    _save(figure, path)


def packed(path: Path) -> None:
    """What the board plays of an extension, and what a tolerance saves."""
    figure = Figure(figsize=(9.6, 3.9), layout="constrained")
    error, count = figure.subplots(1, 2, width_ratios=(1.4, 1))
    start = np.full(4, 45.0)
    end = tendons.lengths(kinematics.inverse((15.0, 0.0, 60.0)), CONFIG.geometry, "paper")
    limits = Limits(speed_mm_s=SERVOS.max_speed_mm_s)
    motion = trajectory.line(start, end, duration_s=1.0, limits=limits)
    begin = SERVOS.ticks(start)
    counts = {}
    for tolerance_um in (0, 1, 2, 5, 10, 15, 20, 30, 50, 100, 200):
        segments = SERVOS.segments(motion.lengths_mm, start_ticks=begin, tolerance_um=tolerance_um)
        counts[tolerance_um] = len(segments)
        if tolerance_um == 10:
            ends = np.cumsum([segment.duration_frames for segment in segments])
            played = packing.played(begin, ends, [segment.target_ticks for segment in segments])
            off_um = (SERVOS.lengths_mm(played) - motion.lengths_mm) * 1e3
            time_s = np.arange(1, motion.frames + 1) * trajectory.plan.FRAME_S
            # Tendon 3 moves as tendon 1 does.
            for tendon, colour in enumerate((palette.PRESSURE, palette.BRISTLE, palette.TENDON)):
                error.plot(
                    time_s, off_um[:, tendon], ".-", ms=3, lw=0.8, color=colour,
                    label=f"tendon {tendon}",
                )  # fmt: skip
            for at in time_s[ends - 1]:
                error.axvline(at, color=palette.GRID, zorder=0)
    half_tick = SERVOS.resolution_mm[0] * 500
    for sign, rounding, promised in ((1, "half a tick", "half a tick and 10 µm"), (-1, None, None)):
        error.axhline(sign * half_tick, color=palette.MUTED, lw=1, ls="--", label=rounding)
        error.axhline(sign * (half_tick + 10), color=palette.CONTACT, lw=1, label=promised)
    error.set(
        title=f"Computed: {counts[10]} segments for {motion.frames} frames",
        xlabel="time (s)",
        ylabel="tendon, played less planned (µm)",
        ylim=(-40, 30),
    )
    error.legend(frameon=False, ncols=3, fontsize=8.5, loc="lower center")
    count.plot(list(counts), list(counts.values()), "o-", color=palette.PRESSURE)
    count.axhline(motion.frames, color=palette.MUTED, lw=1, ls="--")
    count.text(1, motion.frames + 1, "one for each frame", color=palette.MUTED)
    count.set(
        title="What a tolerance saves",
        xlabel="tolerance besides rounding (µm)",
        ylabel="segments",
        ylim=(0, 56),
        xlim=(-0.5, 250),
    )
    count.set_xscale("symlog", linthresh=5)
    count.set_xticks([0, 5, 10, 20, 50, 200], ["0", "5", "10", "20", "50", "200"], minor=False)
    count.set_xticks([], minor=True)
    count.grid(color=palette.GRID)
    _save(figure, path)


def paths(path: Path) -> None:
    """A way along waypoints with and without stops, and a circle under two models."""
    figure = Figure(figsize=(9.6, 6.0), layout="constrained")
    corner, speed, circle, lengths = figure.subplots(2, 2).ravel()
    motion = CONFIG.motion
    limits = Limits(
        speed_mm_s=motion.move_speed_mm_s,
        acceleration_mm_s2=motion.acceleration_mm_s2,
        jerk_mm_s3=motion.jerk_mm_s3,
    )
    points = kinematics.inverse([(-14.0, 0, 55), (0, 12.0, 60), (14.0, 0, 55), (14.0, -12.0, 52)])
    styles = ((0.0, palette.MUTED), (2.0, palette.BRISTLE), (6.0, palette.PRESSURE))
    for blend_mm, colour in styles:
        way = trajectory.along(
            points, CONFIG.geometry, "parallel", limits=limits, blend_mm=blend_mm
        )
        top = kinematics.forward(way.lengths_mm, CONFIG.geometry, "parallel").top_mm
        label = f"{blend_mm:g} mm: {way.duration_s:.2f} s"
        corner.plot(top[:, 0], top[:, 1], color=colour, lw=1.8, label=label)
        _time(speed, way, way.speed_mm_s.max(axis=1), colour, label)
    corner.plot(*points.top_mm[:, :2].T, "o", color=palette.INK, ms=4, label="given points")
    corner.legend(*(part[-1:] for part in corner.get_legend_handles_labels()), frameon=False,
                  fontsize=8.5, loc="lower left")  # fmt: skip
    corner.set(
        title="Computed: a way along points, from above",
        xlabel="x (mm)",
        ylabel="y (mm)",
        aspect="equal",
    )
    speed.axhline(motion.move_speed_mm_s, color=palette.CONTACT, lw=1, label="limit")
    speed.set(
        title="The fastest tendon on it", xlabel="time (s)", ylabel="tendon's speed (mm/s)",
        xlim=(0, 1.45), ylim=(0, 66),
    )  # fmt: skip
    speed.legend(
        loc="center right",
        frameon=False,
        fontsize=8.5,
        title="blended before a corner by",
        title_fontsize=8.5,
    )
    pose = kinematics.inverse((15.0, 0.0, 60.0))
    for model, colour in (("parallel", palette.PRESSURE), ("paper", palette.CONTACT)):
        way = trajectory.circle(
            float(pose.length_mm), float(pose.theta_rad), CONFIG.geometry, model,
            start_rad=math.radians(20), limits=limits, speed_mm_s=60.0, at_jump="bridge",
        )  # fmt: skip
        label = f"{model}: {way.duration_s:.2f} s, {len(way.bridges)} bridges"
        _time(circle, way, way.lengths_mm[:, 0], colour, label)
        _time(lengths, way, way.speed_mm_s[:, 0], colour, label)
    circle.set(
        title="A circle at the tube's targets: tendon 0",
        xlabel="time (s)",
        ylabel="tendon's length (mm)",
    )
    circle.set_ylim(57.8, 68.6)
    circle.legend(frameon=False, fontsize=8.5, loc="upper center", ncols=2)
    lengths.set(title="Its speed", xlabel="time (s)", ylabel="tendon's speed (mm/s)")
    _save(figure, path)


def _time(
    axes: Axes, way: trajectory.FrameTrajectory, values: np.ndarray, colour: str, label: str
) -> None:
    time_s = np.arange(1, way.frames + 1) * way.duration_s / way.frames
    axes.plot(time_s, values, color=colour, lw=1.5, label=label)
    axes.grid(color=palette.GRID)


def _save(figure: Figure, path: Path) -> None:
    # No version of matplotlib in the file: the same code gives the same bytes.
    figure.savefig(path, dpi=140, metadata={"Software": None})


if __name__ == "__main__":
    draw(PICTURES)
