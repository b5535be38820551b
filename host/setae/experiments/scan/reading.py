"""What the logs of a scan say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from setae import record
from setae.config import Scan, loads
from setae.errors import ConfigError, LogError
from setae.experiments.scan.run import MODES, Mode, ScanResult
from setae.experiments.scan.survey import Place, Survey
from setae.record import Log

__all__ = ["read", "read_logs", "settings_of"]


def read(path: str | Path) -> ScanResult:
    """Read a scan from its log, or from the folder of its run.

    Parameters
    ----------
    path
        A log, or a folder with one scan's logs: the first, and those that resumed it.

    Raises
    ------
    LogError
        There is no log, or it holds no scan, or more than one.
    """
    path = Path(path)
    paths = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if not paths:
        raise LogError(f"{path} holds no log.", "Give the folder that `setae scan` wrote.")
    return read_logs([record.read(each) for each in paths])


def read_logs(logs: Sequence[Log]) -> ScanResult:
    """Read a scan from its logs; one that resumes another counts after it.

    Raises
    ------
    LogError
        They hold no scan, or more than one.
    """
    logs = sorted(logs, key=lambda log: int(log.metadata.get("part") or 1))
    for log in logs:
        if not log.events("scan_start"):
            raise LogError(f"{log.path} holds no scan.", "Give the log of a run of `setae scan`.")
    begun = [log.events("scan_start")[0].data for log in logs]
    if any(log.metadata.get("mode") != logs[0].metadata.get("mode") for log in logs) or [
        int(log.metadata.get("part") or 1) for log in logs
    ] != list(range(1, len(logs) + 1)):
        raise LogError(
            f"{logs[0].path.parent} holds the logs of different scans.", "Give one of the logs."
        )
    survey = Survey(settings_of(logs[0]))
    places: list[Place] = []
    duration_s = 0.0
    for log in logs:
        found = [Place.of(event.data, event.time_us) for event in log.events("place")]
        survey.resume(found)
        places += found
        start_us = log.events("scan_start")[0].time_us
        duration_s += (log.events()[-1].time_us - start_us) / 1e6
    mode: Any = begun[0]["mode"]
    if mode not in MODES:
        raise LogError(f"{logs[0].path} holds a scan of unknown mode {mode!r}.")
    return ScanResult(
        height_map=survey.height_map(),
        places=tuple(places),
        mode=cast(Mode, mode),
        duration_s=duration_s,
        complete=survey.known == len(survey),
        scene=logs[0].metadata.get("scene") or {},
    )


def settings_of(log: Log) -> Scan:
    """Settings of a logged scan.

    Raises
    ------
    LogError
        The log's configuration can't be read.
    """
    try:
        return loads(str(log.metadata.get("config", "")), source=str(log.path)).scan
    except ConfigError as error:
        raise LogError(f"The configuration in {log.path} can't be used.", str(error)) from error
