"""`setae scan`: the paper's scan of a surface."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from setae import record, rig
from setae.cli import scan_jobs
from setae.cli.arm import show_arm_targets
from setae.cli.common import Where, app, console, interrupts, new_folder
from setae.cli.live_map import LiveMap
from setae.cli.runs import (
    RunOptions,
    ended_early,
    make_way,
    remove,
    say,
    what_is_left,
    write_report,
)
from setae.cli.scan_jobs import SAME_START_MM, Job
from setae.errors import InputError
from setae.experiments import scan as scans
from setae.experiments.events import Event
from setae.experiments.reach import require_reachable
from setae.experiments.scan import Mode, ScanResult
from setae.heightmap import TOUCHED
from setae.objects import TableScene, UnknownScene
from setae.robot import Robot
from setae.stage import Enter, ManualStage
from setae.ur import UrStage
from setae.wording import counted

# A person moves the arm by hand between two places, or brings it to the first.
_MANUAL_TIMEOUT_S = 3600.0


@app.command
def scan(
    *,
    mode: Annotated[list[Mode] | None, Parameter(negative="")] = None,
    object: str | None = None,  # noqa: A002  # the option's name
    scene: Path | None = None,
    area: str | None = None,
    step: float | None = None,
    order: Literal["zigzag", "raster"] | None = None,
    tallest: float | None = None,
    resume: Path | None = None,
    run: RunOptions | None = None,
    where: Where | None = None,
) -> None:
    """Scan a surface from above: from place to place, extend until the bristle touches it.

    The arm starts above the first place; from there the square goes along +x and +y. Each scan
    writes a log into the folder --out, and all of them one report.

    Parameters
    ----------
    mode
        paper: the paper's cycle, which is the default. safe: retracted in every step. adaptive:
        the same map in less time. Several times: one scan each, side by side in the report.
    object
        What the simulated robot scans: lidded_container, open_container, eraser, coil, orange, or
        none; eraser by itself. SHAPE:SEED gives another size, place and turn; --seed has nothing
        to do with them.
    scene
        Instead: a TOML file that says what stands where.
    area
        Sides along x and y in mm: 200, or 120x80.
    step
        From place to place, in mm.
    order
        Rows to and fro, or all in the same direction.
    tallest
        How far anything rises above the extended bristle's tip, in mm. The simulator knows.
    resume
        Folder of a run that ended early: what it lacks is scanned, with its settings, modes that
        had not begun too. Or the log of one scan: what this one lacks.
    run
        What it writes, and the arm.
    where
        Which robot.
    """
    run, where = run or RunOptions(), where or Where()
    if resume is not None:
        given = (mode, object, scene, area, step, order, tallest, run.out, where.config,
                 where.plant, where.plugin, run.force or None, where.seed or None)  # fmt: skip
        if any(value is not None for value in given):
            raise InputError(
                "--resume goes on with the settings of the earlier run.",
                "Give it alone, or with --port, --stage, --accept-jump, --no-report.",
            )
        jobs, folder = scan_jobs.resumed(resume, where)
    else:
        config = scan_jobs.settings(where, area, step, order, tallest)
        jobs = scan_jobs.fresh(config, where, mode or ["paper"], object, scene)
        if not where.simulated and tallest is None:
            scan_jobs.warn_of_no_height(config)
        folder = cache(lambda: new_folder("scan", run.out, force=run.force))
    for job in jobs:
        scans.require_window(job.config, job.config.scan.tallest_mm)
        scans.Survey(job.config.scan)
        if job.scene is not None:
            scans.require_free_start(job.config, job.scene)
    if run.dry_run:
        show_arm_targets(run.stage, jobs[0].config, scans.arm_targets_mm(jobs[0].config.scan))
        return
    scanning = _Scanning(folder, run)
    scanning.all(jobs)
    if run.report:
        scanning.report()


# -------------------------------------------------------------------------- scanning


class _Scanning:
    """Scans one after the other, each with a log of its own in one folder."""

    def __init__(self, folder: Callable[[], Path], run: RunOptions) -> None:
        self._folder = folder
        self._run = run
        self._logs: list[Path] = []
        self._worth_resuming = False

    def all(self, jobs: Sequence[Job]) -> None:
        """Do them all."""
        with ended_early(self._what_is_left, what="robot and arm are stopped"):
            results = [self._one(job) for job in jobs]
        _print_table(results, jobs)
        say(f"Logs: {self._folder()}")

    def report(self) -> None:
        """Write the report of all logs in the folder, earlier parts included."""
        folder = self._folder()
        write_report(sorted(folder.glob("*.mcap")), folder)

    def _what_is_left(self) -> list[str]:
        if not self._logs:
            return []
        left = what_is_left(self._logs)
        if self._worth_resuming:
            left.append(f"`setae scan --resume {self._logs[-1].parent}` does what is left.")
        return left

    def _one(self, job: Job) -> ScanResult:
        what = "the surface" if job.scene is None else _name(job.scene)
        begun = "" if job.known is None else f", from {counted(job.known_places, 'known place')} on"
        console.print(f"Scan of {what}, mode {job.mode}{begun}")
        with LiveMap() as live, self._ready(job) as (opened, recorder):
            if job.known is not None:
                live.known(job.known.places)
                self._worth_resuming |= job.known_places > 0

            def told(event: Event) -> None:
                # Where not even the first place was found, it would end there again.
                self._worth_resuming |= event.name == "place"
                live.event(event)

            return scans.scan(
                opened.robot,
                opened.stage,
                mode=job.mode,
                known=job.known.places if job.known else (),
                earlier_s=job.known.duration_s if job.known else 0.0,
                on_event=scans.recorded(recorder, told),
                arm_timeout_s=_MANUAL_TIMEOUT_S if self._by_hand(job) else None,
                scene=None if job.scene is None else job.scene.describe()["scene"],
            )

    @contextmanager
    def _ready(self, job: Job) -> Iterator[tuple[rig.Rig, record.Recorder]]:
        """An enabled robot on its arm, and its log."""
        with (
            interrupts.caught(),
            rig.open(
                job.url,
                config=job.config,
                seed=job.seed,
                scene=job.scene or UnknownScene(),
                stage=ManualStage(ask=say) if self._by_hand(job) else self._run.stage,
                pollables=[interrupts],
            ) as opened,
        ):
            arm_base_mm = _arm_base_mm(opened, job)
            # Before an earlier log makes way; `scan` looks again, for whoever calls it.
            require_reachable(opened.stage, scans.arm_targets_mm(job.config.scan))
            # Only now, so that a board that isn't there costs neither work nor a folder.
            log = self._folder() / job.name
            if self._run.force:
                make_way(log)
            elif log in job.replaces:
                remove(log)
            if self._by_hand(job):
                _ask_for_start(opened.robot)
            about = {
                "experiment": scans.EXPERIMENT,
                "mode": job.mode,
                "modes": list(job.modes),
                "part": job.part,
                "arm_base_mm": arm_base_mm,
            }
            recorder = opened.record(log, metadata=about)
            self._logs.append(log)
            if opened.world is not None and job.scene is not None:
                scans.record_true_surface(recorder, opened.world, job.scene, job.config.scan)
            opened.robot.enable(accept_jump=self._run.accept_jump)
            yield opened, recorder

    def _by_hand(self, job: Job) -> bool:
        return self._run.stage is None and job.scene is None


def _arm_base_mm(opened: rig.Rig, job: Job) -> tuple[float, ...] | None:
    """Where a UR arm's start is in its base frame; a resumed scan needs the same."""
    stage = opened.stage
    if not isinstance(stage, UrStage):
        return None
    now_mm, then_mm = stage.base_mm(stage.position_mm), job.arm_base_mm
    if then_mm is not None and np.linalg.norm(np.subtract(now_mm, then_mm)) > SAME_START_MM:
        where = ", ".join(f"{value_mm:.1f}" for value_mm in then_mm)
        raise InputError(
            "The arm is not where the earlier run started.",
            f"Bring frame D's origin to {where} mm in the arm's base frame, then resume.",
        )
    return now_mm


def _ask_for_start(robot: Robot) -> None:
    enter = Enter()
    enter.forget()
    say("Bring the arm to its start, above the first place of the scan, then press Enter.")
    # In the robot's own loop: it is watched meanwhile, and Ctrl-C is heard.
    robot.wait(enter.pressed, timeout_s=_MANUAL_TIMEOUT_S, what="the arm to be at its start")


def _name(scene: TableScene) -> str:
    what = scene.object
    return "an empty table" if what is None else f"{what.shape}, size {what.scale:g}"


def _print_table(results: Sequence[ScanResult], jobs: Sequence[Job]) -> None:
    above = "extended tip" if jobs[0].scene is None else "table"
    table = Table(caption=f"highest: above the {above}")
    table.add_column("mode")
    for name in ("robot time", "touched", "inferred", "empty", "flagged", "highest"):
        table.add_column(name, justify="right")
    for result, job in zip(results, jobs, strict=True):
        base_mm = job.config.scan_reach_mm if job.scene is None else job.scene.table_z_mm
        mark = result.height_map.mark
        heights_mm = result.height_map.points_mm()[:, 2]
        table.add_row(
            result.mode,
            f"{result.duration_s:.0f} s",
            str(int(np.isin(mark, TOUCHED).sum())),
            str(int((mark == "inferred").sum())),
            str(int((mark == "empty").sum())),
            str(int(np.isin(mark, ("slipped", "double", "lost")).sum())),
            f"{heights_mm.max() - base_mm:.1f} mm" if len(heights_mm) else "–",
        )
    console.print(table)
