"""The command `setae`: what a user asks for in a terminal.

Each module adds its commands to `app`. Errors that setae raises on purpose end
in one line on stderr and exit code 1, without a traceback; anything else is a
bug, and keeps it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main", "tell"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `setae` and exit with its code.

    0: done. 1: an error, told in one line. 2: no such command or option, or a value
    of the wrong kind. 3: a study has ended, and some of its runs failed. 130: ended by Ctrl-C.
    """
    try:
        # Here, because Ctrl-C may come in the second that this takes.
        from setae.cli.commands import run

        code = run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt as interrupt:
        tell(" ".join(getattr(interrupt, "__notes__", None) or ["interrupted"]))
        code = 130
    sys.exit(code)


def tell(text: str) -> None:
    """Print one line on stderr."""
    print(f"setae: {' '.join(text.split())}", file=sys.stderr)
