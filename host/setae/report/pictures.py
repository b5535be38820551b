"""Still pictures and the animation of a run, as files."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from setae.report import drawing, extras, palette, shapes, style
from setae.report.drawing import View
from setae.report.tables import compare
from setae.report.trial import Contact, Direction, Level, Trial

FLOOR_BELOW_MM = 30.0
RIM_MM = 10.0
_MARGIN_MM = 74.0  # for the parts' names
_ABOVE_MM = drawing.HOLDER_HEIGHT_MM + 30.0  # the arm above frame D


def origin_note(trials: Sequence[Trial]) -> str:
    """Say where the data come from, in one line."""
    if not trials[0].simulated:
        return "measured on the robot"
    seeds = [trial.log.metadata.get("seed") for trial in trials]
    if None in seeds:
        return "simulated"
    names = ", ".join(str(seed) for seed in dict.fromkeys(seeds))
    return f"simulated, {'seeds' if ',' in names else 'seed'} {names}"


def write_all(folder: Path, trials: Sequence[Trial]) -> tuple[Path, ...]:
    """Write the still pictures of a run into a folder, those that its logs have data for."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = telling(trials)
    written = []
    if shown.motion is not None:
        robot_picture(folder / "robot.png", shown)
        overview_picture(folder / "explore.png", trials)
        written += [folder / "robot.png", folder / "explore.png"]
    pressure_picture(folder / "pressure.png", shown)
    written.append(folder / "pressure.png")
    for name, draw in (
        ("directions", directions_picture),
        ("trials", trials_picture),
    ):
        draw(folder / f"{name}.png", trials)
        written.append(folder / f"{name}.png")
    return tuple(written)


def telling(trials: Sequence[Trial]) -> Trial:
    """Choose the trial that shows most: the second with a touch, so that one sees the way."""
    touched = [trial for trial in trials if trial.touched]
    return touched[min(1, len(touched) - 1)] if touched else trials[0]


# ------------------------------------------------------------------------ the robot


def moment(trial: Trial) -> tuple[int, Contact | None]:
    """Choose the index in `Motion` that shows most: a touch, else a reach to the side."""
    motion = trial.motion
    assert motion is not None
    if trial.contacts:
        return motion.at(trial.contacts[0].time_us), trial.contacts[0]
    sideways = np.linalg.norm(motion.filament_mm[:, 1, :2] - motion.arm_mm[:, :2], axis=1)
    deep = motion.arm_mm[:, 2] <= motion.arm_mm[:, 2].min() + 1.0
    return int(np.argmax(np.where(deep, sideways, -1.0))), None


def floor_mm(trials: Sequence[Trial]) -> float:
    """Lowest height that a picture of these trials must show."""
    lowest = [-150.0]
    for trial in trials:
        if trial.motion is not None:
            lowest.append(float(trial.motion.filament_mm[:, 1, 2].min()))
        if trial.cube is not None:
            lowest.append(trial.cube.centre_mm[2] - trial.cube.edge_mm / 2)
    return min(lowest) - FLOOR_BELOW_MM


def draw_scene(
    axes: Any, trial: Trial, index: int, floor: float, touched: Sequence[Contact], *, scale: float
) -> None:
    """Draw one moment of a trial: tube, cube, arm, robot and the touches so far."""
    motion = trial.motion
    assert motion is not None
    view = View.into(trial.tube)
    if trial.tube is not None:
        drawing.tube(axes, view, trial.tube, floor, RIM_MM)
    if trial.cube is not None:
        drawing.cube(axes, view, trial.cube)
    drawing.robot(axes, view, motion.backbone_mm[index], motion.filament_mm[index], scale=scale)
    drawing.holder(axes, view, motion.arm_mm[index])
    for contact in touched:
        drawing.contact(axes, view, contact, scale=scale)
    axes.set_aspect("equal")
    axes.set_axis_off()


def robot_picture(path: Path, trial: Trial, *, title: bool = True) -> None:
    """Draw the robot at its first touch, the parts named."""
    motion = trial.motion
    if motion is None:
        return
    index, contact = moment(trial)
    floor = floor_mm([trial])
    with style.used():
        figure = style.figure(9.0, 7.6)
        axes = figure.add_axes((0.0, 0.0, 1.0, 0.885 if title else 1.0))
        draw_scene(axes, trial, index, floor, [contact] if contact else [], scale=1.25)
        _frame(axes, trial, floor, motion.arm_mm[index, 2] + _ABOVE_MM, margin_mm=_MARGIN_MM)
        _name_parts(axes, trial, index, contact)
        if title:
            heading = (
                "The bristle touches the obstacle"
                if contact
                else f"Feeling around at {trial.descent_mm:.0f} mm of descent"
            )
            figure.text(0.04, 0.945, heading, fontsize=17, weight="bold", va="center")
            figure.text(
                0.04, 0.905, f"Trial {trial.number}, {origin_note([trial])}. Lengths are to scale.",
                fontsize=10.5, color=palette.MUTED, va="center",
            )  # fmt: skip
        style.save(figure, path)


def _frame(axes: Any, trial: Trial, floor: float, top_mm: float, *, margin_mm: float = 0.0) -> None:
    view = View.into(trial.tube)
    corners = np.array([[0.0, 0.0, floor], [0.0, 0.0, top_mm]])
    if trial.tube is not None:
        wall = shapes.shell(trial.tube, floor, RIM_MM).reshape(-1, 3)
        corners = np.concatenate([corners, wall])
    flat = view.flat(corners)
    axes.set_xlim(flat[:, 0].min() - 6 - margin_mm, flat[:, 0].max() + 6 + 0.8 * margin_mm)
    axes.set_ylim(flat[:, 1].min() - 6, flat[:, 1].max() + 6)


_LABEL_MM = 26.0  # two lines of a label, and some air


def _name_parts(axes: Any, trial: Trial, index: int, contact: Contact | None) -> None:
    """Write the parts' names into the margins, each with a line to its part."""
    motion = trial.motion
    assert motion is not None
    view = View.into(trial.tube)
    arm, backbone = motion.arm_mm[index], motion.backbone_mm[index]
    up = np.array([0.0, 0.0, 1.0])
    left = [
        ("robot arm", arm + (drawing.HOLDER_HEIGHT_MM + 14) * up),
        ("holder with\nfour servos", arm + 42.0 * up),
        ("spring and\nfour tendons", backbone[9]),
        ("bristle", motion.filament_mm[index].mean(axis=0)),
    ]
    right = []
    if contact is not None:
        right.append((f"touch:\n{contact.change_hpa:+.0f} hPa", drawing.contact_point_mm(contact)))
    if trial.cube is not None:
        # In the middle of a face that is seen: the view turns with the tube, and so does the cube.
        aside = np.array([np.sin(trial.cube.yaw_rad), -np.cos(trial.cube.yaw_rad), -0.6]) / 2
        corner = np.array(trial.cube.centre_mm) + trial.cube.edge_mm * aside
        right.append((f"cube,\n{trial.cube.edge_mm:.0f} mm", corner))
    edges = axes.get_xlim()
    for names, x, side in ((left, edges[0] + _MARGIN_MM - 14, -1), (right, edges[1] - 50, 1)):
        above_mm = np.inf  # the last label's height: the next one keeps clear of it
        for text, point in names:
            if not np.isfinite(point).all():
                continue
            end = view.flat(point)
            touch = text.startswith("touch")
            above_mm = min(end[1] + (14 if touch else 0), above_mm - _LABEL_MM)
            axes.annotate(
                text,
                end,
                xytext=(x, above_mm),
                ha="right" if side < 0 else "left",
                va="center",
                fontsize=12,
                color=palette.CONTACT if touch else palette.INK,
                weight="bold" if touch else "normal",
                arrowprops={"arrowstyle": "-", "color": palette.MUTED, "lw": 0.9},
                zorder=9,
            )


# -------------------------------------------------------------------------- pressure


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
            f"{trial.threshold_hpa:g} hPa against the pressure just before each reach.",
            fontsize=10.5, color=palette.MUTED, va="center",
        )  # fmt: skip
        _pressure_axes(whole, trial, trial.start_us, trial.end_us)
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
            _pressure_axes(close, trial, level.start_us, level.end_us)
            for direction in level.directions:
                _name_direction(close, trial, direction)
            close.set_title(f"At {level.descent_mm:.0f} mm of descent", pad=20)
        close.set_xlabel("time since the trial began (s)")
        handles, labels = whole.get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="upper right", bbox_to_anchor=(0.99, 0.985), ncols=3, frameon=False
        )
        style.save(figure, path)


def _name_direction(axes: Any, trial: Trial, direction: Direction) -> None:
    axes.annotate(
        f"{direction.alpha_deg:.0f}°",
        (float(trial.seconds((direction.start_us + direction.end_us) / 2)), 1.02),
        xycoords=("data", "axes fraction"),
        ha="center",
        fontsize=9.5,
        weight="bold" if direction.touched else "normal",
        color=palette.CONTACT if direction.touched else palette.MUTED,
    )


def _pressure_axes(axes: Any, trial: Trial, start_us: int, end_us: int) -> None:
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


# ------------------------------------------------------------------- where it touched


def directions_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Draw, per trial, a rose of the directions felt at each depth; red where it touched."""
    depths = sorted({level.descent_mm for trial in trials for level in trial.levels})
    with style.used():
        # Three roses' width at least, or the line below the title doesn't fit.
        figure = style.figure(2.9 * max(len(trials), 3) + 0.4, 4.5)
        figure.text(0.02, 0.93, "Where the bristle touched", fontsize=17, weight="bold")
        figure.text(
            0.02, 0.865,
            "Looking down the tube. One ring a depth, the outermost the deepest; one sector a "
            f"direction α. {origin_note(trials).capitalize()}.",
            fontsize=10.5, color=palette.MUTED,
        )  # fmt: skip
        width = 1.0 / len(trials)
        for position, trial in enumerate(trials):
            axes = figure.add_axes(
                (position * width + 0.1 * width, 0.13, 0.8 * width, 0.57), projection="polar"
            )
            _rose(axes, trial, depths)
            figure.text(
                (position + 0.5) * width, 0.775, f"Trial {trial.number}: {trial.label}",
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


# -------------------------------------------------------------- beside the paper


def trials_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Show how far down each trial went, beside the paper's."""
    with style.used():
        figure = style.figure(9.0, 1.6 + 0.72 * len(trials))
        axes = figure.add_axes((0.22, 0.17, 0.745, 0.62))
        figure.text(
            0.02, 0.935, "How deep it went before it stopped", fontsize=17, weight="bold",
            va="center",
        )  # fmt: skip
        figure.text(
            0.02, 0.86, f"This run ({origin_note(trials)}) beside the paper's experiment.",
            fontsize=10.5, color=palette.MUTED, va="center",
        )  # fmt: skip
        _trials_axes(axes, trials)
        figure.legend(
            handles=_trials_handles(),
            loc="upper right",
            bbox_to_anchor=(0.985, 0.985),
            frameon=False,
            fontsize=9.5,
        )
        style.save(figure, path)


def _trials_axes(axes: Any, trials: Sequence[Trial]) -> None:
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
    axes.set_xlim(0, 1.18 * max(deepest, default=0.0) or 1.0)
    axes.set_xlabel("descent of the arm (mm)")
    axes.grid(axis="x", color=palette.GRID, zorder=0)
    axes.spines["left"].set_visible(False)


def _trials_handles() -> list[Any]:
    patches = extras.load("matplotlib.patches")
    lines = extras.load("matplotlib.lines")
    return [
        patches.Patch(color=palette.CONTACT, label="stopped by a touch"),
        patches.Patch(color=palette.PRESSURE, label="no touch, all steps"),
        lines.Line2D([], [], color=palette.INK, lw=2.4, label="the paper's robot"),
    ]


# ------------------------------------------------------------------------- overview


def overview_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Put the touch, the depths and the pressure into one picture."""
    trial = telling(trials)
    motion = trial.motion
    if motion is None:
        return
    index, contact = moment(trial)
    floor = floor_mm([trial])
    with style.used():
        figure = style.figure(13.2, 6.9)
        scene = figure.add_axes((0.0, 0.02, 0.53, 0.96))
        draw_scene(scene, trial, index, floor, [contact] if contact else [], scale=1.1)
        _frame(scene, trial, floor, motion.arm_mm[index, 2] + _ABOVE_MM, margin_mm=_MARGIN_MM)
        _name_parts(scene, trial, index, contact)
        depths = figure.add_axes((0.685, 0.57, 0.3, 0.3))
        _trials_axes(depths, trials)
        figure.text(0.56, 0.955, "How deep it went", fontsize=14, weight="bold", va="center")
        figure.legend(
            handles=_trials_handles(), loc="center left", bbox_to_anchor=(0.552, 0.91),
            frameon=False, fontsize=9, ncols=3, columnspacing=1.0, handlelength=1.4,
        )  # fmt: skip
        if contact is not None:
            felt = figure.add_axes((0.61, 0.11, 0.37, 0.24))
            _pressure_axes(felt, trial, contact.time_us - 1_000_000, contact.time_us + 900_000)
            figure.text(
                0.56, 0.43, "What the bristle felt", fontsize=14, weight="bold", va="center"
            )
            handles, labels = felt.get_legend_handles_labels()
            figure.legend(
                handles, labels, loc="center left", bbox_to_anchor=(0.552, 0.385), frameon=False,
                fontsize=9, ncols=3, columnspacing=1.0, handlelength=1.4,
            )  # fmt: skip
            felt.set_xlabel("time since the trial began (s)")
        figure.text(0.985, 0.012, origin_note(trials), fontsize=9, color=palette.MUTED, ha="right")
        style.save(figure, path, dpi=130)


# ------------------------------------------------------------------------ animation


def animation(path: Path, trial: Trial, *, frames: int = 96, width_px: int = 560) -> None:
    """Write an animated GIF: the way down, then the level where it ended in detail."""
    motion = trial.motion
    if motion is None:
        return
    image = extras.load("PIL.Image")
    floor = floor_mm([trial])
    images = []
    with style.used():
        for index in _story(trial, frames):
            figure = style.figure(5.2, 5.2)
            axes = figure.add_axes((0.0, 0.0, 1.0, 0.93))
            now_us = int(motion.time_us[index])
            touched = [c for c in trial.contacts if c.time_us <= now_us]
            draw_scene(axes, trial, index, floor, touched, scale=0.9)
            _frame(axes, trial, floor, motion.arm_mm[0, 2] + _ABOVE_MM)
            descent = motion.arm_mm[0, 2] - motion.arm_mm[index, 2]
            figure.text(
                0.03, 0.955, f"{descent:.0f} mm down", fontsize=13, weight="bold", va="center"
            )
            fresh = bool(touched) and now_us - touched[-1].time_us < 600_000
            figure.text(
                0.97, 0.955, "touch!" if fresh else origin_note([trial]).split(",")[0],
                fontsize=13 if fresh else 11, ha="right", va="center",
                color=palette.CONTACT if fresh else palette.MUTED,
                weight="bold" if fresh else "normal",
            )  # fmt: skip
            buffer = BytesIO()
            figure.savefig(buffer, dpi=width_px / 5.2, format="png")
            images.append(image.open(buffer).convert("RGB"))
    colours = _shared_palette(image, images[len(images) // 2])
    flat = [frame.quantize(palette=colours, dither=image.Dither.NONE) for frame in images]
    flat[0].save(path, save_all=True, append_images=flat[1:], duration=100, loop=0, optimize=True)


def _shared_palette(image: Any, frame: Any) -> Any:
    """Build one palette for all frames, or the background would flicker."""
    thin = (  # colours of thin things, which would otherwise lose against the wall's blues
        palette.CONTACT, palette.TENDON, palette.BRISTLE, palette.SPRING, palette.SILICONE,
        palette.INK, palette.MUTED, palette.mix(palette.CONTACT, "#ffffff", 0.6),
    )  # fmt: skip
    strip = frame.height // 6
    sample = image.new("RGB", (frame.width, frame.height + strip * len(thin)), "white")
    sample.paste(frame, (0, 0))
    for row, colour in enumerate(thin):
        sample.paste(
            colour, (0, frame.height + row * strip, frame.width, frame.height + (row + 1) * strip)
        )
    return sample.quantize(colors=160, method=image.Quantize.MEDIANCUT)


def _story(trial: Trial, frames: int) -> list[int]:
    """Indices of frames: a little of each level, most around the first touch."""
    motion = trial.motion
    assert motion is not None
    if not trial.levels:
        times = np.linspace(trial.start_us, trial.end_us, frames)
        return [motion.at(float(time)) for time in times]
    last = trial.levels[-1]
    touch = next((d for d in last.directions if d.touched), last.directions[0])
    parts = (
        (trial.start_us, last.start_us, 0.34),
        (touch.start_us, touch.end_us, 0.32),
        (touch.end_us, last.end_us, 0.24),
        (last.end_us, trial.end_us, 0.10),
    )
    times = np.concatenate(
        [
            np.linspace(start, end, max(round(frames * share), 2), endpoint=False)
            for start, end, share in parts
        ]
    )
    return [motion.at(float(time)) for time in times]
