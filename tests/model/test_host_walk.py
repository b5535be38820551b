"""The host that the checker explores is the real one: both do the same in the same states."""

from __future__ import annotations

from collections import deque

import pytest
from tests.model.checker import WHOLE, Scope
from tests.model.host_walk import replay
from tests.model.walk import Walker, paths

STATES = 3_000


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Walker:
    return Walker(tmp_path_factory.mktemp("walk"))


@pytest.mark.parametrize("scope", WHOLE, ids=lambda scope: scope.name)
def test_the_engine_does_what_the_models_host_does(walker: Walker, scope: Scope) -> None:
    steps = walker.steps(scope, STATES)
    assert len(steps) > 100
    for path in paths(steps):
        replay(path)


@pytest.mark.parametrize(
    ("plant", "name", "difference"),
    [
        ("RECEIPT_TRUSTED", "refusal", "the end of command"),
        ("TOLD_TWICE", "refusal", "whether it tells a record"),
        ("SAME_STOP", "stops", "it does not send"),
        ("STOP_TRUSTED", "stop", "whether a stop is under way"),
    ],
)
def test_another_host_in_the_model_is_noticed(
    walker: Walker, plant: str, name: str, difference: str
) -> None:
    scope = next(scope for scope in WHOLE if scope.name == name)
    found = paths(walker.steps(scope, 20_000, plant=f"PLANT_{plant}"))
    with pytest.raises(AssertionError, match=difference):
        deque(map(replay, found), maxlen=0)
