"""What the model's host does and hears, as `walk.c` writes it down."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.model.checker import HERE, Scope, plants


@dataclass(frozen=True, slots=True)
class Up:
    """A frame that the host hears; fields as in host.h.

    Attributes
    ----------
    earlier, new
        Of a record: whether it is of an earlier session, whether the host tells it.
    """

    kind: int
    session: int
    expected: int
    credit: int
    epoch: int
    stopped: int
    waits: int
    token: int
    which: int
    id: int
    record_session: int
    sequence: int
    refused_kind: int
    command: int
    era: int
    earlier: int
    new: int


@dataclass(frozen=True, slots=True)
class Down:
    """A frame that the host sends; fields as in board.h."""

    kind: int
    session: int
    sequence: int
    epoch: int
    value: int
    token: int
    command: int
    era: int


@dataclass(frozen=True, slots=True)
class Step:
    """An event, and how the model's host is after it.

    Attributes
    ----------
    before
        The number of the event before it; -1 where it is the first.
    known
        Phase, session, epoch, credit, stop under way, its number, whether one was shown, which.
    tickets
        Kind, number and end of its last commands; zeros where there is none.
    """

    before: int
    action: str
    heard: Up
    sent: tuple[Down, ...]
    known: tuple[int, ...]
    tickets: tuple[tuple[int, int, int], ...]


class Walker:
    """`walk.c`, compiled into a folder."""

    def __init__(self, folder: Path) -> None:
        self._program = folder / "walk"
        options = ["-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
        command = ["cc", *options, "-o", str(self._program), str(HERE / "walk.c")]
        subprocess.run(command, check=True)

    def steps(self, scope: Scope, states: int, *, plant: str = "NO_PLANT") -> list[Step]:
        """Return the events in the first so many states of a scope."""
        environment = {**os.environ, "SETAE_MODEL": f"{plants().index(plant)} {scope.numbers}"}
        command = [str(self._program), str(states)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return [_read(line) for line in done.stdout.splitlines()]


def _read(line: str) -> Step:
    first, *rest = line.split(";")
    before, action = first.split()
    heard, sent, known, tickets = (tuple(map(int, part.split())) for part in rest)
    return Step(
        int(before),
        action,
        Up(*heard),
        tuple(Down(*sent[i : i + 8]) for i in range(0, len(sent), 8)),
        known,
        tuple((tickets[i], tickets[i + 1], tickets[i + 2]) for i in range(0, len(tickets), 3)),
    )


def paths(steps: list[Step]) -> Iterator[list[Step]]:
    """The ways through the events, each event in at least one."""
    inner = {step.before for step in steps}
    for last in range(len(steps)):
        if last not in inner:
            path = []
            at = last
            while at >= 0:
                path.append(steps[at])
                at = steps[at].before
            yield path[::-1]
