"""What all Python tests share; they refuse to run on an installation older than its source."""

from __future__ import annotations

import importlib.util
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes is the machine's affair: a busy one failed a test of the kinematics.
# The same examples every time; `--hypothesis-profile search` draws others.
settings.register_profile("setae", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("setae")

# Who is started in the background of a script ignores Ctrl-C, and so would all that tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[1]
NATIVE_FOLDERS = ("firmware/lib", "simulator")
# Where files are handed out to several cores, none has to wait for a long one at the end.
LONG_FIRST = ("system", "ur", "fuzz", "avr", "model")

# There is no wheel of ur-rtde for these Pythons (see pyproject.toml). For all others, that it is
# missing is a failure.
WITHOUT_ARM = sys.version_info >= (3, 13) and importlib.util.find_spec("rtde_control") is None
collect_ignore = ["ur"] if WITHOUT_ARM else []


def newer_than(stamp: Path) -> list[Path]:
    """Return the C++ sources changed since the simulator was compiled into .venv."""
    sources = [ROOT / "CMakeLists.txt"]
    for folder in NATIVE_FOLDERS:
        sources += [file for file in (ROOT / folder).rglob("*") if file.suffix in (".cpp", ".h")]
    compiled_at = stamp.stat().st_mtime
    return [file for file in sources if file.stat().st_mtime > compiled_at]


def gone(listing: Path) -> list[str]:
    """Return the modules that the editable installation looks for in vain."""
    return [name for name in listing.read_text().split() if not (ROOT / name).exists()]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Bring the folders with the longest tests first; all else keeps its order."""

    def place(item: pytest.Item) -> int:
        folder = item.path.parent.name
        return LONG_FIRST.index(folder) if folder in LONG_FIRST else len(LONG_FIRST)

    items.sort(key=place)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests need a library that this Python can't have."""
    if WITHOUT_ARM:
        terminalreporter.write_line("Without tests/ur: ur-rtde isn't installed (see docs/ur.md).")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Stop before the first test if it would test yesterday's code."""
    del session
    stamp = Path(sys.prefix) / ".installed"  # the Makefile's; other environments have none
    if not stamp.exists():
        return
    if changed := newer_than(stamp):
        words = f"{changed[0].relative_to(ROOT)} changed after the simulator was compiled"
    elif moved := gone(stamp.with_name(".modules")):
        words = f"{moved[0]} has gone since the package was installed"
    else:
        return
    pytest.exit(f"{words}: run `make build` first", returncode=1)
