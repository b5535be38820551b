"""The report of scans: one page, pictures and a table from their logs."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from setae.record import Log, read
from setae.report import files, scan_page, scan_pictures
from setae.report.files import Report
from setae.report.scan_reading import Scan, read_scans

__all__ = ["scans", "write"]


def scans(logs: str | Path | Iterable[str | Path | Log]) -> tuple[Scan, ...]:
    """Read the scans of a run.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several.

    Raises
    ------
    LogError
        There is no log, one of them holds no scan, or a part of one is missing.
    """
    return read_scans(log if isinstance(log, Log) else read(log) for log in files.logs_of(logs))


def write(
    logs: str | Path | Iterable[str | Path | Log], out: str | Path, *, page: str = "report.html"
) -> Report:
    """Write the report of a run.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several.
    out
        The folder to write to; made if it isn't there. Files of an earlier report are replaced.
    page
        Name of the page in it.

    Raises
    ------
    LogError
        As `scans`, or the folder can't be written to.
    ExtraMissingError
        Matplotlib or Plotly isn't installed.
    """
    shown = scans(logs)
    folder = Path(out)
    with files.writing(folder):
        drawn = scan_pictures.write_all(folder / "pictures", shown)
        (folder / page).write_text(scan_page.page(shown, drawn), encoding="utf-8")
        table = folder / "places.csv"
        _write_places(table, shown)
    return Report(page=folder / page, pictures=drawn, tables=(table,))


def _write_places(path: Path, shown: Sequence[Scan]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ("mode", "time_s", "x_mm", "y_mm", "mark", "height_mm", "true_height_mm",
             "uncertainty_mm")
        )  # fmt: skip
        for scan in shown:
            true_mm = None if scan.surface is None else scan.surface.at(scan.result.height_map)
            for time_s, place in zip(scan.place_s, scan.result.places, strict=True):
                column, row = place.cell
                writer.writerow(
                    (
                        scan.result.mode,
                        f"{time_s:.2f}",
                        f"{place.x_mm:g}",
                        f"{place.y_mm:g}",
                        place.mark,
                        _number(place.height_mm),
                        "" if true_mm is None else _number(float(true_mm[row, column])),
                        _number(place.uncertainty_mm),
                    )
                )


def _number(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else ""
