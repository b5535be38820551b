"""What a run is told and leaves in its folder, and what it says when it ends early."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from setae.cli.common import Flag, console
from setae.errors import ExtraMissingError, LogError, SetaeError


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What a run of robot and arm writes, and how it begins.

    Parameters
    ----------
    out
        Folder for logs and report; the default is the next free one in runs.
    force
        Use --out though it holds files. Logs of the same names are replaced, and with them those
        that resumed them.
    report
        Write the report.
    accept_jump
        Enable the servos though nobody knows where they are, or they were left where the
        configuration doesn't allow them: the first pulse may move them at full speed.
    stage
        The arm that carries the robot: ur://ADDRESS. Without it a simulated robot has a
        simulated arm, and a real one a person who moves it.
    dry_run
        Connect to the arm, show where it would go, and move nothing.
    """

    out: Path | None = None
    force: Flag = False
    report: bool = True
    accept_jump: Flag = False
    stage: str | None = None
    dry_run: Flag = False


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


@contextmanager
def ended_early(left: Callable[[], Sequence[str]], *, what: str) -> Iterator[None]:
    """Have an error or a Ctrl-C say what stands still, and what the run leaves.

    Parameters
    ----------
    left
        Sentences about what is left, such as those of `what_is_left`.
    what
        What stands still after a Ctrl-C, such as "robot and arm are stopped".
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        failures = getattr(interrupt, "__notes__", [])
        stopped = ["interrupted, but:", *failures] if failures else [f"interrupted: {what}."]
        interrupt.__notes__ = [*stopped, *left()]
        raise
    except SetaeError as error:
        for line in left():
            error.add_note(line)
        raise


def later_parts(log: Path) -> list[Path]:
    """Logs that resumed a log, by their names: paper-2.mcap and so on for paper.mcap."""
    part = re.compile(rf"{re.escape(log.stem)}-\d+")
    return sorted(each for each in log.parent.glob("*.mcap") if part.fullmatch(each.stem))


def make_way(log: Path) -> None:
    """Remove the log of an earlier run, because --force was given, and say so.

    Logs that resumed it go too: they would count as parts of the new one.

    Raises
    ------
    LogError
        It can't be removed.
    """
    # The first part last: what a failure leaves is still one run.
    for old in (*reversed(later_parts(log)), log):
        if remove(old):
            say(f"Replaced, because of --force: {old}")


def remove(log: Path) -> bool:
    """Remove a log; whether there was one.

    Raises
    ------
    LogError
        It can't be removed.
    """
    try:
        log.unlink()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise LogError(
            f"{log} can't be replaced: {error.strerror}.", "Give another --out."
        ) from error
    return True


def write_report(logs: Sequence[Path], folder: Path) -> None:
    """Write the report, or say why there is none: the experiment itself is done.

    So does a Ctrl-C meanwhile.
    """
    from setae import report

    try:
        path = report.write(logs, folder / "report.html")
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(f"interrupted: the experiment is done. {later(folder)}")
        raise
    except ExtraMissingError as error:
        text = f"No report: {error} {later(folder)}"
        console.print(text, style="yellow", markup=False, soft_wrap=True)
        return
    say(f"Report: {path}")
