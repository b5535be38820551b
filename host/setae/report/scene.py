"""The robot in its tube at one moment of a trial, and the picture of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from setae.report import drawing, palette, shapes, style
from setae.report.drawing import View
from setae.report.trial import Contact, Trial, origin_note

FLOOR_BELOW_MM = 30.0
RIM_MM = 10.0
MARGIN_MM = 74.0  # for the parts' names
ABOVE_MM = drawing.HOLDER_HEIGHT_MM + 30.0  # the arm above frame D


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


def draw(
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
        draw(axes, trial, index, floor, [contact] if contact else [], scale=1.25)
        frame(axes, trial, floor, motion.arm_mm[index, 2] + ABOVE_MM, margin_mm=MARGIN_MM)
        name_parts(axes, trial, index, contact)
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


def frame(axes: Any, trial: Trial, floor: float, top_mm: float, *, margin_mm: float = 0.0) -> None:
    """Let the axes hold the tube and the robot up to a height, with a margin for names."""
    view = View.into(trial.tube)
    corners = np.array([[0.0, 0.0, floor], [0.0, 0.0, top_mm]])
    if trial.tube is not None:
        wall = shapes.shell(trial.tube, floor, RIM_MM).reshape(-1, 3)
        corners = np.concatenate([corners, wall])
    flat = view.flat(corners)
    axes.set_xlim(flat[:, 0].min() - 6 - margin_mm, flat[:, 0].max() + 6 + 0.8 * margin_mm)
    axes.set_ylim(flat[:, 1].min() - 6, flat[:, 1].max() + 6)


_LABEL_MM = 26.0  # two lines of a label, and some air


def name_parts(axes: Any, trial: Trial, index: int, contact: Contact | None) -> None:
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
    for names, x, side in ((left, edges[0] + MARGIN_MM - 14, -1), (right, edges[1] - 50, 1)):
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
