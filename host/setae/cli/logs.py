"""`setae report` and `setae replay`: what a log holds."""

from __future__ import annotations

from pathlib import Path

from setae import record
from setae.cli.common import app, console
from setae.errors import InputError


@app.command
def report(log: Path, *more: Path, out: Path | None = None) -> None:
    """Write one HTML page about one or more logs.

    Parameters
    ----------
    log
        A log.
    more
        Further logs for the same page.
    out
        The page's file; the default is report.html beside the first log.
    """
    from setae import report as pages

    path = pages.write([log, *more], out or log.with_name("report.html"))
    console.print(f"Report: {path}", markup=False, soft_wrap=True)


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
    if read.damage is not None:
        console.print(f"Damaged: {read.damage}", style="yellow", markup=False, soft_wrap=True)
