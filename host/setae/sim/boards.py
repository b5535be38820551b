"""Boards from outside of this package, in a simulated world: ``avr://firmware.elf`` and the like.

A plug-in is a function that is called with what stands behind ``://`` and with
a started `World`. It takes the world's own board out (`World.remove_board`),
tells the world of its pulses, asks it for the pressure, and returns a
`setae.link.transport.Transport` in which the world's time is the board's.

The environment variable ``SETAE_BOARDS`` names plug-ins, comma-separated, each
as ``scheme=module:function``. The module may lie in the present folder.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias
from urllib.parse import urlsplit

from setae.errors import InputError
from setae.link.transport import Transport
from setae.sim.world import World

__all__ = ["VARIABLE", "Board", "connect"]

VARIABLE = "SETAE_BOARDS"

Board: TypeAlias = Callable[[str, World], Transport]

# Where the project's own development plug-in is, in a clone.
_IN_A_CLONE = {"avr": "avr=tests.avr.robot:connect"}


def connect(url: str, world: World) -> Transport:
    """Put the board that a URL names into a world, in place of the world's own.

    Raises
    ------
    InputError
        No plug-in has the URL's scheme, or the named one can't be imported.
    """
    scheme = urlsplit(url).scheme
    named = dict(
        entry.strip().partition("=")[::2]
        for entry in os.environ.get(VARIABLE, "").split(",")
        if entry.strip()
    )
    if scheme not in named:
        example = _IN_A_CLONE.get(scheme, f"{scheme}=module:function")
        raise InputError(
            f"Nothing here knows {scheme}://.",
            f"Give sim:// or a serial port. A plug-in is named by {VARIABLE}, such as"
            f" {VARIABLE}={example}"
            + (" in a clone's folder, after `make avr`." if scheme in _IN_A_CLONE else "."),
        )
    return _load(scheme, named[scheme])(url.partition("://")[2], world)


def _load(scheme: str, name: str) -> Board:
    module_name, _, function_name = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        board: Board = getattr(importlib.import_module(module_name), function_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"The plug-in {name} for {scheme}:// can't be loaded: {error}.",
            f"Start setae in the module's folder, and check {VARIABLE}.",
        ) from error
    return board
