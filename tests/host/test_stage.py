"""The stage that a person moves."""

from __future__ import annotations

import os
import pty
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO

import pytest

from setae.errors import StageError
from setae.stage import Enter, ManualStage, Stage

TARGET_MM = (0.0, 0.0, -20.0)


@dataclass
class Person:
    """Reads what is asked, presses Enter when told to."""

    stage: ManualStage
    keyboard: IO[str]
    asked: list[str] = field(default_factory=list)


@pytest.fixture
def person() -> Iterator[Person]:
    read, write = os.pipe()
    asked: list[str] = []
    with os.fdopen(read) as answers, os.fdopen(write, "w") as keyboard:
        yield Person(ManualStage(ask=asked.append, answers=answers), keyboard, asked)


def test_it_is_a_stage(person: Person) -> None:
    assert isinstance(person.stage, Stage)


def test_a_move_lasts_until_the_person_confirms_it(person: Person) -> None:
    stage = person.stage
    stage.move_to(TARGET_MM)
    assert "-20" in person.asked[-1]
    stage.poll(0)
    assert (stage.moving, stage.position_mm) == (True, (0.0, 0.0, 0.0))
    print(file=person.keyboard, flush=True)
    stage.poll(1)
    assert (stage.moving, stage.position_mm) == (False, TARGET_MM)


def test_a_stop_tells_the_person_and_ends_the_move(person: Person) -> None:
    person.stage.stop()
    assert person.asked == []
    person.stage.move_to(TARGET_MM)
    person.stage.stop()
    assert "STOP" in person.asked[-1]
    assert not person.stage.moving
    assert person.stage.position_mm == (0.0, 0.0, 0.0)


def test_without_anybody_to_confirm_it_fails_instead_of_waiting(person: Person) -> None:
    person.stage.move_to(TARGET_MM)
    person.keyboard.close()
    with pytest.raises(StageError, match="terminal"):
        person.stage.poll(0)


def test_enter_typed_before_the_question_is_no_answer() -> None:
    """One Enter too many, during a scan, confirmed the arm's next move unseen."""
    keyboard, terminal = pty.openpty()
    with os.fdopen(keyboard, "wb", buffering=0) as keys, os.fdopen(terminal) as answers:
        stage = ManualStage(ask=lambda _: None, answers=answers)
        keys.write(b"\n")
        stage.move_to(TARGET_MM)
        stage.poll(0)
        assert stage.moving
        keys.write(b"\n")
        stage.poll(1)
        assert not stage.moving


def test_no_input_at_all_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program started without stdin gave a TypeError."""
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(StageError, match="Nobody"):
        Enter().pressed()
