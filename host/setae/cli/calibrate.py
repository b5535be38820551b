"""`setae calibrate bristle`: from which change of pressure on the bristle touches something."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cyclopts import App

from setae import rig
from setae.cli.common import Flag, Where, Whole, app, console, interrupts, new_folder
from setae.cli.runs import ended_early, make_way, say, write_report
from setae.config import Config
from setae.errors import InputError
from setae.experiments import bristle as study
from setae.experiments.events import Event
from setae.record import Recorder
from setae.scene import open_scene
from setae.stage import Enter
from setae.wording import counted

# Below the surface's height, so that the robot can be enabled and relaxed at its free length.
_RAISED_MM = 30.0
_PLACE_TIMEOUT_S = 3600.0

calibrate = App(name="calibrate", help="Measure what a robot's configuration needs to know.")
app.command(calibrate)


@calibrate.command
def bristle(
    *,
    moves: Whole = 100,
    touches: Whole = 100,
    out: Path | None = None,
    force: Flag = False,
    report: bool = True,
    accept_jump: Flag = False,
    where: Where | None = None,
) -> None:
    """Find the bristle's threshold: move without contact, then touch something flat.

    Writes a log, bristle.toml with the recommended threshold, and a report into the
    folder --out. With a board somebody has to put something flat below the robot in
    between, and to take it away at the end.

    Parameters
    ----------
    moves
        Moves without contact.
    touches
        Touches.
    out
        Folder for log and report; the default is the next free runs/bristle-N.
    force
        Use --out though it holds files; those of the same names are replaced.
    report
        Write the report.
    accept_jump
        Enable the servos though nobody knows where they are: the first pulse may move
        them at full speed.
    where
        Which robot.
    """
    where = where or Where()
    config = where.load()
    for name, count in (("--moves", moves), ("--touches", touches)):
        if count < 1:
            raise InputError(f"{name} is {count}.", "Give 1 or more.")
    logs: list[Path] = []

    def left() -> list[str]:
        # Too little for a threshold, and so for a report.
        return [f"What happened is in {logs[-1]}; `setae replay` shows it."] if logs else []

    with ended_early(left, what="the robot is stopped"):
        folder = _measure(where, config, moves, touches, out, logs, force=force, jump=accept_jump)
    if report:
        write_report(logs, folder)


def _measure(
    where: Where,
    config: Config,
    moves: int,
    touches: int,
    out: Path | None,
    logs: list[Path],
    *,
    force: bool,
    jump: bool,
) -> Path:
    surface_mm = study.surface_mm(config)
    with (
        interrupts.caught(),
        rig.open(
            where.url,
            config=config,
            seed=where.seed,
            scene=open_scene(surface_mm + _RAISED_MM),
            pollables=[interrupts],
        ) as opened,
    ):
        folder = new_folder("bristle", out, force=force)
        log = folder / "bristle.mcap"
        if force:
            make_way(log)
        metadata = {"experiment": study.EXPERIMENT, "surface_mm": surface_mm}
        recorder = opened.record(log, metadata=metadata)
        logs.append(log)
        below_tip_mm = _below_tip_mm(config)
        _ask(opened, "Take everything away from around the robot")
        opened.robot.enable(accept_jump=jump)
        with console.status("") as status:
            measured = study.Bristle(
                opened.robot, seed=where.seed, on_event=_told(recorder, status.update)
            )
            found = measured.free(moves)
            _arm(opened, -_RAISED_MM)
            _ask(
                opened,
                f"Put something flat and hard below the robot, its top {below_tip_mm:.0f} mm "
                "below the bristle's tip as it is now",
            )
            found += measured.touches(touches)
            _arm(opened, _RAISED_MM)
        _ask(opened, "Take it away again: the robot gets longer when it relaxes")
    chosen, now = study.threshold(found), study.Threshold.of(config.bristle.threshold_hpa, found)
    for name, one in (("Recommended", chosen), ("Configured", now)):
        say(
            f"{name}: {one.hpa:g} hPa. {one.false} of {one.free} moves without contact count as "
            f"touches, {one.missed} of {one.touches} touches are missed."
        )
    from setae.report.files import writing

    fragment = folder / "bristle.toml"
    with writing(folder, "The threshold"):
        fragment.write_text(_toml(chosen, simulated=where.simulated), encoding="utf-8")
    say(f"Threshold: {fragment}")
    say(f"Log: {log}")
    return folder


def _below_tip_mm(config: Config) -> float:
    tip_mm = config.explore.compressed_length_mm + config.geometry.tip_offset_mm
    return study.surface_mm(config) - tip_mm


def _told(recorder: Recorder, show: Callable[[str], None]) -> Callable[[Event], None]:
    counts = {False: 0, True: 0}

    def on_event(event: Event) -> None:
        recorder.experiment(event.time_us, event.name, event.data)
        counts[event.data["touched"]] += 1
        show(f"{counted(counts[False], 'move')} without contact, {counts[True]} with")

    return on_event


def _arm(opened: rig.Rig, up_mm: float) -> None:
    """Bring the simulated surface within reach, or out of it; a person does the same by hand."""
    if opened.world is None:
        return
    x_mm, y_mm, z_mm = opened.stage.position_mm
    opened.stage.move_to((x_mm, y_mm, z_mm + up_mm))
    opened.robot.wait(lambda: not opened.stage.moving, timeout_s=30.0, what="the arm to move")


def _ask(opened: rig.Rig, what: str) -> None:
    if opened.world is not None:
        return
    enter = Enter()
    enter.forget()
    say(f"{what}, then press Enter.")
    opened.robot.wait(enter.pressed, timeout_s=_PLACE_TIMEOUT_S, what="Enter to be pressed")


def _toml(chosen: study.Threshold, *, simulated: bool) -> str:
    where = "a simulated robot" if simulated else "this robot"
    return (
        f"# Measured by `setae calibrate bristle` on {where}: of {chosen.free} moves without\n"
        f"# contact {chosen.false} count as touches, of {chosen.touches} touches "
        f"{chosen.missed} are missed.\n"
        f"[bristle]\nthreshold_hpa = {chosen.hpa:.1f}\n"
    )
