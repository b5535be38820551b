"""The fuzzers' short run: what they found before, then a little more, the same every time."""

from __future__ import annotations

import pytest
from tests.fuzz import building, fuzz, planted

RUNS = {"decoder": 20_000, "board": 2_000}


@pytest.mark.parametrize("target", RUNS)
def test_nothing_that_a_host_sends_breaks_a_promise(target: str) -> None:
    assert len(building.read_corpus(target)) > 20, "the corpus is gone"
    done = fuzz.check(target, RUNS[target])
    assert done.returncode == 0, done.stderr[-4000:]
    assert f"stat::number_of_executed_units: {RUNS[target]}" in done.stderr


@pytest.mark.parametrize("bug", planted.BUGS, ids=lambda bug: bug.name)
def test_a_bug_in_the_firmware_is_found_by_the_corpus_alone(bug: planted.Bug) -> None:
    said = planted.plant(bug)
    assert "violated: " in said, "nobody noticed"
    assert bug.promise in said
