"""Damaged frames and fuzzing: what gets through, and how much was tried."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable

from bench.figure import Figure
from tests.fuzz import damage, fuzz

FRAMES = 30_000_000
FRAMES_IN_PYTHON = 1_000_000


def damaged_frames() -> Iterable[Figure]:
    """Whether a damaged frame passes for a right one."""
    counts = [damage.count(pattern, FRAMES) for pattern in damage.PATTERNS]
    each = FRAMES_IN_PYTHON // len(damage.PATTERNS)
    differing = [damage.disagreement(pattern, each) for pattern in damage.PATTERNS]
    yield Figure(
        "damaged_frames",
        min(count.damaged for count in counts),
        "frames",
        f"damaged frames through the C++ decoder, of each of {len(damage.PATTERNS)} patterns:"
        f" {', '.join(damage.PATTERNS)}; {FRAMES_IN_PYTHON} more through both decoders, which"
        f" disagree on {sum(map(bool, differing))} patterns",
    )
    yield Figure(
        "undetected_frames",
        sum(count.undetected for count in counts),
        "frames",
        "of all those: handed out, and not what was sent",
    )


def fuzzing() -> Iterable[Figure]:
    """What fuzzers have tried against each target's last version, and what broke."""
    runs = json.loads(fuzz.RUNS.read_text())
    commits = {run["target"]: run["commit"] for run in runs}
    last = [run for run in runs if run["commit"] == commits[run["target"]]]
    before = [run for run in runs if run not in last]
    parts = [
        f"{target} {sum(run['executions'] for run in last if run['target'] == target)} at {commit}"
        for target, commit in sorted(commits.items())
    ]
    yield Figure(
        "fuzz_executions",
        sum(run["executions"] for run in last),
        "inputs",
        "`make fuzz`, as recorded in tests/fuzz/runs.json, the last version of each target:"
        f" {', '.join(parts)}; {sum(run['executions'] for run in before)} more of versions before",
    )
    notes = [f"{run['target']} at {run['commit']}: {run['note']}" for run in runs if "note" in run]
    yield Figure(
        "fuzz_crashes",
        sum(run["crashes"] for run in last),
        "inputs",
        "of all those: on which the code under test crashed or broke a promise; versions before:"
        f" {sum(run['crashes'] for run in before)}. At"
        f" {sum(run.get('false_alarms', 0) for run in runs)} of all an observer was wrong"
        + "".join(f" ({note})" for note in notes),
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "damaged_frames": damaged_frames,
    "fuzzing": fuzzing,
}
