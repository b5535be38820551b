"""The robot along waypoints and circles, and how far ahead the board is told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.system.robots import compressed, run_world

from setae import kinematics, tendons
from setae.errors import InputError, LinkLostError, TrajectoryError, UnreachableError
from setae.link.lossy import Faults
from setae.servo import ServoModel

WAYPOINTS_MM = [(0.0, 0.0, 50.0), (12.0, 0.0, 57.0), (0.0, 12.0, 57.0)]


def test_a_way_passes_its_waypoints_and_ends_at_the_last() -> None:
    with compressed() as made:
        robot = made.robot
        before = len(made.reports)
        robot.move_along(WAYPOINTS_MM, model="parallel", speed_mm_s=20.0)
        servos, geometry = ServoModel(robot.config), robot.config.geometry
        played = servos.lengths_mm(
            [report.telemetry.pulse_ticks for report in made.reports[before:]]
        )
        for point in WAYPOINTS_MM:
            wanted = tendons.lengths(kinematics.inverse(point), geometry, "parallel")
            assert np.abs(played - wanted).max(axis=1).min() < 0.03
        speed = np.abs(np.diff(played, axis=0)).max() / 0.02
        assert speed < 60


def test_a_circle_comes_back_to_where_it_began() -> None:
    with compressed() as made:
        robot = made.robot
        robot.circle(12.0, 57.0, start_deg=30.0, model="parallel", speed_mm_s=40.0)
        angle = math.radians(30)
        point = (12 * math.cos(angle), 12 * math.sin(angle), 57.0)
        wanted = tendons.lengths(kinematics.inverse(point), robot.config.geometry, "parallel")
        assert np.abs(robot.lengths_mm - wanted).max() < 0.02
        # It has been on the other side.
        servos = ServoModel(robot.config)
        played = servos.lengths_mm([report.telemetry.pulse_ticks for report in made.reports])
        across = kinematics.inverse((-point[0], -point[1], 57.0))
        other = tendons.lengths(across, robot.config.geometry, "parallel")
        assert np.abs(played - other).max(axis=1).min() < 0.3


def test_under_paper_a_circle_is_refused_before_anything_moves_or_bridged() -> None:
    with compressed() as made:
        robot = made.robot
        start = tuple(robot.telemetry.pulse_ticks)
        with pytest.raises(TrajectoryError, match=r"jumps by 0\.\d\d mm"):
            robot.circle(12.0, 57.0, start_deg=30.0)
        made.run(0.1)
        assert tuple(robot.telemetry.pulse_ticks) == start
        robot.circle(12.0, 57.0, start_deg=30.0, turns=0.5, at_jump="bridge")
        assert robot.state.name == "HOLDING"


def test_bad_ways_are_refused_before_anything_moves() -> None:
    with compressed() as made:
        robot = made.robot
        start = tuple(robot.telemetry.pulse_ticks)
        with pytest.raises(InputError, match=r"waypoints_mm has shape \(3,\)"):
            robot.move_along((0, 0, 60))
        with pytest.raises(UnreachableError, match="Target 1: "):
            robot.move_along([(0, 0, 60), (0, 0, 75)])
        with pytest.raises(InputError, match="Both duration_s and speed_mm_s"):
            robot.move_along(WAYPOINTS_MM, model="parallel", duration_s=2.0, speed_mm_s=10.0)
        with pytest.raises(InputError, match="radius_mm is -3"):
            robot.circle(-3.0, 57.0)
        made.run(0.1)
        assert tuple(robot.telemetry.pulse_ticks) == start


def test_a_board_whose_host_died_goes_on_for_about_a_second() -> None:
    with compressed() as made:

        def cut() -> None:
            made.line.down_faults = made.line.up_faults = Faults(lose=1.0)

        start_us = made.robot.now_us
        made.at(start_us + 1_000_000, cut)
        with pytest.raises(LinkLostError):
            made.robot.move_to((0.0, 0.0, 65.0), duration_s=8.0)
        # From the cut on a second, and a little for the rest of the last segment.
        left_s = 2.3 - (made.robot.now_us - start_us) / 1e6
        if left_s > 0:
            run_world(made.world, left_s)
        held = made.pulses_us()
        run_world(made.world, 3.0)
        assert made.pulses_us() == pytest.approx(held)
        goal = ServoModel(made.robot.config).pulses_us([65.0] * 4)
        assert np.abs(np.array(held) - goal).min() > 100


def test_a_long_slow_move_never_runs_dry_and_ends_in_time() -> None:
    with compressed() as made:
        robot = made.robot
        made.run(0.3)  # a motion right after another counts as one that ran dry
        before = robot.telemetry.underruns
        start_us = robot.now_us
        robot.move_to((10.0, 5.0, 58.0), duration_s=6.0)
        assert robot.telemetry.underruns == before
        assert (robot.now_us - start_us) / 1e6 < 6.2
