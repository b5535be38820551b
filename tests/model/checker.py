"""Run the model in Spin: scope by scope, whole or with an error planted.

python -m tests.model.checker            all scopes, and the number of states
python -m tests.model.checker --small    those of the tests
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMMANDS = (
    "enable", "segments", "guard", "disarm", "relax", "limp", "resume", "bad_segments",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """How much may happen in one run.

    Attributes
    ----------
    name, what
        What it is for.
    kinds
        The commands that the user may send, in any order.
    commands, stops, trips, faults, resets, switches, hosts
        How often. With `holding` the enable at the start is one of the commands.
    eras
        How often the epoch may change, the session's start included.
    handshake
        Start with the first hello, not with an open session.
    holding
        Start with the servos on.
    late
        Frames from the board may come late.
    """

    name: str
    what: str
    kinds: tuple[str, ...] = COMMANDS
    commands: int = 2
    stops: int = 0
    trips: int = 0
    faults: int = 0
    resets: int = 0
    switches: int = 0
    hosts: int = 1
    eras: int = 4
    handshake: bool = False
    holding: bool = False
    late: bool = False

    @property
    def numbers(self) -> str:
        """What the model reads from its environment, after the plant."""
        kinds = sum(1 << COMMANDS.index(kind) for kind in self.kinds)
        values = (
            self.commands, self.stops, self.trips, self.faults, self.resets, self.switches,
            self.hosts,
            self.eras, kinds, self.handshake, self.holding, self.late,
        )  # fmt: skip
        return " ".join(str(int(value)) for value in values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What Spin found.

    Attributes
    ----------
    states
        Different states that were reached.
    complete
        Whether all were visited.
    wrong
        The property that does not hold; empty where all do.
    trace
        A way there.
    """

    states: int
    complete: bool
    wrong: str
    trace: tuple[str, ...]


class Model:
    """The model, compiled.

    Parameters
    ----------
    folder
        Where to build it; used for nothing else.
    shortest
        Breadth first: it takes more memory, and a trace is as short as can be.

    Raises
    ------
    RuntimeError
        Spin or the compiler failed.
    """

    def __init__(self, folder: Path, *, shortest: bool = False) -> None:
        self.folder = folder
        for source in [*HERE.glob("*.h"), HERE / "actions.def", HERE / "model.pml"]:
            shutil.copy(source, folder)
        # One process: there is nothing to reorder, so no reduction.
        options = ["-O2", "-DSAFETY", "-DNOREDUCE", "-DVECTORSZ=2048"]
        if shortest:
            options.append("-DBFS")
        for command in (["spin", "-a", "model.pml"], ["cc", *options, "-o", "pan", "pan.c"]):
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")

    def check(self, scope: Scope, *, plant: str = "NO_PLANT") -> Result:
        """Explore one scope, with an error in it where `plant` names one of board.h."""
        environment = {**os.environ, "SETAE_MODEL": f"{plants().index(plant)} {scope.numbers}"}
        said = self._run(["-m3000000"], environment)
        stored = re.search(r"(\d+) states, stored", said)
        depth = re.search(r"depth reached (\d+), errors: (\d+)", said)
        if stored is None or depth is None:
            raise RuntimeError(f"Spin said nothing of its states:\n{said}")
        failed = depth.group(2) != "0"
        wrong = re.search(r"^wrong: (\w+)", said, re.MULTILINE)
        trace = self._run(["-r"], environment) if failed else ""
        return Result(
            states=int(stored.group(1)),
            complete=not failed and "too small" not in said and "not completed" not in said,
            wrong=wrong.group(1) if wrong else "UNKNOWN" if failed else "",
            trace=tuple(
                re.findall(r"^((?:user|host|board|sensor|line)_\w+)$", trace, re.MULTILINE)
            ),
        )

    def _run(self, arguments: list[str], environment: dict[str, str]) -> str:
        return subprocess.run(
            ["./pan", *arguments], cwd=self.folder, env=environment, capture_output=True,
            text=True, check=False,
        ).stdout  # fmt: skip


def plants() -> list[str]:
    """Return the names of the errors that can be planted, none first."""
    body = re.search(r"enum \{\n  NO_PLANT,(.*?)\};", (HERE / "board.h").read_text(), re.DOTALL)
    assert body is not None
    return ["NO_PLANT", *re.findall(r"^  (PLANT_\w+),", body.group(1), re.MULTILINE)]


SMALL = (
    Scope(
        name="refusal", what="lost, doubled and reordered commands, refused and not",
        kinds=("enable", "disarm"), commands=3, holding=True, eras=1,
    ),
    Scope(
        name="stop", what="segments or a resume, and a stop at any moment",
        kinds=("segments", "resume"), commands=2, stops=1, holding=True,
    ),
)  # fmt: skip
WHOLE = (
    *SMALL,
    Scope(
        name="numbers", what="more commands than there are sequence numbers",
        kinds=("disarm",), commands=6, holding=True,
    ),
    Scope(
        name="epochs", what="segments behind some that are refused",
        kinds=("segments", "bad_segments"), commands=4, holding=True,
    ),
    Scope(name="commands", what="any two commands, from relaxed"),
    Scope(
        name="late", what="records that come late",
        kinds=("disarm", "bad_segments"), commands=4, holding=True, eras=3, late=True,
    ),
    Scope(
        name="resume", what="segments, a stop, a resume", kinds=("segments", "resume"),
        commands=3, stops=1, holding=True,
    ),
    Scope(
        name="stops", what="two stops, and a resume", kinds=("resume",),
        commands=2, stops=2, holding=True, eras=5,
    ),
    Scope(
        name="contact", what="a guarded move, a contact and a stop at any moment",
        kinds=("segments", "guard"), commands=3, trips=1, stops=1, holding=True,
    ),
    Scope(
        name="trip", what="a guard, a trip at any moment, a resume", kinds=("guard", "resume"),
        commands=3, trips=1, holding=True, eras=3,
    ),
    Scope(
        name="fault", what="a guard, and a fault at any moment", kinds=("guard", "resume"),
        commands=2, stops=1, faults=1, holding=True,
    ),
    Scope(
        name="switch", what="segments, and the stop switch", kinds=("segments", "resume"),
        commands=3, switches=1, holding=True,
    ),
    Scope(
        name="handshake", what="a session that opens, and a stop meanwhile",
        kinds=("segments",), commands=1, stops=1, handshake=True, eras=2,
    ),
    Scope(
        name="hosts", what="a host that is killed in motion, and the next one",
        kinds=("segments", "resume"), commands=2, hosts=2, holding=True,
    ),
    Scope(
        name="reset", what="a board that is reset, and the next host", kinds=("enable",),
        commands=2, resets=1, hosts=2, holding=True,
    ),
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Explore, and print what was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--small", action="store_true", help="only the scopes of the tests")
    parser.add_argument("--only", nargs="+", choices=[scope.name for scope in WHOLE])
    options = parser.parse_args(arguments)
    scopes: tuple[Scope, ...] = SMALL if options.small else WHOLE
    if options.only:
        scopes = tuple(scope for scope in WHOLE if scope.name in options.only)
    states = 0
    for scope, result in explore(scopes):
        states += result.states
        sys.stdout.write(f"{scope.name:10} {result.states:>10} states  {scope.what}\n")
        sys.stdout.writelines(f"    {action}\n" for action in result.trace)
        sys.stdout.flush()
        if not result.complete:
            sys.stdout.write(f"  {result.wrong or 'not all states were visited'}\n")
            return 1
    sys.stdout.write(f"{states} states\n")
    return 0


def explore(scopes: Sequence[Scope]) -> Iterator[tuple[Scope, Result]]:
    """Explore scope by scope; where something is wrong, say the shortest way to it."""
    with tempfile.TemporaryDirectory() as folder:
        model = Model(Path(folder))
        for scope in scopes:
            result = model.check(scope)
            if result.wrong:
                with tempfile.TemporaryDirectory() as other:
                    result = Model(Path(other), shortest=True).check(scope)
            yield scope, result


if __name__ == "__main__":
    raise SystemExit(main())
