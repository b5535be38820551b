"""The report of the tube exploration: one page, pictures and tables from its logs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from setae.errors import LogError
from setae.record import Log, read
from setae.report import html, pictures, tables
from setae.report.trial import Trial, load


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The files of a report.

    Attributes
    ----------
    page
        The web page. It holds all it needs, so it can be sent to somebody.
    pictures
        PNG files.
    tables
        CSV files; the units are in the columns' names.
    """

    page: Path
    pictures: tuple[Path, ...]
    tables: tuple[Path, ...]


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
    for number, log in enumerate(_logs(logs), start=1):
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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(text, encoding="utf-8")
        written = tables.write_all(folder, shown)
        drawn = pictures.write_all(folder / "pictures", shown)
    except OSError as error:
        raise LogError(
            f"The report can't be written to {folder}: {error.strerror or error}.",
            "Check the folder and the room on the disk.",
        ) from error
    return Report(page=folder / page, pictures=drawn, tables=written)


def _logs(logs: str | Path | Iterable[str | Path | Log]) -> Sequence[str | Path | Log]:
    found: Sequence[str | Path | Log]
    if not isinstance(logs, str | Path):
        found = list(logs)
    elif Path(logs).is_dir():
        found = sorted(Path(logs).glob("*.mcap"))
    else:
        found = [logs]
    if not found:
        raise LogError(
            f"No log to report in {logs}." if isinstance(logs, str | Path) else "No log to report.",
            "Give the folder that `setae explore` wrote.",
        )
    return found
