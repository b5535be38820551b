"""All runs of a study: in this process, in some on this machine, or on a cluster.

What a run gives is kept at once, in a folder of its own, its line of the table last: a line that
is there belongs to a run that is whole. So an interrupted study goes on where it was.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from types import FrameType
from typing import Any, Final, TypeAlias

from setae import extras
from setae.errors import InputError, SetaeError
from setae.experiments.scan import MODES
from setae.experiments.study.one import LOG, Outcome, perform
from setae.experiments.study.plan import Run

__all__ = [
    "LINE",
    "RUNS",
    "Row",
    "conduct",
    "finished",
    "require",
    "workers_for",
]

Row: TypeAlias = Mapping[str, Any]
"""A run's line of the table."""

RUNS: Final = "runs"
LINE: Final = "row.json"
_CONNECT_S: Final = 10
# Workers on this machine come out of one process that imports all this once, while this one still
# imports its own; each for itself would take longer to begin than a scan takes.
_NEEDED: Final = ("distributed", "setae.experiments.study", "scipy.spatial", "threadpoolctl")
# A sampling profiler that nobody reads, and looks at the loop and the memory many times a second,
# would take some of the cores from the runs.
_OF_WORKERS: Final = {
    "distributed.worker.multiprocessing-method": "forkserver",
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "2s",
    "distributed.worker.memory.monitor-interval": "1s",
}


def require() -> None:
    """Look for what a study needs, before any work is done.

    It is not imported yet: that is done while the workers' process imports the same.

    Raises
    ------
    ExtraMissingError
        The extra ``study`` isn't installed.
    """
    for module in ("distributed", "pyarrow", "scipy", "threadpoolctl"):
        extras.find(module, "study", "A study")


def workers_for(workers: int | None, scheduler: str | None) -> int:
    """How many processes on this machine do the runs, if no scheduler is given.

    Raises
    ------
    InputError
        Workers and a scheduler are both given, or the number of workers is no good.
    """
    if scheduler is not None and workers is not None:
        raise InputError("A scheduler has workers of its own.", "Give it, or --workers.")
    workers = workers if workers is not None else _cores()
    if workers < 1:
        raise InputError(f"{workers} workers do nothing.", "Give 1 or more.")
    return workers


def _cores() -> int:
    """How many cores this process may use, or the machine has where nobody can tell."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _prepare_workers() -> None:
    """Begin the process that workers on this machine come out of; it ends with this one."""
    with _interrupts_held_back():
        multiprocessing.set_forkserver_preload(list(_NEEDED))
        forkserver.ensure_running()


def conduct(
    runs: Sequence[Run],
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    on_row: Callable[[Row], None] | None = None,
    task: Callable[[Run], Outcome] = perform,
) -> list[Row]:
    """Do those runs that aren't done yet.

    Parameters
    ----------
    runs
        All runs of the study.
    folder
        Where they are kept; runs that are done there are left out, failed ones are tried again,
        and so are those whose log is to be kept now and was not.
    workers
        Processes on this machine; 1: this one. None: one for each core that it may use.
    scheduler
        Address of a dask scheduler, such as ``tcp://10.0.0.1:8786``; its workers do the runs.
    on_row
        Called with each run's line when it has ended, also with those of earlier runs.
    task
        What does one run.

    Returns
    -------
    list
        Lines of all runs, in their order. Those of runs that failed say why.

    Raises
    ------
    InputError
        Workers and a scheduler are both given, or the number of workers is no good.
    SetaeError
        There is no such scheduler, or the folder can't be written to.
    ExtraMissingError
        dask.distributed isn't installed.
    """
    workers = workers_for(workers, scheduler)
    rows = {run.name: row for run in runs if (row := finished(folder, run)) is not None}
    told = on_row or _ignore
    for row in rows.values():
        told(row)
    left = [run for run in runs if run.name not in rows]
    if scheduler is None:
        workers = min(workers, len(left))
    for run, outcome in _outcomes(left, workers, scheduler, task):
        _keep(folder / RUNS / run.name, outcome)
        rows[run.name] = outcome.row
        told(outcome.row)
    return [rows[run.name] for run in runs]


def _ignore(row: Row) -> None:
    del row


def finished(folder: Path, run: Run) -> Row | None:
    """Line of a run that is done; None where it isn't, has failed, or lacks a log to be kept."""
    if run.keep_log and not (folder / RUNS / run.name / LOG).is_file():
        return None
    try:
        row = json.loads((folder / RUNS / run.name / LINE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return row if isinstance(row, dict) and row.get("status") == "done" else None


def _keep(folder: Path, outcome: Outcome) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # An earlier line, of the run without its log, would vouch for files half written.
        (folder / LINE).unlink(missing_ok=True)
        for name, content in outcome.files.items():
            (folder / name).write_bytes(content)
        unfinished = folder / f"{LINE}.part"
        unfinished.write_text(json.dumps(outcome.row, indent=1) + "\n", encoding="utf-8")
        unfinished.replace(folder / LINE)
    except OSError as error:
        raise SetaeError(
            f"{folder} can't be written to: {error.strerror or error}.",
            "Make room, or give another --out; the same call then goes on.",
        ) from error


def _outcomes(
    runs: Sequence[Run], workers: int, scheduler: str | None, task: Callable[[Run], Outcome]
) -> Iterable[tuple[Run, Outcome]]:
    if not runs:
        return ()
    if scheduler is None and workers == 1:
        return ((run, task(run)) for run in runs)
    return _distributed(runs, workers, scheduler, task)


def _distributed(
    runs: Sequence[Run], workers: int, scheduler: str | None, task: Callable[[Run], Outcome]
) -> Iterator[tuple[Run, Outcome]]:
    if scheduler is None:
        _prepare_workers()
    distributed = extras.load("distributed", "study", "More than one worker")
    dask_config = extras.load("dask.config", "study", "More than one worker")
    with ExitStack() as stack:
        if scheduler is None:
            stack.enter_context(dask_config.set(_OF_WORKERS))
            # Only this machine can reach it, it has no pages, and any free ports will do: studies
            # run beside each other.
            with _interrupts_held_back():
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        processes=True,
                        host="127.0.0.1",
                        dashboard_address="127.0.0.1:0",
                        scheduler_kwargs={"dashboard": False},
                        silence_logs=50,
                    )
                )
            client = stack.enter_context(distributed.Client(cluster))
        else:
            try:
                client = stack.enter_context(distributed.Client(scheduler, timeout=_CONNECT_S))
            except (OSError, ValueError, TypeError) as error:
                raise SetaeError(
                    f"There is no scheduler at {scheduler}.",
                    "Start one with `dask scheduler`, and give its address: tcp://HOST:8786.",
                ) from error
        # The long ones first: at the end, whoever has nothing left to do waits for a short one.
        runs = sorted(runs, key=lambda run: MODES.index(run.mode))
        # Not pure: a run that failed is tried again by the next call, not remembered.
        futures = client.map(task, runs, pure=False, retries=0)
        of = {future.key: run for future, run in zip(futures, runs, strict=True)}
        ended = distributed.as_completed(futures, raise_errors=False)
        del futures  # so that what has been read leaves the workers' memory
        for future in ended:
            run = of[future.key]
            lost = future.exception()
            yield run, future.result() if lost is None else _lost(run, lost)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Have a Ctrl-C wait until the workers are there: half started they can't be ended in order.

    They begin with it blocked and keep it so: this process ends them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # where no Ctrl-C arrives
        return
    pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        del number, frame
        pressed = True

    resource_tracker.ensure_running()  # with the first process, it would undo what follows
    before = signal.signal(signal.SIGINT, note)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


def _lost(run: Run, error: BaseException) -> Outcome:
    """Outcome of a run whose worker died, or couldn't begin."""
    return Outcome(
        row={
            "run": run.name,
            "object": run.object,
            "seed": run.seed,
            "mode": run.mode,
            **dict(run.changes),
            "status": "failed",
            "error": f"{type(error).__name__}: {error}",
        }
    )
