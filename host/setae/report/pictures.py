"""The still pictures of an exploration, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from setae.report import depths, felt, palette, scene, style
from setae.report.trial import Trial, origin_note, telling


def write_all(folder: Path, trials: Sequence[Trial]) -> tuple[Path, ...]:
    """Write the still pictures of a run into a folder, those that its logs have data for."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = telling(trials)
    written = []
    if shown.motion is not None:
        scene.robot_picture(folder / "robot.png", shown)
        overview_picture(folder / "explore.png", trials)
        written += [folder / "robot.png", folder / "explore.png"]
    felt.pressure_picture(folder / "pressure.png", shown)
    written.append(folder / "pressure.png")
    for name, draw in (
        ("directions", felt.directions_picture),
        ("trials", depths.trials_picture),
    ):
        draw(folder / f"{name}.png", trials)
        written.append(folder / f"{name}.png")
    return tuple(written)


def overview_picture(path: Path, trials: Sequence[Trial]) -> None:
    """Put the touch, the depths and the pressure into one picture."""
    trial = telling(trials)
    motion = trial.motion
    if motion is None:
        return
    index, contact = scene.moment(trial)
    floor = scene.floor_mm([trial])
    with style.used():
        figure = style.figure(13.2, 6.9)
        robot = figure.add_axes((0.0, 0.0, 0.53, 0.94))
        scene.draw(robot, trial, index, floor, [contact] if contact else [], scale=1.1)
        scene.frame(
            robot, trial, floor, motion.arm_mm[index, 2] + scene.ABOVE_MM, margin_mm=scene.MARGIN_MM
        )
        scene.name_parts(robot, trial, index, contact)
        bars = figure.add_axes((0.685, 0.57, 0.3, 0.3))
        depths.trials_axes(bars, trials)
        figure.text(0.56, 0.955, "How deep it went", fontsize=14, weight="bold", va="center")
        figure.legend(
            handles=depths.trials_handles(), loc="center left", bbox_to_anchor=(0.552, 0.91),
            frameon=False, fontsize=9, ncols=3, columnspacing=1.0, handlelength=1.4,
        )  # fmt: skip
        if contact is not None:
            pressure = figure.add_axes((0.61, 0.11, 0.37, 0.215))
            felt.pressure_axes(
                pressure, trial, contact.time_us - 1_000_000, contact.time_us + 900_000
            )
            figure.text(
                0.56, 0.43, "What the bristle felt", fontsize=14, weight="bold", va="center"
            )
            handles, labels = pressure.get_legend_handles_labels()
            figure.legend(
                handles, labels, loc="center left", bbox_to_anchor=(0.552, 0.385), frameon=False,
                fontsize=9, ncols=3, columnspacing=1.0, handlelength=1.4,
            )  # fmt: skip
            pressure.set_xlabel("time since the trial began (s)")
            felt.name_directions(pressure, trial)
        title = "The bristle touches the obstacle" if contact else "The robot in the tube"
        figure.text(0.02, 0.955, title, fontsize=14, weight="bold", va="center")
        origin = origin_note(trials)
        figure.text(
            0.02, 0.915, f"{origin[:1].upper()}{origin[1:]}", fontsize=10, color=palette.MUTED,
            va="center",
        )  # fmt: skip
        style.save(figure, path, dpi=130)
