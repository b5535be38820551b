"""Scans as one web page that needs no network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from setae.experiments.scan.quality import Quality, agreement
from setae.heightmap import TOUCHED
from setae.report import extras, palette, solving, template
from setae.report.scan_maps import top_mm
from setae.report.scan_notes import comparable, differences, each, object_of, plant_of
from setae.report.scan_pictures import cloud
from setae.report.scan_reading import Scan
from setae.wording import counted

_PICTURES: Final = {
    "heights": "Height maps from above, with flags, the true surface and the errors",
    "clouds": "The clouds of points, coloured by their height",
    "paths": "The arm's way from above, coloured by time",
    "pressure": "Pressure of the bristle over the scan and around the first touch",
}
_SIMULATED: Final = (
    "simulated: the board’s own firmware, compiled for this computer, drives a physical model of "
    "servos, tendons, spring and bristle. No hardware was involved."
)
_REAL: Final = "the real one"
_SAID: Final = {
    "paper": "the paper’s cycle",
    "safe": "retracted in every step",
    "adaptive": "adaptive",
}


def page(scans: Sequence[Scan], pictures: Sequence[Path]) -> str:
    """Return the whole page.

    Raises
    ------
    ExtraMissingError
        Plotly isn't installed.
    """
    plotly = extras.load("plotly.offline")
    by_name = {path.stem: path for path in pictures}
    return template.fill(
        "scan.html",
        {
            "badges": _badges(scans),
            "step": each(scans, lambda scan: f"{scan.config.scan.step_mm:g} mm"),
            "threshold": each(scans, lambda scan: f"{scan.config.bristle.threshold_hpa:g} hPa"),
            "finding": html.escape(finding(scans)),
            "table": _table(scans),
            "depth": each(scans, lambda scan: f"{scan.config.scan.contact_depth_mm:g} mm"),
            "origin": _origin(scans),
            "config": _configs(scans),
            "plotly": plotly.get_plotlyjs(),
            "data": template.json_text(_data(scans)),
            "js": template.text("scan.js"),
            **{name: template.image(by_name[name], text) for name, text in _PICTURES.items()},
        },
    )


def finding(scans: Sequence[Scan]) -> str:
    """Say in a few sentences what came out."""
    sentences = []
    for scan in scans:
        marks = scan.result.height_map.mark
        touched = int(np.isin(marks, TOUCHED).sum())
        text = f"{scan.result.mode}: {touched} of {counted(marks.size, 'place')} touched"
        if scan.result.mode == "adaptive":
            text += f", {int((marks == 'inferred').sum())} inferred"
        text += f", in {scan.result.duration_s:.0f} s of robot time"
        if not scan.result.complete:
            text += ", not complete"
        sentences.append(f"{text[:1].upper()}{text[1:]}.")
    whole = {scan.result.mode: scan for scan in scans if scan.result.complete}
    if "paper" in whole and "adaptive" in whole and comparable(whole["paper"], whole["adaptive"]):
        share = whole["adaptive"].result.duration_s / whole["paper"].result.duration_s
        sentences.append(f"The adaptive scan took {share:.0%} of the time of the paper’s cycle.")
    if other := differences(scans):
        sentences.append(f"Besides their mode the scans differ in: {', '.join(other)}.")
    return " ".join(sentences)


def _badges(scans: Sequence[Scan]) -> str:
    simulated = {scan.logs[0].simulated for scan in scans}
    badges = ""
    if True in simulated:
        badges += '<span class="badge">Simulated: no hardware</span>'
    if False in simulated:
        badges += '<span class="badge real">Measured on the robot</span>'
    if any(not scan.result.complete or log.damage for scan in scans for log in scan.logs):
        badges += '<span class="badge warn">Not all scans are complete; see below</span>'
    return badges


def _table(scans: Sequence[Scan]) -> str:
    truth = any(scan.quality for scan in scans)
    paper = next((scan for scan in scans if scan.result.mode == "paper"), None)
    head = ["mode", "robot time (s)", "touched", "inferred", "empty", "slipped / double / lost"]
    if truth:
        head += ["error (mm)", "at edges (mm)"]
    if paper is not None and len(scans) > 1:
        head.append('<span title="share of places where both found something, or both nothing">'
                    "like the paper’s</span>")  # fmt: skip
    lines = ["<table><thead><tr>", *(f"<th>{name}</th>" for name in head), "</tr></thead><tbody>"]
    for scan in scans:
        marks = scan.result.height_map.mark
        inferred, empty, *flagged = (
            str(int((marks == name).sum()))
            for name in ("inferred", "empty", "slipped", "double", "lost")
        )
        cells = [
            html.escape(_SAID[scan.result.mode])
            + ("" if scan.result.complete else " <br><small>(not complete)</small>"),
            f"<b>{scan.result.duration_s:.0f}</b>",
            str(int(np.isin(marks, TOUCHED).sum())),
            inferred,
            empty,
            " / ".join(flagged),
        ]
        if truth:
            cells += _errors(scan.quality)
        if paper is not None and len(scans) > 1:
            cells.append(_like(scan, paper))
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return "".join([*lines, "</tbody></table>"])


def _errors(found: Quality | None) -> tuple[str, str]:
    """Height errors of a scan away from edges, with how many places that is, and at edges."""
    return (
        f"{found.rms_mm:.2f} ({found.places})" if found and found.places else "–",
        f"{found.edge_rms_mm:.1f}" if found and found.edge_places else "–",
    )


def _like(scan: Scan, paper: Scan) -> str:
    if scan is paper or not comparable(scan, paper):
        return "–"
    return f"{agreement(scan.result.height_map, paper.result.height_map):.1%}"


def _configs(scans: Sequence[Scan]) -> str:
    """Show the configuration of all scans, or where they differ that of each."""
    metadata = {scan.result.mode: scan.logs[0].metadata for scan in scans}
    if len({str(about.get("config")) for about in metadata.values()}) == 1:
        return template.config_text(scans[0].logs[0].metadata)
    return "".join(template.config_text(about, f"mode {mode}") for mode, about in metadata.items())


def _origin(scans: Sequence[Scan]) -> str:
    rows = [("robot", each(scans, lambda scan: _SIMULATED if scan.logs[0].simulated else _REAL))]
    if any(scan.logs[0].simulated for scan in scans):
        rows.append(("plant, seed", each(scans, plant_of)))
        rows.append(("object", each(scans, object_of)))
    if versions := each(scans, _versions):
        rows.append(("versions", versions))
    rows += solving.row(log for scan in scans for log in scan.logs)
    rows.append(("logs", ", ".join(log.path.name for scan in scans for log in scan.logs)))
    for scan in scans:
        if scan.problem:
            rows.append((scan.result.mode, f"not complete: {scan.problem}"))
        rows += [(log.path.name, str(log.damage)) for log in scan.logs if log.damage]
    items = "".join(f"<dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd>" for a, b in rows)
    return f"<dl>{items}</dl>"


def _versions(scan: Scan) -> str:
    versions = scan.logs[0].metadata.get("versions")
    if not isinstance(versions, Mapping):
        return ""
    return ", ".join(f"{name} {version}" for name, version in sorted(versions.items()))


def _data(scans: Sequence[Scan]) -> dict[str, Any]:
    return {
        "scans": [_scan(scan) for scan in scans],
        "colours": {
            "ink": palette.INK,
            "grid": palette.GRID,
            "contact": palette.CONTACT,
            "heights": palette.stops(palette.HEIGHTS),
        },
    }


def _scan(scan: Scan) -> dict[str, Any]:
    points, inferred = cloud(scan)
    grid = scan.result.height_map
    surface = scan.surface
    true_mm = None
    if surface is not None:
        true_mm = np.where(
            surface.height_mm > scan.lowest_mm, surface.height_mm - scan.base_mm, np.nan
        )
    return {
        "mode": scan.result.mode,
        "points": [[float(value) for value in point] for point in points],
        "inferred": [bool(one) for one in inferred],
        "above": scan.above,
        "range_mm": [scan.lowest_mm - scan.base_mm, top_mm(scan)],
        "size_mm": [float(places[-1]) for places in (grid.x_mm, grid.y_mm)],
        "truth": None
        if true_mm is None or surface is None
        else {
            "step_mm": surface.step_mm,
            "height_mm": [[float(value) for value in row] for row in true_mm],
        },
    }
