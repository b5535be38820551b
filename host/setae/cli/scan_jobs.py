"""Which scans `setae scan` does: those that are asked for, or that an earlier run left."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from setae import record
from setae.cli import tell
from setae.cli.common import Where
from setae.cli.runs import later_parts
from setae.config import Config
from setae.errors import InputError, LogError
from setae.experiments import scan as scans
from setae.experiments.scan import Mode, ScanResult
from setae.objects import ScanObject, TableScene, of_description, random_object, table_scene
from setae.record import Log

__all__ = ["SAME_START_MM", "Job", "fresh", "resumed", "settings", "warn_of_no_height"]

SAME_START_MM = 0.5
"""How far off its earlier start a UR arm may stand to resume a scan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A scan to do: how, what, and what is known of it already.

    `modes` are all that the run was asked for; `replaces` are logs in which no scan has begun.
    """

    url: str | None
    config: Config
    mode: Mode
    modes: tuple[Mode, ...]
    seed: int
    scene: TableScene | None
    replaces: frozenset[Path] = frozenset()
    known: ScanResult | None = None
    part: int = 1
    arm_base_mm: tuple[float, ...] | None = None

    @property
    def known_places(self) -> int:
        """Of how many places something is known already."""
        return len(self.known.places) if self.known else 0

    @property
    def name(self) -> str:
        """Of its log."""
        return f"{self.mode}.mcap" if self.part == 1 else f"{self.mode}-{self.part}.mcap"


def settings(
    where: Where, area: str | None, step: float | None, order: str | None, tallest: float | None
) -> Config:
    """The robot with what the options say of the scan."""
    config = where.load()
    changes: dict[str, object] = {}
    if area is not None:
        changes["area_mm"] = _area_mm(area)
    if step is not None:
        changes["step_mm"] = step
    if order is not None:
        changes["order"] = order
    if tallest is not None:
        if where.simulated:
            raise InputError("--tallest tells of a real object.", "The simulator knows its own.")
        changes["tallest_mm"] = tallest
    return dataclasses.replace(config, scan=dataclasses.replace(config.scan, **changes))  # type: ignore[arg-type]  # each as its key has it


def warn_of_no_height(config: Config) -> None:
    """Say that the height window can't be checked: the configured height is all of it."""
    window_mm = scans.window_mm(config)
    if config.scan.tallest_mm == window_mm:
        tell(
            f"Nobody said how tall the object is, so that it fits is not checked. It may rise "
            f"{window_mm:g} mm above the extended bristle's tip; --tallest says how far it does."
        )


def _area_mm(text: str) -> tuple[float, float]:
    parts = re.split(r"[x×]", text)
    try:
        sides = [float(part) for part in parts]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2):
        raise InputError(f"--area {text!r} is no area.", "Give mm: --area 200 or --area 120x80.")
    return sides[0], sides[-1]


def fresh(
    config: Config, where: Where, modes: Sequence[Mode], object_: str | None, scene: Path | None
) -> list[Job]:
    """Scans that the options ask for, one for each mode."""
    if len(set(modes)) < len(modes):
        raise InputError("A --mode is given twice.", "Give each once.")
    url = where.url
    place: TableScene | None = None
    if where.simulated:
        if object_ is not None and scene is not None:
            raise InputError("--object and --scene exclude each other.", "Give one of them.")
        place = _scene(config, scene) if scene else _object(config, object_)
        config = scans.in_scene(config, place)
    elif object_ is not None or scene is not None:
        raise InputError("--object and --scene are for the simulator.", "Give --sim too.")
    job = Job(
        url=url, config=config, mode=modes[0], modes=tuple(modes), seed=where.seed, scene=place
    )
    return [dataclasses.replace(job, mode=mode) for mode in modes]


def _object(config: Config, text: str | None) -> TableScene:
    shape, _, seed = ("eraser" if text is None else text).partition(":")
    if shape == "none":
        return table_scene(config)
    if seed and not seed.isdecimal():
        raise InputError(
            f"--object {text!r}: {seed!r} is no seed.", "Give a whole number, as in eraser:3."
        )
    return table_scene(config, random_object(shape, int(seed or 0), area_mm=config.scan.area_mm))


def _scene(config: Config, path: Path) -> TableScene:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"The scene {path} can't be read: {error.strerror}.", "Check the file's name."
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"The scene {path} isn't valid TOML: {error}.", "Correct that line."
        ) from None
    try:
        # Where the table is doesn't matter to what stands on it: without it, it lies as it would
        # under this object.
        found = of_description({"table_z_mm": 0.0, **data})
        if "table_z_mm" not in data:
            found = table_scene(config, found.object)
    except InputError as error:
        raise InputError(f"{path}: {error.problem}", error.remedy) from error
    if unknown := set(data) - {"table_z_mm", "object"}:
        raise InputError(
            f"The scene {path} has no {sorted(unknown)[0]!r}.", "It has table_z_mm and [object]."
        )
    _warn_of_outside(config, found.object)
    return found


def _warn_of_outside(config: Config, what: ScanObject | None) -> None:
    """Say that an object stands wholly beside the scanned square, where nobody feels it."""
    if what is None:
        return
    width_mm, depth_mm = config.scan.area_mm
    beside_mm = math.hypot(
        max(-what.x_mm, what.x_mm - width_mm, 0.0), max(-what.y_mm, what.y_mm - depth_mm, 0.0)
    )
    if beside_mm > what.radius_mm:
        tell(
            f"The {what.shape} at {what.x_mm:g}, {what.y_mm:g} mm stands beside the scanned "
            f"{width_mm:g} x {depth_mm:g} mm: nothing of it will be felt."
        )


def resumed(path: Path, where: Where) -> tuple[list[Job], Callable[[], Path]]:
    """What a run left undone: scans that ended early, then modes that had not begun.

    Of a single log: what its scan lacks.
    """
    found = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if not found:
        raise LogError(f"{path} holds no log.", "Give the folder that `setae scan` wrote.")
    logs = [record.read(log) for log in (_all_parts(path) if path.is_file() else found)]
    # A run that ended while the robot was being enabled leaves a log in which no scan has begun.
    vain = [log for log in logs if scans.is_vain(log)]
    # A folder may hold scans of several runs: each goes on with its own settings.
    begun = scans.scans_of(logs) if len(vain) < len(logs) else []
    replaces = frozenset(log.path for log in vain)
    left, modes = [], set()
    for parts in begun:
        known = scans.read_parts(parts)
        modes.add(known.mode)
        if not known.complete:
            job = _job(parts[0], known.mode, where, replaces)
            left.append(dataclasses.replace(job, known=known, part=len(parts) + 1))
    firsts = [*(parts[0] for parts in begun), *vain]
    for mode in dict.fromkeys(mode for log in firsts for mode in _asked(log, path)):
        if mode not in modes:
            asking = [log for log in firsts if mode in _asked(log, path)]
            jobs = [_job(log, mode, where, replaces) for log in asking]
            if not all(_alike(job, jobs[0]) for job in jobs):
                names = " and ".join(log.path.name for log in asking)
                raise InputError(
                    f"Which scan mode {mode} has to do is not clear: {names} differ in settings.",
                    f"Go on with each alone, as in --resume {asking[0].path}.",
                )
            left.append(jobs[0])
    if not left:
        raise InputError(f"The scan in {path} is complete.", "`setae report` makes its report.")
    return left, lambda: logs[0].path.parent


def _job(log: Log, mode: Mode, where: Where, replaces: frozenset[Path]) -> Job:
    """A scan with the settings of a log."""
    about = log.metadata
    simulated = bool(about.get("simulated"))
    if simulated and where.port is not None:
        raise InputError("That scan was simulated, so --port has no part in it.", "Leave it out.")
    plant = str(about.get("plant") or "")
    base_mm = about.get("arm_base_mm")
    return Job(
        url=(plant if plant.startswith("python:") else "sim://") if simulated else where.url,
        config=log.config,
        mode=mode,
        modes=tuple(about.get("modes") or ()),
        seed=int(about.get("seed") or 0),
        scene=of_description(about.get("scene") or {}) if simulated else None,
        replaces=replaces,
        arm_base_mm=None if base_mm is None else tuple(base_mm),
    )


def _asked(log: Log, path: Path) -> tuple[Mode, ...]:
    """All modes of a log's run; its own where it was given alone."""
    return (log.metadata["mode"],) if path.is_file() else tuple(log.metadata.get("modes") or ())


def _alike(one: Job, other: Job) -> bool:
    """Whether both have the same settings, and begin at the same place."""
    names = ("url", "config", "seed", "scene")
    if any(getattr(one, name) != getattr(other, name) for name in names):
        return False
    if one.arm_base_mm is None or other.arm_base_mm is None:
        return True
    return math.dist(one.arm_base_mm, other.arm_base_mm) <= SAME_START_MM


def _all_parts(log: Path) -> list[Path]:
    """A log and the others of its scan, which lie beside it."""
    first = log.with_stem(re.sub(r"-\d+$", "", log.stem))
    return [part for part in (first, *later_parts(first)) if part.exists()]
