"""`setae explore`: the paper's exploration of a tube."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.table import Table

from setae import rig
from setae.cli.arm import show_arm_targets
from setae.cli.common import Where, app, console, interrupts, new_folder
from setae.cli.runs import RunOptions, ended_early, make_way, say, what_is_left, write_report
from setae.config import Config
from setae.errors import InputError
from setae.experiments.descent import (
    PAPER_DESCENTS_MM,
    arm_targets_mm,
    paper_obstacles,
    reach_below_tip_mm,
    targets_mm,
)
from setae.experiments.events import Event, OnEvent
from setae.experiments.explore import ExploreResult, run_trials
from setae.experiments.reach import require_reachable
from setae.robot import Robot
from setae.scene import Obstacle, tube_scene
from setae.stage import Enter, ManualStage
from setae.wording import counted


@app.command
def explore(
    *,
    obstacle: Annotated[list[str] | None, Parameter(negative="")] = None,
    azimuth: float = 0.0,
    trials: Literal["paper"] | None = None,
    run: RunOptions | None = None,
    where: Where | None = None,
) -> None:
    """Explore a tube: step down, feel in eight directions, stop at an obstacle.

    Without --obstacle it runs the paper's five trials. Each trial writes a log
    into the folder --out, and all of them one report.

    Parameters
    ----------
    obstacle
        Height in mm between the compressed bristle's tip and the top of a cube
        at the tube's wall, or "none" for an empty tube. Several times: several
        trials.
    azimuth
        Direction of the cube, as angle α of frame D, in degrees.
    trials
        "paper": the five trials of the paper.
    run
        What it writes, and the arm.
    where
        Which robot.
    """
    run, where = run or RunOptions(), where or Where()
    config = where.load()
    obstacles = _obstacles(config, obstacle, azimuth, trials)
    by_hand = run.stage is None and not where.simulated
    targets_mm(config)  # what the robot can't reach is told before anything begins
    if run.dry_run:
        show_arm_targets(run.stage, config, arm_targets_mm(config))
        return
    progress = _Progress(len(obstacles))
    logs: list[Path] = []

    @cache
    def folder() -> Path:
        return new_folder("explore", run.out, force=run.force)

    @contextmanager
    def setup(number: int, what: Obstacle | None) -> Iterator[tuple[rig.Rig, OnEvent]]:
        progress.trial(number, what)
        with (
            interrupts.caught(),
            rig.open(
                where.url,
                config=config,
                seed=where.seed + number - 1,
                scene=tube_scene(config, what),
                stage=ManualStage(ask=say) if by_hand else run.stage,
                pollables=[interrupts],
            ) as opened,
        ):
            # Before anybody is asked for anything; `explore` looks again, for whoever calls it.
            require_reachable(opened.stage, arm_targets_mm(config))
            # Only now, so that a board that isn't there costs neither work nor a folder.
            log = folder() / f"trial-{number}.mcap"
            if run.force:
                make_way(log)
            if not where.simulated:
                _ask_to_place(opened.robot, what, by_hand=by_hand)
            recorder = opened.record(log, metadata={"experiment": "explore", "trial": number})
            logs.append(log)
            opened.robot.enable(accept_jump=run.accept_jump)

            def on_event(event: Event) -> None:
                recorder.experiment(event.time_us, event.name, event.data)
                progress.event(event)

            yield opened, on_event

    with ended_early(lambda: what_is_left(logs), what="robot and arm are stopped"):
        results = run_trials(
            setup, obstacles=obstacles, arm_timeout_s=_MANUAL_TIMEOUT_S if by_hand else None
        )
    _print_table(results, paper=list(obstacles) == list(paper_obstacles(config)))
    say(f"Logs: {folder()}")
    if run.report:
        write_report(logs, folder())


# Nobody places a cube so close: that was meant in metres.
_LEAST_MM = 1.0
# A person jogs the arm by hand between two steps.
_MANUAL_TIMEOUT_S = 600.0
# Taking the tube apart to fix a cube in it takes longer.
_PLACE_TIMEOUT_S = 3600.0


def _obstacles(
    config: Config, given: Sequence[str] | None, azimuth_deg: float, trials: str | None
) -> list[Obstacle | None]:
    if given and trials:
        raise InputError("--obstacle and --trials exclude each other.", "Give one of them.")
    if not given:
        obstacles = paper_obstacles(config)
        return [what and dataclasses.replace(what, azimuth_deg=azimuth_deg) for what in obstacles]
    return [_obstacle(config, text, azimuth_deg) for text in given]


def _obstacle(config: Config, text: str, azimuth_deg: float) -> Obstacle | None:
    if text.lower() == "none":
        return None
    try:
        below_tip_mm = float(text)
    except ValueError:
        raise InputError(
            f"--obstacle {text!r} is neither a height in mm nor none.",
            "Give for example --obstacle 55.",
        ) from None
    if 0 < below_tip_mm < _LEAST_MM:
        raise InputError(
            f"--obstacle {text} is less than {_LEAST_MM:g} mm below the tip.",
            "Give it in mm, for example --obstacle 55.",
        )
    obstacle = Obstacle(
        below_tip_mm=below_tip_mm, azimuth_deg=azimuth_deg, edge_mm=config.tube.cube_edge_mm
    )
    reach_mm = reach_below_tip_mm(config)
    if below_tip_mm > reach_mm:
        raise InputError(
            f"--obstacle {text} lies deeper than the bristle gets, which is {reach_mm:.0f} mm.",
            "Give a smaller height, or none for an empty tube.",
        )
    return obstacle


def _ask_to_place(robot: Robot, what: Obstacle | None, *, by_hand: bool) -> None:
    where = (
        "Take every obstacle out of the tube"
        if what is None
        else f"Fix the cube {what.below_tip_mm:g} mm below the compressed tip"
        f" at α = {what.azimuth_deg:g}°"
    )
    enter = Enter()
    enter.forget()
    arm = "and bring the arm to its start" if by_hand else "without moving the arm"
    say(f"{where} {arm}, then press Enter.")
    # In the robot's own loop: it is watched meanwhile, and Ctrl-C is heard.
    robot.wait(enter.pressed, timeout_s=_PLACE_TIMEOUT_S, what="the arm to be at its start")


class _Progress:
    """Says in the terminal what happens."""

    def __init__(self, trials: int) -> None:
        self._trials = trials

    def trial(self, number: int, what: Obstacle | None) -> None:
        console.print(f"Trial {number} of {self._trials}: {_name(what)}")

    def event(self, event: Event) -> None:
        data = event.data
        if event.name == "level_start":
            console.print(f"  {data['descent_mm']:5.0f} mm down ", end="")
        elif event.name == "direction_end":
            if data["touched"]:
                change_hpa = data["contact"]["pressure_hpa"] - data["contact"]["baseline_hpa"]
                console.print(
                    f"[bold red]{data['alpha_deg']:g}° ({change_hpa:+.0f} hPa)[/]", end=" "
                )
            else:
                console.print(f"[dim]{data['alpha_deg']:g}°[/]", end=" ")
        elif event.name == "level_end":
            console.print("contact" if data["touched_deg"] else "free")
        elif event.name == "lowering_contact":
            console.print(
                f"  [bold red]contact while the arm lowered[/], {data['contact']['descent_mm']:.1f}"
                " mm down: arm stopped"
            )
        elif event.name == "trial_end":
            console.print(
                f"  descent {data['descent_mm']:g} mm, {counted(len(data['contacts']), 'contact')},"
                f" {data['duration_s']:.0f} s"
            )
        elif event.name == "trial_aborted":
            console.print("")


def _name(what: Obstacle | None) -> str:
    if what is None:
        return "no obstacle"
    where = "" if what.azimuth_deg == 0 else f" at α = {what.azimuth_deg:g}°"
    return f"obstacle {what.below_tip_mm:g} mm below the tip{where}"


def _print_table(results: Sequence[ExploreResult], *, paper: bool) -> None:
    table = Table()
    table.add_column("obstacle", overflow="fold")
    table.add_column("descent", justify="right", overflow="fold")
    if paper:
        table.add_column("paper's descent", justify="right", overflow="fold")
    table.add_column("contacts", justify="right", overflow="fold")
    table.add_column("directions of contact", overflow="fold")
    for result, theirs_mm in zip(
        results, PAPER_DESCENTS_MM if paper else [0.0] * len(results), strict=True
    ):
        angles = ", ".join(
            "lowering" if touch.alpha_deg is None else f"{touch.alpha_deg:g}°"
            for touch in result.contacts
        )
        row = [
            "none" if result.obstacle is None else f"{result.obstacle.below_tip_mm:g} mm",
            f"{result.descent_mm:g} mm",
            *([f"{theirs_mm:g} mm"] if paper else []),
            str(len(result.contacts)),
            angles or "–",
        ]
        table.add_row(*row)
    console.print(table)
