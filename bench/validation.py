"""How long the validation takes, how like the paper's the named plant is, the bristle's rates."""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor

from bench.figure import Figure

from setae import rig
from setae.config import load
from setae.experiments.accuracy import Pose, by_group
from setae.experiments.bristle import Bristle, Move, Threshold, surface_mm
from setae.experiments.targets import GROUPS, paper_targets
from setae.experiments.validate import validate
from setae.report import paper
from setae.scene import open_scene

RUNS = 3
MOVES = 10_000
PROCESSES = 2
PARTS = 20
"""Each a world and a seed of its own."""


def poses(plant: str) -> list[Pose]:
    """All 145 targets on a plant, model paper, positions from the simulator's truth."""
    config = dataclasses.replace(load(), plant=plant)
    with rig.open("sim://", config=config, scene=open_scene()) as opened:
        world = opened.world
        assert world is not None
        opened.robot.enable()
        return validate(
            opened.robot,
            paper_targets(config),
            lambda _: world.truth().backbone_mm[-1].copy(),
            model="paper",
        )


def validation_wall() -> Iterable[Figure]:
    times_s = []
    for _ in range(RUNS):
        start_s = time.perf_counter()
        poses("paper_like")
        times_s.append(time.perf_counter() - start_s)
    yield Figure(
        "validate_145_wall_s",
        round(statistics.median(times_s), 2),
        "s",
        "all 145 targets on the plant paper_like, each from straight and back, one core, without"
        f" a log, median of {RUNS}",
    )


def paper_like() -> Iterable[Figure]:
    ours, theirs = by_group(poses("paper_like")), paper.validation()
    pairs = [(ours[group].in_plane, theirs[group].distance) for group in GROUPS]
    how = (
        "largest difference to the paper's five groups, plant paper_like, 145 simulated targets, in"
        " the bending plane; ours "
    )
    yield Figure(
        "paper_like_group_mean_error_mm_max",
        round(max(abs(mine.mean_mm - other.mean_mm) for mine, other in pairs), 3),
        "mm",
        how + ", ".join(f"{mine.mean_mm:.2f}" for mine, _ in pairs),
    )
    yield Figure(
        "paper_like_group_sd_error_mm_max",
        round(max(abs(mine.sd_mm - other.sd_mm) for mine, other in pairs), 3),
        "mm",
        how + ", ".join(f"{mine.sd_mm:.2f}" for mine, _ in pairs),
    )


def bristle_rates() -> Iterable[Figure]:
    yield from _bristle_rates("ideal", "bristle", MOVES)


def bristle_paper_like_rates() -> Iterable[Figure]:
    yield from _bristle_rates("paper_like", "bristle_paper_like", MOVES // 10)


def _bristle_rates(plant: str, name: str, count: int) -> Iterable[Figure]:
    with ProcessPoolExecutor(PROCESSES) as pool:
        parts = pool.map(_bristle_part, *zip(*_parts(plant, count), strict=True))
        moves = [move for part in parts for move in part]
    judged = Threshold.of(load().bristle.threshold_hpa, moves)
    how = (
        f"at {judged.hpa:g} hPa, simulated, plant {plant}, moves of 0.6 to 1.3 s, peaks judged on"
        " the host, over"
    )
    yield Figure(
        f"{name}_false_rate",
        judged.false_rate,
        "1",
        f"{how} {judged.free} moves without contact: those that count as touches",
    )
    yield Figure(
        f"{name}_missed_rate",
        judged.missed_rate,
        "1",
        f"{how} {judged.touches} touches of a flat surface, within 4 degrees of upright, sent 2 to"
        " 6 mm beyond it: those that don't count",
    )


def _parts(plant: str, count: int) -> list[tuple[str, int, int]]:
    """Plant, seed and moves of each world."""
    return [(plant, seed, count // PARTS) for seed in range(PARTS)]


def _bristle_part(plant: str, seed: int, count: int) -> list[Move]:
    config = dataclasses.replace(load(), plant=plant)
    raised_mm = 30.0
    scene = open_scene(surface_mm(config) + raised_mm)
    with rig.open("sim://", config=config, seed=seed, scene=scene, leave="hold") as opened:
        opened.robot.enable()
        measured = Bristle(opened.robot, seed=seed)
        found = measured.free(count)
        opened.stage.move_to((0.0, 0.0, -raised_mm))
        opened.robot.wait(lambda: not opened.stage.moving, timeout_s=30.0, what="the arm to move")
        return found + measured.touches(count)


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "validation_wall": validation_wall,
    "paper_like": paper_like,
    "bristle_rates": bristle_rates,
    "bristle_paper_like_rates": bristle_paper_like_rates,
}
