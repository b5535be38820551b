"""What a report reads and what it writes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from setae.errors import LogError
from setae.record import Log

__all__ = ["Report", "logs_of", "pictures_of", "writing"]


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


def logs_of(logs: str | Path | Iterable[str | Path | Log]) -> Sequence[str | Path | Log]:
    """The logs of a run: those of a folder, one log, or several.

    Raises
    ------
    LogError
        There is none.
    """
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
            "Give the folder that an experiment wrote.",
        )
    return found


@contextmanager
def writing(folder: Path, what: str = "The report") -> Iterator[None]:
    """Make the folder, and turn failures to write `what` into it into LogError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise LogError(
            f"{what} can't be written to {folder}: {error.strerror or error}.",
            "Check the folder and the room on the disk.",
        ) from error


def pictures_of(folder: Path) -> Path:
    """Make and return the folder for a report's pictures."""
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    return pictures
