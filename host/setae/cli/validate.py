"""`setae validate`: how exactly the robot goes where it is sent, on the paper's targets."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from setae import record, rig, tendons
from setae.arc import FloatArray
from setae.cli.common import Flag, Where, Whole, app, console, interrupts, new_folder
from setae.cli.errors_table import print_causes, print_runs, print_targets
from setae.cli.runs import ended_early, later, make_way, remove, say, what_is_left, write_report
from setae.config import Config
from setae.errors import InputError
from setae.experiments import causes as why
from setae.experiments import frames, runs, view
from setae.experiments import positions as measurements
from setae.experiments.events import Event, OnEvent
from setae.experiments.targets import Target, choose, paper_targets
from setae.experiments.validate import Noise, measured, validate
from setae.robot import Robot
from setae.scene import open_scene
from setae.stage import Enter

Several = Annotated[list[str] | None, Parameter(negative="")]

# Somebody takes a picture of each pose.
_PICTURE_TIMEOUT_S = 3600.0


@app.command(name="validate")
def validate_command(
    *,
    model: Several = None,
    targets: Whole | None = None,
    positions: Several = None,
    frame: Path | None = None,
    noise_mm: float = 0.0,
    noise_seed: Whole = 0,
    out: Path | None = None,
    causes: Flag = False,
    resume: Flag = False,
    force: Flag = False,
    report: bool = True,
    list_targets: Annotated[bool, Parameter(name="--list", negative="")] = False,
    accept_jump: Flag = False,
    where: Where | None = None,
) -> None:
    """Send the robot to the paper's 145 targets, and compare where it comes to.

    With --sim the simulator says where it is. A real robot waits at each target for a
    picture; the positions measured in them come in a second call, with --positions and
    the same --out. Both write logs, tables and one report into the folder --out.

    Parameters
    ----------
    model
        Tendon model: paper, parallel or taut. Several times: one after the other, side
        by side in the report. Without it the configuration's.
    targets
        Drive only so many of the 145, evenly spread over the five groups; 5 at least.
    positions
        File with measured positions: columns target, x_mm, y_mm, z_mm, or ImageJ's
        table of results. GROUP=FILE for one whose rows are a group's targets in their
        order, such as +X=plus_x.csv. Several times: several files.
    frame
        TOML file with scale and axes of ImageJ's pictures.
    noise_mm
        Standard deviation of noise that is added to simulated positions, along each axis.
    noise_seed
        Seed of that noise.
    out
        Folder for logs and report; the default is the next free runs/validate-N.
    causes
        Drive on plants with each imperfection alone, and with each mended, too.
    resume
        Go on with a run in --out that ended early.
    force
        Use --out though it holds files. Logs of the same names are replaced, and with them those
        that resumed them, and the positions that were measured of them.
    report
        Write the report.
    list_targets
        Print all targets with their positions and tendon lengths, and end.
    accept_jump
        Enable the servos though nobody knows where they are: the first pulse may move
        them at full speed.
    where
        Which robot.
    """
    where = where or Where()
    config = where.load()
    models = [tendons.model(name).name for name in model or [config.motion.model]]
    if len(set(models)) < len(models):
        raise InputError("A model is named twice.", "Give each once.")
    wanted = paper_targets(config)
    if targets is not None:
        wanted = choose(wanted, targets)
    if list_targets:
        print_targets(wanted, config, models)
        return
    noise = Noise(sd_mm=noise_mm, seed=noise_seed)
    if positions:
        drives = {"--targets": targets is not None, "--noise-mm": noise.sd_mm != 0,
                  "--causes": causes, "--resume": resume, **where.named_robot}  # fmt: skip
        if given := [name for name, is_given in drives.items() if is_given]:
            raise InputError(
                f"{given[0]} is for driving, and --positions drives nothing.", "Leave one out."
            )
        folder = _import(positions, frame, models, out, config, force=force)
    else:
        if frame is not None:
            raise InputError("--frame belongs to --positions.", "Give both, or none.")
        if causes and where.url != "sim://":
            raise InputError(
                "--causes takes the simulator's own robot apart.", "Give --sim, and a --plant."
            )
        if noise.sd_mm and not where.simulated:
            raise InputError("--noise-mm is for simulated positions.", "Leave it out.")
        if resume and out is None:
            raise InputError("--resume needs the folder of the run.", "Give it as --out.")
        drive = _Drive(where, config, noise, out, resume=resume, force=force)
        folder = drive.all(models, wanted, accept_jump=accept_jump)
        if causes:
            left = (
                f"Its targets are done. {later(folder)} `setae validate --causes --resume --out "
                f"{folder}` with the same options goes on with the other causes."
            )
            with ended_early(lambda: [left], what="the study of causes is not whole"):
                _study(where, config, models[0], wanted, noise, folder, resume=resume)
    logs = sorted(folder.glob("*.mcap"))
    read = [record.read(log) for log in logs]
    found = runs.read(runs.of_kind(read, runs.EXPERIMENT))
    print_runs(found)
    for log in runs.of_kind(read, why.EXPERIMENT):
        print_causes(log)
    say(f"Logs: {folder}")
    if report and any(run.poses for run in found):
        write_report(logs, folder)


class _Drive:
    """Drives the robot to targets, one log a model."""

    def __init__(
        self,
        where: Where,
        config: Config,
        noise: Noise,
        out: Path | None,
        *,
        resume: bool,
        force: bool,
    ) -> None:
        self._where = where
        self._config = config
        self._noise = noise
        self._resume = resume
        self._force = force
        self._out = out
        self._folder: Path | None = None
        self._logs: list[Path] = []

    def all(self, models: Sequence[str], targets: Sequence[Target], *, accept_jump: bool) -> Path:
        """Run every model; the folder with the logs."""
        before = self._before() if self._resume else ()
        with ended_early(self._what_is_left, what="the robot is stopped"):
            for model in models:
                done = self._done(model, before)
                left = [target for target in targets if target.label not in done]
                if left:
                    self._one(model, left, accept_jump=accept_jump)
                else:
                    say(f"Model {model}: all {len(targets)} targets are done already.")
        return self._where_to()

    def _what_is_left(self) -> list[str]:
        if not self._logs:
            return []
        again = f"`setae validate --resume --out {self._logs[-1].parent}` with the same options"
        return [*what_is_left(self._logs), f"{again} goes on with the other targets."]

    def _where_to(self) -> Path:
        if self._folder is None:
            self._folder = new_folder("validate", self._out, force=self._force or self._resume)
        return self._folder

    def _before(self) -> Sequence[runs.Run]:
        """What the run that is gone on with has done."""
        assert self._out is not None
        read = [record.read(log) for log in sorted(self._out.glob("*.mcap"))]
        found = runs.read(runs.of_kind(read, runs.EXPERIMENT))
        if not found:
            raise InputError(
                f"{self._out} holds no run of `setae validate` to go on with.",
                "Give the folder of that run as --out, or leave --resume out.",
            )
        return found

    def _done(self, model: str, before: Sequence[runs.Run]) -> set[str]:
        for run in before:
            if run.model == model:
                self._require_same(run)
                return set(run.visited)
        return set()

    def _require_same(self, run: runs.Run) -> None:
        if run.config != self._config:
            raise InputError(
                f"The run in {self._where_to()} had another configuration.",
                "Resume it with the same --config and --plant, or begin a new one.",
            )
        now = {"seed": self._where.seed, "noise_sd_mm": self._noise.sd_mm,
               "noise_seed": self._noise.seed}  # fmt: skip
        before = {name: run.metadata.get(name) for name in now}
        if run.simulated and before != now:
            raise InputError(
                f"The run in {self._where_to()} had another --seed or another noise.",
                "Resume it with the options of the first call, or begin a new one.",
            )

    def _log(self, model: str) -> Path:
        log = self._where_to() / f"{model}.mcap"
        if self._resume:
            number = 2
            while log.exists():
                log = log.with_name(f"{model}-{number}.mcap")
                number += 1
        elif self._force:
            make_way(log)
            make_way(_measured_log(self._where_to(), model))
        return log

    def _one(self, model: str, targets: Sequence[Target], *, accept_jump: bool) -> None:
        with (
            interrupts.caught(),
            rig.open(
                self._where.url,
                config=self._config,
                seed=self._where.seed,
                scene=open_scene(),
                pollables=[interrupts],
            ) as opened,
        ):
            log = self._log(model)
            recorder = opened.record(
                log,
                metadata={
                    "experiment": runs.EXPERIMENT,
                    "model": model,
                    "noise_sd_mm": self._noise.sd_mm,
                    "noise_seed": self._noise.seed,
                },
            )
            self._logs.append(log)
            opened.robot.enable(accept_jump=accept_jump)
            with console.status("") as status:
                count = 0

                def on_event(event: Event) -> None:
                    nonlocal count
                    recorder.experiment(event.time_us, event.name, event.data)
                    if event.name == "target":
                        count += 1
                        status.update(f"Model {model}: {count} of {len(targets)} targets")

                validate(
                    opened.robot, targets, self._measure(opened, len(targets), on_event),
                    model=model, on_event=on_event,
                )  # fmt: skip

    def _measure(
        self, opened: rig.Rig, count: int, on_event: OnEvent
    ) -> Callable[[Target], FloatArray | None]:
        if opened.world is None:
            return _ask_for_picture(opened.robot, count)
        return _look(opened, self._noise, on_event)


def _look(
    opened: rig.Rig, noise: Noise, on_event: OnEvent
) -> Callable[[Target], FloatArray | None]:
    world = opened.world
    assert world is not None

    def look(target: Target) -> FloatArray | None:
        truth = world.truth()
        if not truth.solved:  # then it is no rest, and no measurement
            found = {"label": target.label, "residual": truth.plant_residual}
            on_event(Event(time_us=truth.time_us, name=runs.UNSOLVED, data=found))
            return None
        return np.asarray(truth.backbone_mm[-1] + noise.on(target))

    return look


def _ask_for_picture(robot: Robot, count: int) -> Callable[[Target], None]:
    enter = Enter()
    number = 0

    def ask(target: Target) -> None:
        nonlocal number
        number += 1
        enter.forget()
        x, y, z = target.position_mm
        say(
            f"{number} of {count}: {target.label}, commanded ({x:.1f}, {y:.1f}, {z:.1f}) mm. "
            "Take the picture, then press Enter."
        )
        robot.wait(enter.pressed, timeout_s=_PICTURE_TIMEOUT_S, what="the picture to be taken")

    return ask


def _import(
    files: Sequence[str],
    frame: Path | None,
    models: Sequence[str],
    out: Path | None,
    config: Config,
    *,
    force: bool,
) -> Path:
    """Turn measured positions into a log of their own, beside that of the drive if there is one."""
    if len(models) > 1:
        raise InputError(
            "The positions were measured under one tendon model.", "Give one --model a call."
        )
    every = paper_targets(config)
    seen = view.load(frame) if frame is not None else None
    poses = measurements.merged([measurements.read(file, every, seen) for file in files])
    # The run that was driven before may be there, and is gone on with.
    drove = out is not None and (out / f"{models[0]}.mcap").exists()
    folder = new_folder("validate", out, force=force or drove)
    log = _measured_log(folder, models[0])
    if force:
        make_way(log)
    measured(log, poses, config, model=models[0], files=[Path(file).name for file in files])
    say(f"{len(poses)} of {len(every)} targets measured.")
    for doubt in frames.doubts(poses):
        say(f"Is the frame right? {doubt}")
    return folder


def _measured_log(folder: Path, model: str) -> Path:
    """Where positions go that were measured outside; they belong to the run driven in a folder."""
    return folder / f"{model}-measured.mcap"


def _study(
    where: Where,
    config: Config,
    model: str,
    targets: Sequence[Target],
    noise: Noise,
    folder: Path,
    *,
    resume: bool,
) -> None:
    """Drive on the plant's imperfections one by one; one log of all."""
    values = rig.simulator_parameters(config, where.seed)
    study = why.cases(rig.plants.by_cause(values), model, list(tendons.MODELS))
    metadata = {"experiment": why.EXPERIMENT, "simulated": True, "seed": where.seed,
                "plant": config.plant, "config": config.to_toml(), "targets": len(targets),
                "noise_sd_mm": noise.sd_mm, "noise_seed": noise.seed}  # fmt: skip
    path = folder / f"{why.EXPERIMENT}.mcap"
    known = why.known(record.read(path), metadata) if resume and path.exists() else {}
    remove(path)
    with record.Recorder(path, metadata=metadata) as recorder, console.status("") as status:
        # A second of log time each, so that each is on the disk when the next begins.
        left = [case for case in study if case.name not in known]
        for number, done in enumerate(known.values(), start=1):
            recorder.experiment(number * 1_000_000, "case", done)
        for number, case in enumerate(left, start=len(known) + 1):
            status.update(f"Cause {number} of {len(study)}: {case.cause or case.kind}")
            plant = dataclasses.replace(
                config, plant="ideal", simulator=tuple(sorted(case.parameters.items()))
            )
            with (
                interrupts.caught(),
                rig.open(
                    "sim://", config=plant, seed=where.seed, scene=open_scene(),
                    pollables=[interrupts],
                ) as opened,
            ):  # fmt: skip
                opened.robot.enable()
                missed: list[str] = []

                def miss(event: Event, missed: list[str] = missed) -> None:
                    missed.append(str(event.data["label"]))

                look = _look(opened, noise, miss)
                poses = validate(opened.robot, targets, look, model=case.model)
            recorder.experiment(number * 1_000_000, "case", why.told(case, poses, missed))
