"""What all commands share: the application, where the robot is, how to print."""

from __future__ import annotations

import dataclasses
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Annotated

from cyclopts import App, Parameter, Token
from rich.console import Console

import setae
from setae import rig
from setae.config import Config, load
from setae.errors import InputError, SetaeError
from setae.robot import Robot

app = App(
    name="setae",
    help="Drive, probe and simulate a tendon-driven continuum robot with a bristle.",
    version=setae.__version__,
    suppress_keyboard_interrupt=False,  # main() says what became of the robot
)

console = Console(highlight=False)


Flag = Annotated[bool, Parameter(negative="")]


def _whole(kind: object, tokens: Sequence[Token]) -> int:
    del kind
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"{tokens[0].value!r} is no whole number.") from None


Whole = Annotated[int, Parameter(converter=_whole)]
"""A whole number; cyclopts alone rounds 1.5 to 2."""


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """Which robot a command talks to.

    Parameters
    ----------
    sim
        Use the simulator. `--sim python:module:factory` puts another plant into it.
    plugin
        The same as `--sim python:module:factory`.
    plant
        The simulated robot: ideal, paper_like or random:SEED.
    port
        Serial port of the board, such as /dev/ttyACM0. Without it the board is
        found by its USB ids.
    config
        TOML file with what differs from the paper's robot.
    seed
        Seed of the simulator: the same seed gives the same run.
    """

    sim: Annotated[bool, Parameter(negative="")] = False
    plugin: str | None = None
    plant: str | None = None
    port: str | None = None
    config: Path | None = None
    seed: Whole = 0

    @property
    def url(self) -> str | None:
        """For `setae.rig.connect` and `setae.rig.open`."""
        if (self.sim or self.plugin is not None) and self.port is not None:
            raise InputError("--sim and --port exclude each other.", "Give one of them.")
        if self.plant is not None and not self.simulated:
            raise InputError("--plant names a simulated robot.", "Give --sim too.")
        if self.seed < 0:
            raise InputError(f"--seed is {self.seed}.", "Give 0 or more.")
        return self.plugin or ("sim://" if self.sim else self.port)

    @property
    def simulated(self) -> bool:
        """Whether the robot is a simulated one, as also `--port avr://...` names."""
        return self.sim or self.plugin is not None or "://" in (self.port or "")

    @property
    def named_robot(self) -> dict[str, bool]:
        """Whether each option that names a robot to drive is given."""
        return {
            "--sim": self.sim or self.plugin is not None,
            "--plant": self.plant is not None,
            "--port": self.port is not None,
        }

    def load(self) -> Config:
        """The configuration."""
        config = load(self.config)
        return config if self.plant is None else dataclasses.replace(config, plant=self.plant)


def with_plugin(arguments: Sequence[str]) -> list[str]:
    """Arguments with `--sim python:...` written as `--sim --plugin python:...`.

    `--sim` takes no value, otherwise `--sim 15 0 60` could not be told apart.
    """
    result: list[str] = []
    for argument in arguments:
        if argument.startswith("--sim=python:"):
            result += ["--sim", "--plugin", argument.removeprefix("--sim=")]
        elif argument.startswith("python:") and result and result[-1] == "--sim":
            result += ["--plugin", argument]
        else:
            result.append(argument)
    return result


def new_folder(name: str, out: Path | None, *, force: bool) -> Path:
    """The folder to write into, made if need be; by default the next free runs/NAME-N."""
    try:
        if out is None:
            return _next_free(name)
        if out.is_dir() and any(out.iterdir()) and not force:
            raise InputError(
                f"{out} holds files already.", "Give another --out, or --force to write into it."
            )
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SetaeError(
            f"The folder {error.filename} can't be made: {error.strerror}.", "Give another --out."
        ) from error
    return out


def _next_free(name: str) -> Path:
    number = 1
    while True:
        folder = Path("runs") / f"{name}-{number}"
        try:
            folder.mkdir(parents=True)  # not looked for first: two runs may start at once
        except FileExistsError:
            number += 1
        else:
            return folder


class Interrupts:
    """Ctrl-C, noticed where the session waits and nowhere else.

    A KeyboardInterrupt in the middle of the link's bookkeeping could leave it in
    a state in which a stop no longer goes out. So the signal only sets a flag;
    the session's loop polls it at least every 20 ms.
    """

    def __init__(self) -> None:
        self._pending = False

    def poll(self, now_us: int) -> None:
        """Raise KeyboardInterrupt, once for each Ctrl-C."""
        del now_us
        if self._pending:
            self._pending = False
            raise KeyboardInterrupt

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Catch Ctrl-C while this lasts."""

        def note(number: int, frame: FrameType | None) -> None:
            del number, frame
            self._pending = True

        before = signal.signal(signal.SIGINT, note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)


interrupts = Interrupts()


@contextmanager
def connected(where: Where | None, *, leave: rig.Leave) -> Iterator[Robot]:
    """Connect for one command, with Ctrl-C noticed; `leave` as in `setae.rig.connect`."""
    where = where or Where()
    with (
        interrupts.caught(),
        rig.connect(
            where.url,
            config=where.load(),
            seed=where.seed,
            leave=leave,
            pollables=[interrupts],
        ) as robot,
    ):
        yield robot
