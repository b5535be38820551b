"""A rig as a context: what is let go of, whatever fails on the way."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from setae import rig
from setae.errors import InputError, LogError


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


def test_the_url_of_the_simulator_gives_seed_and_speed() -> None:
    with rig.open("sim://?seed=3&speed=50") as opened:
        assert opened.seed == 3


@pytest.mark.parametrize(
    "url", ["sim://?sed=3", "sim://?seed=-1", "sim://?speed=0", "sim://?speed=fast", "sim://seed=3"]
)
def test_what_the_url_of_the_simulator_can_not_ask_for_is_told(url: str) -> None:
    """All but a bad seed was passed over."""
    with pytest.raises(InputError, match="simulator's"):
        rig.open(url)


def test_an_unknown_way_to_leave_the_robot_is_told() -> None:
    """The robot was left holding."""
    with pytest.raises(InputError, match="relax"):
        rig.open("sim://", leave="limp")  # type: ignore[arg-type]  # that is the mistake
