"""What the named plants do: `python bench/plants.py tube` and `python bench/plants.py rests`.

Prints the table of docs/plants.md and the counts of simulator/README.md; writes nothing. The
first takes a minute or two, the second three.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from setae import rig
from setae.config import Config, load
from setae.errors import SetaeError
from setae.experiments.descent import paper_obstacles
from setae.experiments.explore import explore
from setae.report import explore as report
from setae.report import shifts
from setae.report.tables import Comparison, compare
from setae.scene import Obstacle, tube_scene
from setae.sim import Spring, plants

PLANTS = ("ideal", "paper_like", *(f"random:{seed}" for seed in range(1, 6)))
TOLD = 3  # imperfections in a cell
SEED = 20261122
DRAWN = 60


def tube() -> Iterator[str]:
    """The paper's five trials on each plant, and what did it in the first that differs."""
    obstacles = paper_obstacles(load())
    heads = ["none" if what is None else f"{what.below_tip_mm:g} mm" for what in obstacles]
    yield f"| plant | {' | '.join(heads)} | what the imperfections did |"
    yield "|---" * (len(obstacles) + 2) + "|"
    for plant in PLANTS:
        config = replace(load(), plant=plant)
        rows = [_trial(config, number, what) for number, what in enumerate(obstacles, start=1)]
        why = next((text for row in rows if (text := _why(row))), "")
        yield f"| `{plant}` | {' | '.join(map(_stop, rows))} | {why} |"


def _trial(config: Config, number: int, obstacle: Obstacle | None) -> Comparison:
    """As `setae explore --sim` does them, each with a seed of its own."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "trial.mcap"
        scene = tube_scene(config, obstacle)
        try:
            with rig.open("sim://", config=config, seed=number - 1, scene=scene) as opened:
                about = {"experiment": "explore", "trial": number}
                recorder = opened.record(log, metadata=about)
                opened.robot.enable()
                explore(
                    opened.robot,
                    opened.stage,
                    obstacle=obstacle,
                    on_event=lambda event: recorder.experiment(
                        event.time_us, event.name, event.data
                    ),
                )
        except SetaeError as error:
            print(f"{config.plant}, trial {number}: {error}", file=sys.stderr)
        (row,) = compare(report.trials(log))
        return row


def _stop(row: Comparison) -> str:
    depth = f"{row.trial.descent_mm:g}" + ("" if row.trial.complete else ", ended early")
    return depth if row.agrees else f"**{depth}**"


def _why(row: Comparison) -> str:
    """The imperfections that did most, where the trial came out otherwise than the paper's."""
    if row.agrees and row.trial.complete:
        return ""
    aside = shifts.look(row)
    if aside is None:
        return "not told by the log"
    if aside.jerk:
        quietest = sorted(aside.shifts.each, key=lambda shift: shift.without_hpa)[:TOLD]
        parts = (f"{shift.without_hpa:.1f} without {shift.cause}" for shift in quietest)
        return f"a jerk made {aside.shifts.here.loudest_hpa:.1f} hPa: {', '.join(parts)}"
    whole_mm = aside.outwards_mm(aside.shifts.here.tip_mm - aside.shifts.ideal.tip_mm)
    parts = (
        f"{shift.cause} {aside.outwards_mm(shift.here_mm):+.1f}"
        for shift in aside.shifts.each[:TOLD]
    )
    return f"the tip {whole_mm:+.1f} mm towards {aside.alpha_deg:g}°: {', '.join(parts)}"


def rests() -> Iterator[str]:
    """How many sets of tendon lengths let the spring rest in several ways."""
    angles_deg = np.array([0.0, 90.0, 180.0, 270.0])
    arcs_mm = [
        length_mm - 8.3 * np.radians(bend_deg) * np.cos(np.radians(angles_deg - towards_deg))
        for length_mm, bend_deg, towards_deg in product(
            range(20, 71, 10), (30.0, 60.0, 90.0), (0.0, 22.5, 45.0, 67.5)
        )
    ]
    drawn_mm = list(np.random.default_rng(SEED).uniform(20.0, 70.0, (DRAWN, 4)))
    for plant in ("ideal", "paper_like"):
        spring = Spring(parameters=plants.parameters(plant))
        for what, sets_mm in (("of arcs", arcs_mm), ("drawn", drawn_mm)):
            found = [spring.rests(lengths_mm) for lengths_mm in sets_mm]
            several = sum(len(rests) > 1 for rests in found)
            unsettled = sum(bool(rests.unsettled) for rests in found)
            yield (
                f"{plant}: of {len(sets_mm)} sets {what}, {several} let it rest in several ways;"
                f" in {unsettled} a start found no stable rest"
            )


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("tube", "rests"))
    for line in {"tube": tube, "rests": rests}[parser.parse_args().what]():
        print(line, flush=True)


if __name__ == "__main__":
    main()
