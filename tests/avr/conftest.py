"""A simulated UNO for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.avr.built import require_built
from tests.avr.driver import Driver
from tests.avr.simavr import Uno


@pytest.fixture(scope="session", autouse=True)
def _built() -> None:
    require_built()


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
