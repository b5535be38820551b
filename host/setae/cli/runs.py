"""What a run leaves in its folder, and what it says when it ends early."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from setae.cli.common import console
from setae.errors import ExtraMissingError

STOPPED = ["interrupted: robot and arm are stopped."]


def say(text: str) -> None:
    """Print a line as it is."""
    console.print(text, markup=False, soft_wrap=True)


def what_is_left(logs: Sequence[Path]) -> list[str]:
    """What a run that ended early leaves, and what can be done with it."""
    if not logs:
        return []
    return [f"What happened is in {logs[-1]}. {later(logs[-1].parent)}"]


def later(folder: Path) -> str:
    """How to make the report of a folder."""
    return f"`setae report {folder}` makes a report of it."


def write_report(logs: Sequence[Path], folder: Path) -> None:
    """Write the report, or say why there is none: the experiment itself is done."""
    from setae import report

    try:
        path = report.write(logs, folder / "report.html")
    except ExtraMissingError as error:
        text = f"No report: {error} {later(folder)}"
        console.print(text, style="yellow", markup=False, soft_wrap=True)
        return
    say(f"Report: {path}")
