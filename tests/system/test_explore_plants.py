"""The exploration on named plants: the paper's answer, or a report that says why not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from setae import rig
from setae.config import Config, load
from setae.errors import SetaeError
from setae.experiments.explore import explore
from setae.report import explore as report
from setae.report import shifts
from setae.report.imperfections import section, sentences
from setae.report.tables import compare
from setae.scene import Obstacle, tube_scene

OBSTACLE = Obstacle(below_tip_mm=35.0)


def test_the_robot_that_errs_like_the_papers_stops_at_a_cube_on_any_side_but_plus_x() -> None:
    config = dataclasses.replace(load(), plant="paper_like")
    scene = tube_scene(config, dataclasses.replace(OBSTACLE, azimuth_deg=180.0))
    with rig.open("sim://", config=config, scene=scene) as opened:
        opened.robot.enable()
        assert explore(opened.robot, opened.stage).descent_mm == 40.0


@pytest.mark.parametrize("plant", ["ideal", "paper_like", "random:2"])
def test_each_plant_gives_the_papers_answer_or_the_report_says_why_not(
    plant: str, tmp_path: Path
) -> None:
    config = dataclasses.replace(load(), plant=plant)
    try:
        _run(config, tmp_path)
    except SetaeError:
        assert plant != "ideal"
    trials = report.trials(tmp_path)
    (row,) = compare(trials)
    told = sentences(trials)
    if plant == "ideal":
        assert row.agrees
        assert told == []
        assert section(trials) == ""
        return
    assert plant in told[0]  # how far beside its targets it went
    same = "Every trial came out as the paper’s all the same."
    if row.agrees:
        assert told[-1] == same
        # It said so of trials that the paper doesn't have, too.
        other = dataclasses.replace(trials[0], obstacle_below_tip_mm=20.0)
        assert same not in sentences([other])
    else:
        assert "touched nothing" in section(trials) or "ended early" in section(trials)
        assert "tendon.offset_mm" in told[-1]
    if plant == "paper_like":  # where it was, how it was held as it passed the cube, and why
        assert "short of it sideways; tendon 0 pulled" in told[2]
        assert "What each imperfection moved it: zero offsets" in told[3]
    else:  # it stopped in the air, so what jerked it
        assert "motion alone made" in told[-2]
        assert "(winding gain)" in told[-2]


def test_a_miss_is_laid_at_the_imperfection_that_did_it(tmp_path: Path) -> None:
    # Tendon 0 is too long, so the robot bends too little towards the cube.
    culprit, bystander = ("tendon.offset_mm_0", 1.5), ("tendon.backlash_mm", 0.3)
    config = dataclasses.replace(load(), simulator=(bystander, culprit))
    _run(config, tmp_path)
    (row,) = compare(report.trials(tmp_path))
    assert row.agrees is False
    aside = shifts.look(row)
    assert aside is not None
    offsets, backlash = aside.shifts.each
    assert (offsets.cause, backlash.cause) == ("zero offsets", "backlash")
    # It did nearly all: without it the tip is where the ideal robot's is, and it alone
    # moves it as far.
    whole_mm = aside.shifts.here.tip_mm - aside.shifts.ideal.tip_mm
    assert np.linalg.norm(offsets.here_mm - whole_mm) < 0.15 * np.linalg.norm(whole_mm)
    assert np.linalg.norm(offsets.alone_mm - whole_mm) < 0.15 * np.linalg.norm(whole_mm)
    assert aside.outwards_mm(offsets.here_mm) < -5
    assert backlash.size_mm < 0.15 * offsets.size_mm
    assert "moved it: zero offsets" in shifts.sentence(aside)
    assert "<td>zero offsets</td>" in shifts.table([aside])
    one = dataclasses.replace(aside.shifts, each=(offsets,), untold=("backlash",))
    told = shifts.sentence(dataclasses.replace(aside, shifts=one))
    assert "Nothing is known of backlash" in told
    # Of a log that is not of this robot nothing is told.
    row.trial.log.metadata["plant_parameters"] = {"tendon.offset_mm_0": -3.0}
    assert shifts.look(row) is None


def _run(config: Config, folder: Path) -> None:
    with rig.open("sim://", config=config, scene=tube_scene(config, OBSTACLE)) as opened:
        recorder = opened.record(
            folder / "trial-1.mcap", metadata={"experiment": "explore", "trial": 1}
        )
        opened.robot.enable()
        explore(
            opened.robot,
            opened.stage,
            obstacle=OBSTACLE,
            on_event=lambda event: recorder.experiment(event.time_us, event.name, event.data),
        )
