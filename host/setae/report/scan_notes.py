"""What scans of one report have in common and in what they differ, in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from setae.config import Config
from setae.report.scan_reading import Scan

__all__ = ["comparable", "differences", "each", "note", "object_of", "plant_of"]

_UNKNOWN: Final = "unknown object"


def each(scans: Sequence[Scan], tell: Callable[[Scan], str]) -> str:
    """Tell something of all scans: once where it is the same, else with the modes it is true of."""
    modes: dict[str, list[str]] = {}
    for scan in scans:
        modes.setdefault(tell(scan), []).append(scan.result.mode)
    if len(modes) == 1:
        return next(iter(modes))
    return " and ".join(f"{text} ({', '.join(some)})" for text, some in modes.items())


def object_of(scan: Scan) -> str:
    """What was scanned, as far as it is known: simulated objects are."""
    scene = scan.result.scene
    what = scene.get("object")
    if isinstance(what, Mapping):
        place = f"at {what['x_mm']:g}, {what['y_mm']:g} mm, turned by {what['yaw_deg']:g}°"
        return f"{str(what['shape']).replace('_', ' ')}, size {what['scale']:.2g}, {place}"
    return "an empty table" if scan.logs[0].simulated and scene else _UNKNOWN


def plant_of(scan: Scan) -> str:
    """Which robot it was: the simulated one and its seed, or the real one."""
    log = scan.logs[0]
    if not log.simulated:
        return "measured on the robot"
    plant, seed = log.metadata.get("plant") or "ideal", log.metadata.get("seed")
    return f"simulated, plant {plant}, seed {seed}"


def note(scans: Sequence[Scan]) -> str:
    """Say what was scanned by which robot, for a picture's corner."""
    what = "" if all(object_of(scan) == _UNKNOWN for scan in scans) else each(scans, _short)
    whole = "; " if " (" in what else ", "
    text = whole.join(part for part in (what, each(scans, plant_of)) if part)
    return f"{text[:1].upper()}{text[1:]}."


def _short(scan: Scan) -> str:
    return object_of(scan).split(", at ")[0]


def differences(scans: Sequence[Scan]) -> tuple[str, ...]:
    """In what scans differ, besides their mode."""
    told: dict[str, Callable[[Scan], object]] = {
        "object": lambda scan: scan.result.scene,
        "robot": lambda scan: plant_of(scan).split(", seed")[0],
        "seed": lambda scan: scan.logs[0].metadata.get("seed"),
        "places": lambda scan: (
            scan.result.height_map.x_mm.tolist(), scan.result.height_map.y_mm.tolist(),
        ),
        "settings": _settings,
    }  # fmt: skip
    return tuple(
        name for name, of in told.items() if any(of(scan) != of(scans[0]) for scan in scans[1:])
    )


def _settings(scan: Scan) -> Config:
    """The configuration less what is told of by itself, or follows from the object."""
    rest = dataclasses.replace(scan.config.scan, area_mm=(0.0, 0.0), step_mm=1.0, tallest_mm=0.0)
    return dataclasses.replace(scan.config, scan=rest, plant="ideal")


def comparable(one: Scan, other: Scan) -> bool:
    """Whether two scans felt the same places of the same surface."""
    return not {"object", "places"} & set(differences((one, other)))
