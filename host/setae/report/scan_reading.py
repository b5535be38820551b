"""What the logs of scans say, in the form that reports draw."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from setae.arc import FloatArray
from setae.config import Config
from setae.experiments.scan import ScanResult, read_parts, scans_of
from setae.experiments.scan.quality import Quality, Surface, quality, surface_of
from setae.record import Log

__all__ = ["Scan", "Trace", "read_scans"]

_ORDER = ("paper", "safe", "adaptive")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """Samples over the time of a scan.

    Attributes
    ----------
    time_s
        Since the scan began, (n,); the pause before a resumed part left out.
    value
        (n,) or (n, k).
    """

    time_s: FloatArray
    value: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """One scan, of one log or several parts.

    Attributes
    ----------
    result
        What was found.
    surface, quality
        The true surface in the simulator, and how near the scan came to it; None otherwise.
    path
        Where the arm was: x, y from the first place, (n, 2).
    pressure
        The bristle's and the baseline that the board compares it with, in hPa, (n, 2); without
        a baseline where nobody watches.
    place_s
        When each place of `result` became known, (n,).
    step_contacts
        Contacts in steps of the arm: x, y, (n, 2).
    problem
        Why it is not complete; empty otherwise.
    """

    result: ScanResult
    surface: Surface | None
    quality: Quality | None
    path: Trace
    pressure: Trace
    place_s: FloatArray
    step_contacts: Trace
    problem: str
    config: Config
    logs: tuple[Log, ...]

    @property
    def base_mm(self) -> float:
        """Height from which heights are told: the table's where it is known, else the tip's."""
        table_mm = self.result.scene.get("table_z_mm")
        return self.lowest_mm if table_mm is None else float(table_mm)

    @property
    def lowest_mm(self) -> float:
        """Height of the extended bristle's tip."""
        return self.config.scan_reach_mm

    @property
    def above(self) -> str:
        """What heights are told above."""
        known = self.result.scene.get("table_z_mm") is not None
        return "above the table" if known else "above the extended tip"


def read_scans(logs: Iterable[Log]) -> tuple[Scan, ...]:
    """Read all scans of some logs, the paper's mode first.

    Raises
    ------
    LogError
        A log holds no scan, or a part of one is missing.
    """
    scans = [_scan(parts) for parts in scans_of(logs)]
    return tuple(sorted(scans, key=lambda scan: _ORDER.index(scan.result.mode)))


def _scan(parts: Sequence[Log]) -> Scan:
    result = read_parts(parts)
    config = parts[0].config
    traces: dict[str, list[FloatArray]] = {name: [] for name in ("path", "pressure", "contacts")}
    place_s: list[float] = []
    begin_s = 0.0
    for log in parts:
        start = log.events("scan_start")[0]
        offset_s = begin_s - start.time_us / 1e6
        for topic, name, values in (
            ("/stage", "path", log.array("/stage", "position_mm")),
            ("/pressure", "pressure", _watched(log)),
        ):
            times_us = log.times_us(topic)
            values = values.reshape(len(times_us), -1)
            order = np.argsort(times_us, kind="stable")
            stamped = np.column_stack([times_us[order] / 1e6 + offset_s, values[order]])
            traces[name].append(stamped[times_us[order] >= start.time_us])
        traces["contacts"] += [
            np.array([[event.time_us / 1e6 + offset_s, *event.data["position_mm"][:2]]])
            for event in log.events("step_contact")
        ]
        place_s += [event.time_us / 1e6 + offset_s for event in log.events("place")]
        begin_s += (log.events()[-1].time_us - start.time_us) / 1e6
    aborts = parts[-1].events("scan_aborted")
    reason = str(aborts[-1].data.get("reason", "")) if aborts else "the log ends before the scan"
    if reason.startswith("KeyboardInterrupt"):
        reason = "somebody ended it with Ctrl-C"
    surface = surface_of(parts[0])
    return Scan(
        result=result,
        surface=surface,
        quality=quality(result, surface, config.scan_reach_mm) if surface else None,
        path=_trace(traces["path"], 3),
        pressure=_trace(traces["pressure"], 2),
        place_s=np.array(place_s),
        step_contacts=_trace(traces["contacts"], 2),
        problem="" if result.complete else reason,
        config=config,
        logs=tuple(parts),
    )


def _watched(log: Log) -> FloatArray:
    armed = log.array("/pressure", "armed").astype(bool)
    baseline_hpa = np.where(armed, log.array("/pressure", "baseline_hpa"), np.nan)
    return np.stack([log.array("/pressure", "pressure_hpa"), baseline_hpa], axis=-1)


def _trace(parts: Sequence[FloatArray], width: int) -> Trace:
    together = np.concatenate([np.empty((0, width + 1)), *parts])
    return Trace(time_s=together[:, 0], value=together[:, 1:])
