"""What the pages show of the board's states is the firmware's table."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_picture_is_of_this_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    importlib.import_module("states_picture").draw(tmp_path / "states.svg")
    committed = (DOCS / "pictures" / "states.svg").read_text(encoding="utf-8")
    assert (tmp_path / "states.svg").read_text(encoding="utf-8") == committed


def test_a_way_that_the_picture_lacks_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    picture = importlib.import_module("states_picture")
    monkeypatch.delitem(picture.LINES, ("unwinding", "holding"))
    with pytest.raises(ValueError, match="does not fit"):
        picture.draw(tmp_path / "states.svg")
