"""The run as one web page that needs no network: data, style and script are all inside."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from setae.report import drawing, extras, imperfections, palette, paper, shapes, solving, template
from setae.report.scene import floor_mm
from setae.report.tables import Comparison, compare
from setae.report.trial import Trial, origin_note
from setae.wording import counted

FRAMES_PER_S = 8.0  # the page draws straight lines in between
POINT_STEP_MM = 0.05  # 16 bits then reach 1.6 m
BACKBONE_STEP = 2  # every second point of the backbone


def page(trials: Sequence[Trial]) -> str:
    """Return the whole page.

    Raises
    ------
    ExtraMissingError
        Plotly isn't installed.
    """
    plotly = extras.load("plotly.offline")
    rows = compare(trials)
    first = trials[0]
    levels = [level for trial in trials for level in trial.levels]
    directions = {direction.alpha_deg for level in levels for direction in level.directions}
    explore = first.config.explore
    edges = {trial.cube.edge_mm for trial in trials if trial.cube}
    values = {
        "title": "Feeling the way down a tube",
        "badges": _badges(trials),
        "step": f"{explore.step_mm:g} mm",
        "directions": str(len(directions)),
        "finding": html.escape(finding(rows)),
        "cube_edge": f"{max(edges):g} mm" if edges else "40 mm",
        "table": _table(rows),
        "imperfections": imperfections.section(trials),
        "coils": ", but for the spring’s coils, which are fewer here than in the real spring",
        "threshold": f"{first.threshold_hpa:g} hPa",
        "compressed": f"{explore.compressed_length_mm:g} mm",
        "origin": _origin(trials),
        "source": html.escape(paper.source()),
        "config": template.config_text(first.log.metadata),
        "plotly": plotly.get_plotlyjs(),
        "data": template.json_text(_data(trials)),
        "js": template.text("page.js"),
    }
    return template.fill("page.html", values)


def finding(rows: Sequence[Comparison]) -> str:
    """Say in a sentence or two what came out."""
    early = [row.trial.number for row in rows if not row.trial.complete]
    rows = [row for row in rows if row.trial.complete]
    with_obstacle = [row for row in rows if row.trial.obstacle_below_tip_mm is not None]
    without = [row for row in rows if row.trial.obstacle_below_tip_mm is None]
    sentences = []
    if with_obstacle:
        found = sum(row.trial.touched for row in with_obstacle)
        sentences.append(
            f"the bristle found the obstacle in {found} of {counted(len(with_obstacle), 'trial')}"
        )
    if without:
        false = sum(row.trial.touched for row in without)
        touched = "touched nothing" if not false else f"felt a touch in {false} of {len(without)}"
        sentences.append(f"without an obstacle it {touched}")
    text = "; ".join(sentences)
    known = [row for row in rows if row.agrees is not None]
    if known:
        text += f". {_beside_the_paper(sum(bool(row.agrees) for row in known), len(known))}"
    text = text[:1].upper() + text[1:] + "." if text else "No trial was completed."
    if early and rows:
        which = "s" if len(early) > 1 else ""
        numbers = ", ".join(str(number) for number in early)
        text += f" Trial{which} {numbers} ended early and {'do' if which else 'does'} not count."
    return text


def _beside_the_paper(agreeing: int, known: int) -> str:
    if known == 1:
        if agreeing:
            return "It stopped at the same depth as the paper’s robot"
        return "It did otherwise than the paper’s robot"
    how_many = f"all {known}" if agreeing == known else f"{agreeing} of the {known}"
    return f"It stopped at the same depth as the paper’s robot in {how_many} trials that both ran"


def _badges(trials: Sequence[Trial]) -> str:
    if trials[0].simulated:
        text = html.escape(origin_note(trials).capitalize())
        badges = f'<span class="badge">{text}: no hardware</span>'
    else:
        badges = '<span class="badge real">Measured on the robot</span>'
    if any(not trial.complete or trial.log.damage for trial in trials):
        badges += '<span class="badge warn">Not all logs are complete; see below</span>'
    return badges


def _table(rows: Sequence[Comparison]) -> str:
    lines = [
        (
            "<table><thead><tr><th></th><th></th>"
            '<th class="group" colspan="4">this run</th>'
            '<th class="group paper" colspan="2">paper</th><th></th></tr>'
            "<tr><th>trial</th><th>obstacle below (mm)</th><th>stopped at (mm)</th><th>touched</th>"
            "<th>touches</th><th>directions felt</th>"
            '<th class="paper">stopped at (mm)</th><th class="paper">touched</th><th></th></tr>'
            "</thead><tbody>"
        )
    ]
    for index, row in enumerate(rows):
        trial, theirs = row.trial, row.theirs
        obstacle = trial.obstacle_below_tip_mm
        touched = '<b class="touched">yes</b>' if trial.touched else "no"
        if not (trial.complete or trial.touched):
            touched = "not yet"
        same = {
            True: '<span class="same">✓ same</span>',
            False: '<span class="other">✗ differs</span>',
            None: "",
        }[row.agrees]
        cells = [
            f"{trial.number}" + ("" if trial.complete else " <br><small>(not complete)</small>"),
            ("none" if obstacle is None else f"{obstacle:g}")
            + (f" <br><small>at α = {trial.azimuth_deg:g}°</small>" if trial.azimuth_deg else ""),
            f"<b>{trial.descent_mm:g}</b>" if trial.complete else f"{trial.descent_mm:g}",
            touched,
            str(len(trial.contacts)),
            str(sum(len(level.directions) for level in trial.levels)),
        ]
        lines.append(
            f'<tr data-trial="{index}">'
            + "".join(f"<td>{cell}</td>" for cell in cells)
            + f'<td class="paper">{f"{theirs.descent_mm:g}" if theirs else "–"}</td>'
            + f'<td class="paper">{("yes" if theirs.contact else "no") if theirs else "–"}</td>'
            + f"<td>{same}</td></tr>"
        )
    lines.append("</tbody></table>")
    return "".join(lines)


_SIMULATED = (
    "simulated: the board’s own firmware, compiled for this computer, drives a physical model of "
    "servos, tendons, spring and bristle. No hardware was involved."
)


def _origin(trials: Sequence[Trial]) -> str:
    metadata = trials[0].log.metadata
    rows: list[tuple[str, str]] = []
    if trials[0].simulated:
        rows.append(
            (
                "robot",
                _SIMULATED,
            )
        )
    else:
        rows.append(("robot", "the real one; shapes are drawn from the commanded pulses"))
    tube = trials[0].tube
    if tube is not None:
        beside_mm = math.hypot(*tube.axis_mm)
        text = f"{tube.inner_radius_mm:g} mm inner radius"
        if beside_mm >= 1.0:
            text += (
                f"; its axis is {beside_mm:g} mm beside the robot’s, on the side away from where a "
                "cube would be, so that the bristle can reach one at the wall"
            )
        rows.append(("tube", text))
    seeds = dict.fromkeys(trial.log.metadata.get("seed") for trial in trials)
    if None not in seeds:
        rows.append(("seed" if len(seeds) == 1 else "seeds", ", ".join(map(str, seeds))))
    versions = metadata.get("versions") or {}
    if isinstance(versions, Mapping) and versions:
        rows.append(("versions", ", ".join(f"{name} {v}" for name, v in sorted(versions.items()))))
    rows += solving.row(trial.log for trial in trials)
    rows.append(("logs", ", ".join(trial.log.path.name for trial in trials)))
    for trial in trials:
        if trial.log.damage:
            rows.append((f"trial {trial.number}", str(trial.log.damage)))
        elif not trial.complete:
            why = trial.problem or "the log ends before the trial does"
            rows.append((f"trial {trial.number}", f"not complete: {why}"))
    items = "".join(f"<dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd>" for a, b in rows)
    return f"<dl>{items}</dl>"


# ---------------------------------------------------------------------------- data


def _data(trials: Sequence[Trial]) -> dict[str, Any]:
    floor = floor_mm(trials)
    towards = shapes.towards_wall_rad(next((trial.tube for trial in trials if trial.tube), None))
    return {
        "trials": [_trial(trial) for trial in trials],
        "floor_mm": floor,
        "bounds_mm": _bounds(trials, floor),
        "view_rad": towards + math.radians(shapes.EYE_DEG),
        "wall_deg": shapes.WALL_DEG,
        "robot": {
            "coils": shapes.SPRING_COILS,
            "spring_radius_mm": drawing.SPRING_RADIUS_MM,
            "tendon_radius_mm": drawing.TENDON_RADIUS_MM,
            "holder_radius_mm": drawing.HOLDER_RADIUS_MM,
            "holder_height_mm": drawing.HOLDER_HEIGHT_MM,
        },
        "colours": {
            "ink": palette.INK,
            "muted": palette.MUTED,
            "spring": palette.SPRING,
            "tendon": palette.TENDON,
            "bristle": palette.BRISTLE,
            "silicone": palette.SILICONE,
            "holder": palette.HOLDER,
            "tube": palette.TUBE,
            "cube": palette.CUBE,
            "contact": palette.CONTACT,
            "clear": palette.CLEAR,
            "pressure": palette.PRESSURE,
        },
    }


def _bounds(trials: Sequence[Trial], floor: float) -> list[list[float]]:
    points = [np.array([[-40.0, -40.0, floor], [40.0, 40.0, 10.0]])]
    for trial in trials:
        if trial.tube:
            points.append(shapes.shell(trial.tube, floor, 10.0).reshape(-1, 3))
        if trial.motion:
            top = trial.motion.arm_mm + np.array([0.0, 0.0, drawing.HOLDER_HEIGHT_MM + 30.0])
            points.append(top)
    together = np.concatenate(points)
    ends = zip(together.min(axis=0), together.max(axis=0), strict=True)
    # Plotly cuts off what lies outside, so leave room.
    return [[float(low) - 6.0, float(high) + 6.0] for low, high in ends]


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "number": trial.number,
        "label": trial.label,
        "obstacle_below_tip_mm": trial.obstacle_below_tip_mm,
        "descent_mm": trial.descent_mm,
        "duration_s": max(float(trial.seconds(trial.end_us)), 0.1),
        "threshold_hpa": trial.threshold_hpa,
        "tube": None
        if trial.tube is None
        else {"axis_mm": trial.tube.axis_mm, "inner_radius_mm": trial.tube.inner_radius_mm},
        "cube": None
        if trial.cube is None
        else {
            "centre_mm": trial.cube.centre_mm,
            "edge_mm": trial.cube.edge_mm,
            "yaw_rad": trial.cube.yaw_rad,
        },
        "levels": [
            {
                "descent_mm": level.descent_mm,
                "start_s": trial.seconds(level.start_us),
                "end_s": trial.seconds(level.end_us),
                "directions": [
                    {
                        "alpha_deg": direction.alpha_deg,
                        "start_s": trial.seconds(direction.start_us),
                        "end_s": trial.seconds(direction.end_us),
                        "touched": direction.touched,
                    }
                    for direction in level.directions
                ],
            }
            for level in trial.levels
        ],
        "contacts": [
            {
                "time_s": trial.seconds(contact.time_us),
                "descent_mm": contact.descent_mm,
                "alpha_deg": contact.alpha_deg,
                "point_mm": _point(contact.true_point_mm) or _point(contact.point_mm),
                "pressure_hpa": contact.pressure_hpa,
                "change_hpa": contact.change_hpa,
            }
            for contact in trial.contacts
        ],
        "motion": _motion(trial),
        "pressure": _pressure(trial),
    }


def _point(point_mm: Any) -> list[float] | None:
    return [float(value) for value in point_mm] if np.isfinite(point_mm).all() else None


def _motion(trial: Trial) -> dict[str, Any] | None:
    """Points of each frame: arm, filament's root and tip, then the backbone."""
    motion = trial.motion
    if motion is None:
        return None
    wanted = np.arange(trial.start_us, trial.end_us + 1, 1e6 / FRAMES_PER_S)
    index = np.unique(np.clip(np.searchsorted(motion.time_us, wanted), 0, len(motion.time_us) - 1))
    points = np.concatenate(
        [
            motion.arm_mm[index, None],
            motion.filament_mm[index],
            motion.backbone_mm[index, ::BACKBONE_STEP],
        ],
        axis=1,
    )
    return {
        "time_s": _packed(trial.seconds(motion.time_us[index]), "<f4"),
        "points": _packed(np.clip(np.rint(points / POINT_STEP_MM), -32767, 32767), "<i2"),
        "per_frame": points.shape[1],
        "step_mm": POINT_STEP_MM,
    }


def _pressure(trial: Trial) -> dict[str, Any]:
    pressure = trial.pressure.between(trial.start_us, trial.end_us)
    value = pressure.pressure_hpa
    # Near zero 32 bits are plenty; at 1013 hPa they would show steps.
    offset = float(np.round(np.nanmedian(value))) if value.size else 0.0
    return {
        "time_s": _packed(trial.seconds(pressure.time_us), "<f4"),
        "change_hpa": _packed(value - offset, "<f4"),
        "baseline_hpa": _packed(pressure.baseline_hpa - offset, "<f4"),
        "offset_hpa": offset,
    }


def _packed(values: Any, kind: DTypeLike) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
