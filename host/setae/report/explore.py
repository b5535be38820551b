"""The report of the tube exploration: one page, pictures and tables from its logs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from setae.record import Log, read
from setae.report import files, html, pictures, tables
from setae.report.files import Report
from setae.report.reading import load
from setae.report.trial import Trial


def trials(logs: str | Path | Iterable[str | Path | Log]) -> tuple[Trial, ...]:
    """Read the trials of a run.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several; each log holds one trial.

    Raises
    ------
    LogError
        There is no log, or one of them holds no exploration.
    """
    found: list[Trial] = []
    for number, log in enumerate(files.logs_of(logs), start=1):
        found.append(load(log if isinstance(log, Log) else read(log), number=number))
    return tuple(sorted(found, key=lambda trial: trial.number))


def write(
    logs: str | Path | Iterable[str | Path | Log], out: str | Path, *, page: str = "report.html"
) -> Report:
    """Write the report of a run.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several; each log holds one trial.
    out
        The folder to write to; made if it isn't there. Files of an earlier
        report are replaced.
    page
        Name of the page in it.

    Raises
    ------
    LogError
        There is no log, one of them holds no exploration, or the folder can't
        be written to.
    ExtraMissingError
        Matplotlib or Plotly isn't installed.
    """
    shown = trials(logs)
    folder = Path(out)
    text = html.page(shown)
    with files.writing(folder):
        (folder / page).write_text(text, encoding="utf-8")
        written = tables.write_all(folder, shown)
        drawn = pictures.write_all(folder / "pictures", shown)
    return Report(page=folder / page, pictures=drawn, tables=written)
