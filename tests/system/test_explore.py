"""The paper's exploration, end to end: host, link, the board's own code, plant and arm."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from tests.system import oracle
from tests.system.robots import run_world

from setae import record, rig
from setae.config import load
from setae.errors import LogError
from setae.experiments.descent import PAPER_DESCENTS_MM, paper_obstacles
from setae.experiments.events import Event, OnEvent
from setae.experiments.explore import ExploreResult, explore, run_trials
from setae.scene import Obstacle, Scene, tube_scene
from setae.solids import Box
from setae_protocol.messages import State

DIRECTIONS_DEG = list(oracle.DIRECTIONS_DEG)


@dataclass
class Trial:
    """What a trial left behind."""

    log: Path | None = None
    events: list[Event] = field(default_factory=list)
    result: ExploreResult | None = None

    def scanned(self) -> dict[float, set[float]]:
        """Depth → directions of contact, for every depth that was scanned to its end."""
        return {
            event.data["descent_mm"]: set(event.data["touched_deg"])
            for event in self.events
            if event.name == "level_end"
        }

    def lowering_contacts(self) -> int:
        return sum(event.name == "lowering_contact" for event in self.events)


@contextmanager
def ready(
    obstacle: Obstacle | None,
    log: Path | None,
    *,
    seed: int = 0,
    scene: Scene | None = None,
    on_event: Callable[[Event], None] = lambda _: None,
    interrupt: Interrupt | None = None,
) -> Iterator[tuple[rig.Rig, OnEvent]]:
    """An enabled robot on its arm, logged."""
    config = load()
    with rig.open(
        "sim://",
        config=config,
        seed=seed,
        scene=scene or tube_scene(config, obstacle),
        pollables=[interrupt] if interrupt else [],
    ) as opened:
        recorder = None if log is None else opened.record(log)
        opened.robot.enable()

        def note(event: Event) -> None:
            if recorder is not None:
                recorder.experiment(event.time_us, event.name, event.data)
            on_event(event)

        yield opened, note


def run(obstacle: Obstacle | None, log: Path | None = None, *, seed: int = 0) -> Trial:
    trial = Trial(log)
    with ready(obstacle, log, seed=seed, on_event=trial.events.append) as (opened, on_event):
        trial.result = explore(opened.robot, opened.stage, obstacle=obstacle, on_event=on_event)
    return trial


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> list[Trial]:
    """The paper's five trials."""
    folder = tmp_path_factory.mktemp("paper")
    trials: list[Trial] = []

    @contextmanager
    def setup(number: int, obstacle: Obstacle | None) -> Iterator[tuple[rig.Rig, OnEvent]]:
        trial = Trial(folder / f"trial-{number}.mcap")
        trials.append(trial)
        with ready(obstacle, trial.log, seed=number, on_event=trial.events.append) as made:
            yield made

    results = run_trials(setup, obstacles=paper_obstacles(load()))
    for trial, result in zip(trials, results, strict=True):
        trial.result = result
    return trials


def read(trial: Trial) -> record.Log:
    assert trial.log is not None
    return record.read(trial.log)


def results(trials: list[Trial]) -> list[ExploreResult]:
    return [trial.result for trial in trials if trial.result is not None]


def test_the_papers_five_trials_come_out_as_the_paper_reports(paper: list[Trial]) -> None:
    descents = [result.descent_mm for result in results(paper)]
    assert descents == list(PAPER_DESCENTS_MM) == [40, 60, 80, 100, 100]
    assert [bool(result.contacts) for result in results(paper)] == [True] * 4 + [False]


def test_contacts_are_where_the_cube_is_and_nowhere_else(paper: list[Trial]) -> None:
    for result in results(paper)[:4]:
        assert [touch.alpha_deg for touch in result.contacts] == [0.0]
        touch = result.contacts[0]
        assert touch.descent_mm == result.descent_mm
        assert abs(touch.pressure_hpa - touch.baseline_hpa) >= 15.0
        # The cube: its inner face 30 mm from the axis, its top known.
        assert result.obstacle is not None
        top_mm = -110.0 - result.obstacle.below_tip_mm
        assert touch.tip_world_mm[0] == pytest.approx(30.0, abs=6.0)
        assert touch.tip_world_mm[1] == pytest.approx(0.0, abs=6.0)
        assert touch.tip_world_mm[2] < top_mm + 6.0


def test_after_a_contact_the_other_directions_are_still_scanned(paper: list[Trial]) -> None:
    for trial in paper:
        levels: dict[int, list[float]] = {}
        level = 0
        for event in trial.events:
            if event.name == "level_start":
                level = event.data["level"]
            if event.name == "direction_end":
                levels.setdefault(level, []).append(event.data["alpha_deg"])
        assert trial.result is not None
        assert list(levels) == list(range(1, trial.result.levels + 1))
        assert all(scanned == DIRECTIONS_DEG for scanned in levels.values())


def test_the_arm_returns_to_its_start_and_the_robot_is_left_relaxed(paper: list[Trial]) -> None:
    for trial in paper:
        log = read(trial)
        assert log.damage is None
        assert log.messages("/stage")[-1]["position_mm"] == pytest.approx([0, 0, 0], abs=1e-3)
        assert log.messages("/telemetry")[-1]["state"] == "relaxed"


def test_the_log_tells_what_the_board_says_of_itself_once_a_second(paper: list[Trial]) -> None:
    for trial in paper:
        log = read(trial)
        begin_us, end_us = log.span_us
        told = log.messages("/status")
        assert len(told) == pytest.approx((end_us - begin_us) / 1e6, abs=3)
        assert {message["supply_mv"] for message in told} == {5006}
        assert {message["rx_overruns"] + message["late_pulses"] for message in told} == {0}


def test_the_board_retracts_by_itself_before_the_host_asks_for_anything(
    paper: list[Trial],
) -> None:
    log = read(paper[0])
    (trip,) = log.messages("/trip")
    reflex = [
        message["time_us"] for message in log.messages("/telemetry") if message["reflex_running"]
    ]
    resume = next(
        message["time_us"]
        for message in log.messages("/command")
        if message["name"] == "resume" and message["time_us"] > trip["sample_time_us"]
    )
    assert reflex
    assert min(reflex) - trip["sample_time_us"] < 60_000
    # The host waits for the reflex: it has nothing to do with it.
    assert resume > max(reflex)


def test_the_same_seed_gives_the_same_log_to_the_byte(tmp_path: Path) -> None:
    config = load()
    short = Obstacle(below_tip_mm=5.0, edge_mm=config.tube.cube_edge_mm)
    first, second, other = (tmp_path / name for name in ("first", "second", "other"))
    for log, seed in ((first, 3), (second, 3), (other, 4)):
        run(short, log, seed=seed)
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes() != other.read_bytes()


def test_random_obstacles_are_found_and_nothing_else_is() -> None:
    rng = np.random.default_rng(2024)
    judged = []
    for number in range(6):
        cube = oracle.random_cube(rng)
        trial = run(_obstacle(cube), seed=number)
        judged.append(oracle.judge(cube, trial.scanned(), trial.lowering_contacts()))
    assert sum(judgement.false_stops for judgement in judged) == 0
    assert sum(judgement.missed for judgement in judged) == 0
    # Not vacuous: most directions have a clear answer.
    clear = sum(judgement.clear for judgement in judged)
    assert clear > 4 * sum(judgement.grazing for judgement in judged)


def _obstacle(cube: oracle.Cube | None) -> Obstacle | None:
    if cube is None:
        return None
    return Obstacle(
        below_tip_mm=cube.below_tip_mm, azimuth_deg=cube.azimuth_deg, edge_mm=cube.edge_mm
    )


def test_a_contact_while_the_arm_lowers_stops_the_arm_and_ends_the_descent(
    tmp_path: Path,
) -> None:
    tube = tube_scene(load())
    # Right below the robot, where the paper has nothing.
    in_the_way = dataclasses.replace(
        tube, box=Box(centre_mm=(0.0, 0.0, -165.0), edges_mm=(40.0, 40.0, 40.0), yaw_rad=0.0)
    )
    trial = Trial(tmp_path / "log.mcap")
    with ready(None, trial.log, scene=in_the_way, on_event=trial.events.append) as made:
        opened, on_event = made
        result = explore(opened.robot, opened.stage, on_event=on_event)
        assert opened.stage.position_mm == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert [touch.alpha_deg for touch in result.contacts] == [None]
    # The tip meets the box 35 mm down; from 50 mm/s the arm brakes within 6.25 mm.
    assert 35.0 < result.descent_mm < 46.0
    # The level that was not reached was not scanned.
    assert list(trial.scanned()) == [20.0]


class Interrupt:
    """Ctrl-C at a moment of the run's own time."""

    def __init__(self, after_us: int) -> None:
        self.at_us = after_us

    def poll(self, now_us: int) -> None:
        if now_us >= self.at_us:
            self.at_us = sys.maxsize
            raise KeyboardInterrupt


# While the arm lowers; while the robot extends; while it retracts.
@pytest.mark.parametrize("after_s", [1.4, 2.9, 3.7])
def test_ctrl_c_stops_robot_and_arm_and_leaves_a_readable_log(
    after_s: float, tmp_path: Path
) -> None:
    log_path = tmp_path / "log.mcap"
    with (
        pytest.raises(KeyboardInterrupt),
        ready(None, log_path, interrupt=Interrupt(round(after_s * 1e6))) as (opened, on_event),
    ):
        explore(opened.robot, opened.stage, on_event=on_event)
    assert opened.robot.state is State.STOPPED
    world = opened.world
    assert world is not None
    run_world(world, 0.5)
    before = world.truth()
    run_world(world, 2)
    after = world.truth()
    assert after.pulse_us == pytest.approx(before.pulse_us)
    assert after.attached == (True,) * 4
    assert not after.arm_moving
    assert after.arm_mm == pytest.approx(before.arm_mm)
    log = record.read(log_path)
    assert log.damage is None
    assert log.events("trial_aborted")[0].data["reason"] == "KeyboardInterrupt"
    assert log.messages("/telemetry")[-1]["state"] == "stopped"


def test_a_log_that_can_not_be_written_stops_robot_and_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = 0

    def full(*_: object, **__: object) -> None:
        nonlocal written
        written += 1
        if written > 100:
            raise LogError("The disk is full.", "Make room.")

    monkeypatch.setattr(record.Recorder, "write", full)
    with (
        pytest.raises(LogError, match="Make room"),
        ready(None, tmp_path / "log.mcap") as (opened, on_event),
    ):
        explore(opened.robot, opened.stage, on_event=on_event)
    assert opened.robot.state is State.STOPPED
    assert opened.world is not None
    run_world(opened.world, 1.0)
    assert not opened.world.truth().arm_moving


def test_ctrl_c_in_the_terminal_ends_in_one_line_and_exit_code_130(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "200"}
    process = subprocess.Popen(
        [sys.executable, "-m", "setae.cli", "explore", "--sim", "--out", str(tmp_path / "run")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        text=True,
    )
    assert process.stdout is not None
    seen = ""
    while "mm down" not in seen:
        piece = process.stdout.read(1)
        assert piece, process.communicate()[1]
        seen += piece
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert len(errors.strip().splitlines()) == 1
    assert "stopped" in errors
    log = record.read(tmp_path / "run" / "trial-1.mcap")
    assert log.damage is None
    assert log.messages("/telemetry")[-1]["state"] == "stopped"
