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


def test_a_ctrl_c_during_one_stop_does_not_skip_the_next() -> None:
    """A second Ctrl-C while the arm was told to stop left the robot without its stop."""
    stopped: list[str] = []

    def interrupted() -> None:
        raise KeyboardInterrupt

    error = OSError("The cable is out.")
    with pytest.raises(KeyboardInterrupt):
        stop_all(error, interrupted, lambda: stopped.append("robot"))
    assert stopped == ["robot"]
