"""The fuzzers' short run: what they found before, then a little more, the same every time."""

from __future__ import annotations

import pytest
from tests.fuzz import building, fuzz, planted

from setae_protocol.messages import Fault, Refusal, TripCause

RUNS = {"decoder": 20_000, "board": 2_000}


@pytest.mark.parametrize("target", RUNS)
def test_nothing_that_a_host_sends_breaks_a_promise(target: str) -> None:
    assert len(building.read_corpus(target)) > 20, "the corpus is gone"
    done = fuzz.check(target, RUNS[target])
    assert done.returncode == 0, done.stderr[-4000:]
    assert f"stat::number_of_executed_units: {RUNS[target]}" in done.stderr


def test_the_corpus_meets_every_mode_fault_refusal_and_trip() -> None:
    lines = (line.split() for line in planted.reached().splitlines())
    met = {name: {int(number) for number in numbers} for name, *numbers in lines}
    assert met["mode"] == set(range(9))
    assert met["fault"] == set(Fault) - {Fault.NONE, Fault.INTERNAL}
    assert met["refusal"] == set(Refusal) - {Refusal.NONE}
    assert met["trip"] == set(TripCause)


@pytest.mark.parametrize("bug", planted.BUGS, ids=lambda bug: bug.name)
def test_a_bug_in_the_firmware_is_found_by_the_corpus_alone(bug: planted.Bug) -> None:
    said = planted.plant(bug)
    assert "violated: " in said, "nobody noticed"
    assert bug.promise in said
