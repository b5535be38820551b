"""`setae report` and `setae replay`: what a log holds."""

from __future__ import annotations

import sys
from pathlib import Path

from setae import record
from setae.cli.common import app, console
from setae.errors import InputError, LogError


@app.command
def report(log: Path, *more: Path, out: Path | None = None) -> None:
    """Write one HTML page about one or more logs.

    Parameters
    ----------
    log
        A log, or the folder of a run with all its logs.
    more
        Further logs for the same page.
    out
        A folder for the report, or the page's own file, such as run.html; the
        default is report.html beside the first log. Pictures and tables go beside
        the page.
    """
    from setae import report as pages
    from setae.experiments import scan as scans

    logs = [read for given in (log, *more) for read in _logs_of(given)]
    page = out or (log if log.is_dir() else log.parent)
    if page.suffix.lower() not in (".html", ".htm"):
        page = page / "report.html"
    path = pages.write(logs, page)
    for read in logs:
        if scans.is_vain(read):
            print(f"setae: Left out: {read.path} holds no scan.", file=sys.stderr)
        else:
            _warn_of_damage(read)
    console.print(f"Report: {path}", markup=False, soft_wrap=True)


def _logs_of(given: Path) -> list[record.Log]:
    """The log itself, or the logs in a folder; what can't be read there is told, and left out."""
    if not given.is_dir():
        return [record.read(given)]
    logs = []
    for path in sorted(given.glob("*.mcap")):
        try:
            logs.append(record.read(path))
        except LogError as error:
            print(f"setae: Left out: {error.problem}", file=sys.stderr)
    if not logs:
        raise LogError(
            f"{given} holds no log.",
            "Give the folder that an experiment wrote. Of a study or a comparison, the same "
            "`setae study` or `setae cluster` writes the report again.",
        )
    return logs


def _warn_of_damage(log: record.Log) -> None:
    if log.damage is not None:
        print(f"setae: {log.path} is not whole. {log.damage}.", file=sys.stderr)


@app.command
def replay(log: Path, *, topic: str | None = None) -> None:
    """Print what happened in a log, in order.

    Parameters
    ----------
    log
        A log; one that was cut off is shown as far as it goes.
    topic
        Only this topic, such as /telemetry. Without it: commands, trips, faults,
        refusals and the experiment's events.
    """
    read = record.read(log)
    if topic is not None and topic not in record.TOPICS:
        raise InputError(f"There is no topic {topic!r}.", f"Topics: {', '.join(record.TOPICS)}.")
    topics = [topic] if topic else ["/experiment", "/command", "/trip", "/fault", "/refusal"]
    rows = sorted(
        ((message["time_us"], name, message) for name in topics for message in read.messages(name)),
        key=lambda row: row[0],
    )
    for time_us, name, message in rows:
        fields = {key: value for key, value in message.items() if key != "time_us"}
        text = " ".join(f"{key}={value}" for key, value in fields.items())
        console.print(f"{time_us / 1e6:10.3f} s  {name:<12} {text}", markup=False, soft_wrap=True)
    _warn_of_damage(read)
