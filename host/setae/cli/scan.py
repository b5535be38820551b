"""`setae scan`: the paper's scan of a surface."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from setae import record, rig
from setae.cli import tell
from setae.cli.arm import show_arm_targets
from setae.cli.common import Where, app, console, interrupts, new_folder
from setae.cli.live_map import LiveMap
from setae.cli.runs import RunOptions, ended_early, make_way, say, what_is_left, write_report
from setae.config import Config
from setae.errors import InputError, LogError
from setae.experiments import scan as scans
from setae.experiments.events import Event
from setae.experiments.scan import Mode, ScanResult
from setae.heightmap import TOUCHED
from setae.objects import TableScene, UnknownScene, of_description, random_object, table_scene
from setae.robot import Robot
from setae.stage import Enter, ManualStage
from setae.ur import UrStage
from setae.wording import counted

# A person moves the arm by hand between two places, or brings it to the first.
_MANUAL_TIMEOUT_S = 3600.0
# How far off its earlier start a UR arm may stand to resume a scan.
_SAME_START_MM = 0.5


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
        none. SHAPE:SEED gives another size, place and turn; --seed has nothing to do with them.
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
        had not begun too. Or the log of one scan.
    run
        What it writes, and the arm.
    where
        Which robot.
    """
    run, where = run or RunOptions(), where or Where()
    if resume is not None:
        given = (mode, object, scene, area, step, order, tallest, run.out, where.config,
                 where.plant)  # fmt: skip
        if any(value is not None for value in given):
            raise InputError(
                "--resume goes on with the settings of the earlier run.",
                "Give it alone, or with --port, --stage, --accept-jump, --no-report.",
            )
        jobs, folder = _resumed(resume, where)
    else:
        config = _settings(where, area, step, order, tallest)
        jobs = _fresh(config, where, mode or ["paper"], object, scene)
        if not where.simulated:
            _warn_of_no_height(config)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """A scan to do: how, what, and what is known of it already.

    `modes` are all that the run was asked for; `replaces` are logs in which no scan has begun.
    """

    url: str | None
    config: Config
    mode: Mode
    modes: tuple[Mode, ...]
    seed: int
    scene: TableScene | None
    replaces: frozenset[Path] = frozenset()
    known: ScanResult | None = None
    part: int = 1
    arm_base_mm: tuple[float, ...] | None = None

    @property
    def known_places(self) -> int:
        return len(self.known.places) if self.known else 0

    @property
    def name(self) -> str:
        return f"{self.mode}.mcap" if self.part == 1 else f"{self.mode}-{self.part}.mcap"


# ----------------------------------------------------------------------- what to scan


def _settings(
    where: Where, area: str | None, step: float | None, order: str | None, tallest: float | None
) -> Config:
    config = where.load()
    changes: dict[str, object] = {}
    if area is not None:
        changes["area_mm"] = _area_mm(area)
    if step is not None:
        changes["step_mm"] = step
    if order is not None:
        changes["order"] = order
    if tallest is not None:
        if where.simulated:
            raise InputError("--tallest tells of a real object.", "The simulator knows its own.")
        changes["tallest_mm"] = tallest
    return dataclasses.replace(config, scan=dataclasses.replace(config.scan, **changes))  # type: ignore[arg-type]  # each as its key has it


def _warn_of_no_height(config: Config) -> None:
    """Say that the height window can't be checked: the configured height is all of it."""
    window_mm = scans.window_mm(config)
    if config.scan.tallest_mm >= window_mm:
        tell(
            f"Nobody said how tall the object is, so that it fits is not checked. It may rise "
            f"{window_mm:g} mm above the extended bristle's tip; --tallest says how far it does."
        )


def _area_mm(text: str) -> tuple[float, float]:
    parts = re.split(r"[x×]", text)
    try:
        sides = [float(part) for part in parts]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2):
        raise InputError(f"--area {text!r} is no area.", "Give mm: --area 200 or --area 120x80.")
    return sides[0], sides[-1]


def _fresh(
    config: Config, where: Where, modes: Sequence[Mode], object_: str | None, scene: Path | None
) -> list[_Job]:
    if len(set(modes)) < len(modes):
        raise InputError("A --mode is given twice.", "Give each once.")
    url = where.url
    place: TableScene | None = None
    if where.simulated:
        if object_ is not None and scene is not None:
            raise InputError("--object and --scene exclude each other.", "Give one of them.")
        place = _scene(config, scene) if scene else _object(config, object_ or "eraser")
        config = scans.in_scene(config, place)
    elif object_ is not None or scene is not None:
        raise InputError("--object and --scene are for the simulator.", "Give --sim too.")
    job = _Job(
        url=url, config=config, mode=modes[0], modes=tuple(modes), seed=where.seed, scene=place
    )
    return [dataclasses.replace(job, mode=mode) for mode in modes]


def _object(config: Config, text: str) -> TableScene:
    shape, _, seed = text.partition(":")
    if shape == "none":
        return table_scene(config)
    if seed and not seed.isdecimal():
        raise InputError(
            f"--object {text!r}: {seed!r} is no seed.", "Give a whole number, as in eraser:3."
        )
    return table_scene(config, random_object(shape, int(seed or 0), area_mm=config.scan.area_mm))


def _scene(config: Config, path: Path) -> TableScene:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"The scene {path} can't be read: {error.strerror}.", "Check the file's name."
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"The scene {path} isn't valid TOML: {error}.", "Correct that line."
        ) from None
    if "table_z_mm" not in data:
        data["table_z_mm"] = table_scene(config).table_z_mm
    try:
        found = of_description(data)
    except InputError as error:
        raise InputError(f"{path}: {error.problem}", error.remedy) from error
    if unknown := set(data) - {"table_z_mm", "object"}:
        raise InputError(
            f"The scene {path} has no {sorted(unknown)[0]!r}.", "It has table_z_mm and [object]."
        )
    return found


def _resumed(path: Path, where: Where) -> tuple[list[_Job], Callable[[], Path]]:
    """What a run left undone: scans that ended early, then modes that had not begun."""
    found = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if not found:
        raise LogError(f"{path} holds no log.", "Give the folder that `setae scan` wrote.")
    logs = [record.read(log) for log in _all_parts(found)]
    # A run that ended while the robot was being enabled leaves a log in which no scan has begun.
    vain = [log for log in logs if log.metadata.get("experiment") == scans.EXPERIMENT
            and not log.events("scan_start")]  # fmt: skip
    begun = scans.scans_of(log for log in logs if log not in vain)
    about = logs[0].metadata
    simulated = bool(about.get("simulated"))
    if simulated and where.port is not None:
        raise InputError("That scan was simulated, so --port has no part in it.", "Leave it out.")
    plant = str(about.get("plant") or "")
    base_mm = about.get("arm_base_mm")
    asked = tuple(about.get("modes") or ()) if path.is_dir() or not begun else ()
    job = _Job(
        url=(plant if plant.startswith("python:") else "sim://") if simulated else where.url,
        config=logs[0].config,
        mode=about["mode"],
        modes=tuple(about.get("modes") or ()),
        seed=int(about.get("seed") or 0),
        scene=of_description(about.get("scene") or {}) if simulated else None,
        replaces=frozenset(log.path for log in vain),
        arm_base_mm=None if base_mm is None else tuple(base_mm),
    )
    left, modes = [], set()
    for parts in begun:
        known = scans.read_parts(parts)
        modes.add(known.mode)
        if not known.complete:
            again = dataclasses.replace(job, mode=known.mode, known=known, part=len(parts) + 1)
            left.append(again)
    left += [dataclasses.replace(job, mode=mode) for mode in asked if mode not in modes]
    if not left:
        raise InputError(f"The scan in {path} is complete.", "`setae report` makes its report.")
    return left, lambda: logs[0].path.parent


def _all_parts(logs: Sequence[Path]) -> list[Path]:
    """Of one log: the others of its scan, which lie beside it."""
    if len(logs) > 1:
        return list(logs)
    stem = re.sub(r"-\d+$", "", logs[0].stem)
    return sorted(logs[0].parent.glob(f"{stem}*.mcap"))


# -------------------------------------------------------------------------- scanning


class _Scanning:
    """Scans one after the other, each with a log of its own in one folder."""

    def __init__(self, folder: Callable[[], Path], run: RunOptions) -> None:
        self._folder = folder
        self._run = run
        self._logs: list[Path] = []
        self._worth_resuming = False

    def all(self, jobs: Sequence[_Job]) -> None:
        """Do them all."""
        with ended_early(self._what_is_left, what="robot and arm are stopped"):
            results = [self._one(job) for job in jobs]
        _print_table(results, jobs[0].config)
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

    def _one(self, job: _Job) -> ScanResult:
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
    def _ready(self, job: _Job) -> Iterator[tuple[rig.Rig, record.Recorder]]:
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
            # Only now, so that a board that isn't there costs neither work nor a folder.
            log = self._folder() / job.name
            if self._run.force or log in job.replaces:
                make_way(log)
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

    def _by_hand(self, job: _Job) -> bool:
        return self._run.stage is None and job.scene is None


def _arm_base_mm(opened: rig.Rig, job: _Job) -> tuple[float, ...] | None:
    """Where a UR arm's start is in its base frame; a resumed scan needs the same."""
    stage = opened.stage
    if not isinstance(stage, UrStage):
        return None
    now_mm, then_mm = stage.base_mm(stage.position_mm), job.arm_base_mm
    if then_mm is not None and np.linalg.norm(np.subtract(now_mm, then_mm)) > _SAME_START_MM:
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


def _print_table(results: Sequence[ScanResult], config: Config) -> None:
    table_mm = results[0].scene.get("table_z_mm")
    base_mm = config.scan_reach_mm if table_mm is None else float(table_mm)
    above = "extended tip" if table_mm is None else "table"
    table = Table(caption=f"highest: above the {above}")
    table.add_column("mode")
    for name in ("robot time", "touched", "inferred", "empty", "flagged", "highest"):
        table.add_column(name, justify="right")
    for result in results:
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
