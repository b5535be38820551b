from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.ur.controller import FakeController, controller


@pytest.fixture
def fake() -> Iterator[FakeController]:
    with controller() as running:
        yield running
