"""Errors: one root, messages with a remedy, copies that survive pickling."""

from __future__ import annotations

import inspect
import pickle

import pytest

from setae import errors
from setae.errors import ExtraMissingError, FaultError, RefusedError, SetaeError

KINDS = [getattr(errors, name) for name in errors.__all__]


@pytest.mark.parametrize("kind", KINDS)
def test_every_error_has_the_root_and_says_when_it_happens(kind: type[Exception]) -> None:
    assert issubclass(kind, SetaeError)
    assert inspect.getdoc(kind)


@pytest.mark.parametrize("kind", KINDS)
def test_errors_survive_pickling(kind: type[Exception]) -> None:
    error = kind("one", "Two.")
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is kind
    assert str(back) == str(error)
    assert vars(back) == vars(error)


def test_standard_kinds_can_be_caught_as_such() -> None:
    for kind in (errors.ConfigError, errors.InputError, errors.TrajectoryError):
        assert issubclass(kind, ValueError)
    for timeout in (errors.BoardSilentError, errors.DeadlineError):
        assert issubclass(timeout, TimeoutError)
    assert issubclass(errors.UnreachableError, errors.InputError)


def test_messages_say_what_was_wrong_and_what_to_do() -> None:
    error = RefusedError("pair_limit", "Choose another target.", command="segments", detail="Sum.")
    assert str(error) == "The board refused segments (pair_limit): Sum. Choose another target."
    assert error.reason == "pair_limit"
    fault = FaultError("sensor_silent", "Check the cable.")
    assert str(fault) == "The board is in fault (sensor_silent). Check the cable."
    assert "setae flash" in str(errors.BoardSilentError("No answer."))
    assert "pip install 'setae[ur]'" in str(ExtraMissingError("ur", "A UR arm"))
