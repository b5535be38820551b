"""A rig as a context: what is let go of, whatever fails on the way."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from setae import rig
from setae.errors import LogError


def test_the_arm_is_let_go_of_though_the_log_can_not_be_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk at the very end left the arm's connection open."""
    left: list[str] = []
    arm = ExitStack()
    arm.callback(left.append, "arm")

    def full() -> None:
        raise LogError("No space left.")

    opened = rig.open("sim://")
    opened.closes(arm)
    recorder = opened.record(tmp_path / "log.mcap")
    with monkeypatch.context() as patched:
        patched.setattr(recorder, "close", full)
        with pytest.raises(LogError, match="No space left"), opened:
            pass
    recorder.close()
    assert left == ["arm"]
