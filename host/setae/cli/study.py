"""`setae study`: many simulated scans, here or on a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from setae.cli.common import Flag, app, console, new_folder
from setae.cli.runs import say
from setae.errors import ExtraMissingError, InputError, SetaeError
from setae.experiments import study as studies
from setae.wording import counted

# Exit code: all runs have ended, and what they gave is kept, but some failed.
_SOME_FAILED = 3

Several = Annotated[list[str] | None, Parameter(negative="")]


@app.command
def study(
    file: Path | None = None,
    *,
    object: Several = None,  # noqa: A002  # the option's name
    seeds: int | None = None,
    mode: Several = None,
    plant: Several = None,
    vary: Several = None,
    config: Path | None = None,
    keep_logs: Flag = False,
    workers: int | None = None,
    scheduler: str | None = None,
    out: Path | None = None,
    force: Flag = False,
    report: bool = True,
) -> int:
    """Scan many simulated objects: every combination of objects, seeds and parameters.

    What came out stands in table.parquet, one line for each run. A run that fails says why in
    its line, and the others go on; the exit code is then 3. The same call with the same --out
    does what is left, another one adds its runs to the table.

    Parameters
    ----------
    file
        TOML file with [study] and [vary], instead of the options below.
    object
        A shape, or "none"; several times: several. Without it all five.
    seeds
        How many objects of random size, place and yaw of each shape; the default is 5.
    mode
        Of the scan: paper, safe or adaptive, which is the default.
    plant
        The simulated robot: ideal, paper_like or random:SEED.
    vary
        A key of the configuration with its values, such as scan.step_mm=10,20.
    config
        TOML file with what differs from the paper's robot in all runs.
    keep_logs
        Keep every run's log too: some megabytes each. Runs that were done without are done again.
    workers
        Processes on this machine; the default is one for each core.
    scheduler
        Address of a dask scheduler, such as tcp://10.0.0.1:8786: its workers do the runs.
    out
        Folder; the default is the next free runs/study-N.
    force
        Use --out though it holds something else.
    report
        Write the report.
    """
    options = {"--object": object, "--seeds": seeds, "--mode": mode, "--plant": plant,
               "--vary": vary, "--config": config}  # fmt: skip
    if file is not None:
        given = [name for name, value in options.items() if value]
        if given:
            raise InputError(
                f"{given[0]} stands beside a file that says what to study.", "Give one of them."
            )
        plan = studies.load(file, keep_logs=keep_logs)
    else:
        plan = studies.of_options(
            objects=object or (), seeds=seeds, modes=mode or (), plants=plant or (),
            vary=vary or (), config=config, keep_logs=keep_logs,
        )  # fmt: skip
    studies.workers_for(workers, scheduler)
    studies.require()
    goes_on = out is not None and (out / studies.RUNS).is_dir()
    folder = new_folder("study", out, force=force or goes_on)
    rows = _conduct(plan.runs(), folder, workers, scheduler)
    every = studies.with_earlier(rows, folder)
    table = studies.write_table(folder / "table.parquet", every)
    failed = [row for row in rows if row["status"] != "done"]
    say(f"{len(rows) - len(failed)} of {counted(len(rows), 'run')} done, {len(failed)} failed.")
    for row in failed[:5]:
        say(f"  {row['run']}: {row['error']}")
    if len(failed) > 5:
        say(f"  … and {len(failed) - 5} more, see the table.")
    if failed:
        say(f"The same call with --out {folder} tries what failed again.")
    earlier = f", with {counted(len(every) - len(rows), 'run')} of other calls"
    say(f"Table: {table}{earlier if len(every) > len(rows) else ''}")
    if report:
        from setae.report import study as pages

        try:
            say(f"Report: {pages.write(every, plan.varied, folder).page}")
        except ExtraMissingError as error:
            console.print(f"No report: {error}", style="yellow", markup=False, soft_wrap=True)
    return _SOME_FAILED if failed else 0


def _conduct(
    runs: Sequence[studies.Run], folder: Path, workers: int | None, scheduler: str | None
) -> list[studies.Row]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
               TimeRemainingColumn())  # fmt: skip
    kept: list[studies.Row] = []
    try:
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("scans", total=len(runs))

            def on_row(row: studies.Row) -> None:
                kept.append(row)
                failed = sum(one["status"] != "done" for one in kept)
                text = f"scans, {failed} failed" if failed else "scans"
                progress.update(bar, advance=1, description=text)

            return studies.conduct(
                runs, folder, workers=workers, scheduler=scheduler, on_row=on_row
            )
    except KeyboardInterrupt as interrupt:
        interrupt.__notes__ = [f"interrupted: {_left(kept, folder)}"]
        raise
    except SetaeError as error:
        if kept:
            error.add_note(_left(kept, folder))
        raise


def _left(kept: Sequence[studies.Row], folder: Path) -> str:
    return f"{counted(len(kept), 'run')} kept. The same command with --out {folder} goes on."
