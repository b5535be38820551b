from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest
from tests.ur.controller import FakeController, controller

# There is no wheel of ur-rtde for the latest Pythons; the summary of all tests says so.
collect_ignore_glob = [] if importlib.util.find_spec("rtde_control") else ["test_*.py"]


@pytest.fixture
def fake() -> Iterator[FakeController]:
    with controller() as running:
        yield running
