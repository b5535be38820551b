"""The command `setae`: what a user asks for in a terminal.

Each module adds its commands to `app`. Errors that setae raises on purpose end
in one line on stderr and exit code 1, without a traceback; anything else is a
bug, and keeps it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Sequence

from cyclopts import CycloptsError

from setae.cli import (
    calibrate,
    experiment,
    firmware,
    logs,
    look,
    robot,
    scan,
    shapes,
    study,
    validate,
    workspace,
)
from setae.cli.common import app, with_plugin
from setae.errors import SetaeError

__all__ = ["app", "main"]

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
    logs,
    workspace,
    firmware,
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `setae` and exit with its code.

    0: done. 1: an error, told in one line. 2: no such command or option, or a value
    of the wrong kind. 130: ended by Ctrl-C.
    """
    try:
        given = sys.argv[1:] if arguments is None else arguments
        code = app(with_plugin(given), exit_on_error=False, print_error=False)
        sys.stdout.flush()  # what can't be written is to be told here, not at the interpreter's end
    except SetaeError as error:
        _tell(" ".join([str(error), *getattr(error, "__notes__", [])]))
        sys.exit(1)
    except CycloptsError as error:
        _tell(f"{error} Give --help to see what there is.")
        sys.exit(2)
    except OSError as error:
        # What setae reads and writes has errors of its own; this is what it prints.
        if error.errno not in (errno.ENOSPC, errno.EIO, errno.EPIPE):
            raise
        _tell(f"The output can't be written: {error.strerror}. Give it another place.")
        with contextlib.suppress(OSError):  # the rest of it would be tried again
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except KeyboardInterrupt as interrupt:
        _tell(" ".join(getattr(interrupt, "__notes__", None) or ["interrupted"]))
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)


def _tell(text: str) -> None:
    print(f"setae: {' '.join(text.split())}", file=sys.stderr)
