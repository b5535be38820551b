"""How much the model checker goes through."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bench.figure import Figure
from tests.model.checker import WHOLE, explore


def states() -> Iterable[Figure]:
    """All states of all scopes, none of them wrong."""
    count = 0
    for scope, result in explore(WHOLE):
        if not result.complete:
            raise RuntimeError(f"The model's scope {scope.name} is wrong: {result.wrong}")
        count += result.states
    yield Figure(
        "model_states",
        count,
        "states",
        f"`make model`: host, line and board in {len(WHOLE)} scopes, each visited wholly by Spin;"
        " none in which a property of tests/model/README.md fails",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {"model": states}
