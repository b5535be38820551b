"""A validation as one web page that needs no network."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from setae.experiments import frames
from setae.experiments.accuracy import OVERALL, Spread, Summary, by_group
from setae.experiments.runs import Run
from setae.report import extras, palette, paper, solving, template
from setae.report.validation_pictures import COLOURS, origin_note
from setae.wording import counted

_PICTURES: Final = {
    "boxes": "Box plots of the errors of the five groups beside the paper's means",
    "bubbles": "Mean error at each of the 34 positions, as bubbles",
    "targets": "The targets in a section of the workspace",
}


def page(runs: Sequence[Run], pictures: Sequence[Path], causes: str = "") -> str:
    """Return the whole page.

    Parameters
    ----------
    runs
        One a tendon model, each with something measured.
    pictures
        The pictures that were drawn of them.
    causes
        A further section, as HTML.

    Raises
    ------
    ExtraMissingError
        Plotly isn't installed.
    """
    plotly = extras.load("plotly.offline")
    by_name = {path.stem: path for path in pictures}
    return template.fill(
        "validation.html",
        {
            "badges": _badges(runs),
            "count": str(len(runs[0].targets)),
            "finding": html.escape(finding(runs)),
            "tables": "".join(_table(run, several=len(runs) > 1) for run in runs),
            "causes": causes,
            "origin": _origin(runs),
            "source": html.escape(paper.validation_source()),
            "config": template.config_text(runs[0].metadata),
            "plotly": plotly.get_plotlyjs(),
            "data": template.json_text(_data(runs)),
            "js": template.text("validation.js"),
            **{name: template.image(by_name[name], text) for name, text in _PICTURES.items()},
        },
    )


def finding(runs: Sequence[Run]) -> str:
    """Say in a few sentences what came out."""
    theirs = paper.validation()[OVERALL].distance
    parts = []
    for run in runs:
        whole = by_group(run.poses)[OVERALL]
        parts.append(f"{_spread(whole.in_plane)} mm with the model {run.model}")
    count = f"{len(runs[0].poses)} of {counted(len(runs[0].targets), 'target')}"
    text = f"Mean error in the bending plane, over {count}: {'; '.join(parts)}. "
    text += f"The paper’s robot: {_spread(theirs)} mm"
    some = len(runs[0].poses) < len(runs[0].targets)
    text += ", on all targets: not comparable with some of them." if some else "."
    run = runs[0]
    holds = run.held([pose.target for pose in run.poses])
    if 0 < holds.sum() < len(holds):
        errors = np.array([pose.in_plane_mm for pose in run.poses])
        text += (
            f" On the {counted(int(holds.sum()), 'target')} that tendons can hold it is "
            f"{errors[holds].mean():.2f} mm, on the {int((~holds).sum())} that would need a tendon "
            f"that pushes {errors[~holds].mean():.2f} mm (model {run.model})."
        )
    return text


def _badges(runs: Sequence[Run]) -> str:
    if runs[0].simulated:
        text = html.escape(origin_note(runs).capitalize())
        badges = f'<span class="badge">{text}: no hardware</span>'
    else:
        badges = '<span class="badge real">Measured on the robot</span>'
    if any(not run.complete or any(log.damage for log in run.logs) for run in runs):
        badges += '<span class="badge warn">Not all targets were visited; see below</span>'
    return badges


def _spread(value: Spread | None) -> str:
    if value is None or math.isnan(value.mean_mm):
        return "–"
    return f"{value.mean_mm:.2f}" + ("" if math.isnan(value.sd_mm) else f" ± {value.sd_mm:.2f}")


def _table(run: Run, *, several: bool) -> str:
    theirs = paper.validation()
    rows = []
    for group, ours in by_group(run.poses).items():
        kind = ' class="whole"' if group == OVERALL else ""
        rows.append(f"<tr{kind}>{_cells(group, ours, theirs.get(group))}</tr>")
    colour = COLOURS.get(run.model, palette.INK)
    title = f'<h3 style="color:{colour};margin:24px 0 4px">Model {run.model}</h3>'
    return (
        (title if several else "") + '<div class="scroll"><table><thead><tr><th></th><th></th>'
        '<th class="group first" colspan="2">distance</th>'
        '<th class="group first" colspan="2">x or y</th><th class="group first" colspan="2">z</th>'
        '<th class="group first">3D</th><th class="group first" colspan="3">this run</th></tr>'
        "<tr><th>group</th><th>targets</th>"
        + 3
        * '<th class="first">this run</th><th class="paper">paper</th>'
        + '<th class="first">distance</th><th class="first">largest</th>'
        "<th>outwards</th><th>upwards</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cells(group: str, ours: Summary, theirs: paper.PaperErrors | None) -> str:
    pairs = (
        (ours.in_plane, theirs.distance if theirs else None),
        (ours.lateral, theirs.lateral if theirs else None),
        (ours.height, theirs.height if theirs else None),
    )
    name = "all together" if group == OVERALL else group.replace("-", "−")
    cells = [f"<td>{name}</td><td>{ours.targets}</td>"]
    cells += [
        f'<td class="first"><b>{_spread(mine)}</b></td><td class="paper">{_spread(other)}</td>'
        for mine, other in pairs
    ]
    outwards = "–" if group in (OVERALL, "compression") else f"{ours.bias_lateral_mm:+.2f}"
    cells.append(
        f'<td class="first">{_spread(ours.space)}</td><td class="first">{ours.max_mm:.2f}</td>'
        f"<td>{outwards}</td><td>{ours.bias_height_mm:+.2f}</td>"
    )
    return "".join(cells)


_CUT: Final = (
    "on {} targets this model asks for a tendon longer than the free spring, by up to {:.1f} mm: "
    "it got the free spring’s length"
)
_SIMULATED: Final = (
    "simulated: the board’s own firmware, compiled for this computer, drives a physical model of "
    "servos, tendons and spring"
)


def _origin(runs: Sequence[Run]) -> str:
    rows: list[tuple[str, str]] = []
    for run in runs:
        visited = f"{len(run.poses)} of {counted(len(run.targets), 'target')}"
        rows.append((f"model {run.model}", f"{visited}; positions: {run.source}"))
        if run.cut_mm:
            rows.append(
                (
                    "",
                    _CUT.format(len(run.cut_mm), max(run.cut_mm.values())),
                )
            )
        if not run.simulated:
            rows += [("is the frame right?", doubt) for doubt in frames.doubts(run.poses)]
        if run.unsolved:
            rows.append(("", run.unsolved_text))
        if not run.complete:
            rows.append(("", "the run ended early"))
        rows += [(log.path.name, str(log.damage)) for log in run.logs if log.damage]
    metadata = runs[0].metadata
    if runs[0].simulated:
        rows.append(("robot", _SIMULATED))
    for name in ("plant", "seed"):
        if metadata.get(name) is not None:
            rows.append((name, str(metadata[name])))
    versions = metadata.get("versions") or {}
    if isinstance(versions, Mapping) and versions:
        rows.append(("versions", ", ".join(f"{k} {v}" for k, v in sorted(versions.items()))))
    rows += solving.row(log for run in runs for log in run.logs)
    rows.append(("logs", ", ".join(log.path.name for run in runs for log in run.logs)))
    items = "".join(f"<dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd>" for a, b in rows)
    return f"<dl>{items}</dl>"


def _data(runs: Sequence[Run]) -> dict[str, Any]:
    return {
        "runs": [{"model": run.model, "poses": _poses(run)} for run in runs],
        "most": 2 * paper.validation()[OVERALL].distance.mean_mm,
        "colours": {
            "ink": palette.INK,
            "grid": palette.GRID,
            "line": palette.MUTED,
            "errors": palette.stops(palette.AMOUNTS),
        },
    }


def _poses(run: Run) -> list[dict[str, Any]]:
    rows = []
    holds = run.held([pose.target for pose in run.poses])
    for pose, held in zip(run.poses, holds, strict=True):
        wanted = pose.target.position_mm
        target = [wanted[pose.target.lateral_axis], wanted[2]]
        rows.append(
            {
                "label": pose.target.label,
                "plane": "" if pose.target.bend_deg == 0 else pose.target.group[1],
                "straight": pose.target.bend_deg == 0,
                "target": target,
                "found": [target[0] + pose.lateral_mm, target[1] + pose.height_mm],
                "error": pose.in_plane_mm,
                "held": bool(held),
            }
        )
    return rows
