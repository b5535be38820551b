"""What `setae validate` prints: targets, errors beside the paper's, causes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from setae.cli.common import console
from setae.cli.runs import say
from setae.config import Config
from setae.experiments import causes as why
from setae.experiments import runs
from setae.experiments.accuracy import Pose, Spread, by_group
from setae.experiments.targets import Target, commanded_lengths_mm
from setae.record import Log
from setae.wording import counted

__all__ = ["print_causes", "print_runs", "print_targets"]


def print_targets(targets: Sequence[Target], config: Config, models: Sequence[str]) -> None:
    """Print targets with their positions and tendon lengths, as CSV."""
    for model in models:
        lengths, _ = commanded_lengths_mm(targets, config, model)
        print(
            "target,x_mm,y_mm,z_mm," + ",".join(f"length_{i}_mm" for i in range(lengths.shape[1]))
        )
        for target, row in zip(targets, lengths, strict=True):
            values = [*target.position_mm, *row]
            print(f"{target.label}," + ",".join(f"{value:.3f}" for value in values))


def print_runs(found: Sequence[runs.Run]) -> None:
    """Print the errors of each run, or that nothing was measured yet."""
    for run in found:
        if run.poses:
            say(f"Model {run.model}: {counted(len(run.poses), 'target')}, {run.source}.")
            say("Errors in mm, mean±SD; in the bending plane, but for the last column:")
            console.print(_table(run.poses))
            if len(run.poses) < len(run.targets):
                say(
                    f"These are {len(run.poses)} of {len(run.targets)} targets: not comparable "
                    "with the paper's figures, which are of all."
                )
        if run.unsolved:
            say(f"Model {run.model}: {run.unsolved_text}.")
        elif not run.poses:
            say(
                f"Model {run.model}: {counted(len(run.visited), 'target')} driven, none measured. "
                "Measure the pictures, then give them with --positions and the same --out."
            )


def _table(poses: Sequence[Pose]) -> Table:
    from setae.report import paper

    theirs = paper.validation()
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))
    for name in ("group", "n", "distance", "paper", "x or y", "z", "3D"):
        table.add_column(name, justify="left" if name == "group" else "right", overflow="fold")
    for group, ours in by_group(poses).items():
        table.add_row(
            group,
            str(ours.targets),
            spread(ours.in_plane),
            spread(theirs[group].distance) if group in theirs else "",
            *(spread(part) for part in (ours.lateral, ours.height, ours.space)),
        )
    return table


def print_causes(study: Log) -> None:
    """Print what each imperfection does; nothing where the study ended early."""
    effects = why.effects(study)
    if text := why.left_out(study):
        say(text)
    if not effects:
        return
    say("What each imperfection does to the mean error in the bending plane, in mm:")
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))
    for name in ("cause", "alone", "adds", "all but it", "mending gains"):
        table.add_column(name, justify="left" if name == "cause" else "right", overflow="fold")
    table.add_row("none", f"{effects[0].none_mm:.2f}", "", "", "")
    for effect in effects:
        table.add_row(
            effect.cause,
            f"{effect.alone_mm:.2f}",
            f"{effect.adds_mm:+.2f}",
            f"{effect.mended_mm:.2f}",
            f"{effect.gains_mm:+.2f}",
        )
    table.add_row("all", f"{effects[0].all_mm:.2f}", "", "", "")
    console.print(table)


def spread(value: Spread | None) -> str:
    """Mean ± SD, such as 4.32±2.73."""
    if value is None or np.isnan(value.mean_mm):
        return "–"
    sd = "" if np.isnan(value.sd_mm) else f"±{value.sd_mm:.2f}"
    return f"{value.mean_mm:.2f}{sd}"
