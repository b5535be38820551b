"""A simulated UNO for each test. What is missing or old is a failure: nothing is skipped."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.avr.driver import Driver
from tests.avr.simavr import FIRMWARE, LIBRARY, ROOT, Uno

_SUFFIXES = (".c", ".cpp", ".h", ".ini")


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


@pytest.fixture(scope="session", autouse=True)
def _built() -> None:
    _require(LIBRARY, [ROOT / "tests" / "avr" / "shim"])
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


@pytest.fixture
def uno(_built: None) -> Iterator[Uno]:
    """An UNO at power-on."""
    with Uno() as board:
        yield board


@pytest.fixture
def driver(uno: Uno) -> Driver:
    """An UNO with an open session and wide limits."""
    driver = Driver(uno)
    driver.open()
    return driver
