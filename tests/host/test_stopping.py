"""Stopping after an error: nothing that went wrong is lost, nothing is told twice."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from setae.stopping import stop_all


def failing(failure: Exception) -> Callable[[], object]:
    def stop() -> None:
        raise failure

    return stop


@pytest.mark.parametrize(
    ("failure", "note"),
    [
        (TimeoutError(), "Stopping failed too: TimeoutError"),
        (OSError("cable"), "Stopping failed too: cable"),
    ],
)
def test_a_failed_stop_of_few_words_is_told(failure: Exception, note: str) -> None:
    """One without text, or with a text that the first error's contains, was hidden."""
    error = OSError("The cable is out.")
    stop_all(error, failing(failure), failing(failure))
    assert error.__notes__ == [note]


def test_the_same_failure_again_is_no_news() -> None:
    error = TimeoutError()
    stop_all(error, failing(TimeoutError()))
    assert not hasattr(error, "__notes__")
