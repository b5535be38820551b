"""The scan of a surface: how long it takes, how long the robot, how near the truth."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from bench.figure import Figure

from setae import record
from setae.config import load
from setae.experiments.scan import Mode, simulate
from setae.experiments.scan.quality import Quality, agreement, quality, surface_of
from setae.heightmap import HeightMap
from setae.objects import SHAPES, random_object, table_scene
from setae.perception.measures import EDGE_MM, EDGE_STEP_MM

OBJECT_SEED = 1
WALL_SHAPE = "lidded_container"


@dataclass(frozen=True)
class Run:
    """One simulated scan of the paper's square."""

    robot_s: float
    wall_s: float
    cpu_s: float
    heights: HeightMap
    quality: Quality


@cache
def run(shape: str, mode: Mode) -> Run:
    config = load()
    scene = table_scene(config, random_object(shape, OBJECT_SEED))
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "scan.mcap"
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        result = simulate(config, scene, mode=mode, log=log)
        wall_s = time.perf_counter() - start_s
        cpu_s = time.process_time() - start_cpu_s
        surface = surface_of(record.read(log))
    assert surface is not None, "a simulated scan knows the truth"
    return Run(
        robot_s=result.duration_s,
        wall_s=wall_s,
        cpu_s=cpu_s,
        heights=result.height_map,
        quality=quality(result, surface, config.scan_reach_mm),
    )


def scan_times() -> Iterable[Figure]:
    """How long a user waits, and how long the robot works, in both modes."""
    square = "21 x 21 places, 200 x 200 mm, simulated"
    timed = run(WALL_SHAPE, "paper")
    yield Figure(
        "scan_441_wall_s",
        round(timed.wall_s, 1),
        "s",
        f"the paper's cycle over {WALL_SHAPE}, {square}, with its log; {timed.cpu_s:.1f} s of it"
        " processor time",
    )
    paper_s = {shape: run(shape, "paper").robot_s for shape in SHAPES}
    adaptive_s = {shape: run(shape, "adaptive").robot_s for shape in SHAPES}
    shares = ", ".join(f"{shape} {adaptive_s[shape] / paper_s[shape]:.2f}" for shape in SHAPES)
    objects = f"mean of the five objects, seed {OBJECT_SEED}"
    yield Figure(
        "scan_robot_time_s",
        round(sum(paper_s.values()) / len(SHAPES), 1),
        "s",
        f"virtual time of the paper's cycle, {square}, {objects}",
    )
    yield Figure(
        "scan_adaptive_robot_time_s",
        round(sum(adaptive_s.values()) / len(SHAPES), 1),
        "s",
        f"virtual time of the adaptive mode on the same; share of the paper's: {shares}",
    )


def scan_heights() -> Iterable[Figure]:
    """How near the true surface the measured heights are, in both modes."""
    where = (
        f"heights against the simulator's true surface, five objects, seed {OBJECT_SEED}, away from"
        f" edges: true heights within {EDGE_MM:g} mm along x and y differ by less than"
        f" {EDGE_STEP_MM:g} mm"
    )
    modes: tuple[tuple[str, Mode], ...] = (
        ("scan_height_rms_mm", "paper"),
        ("scan_adaptive_height_rms_mm", "adaptive"),
    )
    for name, mode in modes:
        found = [run(shape, mode).quality for shape in SHAPES]
        places = sum(one.places for one in found)
        square_mm2 = sum(one.places * one.rms_mm**2 for one in found if one.places)
        missed, invented = sum(one.missed for one in found), sum(one.invented for one in found)
        yield Figure(
            name,
            round(math.sqrt(square_mm2 / places), 2),
            "mm",
            f"mode {mode}: {where}; {places} places; not among them {missed} missed there, and"
            f" {invented} heights where nothing is in reach",
        )


def scan_edges() -> Iterable[Figure]:
    """How ragged edges come out, in both modes, and how like the maps of both modes are."""
    modes: tuple[tuple[str, Mode], ...] = (
        ("scan_edge_rms_mm", "paper"),
        ("scan_adaptive_edge_rms_mm", "adaptive"),
    )
    for name, mode in modes:
        found = {shape: run(shape, mode) for shape in SHAPES}
        places = sum(one.quality.edge_places for one in found.values())
        square_mm2 = sum(
            one.quality.edge_places * one.quality.edge_rms_mm**2
            for one in found.values()
            if one.quality.edge_places
        )
        shapes = "; ".join(f"{shape} {_edges(one)}" for shape, one in found.items())
        yield Figure(
            name,
            round(math.sqrt(square_mm2 / places), 2),
            "mm",
            f"mode {mode}: heights against the simulator's true surface at edges, five objects,"
            f" seed {OBJECT_SEED}, {places} places with a height; each shape's error in mm, and"
            f" its places slipped/double/lost: {shapes}",
        )
    both = [(run(shape, "adaptive").heights, run(shape, "paper").heights) for shape in SHAPES]
    touched = [[np.isfinite(one.height_mm) for one in pair] for pair in both]
    shared = sum(int((one & other).sum()) for one, other in touched)
    either = sum(int((one | other).sum()) for one, other in touched)
    yield Figure(
        "scan_adaptive_agreement",
        round(float(np.mean([agreement(*pair) for pair in both])), 3),
        "1",
        "share of the places where the adaptive mode and the paper's cycle both found something,"
        f" or both nothing; mean of the five objects, seed {OBJECT_SEED}; both found something at"
        f" {shared} of the {either} places where either did",
    )


def _edges(one: Run) -> str:
    counts = (int((one.heights.mark == mark).sum()) for mark in ("slipped", "double", "lost"))
    rms = f"{one.quality.edge_rms_mm:.1f}" if one.quality.edge_places else "-"
    return f"{rms}, {'/'.join(str(count) for count in counts)}"


FIGURES = {"scan_times": scan_times, "scan_heights": scan_heights, "scan_edges": scan_edges}
