"""What the logs of a scan say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, cast

from setae import record
from setae.config import Scan
from setae.errors import LogError
from setae.experiments.scan.run import EXPERIMENT, MODES, Mode, ScanResult
from setae.experiments.scan.survey import Place, Survey
from setae.record import Log

__all__ = ["is_vain", "part_of", "read", "read_parts", "scans_of", "settings_of"]


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
    if not path.is_dir():
        return read_parts([record.read(path)])
    paths = sorted(path.glob("*.mcap"))
    if not paths:
        raise LogError(f"{path} holds no log.", "Give the folder that `setae scan` wrote.")
    scans = scans_of([record.read(each) for each in paths])
    if len(scans) > 1:
        raise LogError(f"{path} holds {len(scans)} scans.", "Give one of its logs.")
    return read_parts(scans[0])


def scans_of(logs: Iterable[Log]) -> list[list[Log]]:
    """Sort logs into scans, each a first part and those that resumed it, in their order.

    Logs in which no scan had begun (`is_vain`) are left out where others hold one.

    Raises
    ------
    LogError
        A log holds no scan, or a part of one is missing.
    """
    scans: dict[str, list[Log]] = {}
    given = list(logs)
    for log in [log for log in given if not is_vain(log)] or given:
        if not log.events("scan_start"):
            raise LogError(f"{log.path} holds no scan.", "Give the log of a run of `setae scan`.")
        scans.setdefault(str(log.metadata.get("mode")), []).append(log)
    for parts in scans.values():
        parts.sort(key=part_of)
        if [part_of(log) for log in parts] != list(range(1, len(parts) + 1)):
            raise LogError(
                f"A part of the scan with {parts[0].path} is missing, or there twice.",
                "Give all logs of its folder.",
            )
    return list(scans.values())


def is_vain(log: Log) -> bool:
    """Whether a log of `setae scan` ended before its scan began."""
    return log.metadata.get("experiment") == EXPERIMENT and not log.events("scan_start")


def part_of(log: Log) -> int:
    """Which part of its scan a log is, from 1."""
    return int(log.metadata.get("part") or 1)


def read_parts(parts: Sequence[Log]) -> ScanResult:
    """Read a scan from its logs, first part first.

    Raises
    ------
    LogError
        They hold no scan, or a part does not go on with those before it.
    """
    starts = [log.events("scan_start") for log in parts]
    if not all(starts):
        raise LogError(f"{parts[0].path} holds no scan.", "Give the log of a run of `setae scan`.")
    mode: Any = starts[0][0].data["mode"]
    if mode not in MODES:
        raise LogError(
            f"{parts[0].path} holds a scan of unknown mode {mode!r}.",
            "Read the log with the version of setae that wrote it.",
        )
    survey = Survey(settings_of(parts[0]))
    places: list[Place] = []
    # Of a single later part: what the others took.
    duration_s = float(starts[0][0].data.get("earlier_s") or 0.0)
    for log, start in zip(parts, starts, strict=True):
        if log is not parts[0]:
            _require_goes_on(log, parts[0], survey.known)
        found = [Place.of(event.data, event.time_us) for event in log.events("place")]
        survey.resume(found)
        places += found
        duration_s += (log.events()[-1].time_us - start[0].time_us) / 1e6
    return ScanResult(
        height_map=survey.height_map(),
        places=tuple(places),
        mode=cast(Mode, mode),
        duration_s=duration_s,
        complete=survey.known == len(survey),
        scene=parts[0].metadata.get("scene") or {},
    )


def _require_goes_on(log: Log, first: Log, known: int) -> None:
    """Refuse a part of another run: it began with other settings, or with other knowledge."""
    began_with = log.events("scan_start")[0].data["known"]
    if log.config != first.config or began_with != known:
        raise LogError(
            f"{log.path} resumes another scan than that of {first.path}.",
            "Put the logs of each run into a folder of their own.",
        )


def settings_of(log: Log) -> Scan:
    """Settings of a logged scan.

    Raises
    ------
    LogError
        The log's configuration can't be read.
    """
    return log.config.scan
