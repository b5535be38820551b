"""Make the pictures of README and documentation anew: run the exploration, draw it.

    python docs/make_pictures.py [RUN_DIR]

Without a folder it runs the paper's five trials, its validation and the bristle's
calibration in the simulator, seed 0, and 25 scans of five objects. With one it draws the
logs in it, or the scans of a study. The theory's and the protocol's pictures it draws in any case.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import motion_pictures
import protocol_pictures
import theory_pictures

from setae import record, tendons
from setae.experiments import causes, runs, samples, shapes, study
from setae.report import (
    animation,
    bristle,
    cluster,
    explore,
    pictures,
    scan,
    scan_pictures,
    validation_pictures,
)
from setae.report import causes as why
from setae.report.trial import telling

PICTURES = Path(__file__).resolve().parent / "pictures"


def draw(run: Path) -> None:
    """Draw a run's pictures into docs/pictures."""
    trials = explore.trials(run)
    pictures.write_all(PICTURES, trials)
    animation.write(PICTURES / "explore.gif", telling(trials))


def draw_validation(run: Path) -> None:
    """Draw a validation into docs/pictures."""
    found = runs.read(record.read(log) for log in sorted(run.glob("*.mcap")))
    validation_pictures.boxes_picture(PICTURES / "validation.png", found)
    validation_pictures.bubbles_picture(PICTURES / "bubbles.png", found[:1])
    validation_pictures.targets_picture(PICTURES / "targets.png", found)


def draw_causes(run: Path) -> None:
    """Draw what each imperfection costs into docs/pictures."""
    study = record.read(run / f"{causes.EXPERIMENT}.mcap")
    effects = causes.effects(study)
    why.picture(PICTURES / "causes.png", effects, why.note_of(study))


def draw_shapes(run: Path) -> None:
    """Draw a study's scans side by side into docs/pictures."""
    found = shapes.compare(samples.read(run))
    cluster.clouds_picture(PICTURES / "clouds.png", found)
    cluster.trials_picture(PICTURES / "shape_maps.png", found)


def run_setae(*arguments: str) -> None:
    """Run the command in the simulator, without its report."""
    command = [sys.executable, "-m", "setae.cli", *arguments, "--sim", "--no-report"]
    subprocess.run(command, check=True)


def main(arguments: list[str]) -> None:
    """Draw the given run, or one made for it."""
    theory_pictures.draw(PICTURES)
    motion_pictures.draw(PICTURES)
    protocol_pictures.draw(PICTURES)
    if arguments and (Path(arguments[0]) / study.RUNS).is_dir():
        draw_shapes(Path(arguments[0]))
        return
    if arguments:
        draw(Path(arguments[0]))
        return
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        run_setae("explore", "--out", str(run))
        draw(run)
        validated = Path(folder) / "validate"
        models = [text for name in tendons.MODELS for text in ("--model", name)]
        like = ("validate", "--plant", "paper_like")
        run_setae(*like, *models, "--out", str(validated))
        draw_validation(validated)
        part = Path(folder) / "causes"
        run_setae(*like, "--causes", "--out", str(part))
        draw_causes(part)
        felt = Path(folder) / "bristle"
        run_setae("calibrate", "bristle", "--moves", "200", "--touches", "200", "--out", str(felt))
        bristle.picture(PICTURES / "bristle.png", record.read(felt / "bristle.mcap"))
        scanned = Path(folder) / "scan"
        modes = ("--mode", "paper", "--mode", "adaptive")
        run_setae("scan", "--object", "eraser:1", *modes, "--out", str(scanned))
        scan_pictures.overview_picture(PICTURES / "scan.png", scan.scans(scanned))
        objects = Path(folder) / "objects"
        # Those that the bench scores.
        trials = study.Plan(seeds=tuple(range(2000, 2005)), modes=("paper",))
        study.conduct(trials.runs(), objects)
        draw_shapes(objects)


if __name__ == "__main__":
    main(sys.argv[1:])
