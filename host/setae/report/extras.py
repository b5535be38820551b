"""Imports of the packages that only reports need, when they are first needed."""

from __future__ import annotations

from types import ModuleType

from setae import extras


def load(module: str) -> ModuleType:
    """Import a module of the extra ``report``.

    Raises
    ------
    ExtraMissingError
        It isn't installed.
    """
    return extras.load(module, "report", "A report")
