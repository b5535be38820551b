"""Shapes told apart by simulated scans, and how much faster two workers are than one."""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from bench.figure import Figure

import setae
from setae.experiments import samples, shapes, study
from setae.objects import SHAPES
from setae.perception.measures import EDGE_MM, EDGE_STEP_MM
from setae.sim.library import library_path

ROOT = Path(__file__).resolve().parents[1]

SEEDS = range(2000, 2005)
"""Of the scored trials. What the features and the classifier were chosen on has other seeds:
100 to 159 of maps made up in the tests, 200 to 204 and 1000 to 1004 of simulated scans."""

PLANT, MODE = "ideal", "paper"
WORKERS = 2
SPEED_TURNS = (1, WORKERS, WORKERS, 1, 1, WORKERS)
"""How many work, turn by turn."""
STUDIES = (
    (
        "study_speedup_2_cores",
        ("paper", "adaptive"),
        "a study of the paper's 5 x 5 trials by its own cycle and by the adaptive mode",
    ),
    ("study_speedup_default", study.Plan().modes, "the default study"),
)
"""Name, modes and description of what is timed."""
REPEATS = 8
"""Scans that a process does to show what the machine gives."""


@dataclass(frozen=True)
class Trials:
    """Scans of five random objects of each shape, compared."""

    found: shapes.Comparison
    total: int
    how: str


def trials(mode: str) -> Trials:
    plan = study.Plan(seeds=tuple(SEEDS), modes=(mode,), plants=(PLANT,))
    folder = ROOT / "build" / "bench" / f"objects-{mode}-{_version()}"
    rows = study.conduct(plan.runs(), folder, workers=WORKERS)
    failed = sum(row["status"] != "done" for row in rows)
    how = (
        f"{len(SHAPES)} x {len(SEEDS)} simulated scans, plant {PLANT}, mode {mode}, random size,"
        f" place and yaw, seeds {SEEDS[0]} to {SEEDS[-1]}"
    )
    if failed:
        how += f"; {failed} scans failed, and count as named wrong and not detected"
    found = shapes.compare(samples.read(folder))
    if found.left_out:
        how += (
            f"; {len(found.left_out)} left out, which count as named wrong and not detected:"
            f" {' '.join(found.left_out)}"
        )
    return Trials(found=found, total=len(rows), how=how)


def objects() -> Iterable[Figure]:
    """Five random trials of each of the five objects, scanned by the real firmware's code."""
    scored = trials(MODE)
    found, total, what = scored.found, scored.total, scored.how
    by_shape = {
        shape: [
            not answer.known
            for answer, label in zip(found.strangers, found.labels, strict=True)
            if label == shape
        ]
        for shape in found.shapes
    }
    yield Figure(
        "objects_loo_accuracy",
        round(found.accuracy * len(found.labels) / total, 3),
        "1",
        f"named right by a model of all other trials, unknown counts as wrong; {what}",
    )
    yield Figure(
        "objects_silhouette",
        round(found.silhouette, 3),
        "1",
        "of the trials' six features, each in units of its expected spread, fixed beforehand and"
        " not learned",
    )
    yield Figure(
        "objects_silhouette_paper",
        round(found.silhouette_paper, 3),
        "1",
        "of the heights, normalised as in the paper: aligned by the least x and y, 20 x 15, flat",
    )
    yield Figure(
        "objects_silhouette_tsne",
        round(found.silhouette_plane, 3),
        "1",
        "of the same in the plane of t-SNE",
    )
    yield Figure(
        "unknown_detected",
        round(found.unknown * len(found.labels) / total, 3),
        "1",
        "part of the same trials that are unknown to a model trained without their shape; least of"
        f" a shape {min(np.mean(some) for some in by_shape.values()):.2f}",
    )
    near = [one for one in found.nearness if one is not None]
    yield Figure(
        "objects_chamfer_mm",
        round(float(np.nanmean([one.chamfer_mm for one in near])), 2),
        "mm",
        "mean of the trials: the map's points to the true surface, and that at the scan's places"
        " to the map's points, averaged",
    )
    places = sum(one.places for one in near)
    square_mm2 = sum(one.places * one.height_rms_mm**2 for one in near if one.places)
    yield Figure(
        "objects_height_rms_mm",
        round(math.sqrt(square_mm2 / places), 2),
        "mm",
        "the same trials, map less true height, away from edges: true heights within"
        f" {EDGE_MM:g} mm along x and y differ by less than {EDGE_STEP_MM:g} mm; {places} places",
    )


def objects_adaptive() -> Iterable[Figure]:
    """The same objects by the adaptive mode, which leaves gaps in thin things."""
    scored = trials("adaptive")
    found = scored.found
    wrong: dict[str, int] = {}
    for answer, label in zip(found.answers, found.labels, strict=True):
        if answer.shape != label:
            wrong[label] = wrong.get(label, 0) + 1
    missed = ", ".join(f"{label} {count}" for label, count in wrong.items()) or "none"
    yield Figure(
        "objects_adaptive_loo_accuracy",
        round(found.accuracy * len(found.labels) / scored.total, 3),
        "1",
        f"as objects_loo_accuracy, {scored.how}; named wrong or unknown: {missed}; silhouette of"
        f" the features {found.silhouette:.3f}, unknown to a model without their shape"
        f" {found.unknown * len(found.labels) / scored.total:.3f}",
    )


def study_speedup() -> Iterable[Figure]:
    """Studies as `setae study` does them: in one process, and with two workers.

    What else the machine does only ever makes a run longer. So each counts as long as its quickest
    turn took, and the turns lie to and fro. A turn is a process of its own, as a command is: one
    that has imported all, or has begun workers before, would begin sooner.
    """
    plain_s = [_scans_gain() for _ in range(2)]
    for name, modes, what in STUDIES:
        times_s: dict[int, list[float]] = {1: [], WORKERS: []}
        others = []
        for workers in SPEED_TURNS:
            busy_s, own_s = _busy_s(), _own_s()
            times_s[workers] += _in_processes(1, _study_s, (modes, workers))
            if workers == 1:  # what workers took is nobody's once they have ended
                others.append((_busy_s() - busy_s - (_own_s() - own_s)) / times_s[1][-1])
        plain_s.append(_scans_gain())
        cores = len(os.sched_getaffinity(0))
        yield Figure(
            name,
            round(min(times_s[1]) / min(times_s[WORKERS]), 2),
            "1",
            f"wall time of {what}, {len(study.Plan(modes=modes).runs())} scans, one after the other"
            f" in one process ({_told(times_s[1])} s) over that in {WORKERS} dask workers"
            f" ({_told(times_s[WORKERS])} s, their start and end included), the quickest of each;"
            f" one thread each, {cores} cores, of which others took {max(*others, 0.0):.2f} at most"
            f" while one process worked; the machine itself: {WORKERS} plain processes that repeat"
            f" one scan do {min(plain_s):.2f} to {max(plain_s):.2f} times as many as one alone",
        )


def _scans_gain() -> float:
    """How many times as many scans plain processes do at the same time as one does alone."""
    alone_s = _in_processes(1, _scans_s, REPEATS)
    beside_s = _in_processes(WORKERS, _scans_s, REPEATS)
    return WORKERS * alone_s[0] / (sum(beside_s) / WORKERS)


def _in_processes(count: int, measure: Callable[[Any], float], given: Any) -> list[float]:
    """Measure in new processes at the same time."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=spawn) as pool:
        return list(pool.map(measure, [given] * count))


def _study_s(given: tuple[tuple[str, ...], int]) -> float:
    modes, workers = given
    runs = study.Plan(modes=modes).runs()
    with tempfile.TemporaryDirectory() as folder:
        start_s = time.perf_counter()
        rows = study.conduct(runs, Path(folder), workers=workers)
        took_s = time.perf_counter() - start_s
    assert all(row["status"] == "done" for row in rows), rows
    return took_s


def _scans_s(repeats: int) -> float:
    """The same scan over and over, once all is imported."""
    run = study.Plan().runs()[0]
    study.perform(run)
    start_s = time.perf_counter()
    for _ in range(repeats):
        study.perform(run)
    return time.perf_counter() - start_s


def _told(times_s: Iterable[float]) -> str:
    return ", ".join(f"{time_s:.1f}" for time_s in times_s)


def _own_s() -> float:
    """Processor time of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _busy_s() -> float:
    """Processor time of the whole machine, what its host took from it included."""
    numbers = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]
    user, nice, system, _, _, irq, softirq, steal = (int(number) for number in numbers)
    ticks = user + nice + system + irq + softirq + steal
    return ticks / os.sysconf("SC_CLK_TCK")


def _version() -> str:
    """Digest of all that a scan depends on: kept trials are those of this very code."""
    digest = hashlib.sha256()
    package = Path(setae.__file__).parent
    sources = sorted([*package.rglob("*.py"), *package.rglob("*.toml")])
    for path in [*sources, library_path()]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "objects": objects,
    "objects_adaptive": objects_adaptive,
    "study_speedup": study_speedup,
}
