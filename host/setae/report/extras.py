"""Imports of the packages that only reports need, when they are first needed."""

from __future__ import annotations

import importlib
from types import ModuleType

from setae.errors import ExtraMissingError


def load(module: str) -> ModuleType:
    """Import a module of the extra ``report``.

    Raises
    ------
    ExtraMissingError
        It isn't installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ExtraMissingError("report", "A report") from error
