"""Measure the whole and write results.json. `python bench/run.py --help` says how."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
# The oracle that judges explorations is the tests' own.
sys.path.insert(0, str(ROOT))

from bench import (  # noqa: E402  # needs the path
    arm,
    avr_figures,
    damage,
    elf,
    kinematics,
    line,
    link_model,
    motion,
    perception,
    readme,
    scan,
    validation,
)
from bench import plant as plant_figures  # noqa: E402
from bench.figure import Figure  # noqa: E402
from tests.system import oracle  # noqa: E402

from setae import rig  # noqa: E402
from setae.config import load  # noqa: E402
from setae.experiments.events import Event  # noqa: E402
from setae.experiments.explore import explore  # noqa: E402
from setae.link.events import Event as LinkEvent  # noqa: E402
from setae.link.events import Tripped  # noqa: E402
from setae.scene import Obstacle, tube_scene  # noqa: E402
from setae_protocol.messages import BOARD_OVERHEAD_BYTES, HOST_OVERHEAD_BYTES  # noqa: E402

RUNS = 3
RANDOM_TRIALS = 100
RANDOM_SEED = 20261122
ELF = ROOT / ".pio" / "build" / "uno" / "firmware.elf"


def paper_wall() -> Iterable[Figure]:
    """How long a user waits for the paper's five trials."""
    times = []
    for _ in range(RUNS):
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "setae.cli", "explore", "--sim", "--trials", "paper",
                 "--no-report", "--out", str(Path(folder) / "run")],
                check=True, stdout=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            )  # fmt: skip
            times.append(time.perf_counter() - start)
    yield Figure(
        "explore_paper_wall_s",
        round(statistics.median(times), 2),
        "s",
        f"`setae explore --sim --trials paper --no-report`, with logs, median of {RUNS}",
    )


def realtime_factor() -> Iterable[Figure]:
    """How much faster than the real thing the simulated one is."""
    config = load()
    # All that the plant models: friction, slip, unevenness.
    imperfect = replace(config, plant="paper_like")
    factors = []
    for _ in range(RUNS):
        with rig.open("sim://?seed=0", config=imperfect, scene=tube_scene(config)) as opened:
            opened.robot.enable()
            start_s, start_us = time.perf_counter(), opened.robot.now_us
            explore(opened.robot, opened.stage)
            virtual_s = (opened.robot.now_us - start_us) / 1e6
            factors.append(virtual_s / (time.perf_counter() - start_s))
    yield Figure(
        "sim_realtime_factor",
        round(statistics.median(factors), 1),
        "1",
        "virtual over wall time of one exploration of the empty tube by paper_like: host, link,"
        f" board, full plant and arm, without a log, median of {RUNS}",
    )


def frame_overhead() -> Iterable[Figure]:
    """What a frame costs on the line besides its payload."""
    yield Figure(
        "frame_overhead_bytes",
        HOST_OVERHEAD_BYTES,
        "B",
        "frame to the board: COBS, type, session, sequence, CRC-32C and delimiter",
    )
    yield Figure(
        "frame_overhead_board_bytes",
        BOARD_OVERHEAD_BYTES,
        "B",
        "frame from the board: the same, and expected, credit, epoch and state",
    )


def firmware_size() -> Iterable[Figure]:
    """How much of the UNO the firmware takes."""
    sources = [path for path in (ROOT / "firmware").rglob("*") if path.suffix in (".cpp", ".h")]
    changed_at = max(path.stat().st_mtime for path in sources)
    if not ELF.is_file() or ELF.stat().st_mtime < changed_at:
        subprocess.run(
            [str(ROOT / ".ci" / "platformio" / "pio"), "run", "-e", "uno"], cwd=ROOT, check=True
        )
    sizes = elf.sizes(ELF)
    yield Figure(
        "flash_bytes", sizes.flash_bytes, "B", "of 32256 beside the bootloader; the built ELF"
    )
    yield Figure("ram_static_bytes", sizes.ram_static_bytes, "B", "of 2048; the stack comes on top")


@dataclass(frozen=True)
class Trial:
    """One exploration of a random tube."""

    judgement: oracle.Judgement
    stops: int
    stops_in_air: int
    """Of those, with a bristle that the simulator's truth says touches nothing."""


def random_obstacles() -> Iterable[Figure]:
    """Whether obstacles anywhere are found, and nothing else is."""
    explored = _explored()
    judged = [trial.judgement for trial in explored]
    trials = f"{RANDOM_TRIALS} simulated trials with a cube of random height, direction and size"
    yield Figure(
        "explore_false_stops",
        sum(judgement.false_stops > 0 for judgement in judged),
        "trials",
        f"{trials}, or none: a contact where the oracle says free by"
        f" {oracle.FREE_MARGIN_MM:g} mm or more",
    )
    yield Figure(
        "explore_missed_stops",
        sum(judgement.missed > 0 for judgement in judged),
        "trials",
        f"the same {RANDOM_TRIALS}: no contact where the oracle says {oracle.TOUCH_MARGIN_MM:g} mm"
        " deep or more",
    )
    yield Figure(
        "explore_grazing",
        sum(judgement.grazing for judgement in judged),
        "directions",
        f"between the two, so not judged; {sum(judgement.clear for judgement in judged)} others"
        " came out right",
    )
    yield Figure(
        "explore_stops_in_air",
        sum(trial.stops_in_air for trial in explored),
        "stops",
        f"of all {sum(trial.stops for trial in explored)} stops in the same {RANDOM_TRIALS},"
        " grazing ones too: the simulator's truth has the bristle touch nothing",
    )


@lru_cache(maxsize=1)
def _explored() -> list[Trial]:
    config = load()
    rng = np.random.default_rng(RANDOM_SEED)
    explored = []
    for number in range(RANDOM_TRIALS):
        cube = oracle.random_cube(rng)
        obstacle = None if cube is None else Obstacle(
            below_tip_mm=cube.below_tip_mm, azimuth_deg=cube.azimuth_deg, edge_mm=cube.edge_mm
        )  # fmt: skip
        events: list[Event] = []
        scene = tube_scene(config, obstacle)
        with rig.open("sim://", config=config, seed=number, scene=scene) as opened:
            depths_mm = _depths_at_stops(opened)
            opened.robot.enable()
            explore(opened.robot, opened.stage, on_event=events.append)
        judgement = oracle.judge(
            cube,
            {
                event.data["descent_mm"]: set(event.data["touched_deg"])
                for event in events
                if event.name == "level_end"
            },
            sum(event.name == "lowering_contact" for event in events),
        )
        if judgement.false_stops or judgement.missed:
            print(f"trial {number}: {cube} {judgement}", file=sys.stderr)
        explored.append(Trial(judgement, len(depths_mm), sum(depth <= 0 for depth in depths_mm)))
    return explored


def _depths_at_stops(opened: rig.Rig) -> list[float]:
    """Filled while the rig runs: how deep the bristle is, as each trip becomes known."""
    depths_mm: list[float] = []
    world = opened.world
    assert world is not None, "a simulated rig has a world"

    def look(event: LinkEvent) -> None:
        if isinstance(event, Tripped):
            depths_mm.append(world.truth().contact_depth_mm)

    opened.robot.session.subscribe(look)
    return depths_mm


def kinematics_speed() -> Iterable[Figure]:
    """How fast positions become tendon lengths, for arrays and for one pose."""
    load_1 = f"median of {kinematics.RUNS}, one core, load of the machine {os.getloadavg()[0]:.1f}"
    for model in ("parallel", "paper", "taut"):
        yield Figure(
            f"ik_{model}_poses_per_s",
            round(kinematics.poses_per_s(model), -4),
            "1/s",
            f"inverse kinematics and tendon lengths, arrays of {kinematics.POSES} poses, {load_1}",
        )
    for name, model in (("ik_single_us", "paper"), ("ik_single_taut_us", "taut")):
        yield Figure(
            name,
            round(kinematics.single_us(model), 1),
            "us",
            f"the same for one pose, from Python, model {model}, {load_1}",
        )


def motion_segments() -> Iterable[Figure]:
    """How few segments the board gets for a motion."""
    segments, frames, error_um = motion.segments_per_move()
    yield Figure(
        "segments_per_move",
        segments,
        "segments",
        f"extension of the exploration, a quintic of 1 s, {frames} servo frames, within"
        f" {motion.TOLERANCE_UM:g} um and the half tick of rounding: {error_um:.1f} um at most",
    )


def workspace_volume() -> Iterable[Figure]:
    """How large the workspace is."""
    volumes = motion.volumes()
    how = f"of the spring's top, model paper, {volumes.samples} sampled poses; standard error"
    for name, part, what in (
        ("workspace_cm3", volumes.reachable, "reachable"),
        ("workspace_held_cm3", volumes.held, "reachable, and held by tendons that only pull"),
    ):
        yield Figure(name, round(part.cm3, 1), "cm3", f"{what}; {how} {part.error_cm3:.2f} cm3")


def plant() -> Iterable[Figure]:
    """How exact the simulated spring is, and how fast."""
    error_mm, poses = plant_figures.worst_against_shooting_mm()
    yield Figure(
        "plant_vs_bvp_mm_max",
        round(error_mm, 4),
        "mm",
        f"the tip against a shooting solver of the rod's strong form, {poses} poses, out of plane"
        " included, with gravity, half of them of a robot of uneven stiffness with a load at its"
        " tip; no friction, and tendons as straight chords: the bore is 60 mm wide in both",
    )
    yield Figure(
        "plant_in_bore_vs_bvp_mm_max",
        round(plant_figures.worst_in_bore_mm(), 4),
        "mm",
        "the same with a tendon along the wall of the bore, bent by 75 to 85 degrees with gravity,"
        " against shooting in turns with shortest strings of a general minimiser; an even robot"
        " and an uneven one",
    )
    yield Figure(
        "plant_step_ms",
        round(plant_figures.step_ms(), 3),
        "ms",
        "a sample of the moving paper_like: plant, servos and sensor, with the board's own code and"
        " the link in it, so an upper bound; processor time",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "paper_wall": paper_wall,
    "realtime_factor": realtime_factor,
    "frame_overhead": frame_overhead,
    "firmware_size": firmware_size,
    **avr_figures.FIGURES,
    **line.FIGURES,
    **arm.FIGURES,
    **damage.FIGURES,
    **link_model.FIGURES,
    **validation.FIGURES,
    **scan.FIGURES,
    **perception.FIGURES,
    "random_obstacles": random_obstacles,
    "kinematics_speed": kinematics_speed,
    "motion_segments": motion_segments,
    "plant": plant,
    "workspace_volume": workspace_volume,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=FIGURES, help="measure only these")
    parser.add_argument("--out", type=Path, default=ROOT / "bench" / "results.json")
    options = parser.parse_args(arguments)
    known: dict[str, dict[str, object]] = {}
    if options.only and options.out.is_file():
        known = {entry["name"]: entry for entry in json.loads(options.out.read_text())}
    for name in options.only or FIGURES:
        for figure in FIGURES[name]():
            print(f"{figure.name:<28} {figure.value:>10g} {figure.unit:<10} {figure.how}")
            known[figure.name] = asdict(figure)
    options.out.write_text(json.dumps(list(known.values()), indent=2) + "\n")
    if options.out == readme.RESULTS:
        readme.main([])


if __name__ == "__main__":
    main()
