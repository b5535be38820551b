"""All commands, and how they are run."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import warnings
from collections.abc import Sequence

from cyclopts import CycloptsError

from setae.cli import (
    calibrate,
    experiment,
    firmware,
    logs,
    look,
    plant,
    robot,
    scan,
    shapes,
    study,
    tell,
    validate,
    workspace,
)
from setae.cli.common import app, with_plugin
from setae.errors import SetaeError

__all__ = ["run"]

# Each adds its commands when it is imported.
_COMMANDS = (
    look,
    robot,
    experiment,
    scan,
    shapes,
    study,
    validate,
    calibrate,
    plant,
    logs,
    workspace,
    firmware,
)


def run(arguments: Sequence[str]) -> int:
    """Run one command, tell its error in one line, and return the exit code."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("default", category=UserWarning, module=r"setae\.")
            warnings.showwarning = _tell_warning
            code = _code_of(arguments)
        if sys.stdout is not None:  # else it was closed
            sys.stdout.flush()  # what can't be written is to be told here, not at Python's end
    except SetaeError as error:
        tell(" ".join([str(error), *getattr(error, "__notes__", [])]))
        return 1
    except CycloptsError as error:
        tell(f"{error} Give --help to see what there is.")
        return 2
    except OSError as error:
        # What setae reads and writes has errors of its own; this is what it prints.
        if error.errno not in (errno.ENOSPC, errno.EIO, errno.EPIPE):
            raise
        tell(f"The output can't be written: {error.strerror}. Give it another place.")
        with contextlib.suppress(OSError):  # the rest of it would be tried again
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return code if isinstance(code, int) else 0


def _tell_warning(message: Warning | str, *_: object, **__: object) -> None:
    """In one line, and without the place in the code."""
    tell(str(message))


def _code_of(arguments: Sequence[str]) -> object:
    """What a command returns, or exits with: later versions of cyclopts exit by themselves."""
    try:
        return app(with_plugin(arguments), exit_on_error=False, print_error=False)
    except SystemExit as ended:
        return ended.code
