"""A single run of a study, on whatever machine: all it needs comes with it, all it gives goes back.

So machines that share no disk can work on one study.
"""

from __future__ import annotations

import math
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

import setae
from setae import extras
from setae.config import loads
from setae.errors import SetaeError
from setae.experiments.scan import simulate
from setae.experiments.study.plan import EMPTY, Run
from setae.heightmap import TOUCHED
from setae.objects import random_object, table_scene
from setae.perception import maps, measures

__all__ = ["LOG", "MAP", "Outcome", "perform"]

MAP: Final = "map.npz"
LOG: Final = "scan.mcap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a run gave.

    Attributes
    ----------
    row
        Its line in the table.
    files
        Contents by name, for the run's folder.
    """

    row: dict[str, Any]
    files: dict[str, bytes] = field(default_factory=dict)


def perform(run: Run) -> Outcome:
    """Do a run. What goes wrong in it becomes its outcome: other runs go on.

    Parameters
    ----------
    run
        Which.
    """
    start_s = time.perf_counter()
    row: dict[str, Any] = {
        "run": run.name,
        "object": run.object,
        "seed": run.seed,
        "mode": run.mode,
        **dict(run.changes),
        "setae": setae.__version__,
    }
    try:
        outcome = _scanned(run)
    except Exception as error:
        # A bug's traceback belongs into the run's folder; an error of setae's says all itself.
        bug = not isinstance(error, SetaeError)
        text = f"{type(error).__name__}: {error}"
        files = {"traceback.txt": traceback.format_exc().encode()} if bug else {}
        outcome = Outcome(row={"status": "failed", "error": text}, files=files)
    else:
        outcome.row.update(status="done", error="")
    wall_s = round(time.perf_counter() - start_s, 3)
    return Outcome(row={**row, **outcome.row, "wall_s": wall_s}, files=outcome.files)


def _scanned(run: Run) -> Outcome:
    config = loads(run.config, source=run.name)
    what = None
    if run.object != EMPTY:
        what = random_object(run.object, run.seed, area_mm=config.scan.area_mm)
    scene = table_scene(config, what)
    threads = extras.load("threadpoolctl", "study", "A study")
    # As many runs at once as there are cores: their matrices are small, and need one each.
    with threads.threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / LOG if run.keep_log else None
        result = simulate(config, scene, mode=run.mode, seed=run.seed, log=log)
        heights = result.height_map
        files = {MAP: maps.as_bytes(heights)}
        if log is not None:
            files[LOG] = log.read_bytes()
    reach_mm = config.scan_reach_mm
    near = measures.nearness(heights, scene.solids, reach_mm=reach_mm)
    row: dict[str, Any] = {
        "robot_s": round(result.duration_s, 3),
        "places": heights.mark.size,
        "touched": int(np.isin(heights.mark, TOUCHED).sum()),
        "doubtful": int(np.isin(heights.mark, ("slipped", "double", "lost")).sum()),
        "height_rms_mm": _rounded(near.height_rms_mm),
        "height_bias_mm": _rounded(near.height_bias_mm),
        "judged_places": near.places,
        "chamfer_mm": _rounded(near.chamfer_mm),
        "to_surface_mm": _rounded(near.to_surface_mm),
        "from_surface_mm": _rounded(near.from_surface_mm),
        "reach_mm": reach_mm,
        "table_z_mm": scene.table_z_mm,
    }
    for name in ("scale", "x_mm", "y_mm", "yaw_deg"):
        row[f"object_{name}"] = getattr(what, name) if what else None
    return Outcome(row=row, files=files)


def _rounded(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
