"""The command `setae`: what a user asks for in a terminal.

Each module adds its commands to `app`. Errors that setae raises on purpose end
in one line on stderr and exit code 1, without a traceback; anything else is a
bug, and keeps it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from setae.cli import experiment, firmware, logs, robot, workspace
from setae.cli.common import app
from setae.errors import SetaeError

__all__ = ["app", "main"]

# Each adds its commands when it is imported.
_COMMANDS = (robot, experiment, logs, workspace, firmware)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `setae` and exit with its code.

    0: done. 1: an error, told in one line. 130: ended by Ctrl-C.
    """
    try:
        code = app(arguments)
    except SetaeError as error:
        text = " ".join([str(error), *getattr(error, "__notes__", [])])
        print(f"setae: {' '.join(text.split())}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt as interrupt:
        notes = getattr(interrupt, "__notes__", None) or ["interrupted"]
        print(f"setae: {' '.join(notes)}", file=sys.stderr)
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)
