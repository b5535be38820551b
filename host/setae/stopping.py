"""Stopping things after an error, so that it stays the one that is told."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Final

__all__ = ["stop_all"]

_NOTE: Final = "Stopping failed too: "


def stop_all(error: BaseException, *stops: Callable[[], object]) -> None:
    """Stop everything; a stop's own failure becomes a note on the error, unless it says no more.

    Parameters
    ----------
    error
        What went wrong first.
    stops
        Called one after the other, whatever the ones before did; a Ctrl-C meanwhile is raised
        after the last.

    Examples
    --------
    >>> error = OSError("The cable is out.")
    >>> def stop():
    ...     raise OSError("Nobody hears the stop.")
    >>> stop_all(error, stop, stop)
    >>> error.__notes__
    ['Stopping failed too: Nobody hears the stop.']
    """
    with ExitStack() as left:
        for stop in reversed(stops):
            left.callback(_stop, error, stop)


def _stop(error: BaseException, stop: Callable[[], object]) -> None:
    try:
        stop()
    except Exception as failure:
        note = _NOTE + _text(failure)
        if note not in {_NOTE + _text(error), *getattr(error, "__notes__", [])}:
            error.add_note(note)


def _text(error: BaseException) -> str:
    return str(error) or type(error).__name__
