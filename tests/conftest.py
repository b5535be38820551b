"""What all Python tests share: they refuse to run on a simulator older than its source."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NATIVE_FOLDERS = ("firmware/lib", "simulator")


def newer_than(stamp: Path) -> list[Path]:
    """Return the C++ sources changed since the simulator was compiled into .venv."""
    sources = [ROOT / "CMakeLists.txt"]
    for folder in NATIVE_FOLDERS:
        sources += [file for file in (ROOT / folder).rglob("*") if file.suffix in (".cpp", ".h")]
    compiled_at = stamp.stat().st_mtime
    return [file for file in sources if file.stat().st_mtime > compiled_at]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Stop before the first test if it would test yesterday's simulator."""
    del session
    stamp = Path(sys.prefix) / ".installed"  # the Makefile's; other environments have none
    if stamp.exists() and (changed := newer_than(stamp)):
        pytest.exit(
            f"{changed[0].relative_to(ROOT)} changed after the simulator was compiled: "
            "run `make build` first",
            returncode=1,
        )
