"""The report of a validation: errors by group beside the paper's, pictures, tables."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from setae.errors import LogError
from setae.experiments import causes, runs
from setae.experiments.accuracy import Pose, Summary, by_group
from setae.experiments.causes import EXPERIMENT
from setae.experiments.runs import Run
from setae.record import Log, read
from setae.report import causes as why
from setae.report import extras, files, paper, validation_page, validation_pictures
from setae.report.files import Report

__all__ = ["write"]


def write(
    logs: str | Path | Iterable[str | Path | Log], out: str | Path, *, page: str = "report.html"
) -> Report:
    """Write the report of a validation.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several; a tendon model each, or parts of it.
    out
        The folder to write to; made if it isn't there.
    page
        Name of the page in it.

    Raises
    ------
    LogError
        There is no log, one holds no validation, nothing was measured yet, or the
        folder can't be written to.
    ExtraMissingError
        Matplotlib or Plotly isn't installed.
    """
    given = [log if isinstance(log, Log) else read(log) for log in files.logs_of(logs)]
    studies = runs.of_kind(given, EXPERIMENT)
    found = runs.read(log for log in given if log not in studies)
    shown = [run for run in found if run.poses]
    if not shown:
        raise LogError(
            "Nothing was measured yet: the robot was only driven.",
            "Give the positions with `setae validate --positions FILE --out FOLDER`.",
        )
    extras.load("matplotlib")
    extras.load("plotly.offline")
    folder = Path(out)
    with files.writing(folder):
        drawn = validation_pictures.write_all(folder / "pictures", shown)
        section = ""
        for study in studies:
            if effects := causes.effects(study):
                drawn_to = folder / "pictures" / "causes.png"
                chart = why.picture(drawn_to, effects, why.note_of(study))
                section = why.section(effects, chart, causes.left_out(study))
                drawn = (*drawn, chart)
        text = validation_page.page(shown, drawn, section)
        (folder / page).write_text(text, encoding="utf-8")
        tables = (folder / "targets.csv", folder / "summary.csv")
        _write(tables[0], *_targets(shown))
        _write(tables[1], *_summaries(shown))
        (folder / "validation.json").write_text(
            json.dumps(as_json(shown, studies), indent=1, ensure_ascii=False) + "\n",
            encoding="utf-8",
        )
    return Report(page=folder / page, pictures=drawn, tables=tables)


def as_json(shown: Sequence[Run], studies: Sequence[Log] = ()) -> dict[str, Any]:
    """All figures of a validation, for other programs; NaN becomes null."""
    data = {
        "unit": "mm",
        "error": "true position less target",
        "sd": "of the sample, n - 1",
        "runs": [
            {
                "model": run.model,
                "positions": run.source,
                "simulated": run.simulated,
                "plant": run.metadata.get("plant"),
                "seed": run.metadata.get("seed"),
                "noise_sd_mm": run.noise_sd_mm,
                "complete": run.complete,
                "groups": {group: asdict(row) for group, row in by_group(run.poses).items()},
                "targets": [
                    {
                        "target": pose.target.label,
                        "target_mm": list(pose.target.position_mm),
                        "position_mm": [float(v) for v in pose.position_mm],
                        "in_plane_mm": pose.in_plane_mm,
                        "distance_mm": pose.distance_mm,
                    }
                    for pose in run.poses
                ],
            }
            for run in shown
        ],
        "causes": [asdict(effect) for study in studies for effect in causes.effects(study)],
        "paper": {group: asdict(row) for group, row in paper.validation().items()},
    }
    finite: dict[str, Any] = _finite(data)
    return finite


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return round(value, 5) if math.isfinite(value) else None
    return value


# ------------------------------------------------------------------------------ tables

_Rows = tuple[Sequence[str], Iterator[Sequence[object]]]


def _targets(shown: Sequence[Run]) -> _Rows:
    header = (
        "model", "target", "group", "height_mm", "bend_deg", "held",
        *(f"target_{axis}_mm" for axis in "xyz"), *(f"measured_{axis}_mm" for axis in "xyz"),
        *(f"error_{axis}_mm" for axis in "xyz"), "in_plane_mm", "distance_mm", "cut_mm",
    )  # fmt: skip

    def rows() -> Iterator[Sequence[object]]:
        for run in shown:
            holds = run.held([pose.target for pose in run.poses])
            for pose, good in zip(run.poses, holds, strict=True):
                yield _target_row(run, pose, holds=bool(good))

    return header, rows()


def _target_row(run: Run, pose: Pose, *, holds: bool) -> Sequence[object]:
    target = pose.target
    return (
        run.model, target.label, target.group, f"{target.height_mm:g}", f"{target.bend_deg:g}",
        "yes" if holds else "no",
        *(_number(v) for v in (*target.position_mm, *pose.position_mm, *pose.error_mm)),
        _number(pose.in_plane_mm), _number(pose.distance_mm),
        _number(run.cut_mm.get(target.label, 0.0)),
    )  # fmt: skip


def _summaries(shown: Sequence[Run]) -> _Rows:
    parts = ("in_plane", "lateral", "height", "space")
    header = (
        "model", "group", "targets",
        *(f"{part}_{kind}_mm" for part in parts for kind in ("mean", "sd")),
        "median_mm", "max_mm", "bias_lateral_mm", "bias_height_mm",
        *(f"paper_{part}_{kind}_mm" for part in parts[:3] for kind in ("mean", "sd")),
    )  # fmt: skip
    return header, (
        _summary_row(run, group, row) for run in shown for group, row in by_group(run.poses).items()
    )


def _summary_row(run: Run, group: str, row: Summary) -> Sequence[object]:
    theirs = paper.validation().get(group)
    pairs = [row.in_plane, row.lateral, row.height, row.space]
    known = [theirs.distance, theirs.lateral, theirs.height] if theirs else [None] * 3
    return (
        run.model, group, row.targets,
        *(_number(v) for pair in pairs for v in (pair.mean_mm, pair.sd_mm)),
        *(_number(v) for v in
          (row.median_mm, row.max_mm, row.bias_lateral_mm, row.bias_height_mm)),
        *(_number(v) for pair in known
          for v in ((pair.mean_mm, pair.sd_mm) if pair else (math.nan, math.nan))),
    )  # fmt: skip


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.3f}"


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
