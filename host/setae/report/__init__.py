"""Reports: what a run's logs say, as a web page, pictures and tables.

`write` is the way in. `explore`, `scan`, `validation` and `bristle` are the reports of the
experiments, each with its page, pictures and tables; `paper` holds the paper's
numbers. Of the exploration, `reading` finds a `trial` in a log, `shapes` and
`drawing` draw the robot, and `scene`, `felt` and `depths` draw its pictures.
Matplotlib and Plotly come with the extra ``report`` and are imported when first
needed.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from setae import record
from setae.errors import LogError
from setae.record import Log
from setae.report import bristle, explore, files, scan, validation

__all__ = ["bristle", "explore", "scan", "validation", "write"]

_WRITERS = {
    "explore": explore.write,
    "scan": scan.write,
    "validate": validation.write,
    "bristle": bristle.write,
}


def write(logs: str | Path | Iterable[str | Path | Log], path: str | Path) -> Path:
    """Write the report of an experiment, which its logs name.

    Parameters
    ----------
    logs
        A folder with logs, one log, or several; all of one experiment.
    path
        The page to write, such as ``runs/explore-1/report.html``. Pictures and
        tables go into the same folder.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    LogError
        A log can't be read, the logs are of several experiments, none holds anything to
        report, or the page can't be written.
    ExtraMissingError
        Matplotlib or Plotly isn't installed.
    """
    path = Path(path)
    given = [log if isinstance(log, Log) else record.read(log) for log in files.logs_of(logs)]
    # A run that was killed at once leaves a log without anything in it.
    read = [log for log in given if log.events() or "experiment" not in log.metadata]
    if not read:
        names = ", ".join(str(log.path) for log in given)
        raise LogError(
            f"Nothing to report in {names}: it ended before its experiment began.", "Run it again."
        )
    kinds = {str(log.metadata.get("experiment") or "explore") for log in read}
    if len(kinds) > 1 and kinds != {"validate", "causes"}:
        raise LogError(
            f"These logs are of different experiments: {', '.join(sorted(kinds))}.",
            "Report each experiment's logs alone.",
        )
    writer = _WRITERS.get("validate" if len(kinds) > 1 else kinds.pop(), explore.write)
    return writer(read, path.parent, page=path.name).page
