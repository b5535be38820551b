"""Imports of packages that only some parts of setae need, when they are first needed."""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

from setae.errors import ExtraMissingError

__all__ = ["find", "load"]


def load(module: str, extra: str, what: str) -> ModuleType:
    """Import a module of an extra.

    Parameters
    ----------
    module
        Its full name.
    extra
        The extra that brings it, such as ``perception``.
    what
        What needs it, for the message: "A report".

    Raises
    ------
    ExtraMissingError
        It isn't installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ExtraMissingError(extra, what) from error


def find(module: str, extra: str, what: str) -> None:
    """Look for a module of an extra without importing it.

    Parameters
    ----------
    module
        Its name, without a package around it.
    extra, what
        As in `load`.

    Raises
    ------
    ExtraMissingError
        It isn't installed.
    """
    if importlib.util.find_spec(module) is None:
        raise ExtraMissingError(extra, what)
