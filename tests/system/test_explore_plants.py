"""The exploration on named plants: the paper's answer, or a report that says why not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from setae import rig
from setae.config import load
from setae.errors import SetaeError
from setae.experiments.explore import explore
from setae.report import explore as report
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
    scene = tube_scene(config, OBSTACLE)
    try:
        with rig.open("sim://", config=config, scene=scene) as opened:
            recorder = opened.record(
                tmp_path / "trial-1.mcap", metadata={"experiment": "explore", "trial": 1}
            )
            opened.robot.enable()
            explore(
                opened.robot,
                opened.stage,
                obstacle=OBSTACLE,
                on_event=lambda event: recorder.experiment(event.time_us, event.name, event.data),
            )
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
    if plant == "paper_like":  # where it was, and how it was held, as it passed the cube
        assert "short of it sideways; tendon 0 pulled" in told[2]
