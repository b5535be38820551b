"""Scans to compare: from logs, from a study's folder, or from height maps in files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from setae import record
from setae.config import load
from setae.errors import InputError, LogError, SetaeError
from setae.experiments import scan
from setae.experiments.study.conducting import RUNS
from setae.experiments.study.one import MAP
from setae.heightmap import HeightMap
from setae.objects import ScanObject, TableScene, of_description
from setae.perception import maps
from setae.record import Log
from setae.solids import Solid

__all__ = ["Sample", "read", "read_all"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sample:
    """One scan.

    Attributes
    ----------
    name
        Of its file or folder.
    label
        What was scanned, where it is known.
    heights
        What was felt.
    reach_mm
        z of the world that the extended tip reached.
    scene
        The true scene, where the scan was simulated.
    origin
        Where it comes from, in words.
    """

    name: str
    label: str | None
    heights: HeightMap
    reach_mm: float
    scene: TableScene | None
    origin: str

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The true scene's, or none."""
        return self.scene.solids if self.scene else ()


def read_all(given: Iterable[str | Path]) -> list[Sample]:
    """Read all scans of some paths, each as in `read`.

    Raises
    ------
    InputError, LogError
        A path holds no scan.
    """
    return [sample for one in given for sample in read(one)]


def read(given: str | Path) -> list[Sample]:
    """Read the scans of a path.

    Parameters
    ----------
    given
        A log; a folder with the logs of scans; a study's folder; a height map (``.npz``).
        ``NAME=PATH`` says what was scanned: a real scan doesn't know.

    Returns
    -------
    list of Sample
        Failed runs of a study are left out.

    Raises
    ------
    InputError, LogError
        There is no such path, or it holds no scan.
    """
    label, path = _named(given)
    if not path.exists():
        raise InputError(f"There is no {path}.", "Give logs or folders of `setae scan`.")
    if path.suffix.lower() == ".npz":
        found = [_of_map(path)]
    elif (path / RUNS).is_dir():
        found = [_of_run(folder) for folder in sorted((path / RUNS).iterdir()) if _done(folder)]
    elif (path / MAP).is_file():
        found = [_of_run(path)]
    else:
        found = _of_logs(path)
    if not found:
        raise InputError(f"{path} holds no finished run.", "Let the study go on.")
    if label is None:
        return found
    return [
        Sample(
            name=sample.name,
            label=label,
            heights=sample.heights,
            reach_mm=sample.reach_mm,
            scene=sample.scene,
            origin=sample.origin,
        )
        for sample in found
    ]


def _named(given: str | Path) -> tuple[str | None, Path]:
    text = str(given)
    name, sign, path = text.partition("=")
    # A path may hold the sign too.
    if sign and name and "/" not in name and not Path(text).exists():
        return name, Path(path)
    return None, Path(text)


def _of_map(path: Path) -> Sample:
    return Sample(
        name=path.stem,
        label=None,
        heights=maps.read(path),
        reach_mm=load().scan_reach_mm,
        scene=None,
        origin=f"from {path.name}",
    )


def _of_logs(path: Path) -> list[Sample]:
    if not path.is_dir():
        return [_of_parts([record.read(path)], path.stem)]
    paths = sorted(path.glob("*.mcap"))
    if not paths:
        raise LogError(f"{path} holds no log.", "Give the folder that `setae scan` wrote.")
    scans = scan.scans_of([record.read(one) for one in paths])
    # A folder with several scans has one for each mode.
    names = [path.name if len(scans) == 1 else f"{path.name}-{s[0].path.stem}" for s in scans]
    return [_of_parts(parts, name) for parts, name in zip(scans, names, strict=True)]


def _of_parts(logs: Sequence[Log], name: str) -> Sample:
    result = scan.read_parts(logs)
    scene = _scene(result.scene) if logs[0].simulated else None
    config = logs[0].config
    origin = "measured on the robot"
    if logs[0].simulated:
        origin = f"simulated, plant {config.plant}, mode {result.mode}"
    return Sample(
        name=name,
        label=scene.object.shape if scene and scene.object else None,
        heights=result.height_map,
        reach_mm=config.scan_reach_mm,
        scene=scene,
        origin=origin,
    )


def _scene(data: Mapping[str, Any]) -> TableScene | None:
    """The scene that a log tells of; None: nothing is known of it."""
    if "table_z_mm" not in data:
        return None
    try:
        return of_description(data)
    except SetaeError:
        return None


def _done(folder: Path) -> bool:
    return _row(folder).get("status") == "done"


def _row(folder: Path) -> dict[str, Any]:
    try:
        row = json.loads((folder / "row.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return row if isinstance(row, dict) else {}


def _of_run(folder: Path) -> Sample:
    row = _row(folder)
    try:
        what = None
        if row["object_scale"] is not None:
            what = ScanObject(
                shape=row["object"],
                scale=row["object_scale"],
                x_mm=row["object_x_mm"],
                y_mm=row["object_y_mm"],
                yaw_deg=row["object_yaw_deg"],
            )
        scene = TableScene(table_z_mm=float(row["table_z_mm"]), object=what)
        reach_mm = float(row["reach_mm"])
    except (KeyError, TypeError, ValueError, SetaeError) as error:
        why = f"its line has no {error}" if isinstance(error, KeyError) else error
        raise InputError(
            f"{folder} holds no run of this version: {why}.",
            "Do the study again, into another folder: what is done is kept in this one.",
        ) from error
    plant = row.get("simulator.plant_name") or "ideal"
    return Sample(
        name=folder.name,
        label=what.shape if what else None,
        heights=maps.read(folder / MAP),
        reach_mm=reach_mm,
        scene=scene,
        origin=f"simulated, plant {plant}, mode {row.get('mode')}",
    )
