"""Are the simulated UNO and its firmware built from the sources that are here?"""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.avr.simavr import BOOTLOADER, FIRMWARE, LIBRARY, ROOT

_SUFFIXES = (".c", ".cpp", ".h", ".ini")


def require_built() -> None:
    """Fail where something is missing or old: nothing is skipped."""
    _require(LIBRARY, [ROOT / "tests" / "avr" / "shim"])
    _require(BOOTLOADER, [])
    _require(
        FIRMWARE,
        [
            ROOT / "platformio.ini",
            ROOT / "firmware" / "src",
            *(
                folder
                for folder in (ROOT / "firmware" / "lib").iterdir()
                if folder.name != "hal_host"
            ),
        ],
    )


def _require(built: Path, sources: list[Path]) -> None:
    if not built.is_file():
        pytest.fail(f"{built.relative_to(ROOT)} is missing: run `make avr`", pytrace=False)
    built_at = built.stat().st_mtime
    for source in sources:
        files = [source] if source.is_file() else source.rglob("*")
        for file in files:
            if file.suffix in _SUFFIXES and file.stat().st_mtime > built_at:
                pytest.fail(
                    f"{file.relative_to(ROOT)} is newer than {built.relative_to(ROOT)}: "
                    "run `make avr`",
                    pytrace=False,
                )
