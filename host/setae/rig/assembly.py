"""Connecting, and the rig: a robot, the arm that carries it, and their log."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, TypeAlias
from urllib.parse import parse_qsl, urlsplit

import setae
from setae.arc import positive
from setae.config import Config, load
from setae.errors import InputError, LogError
from setae.link.serial_transport import SerialTransport
from setae.link.session import Pollable, Session
from setae.link.transport import Transport
from setae.record import Recorder
from setae.rig.log import RigLog
from setae.rig.ports import find_port
from setae.robot import Robot
from setae.scene import Scene, tube_scene
from setae.sim import (
    Follower,
    SimTransport,
    SimulatedStage,
    SimulationError,
    World,
    add_solid,
    boards,
    plants,
    plugin,
)
from setae.stage import ManualStage, Stage
from setae.stopping import stop_all
from setae.ur import UrStage
from setae_protocol.messages import PROTOCOL_VERSION

__all__ = [
    "Leave",
    "Rig",
    "connect",
    "open",
    "simulator_parameters",
    "simulator_version",
    "try_simulator",
]

Leave: TypeAlias = Literal["relax", "hold"]

# ------------------------------------------------------------------------ connecting


def connect(
    url: str | None = None,
    *,
    config: Config | None = None,
    seed: int = 0,
    leave: Leave = "relax",
    pollables: Sequence[Pollable] = (),
) -> Robot:
    """Connect to a robot and give its board the configuration's limits.

    Parameters
    ----------
    url
        ``sim://`` for the simulator, ``sim://?seed=3&speed=1`` for one of that seed in
        real time, ``python:module:factory`` for the simulator with
        another plant (`setae.sim.plugin`), a serial port such as ``/dev/ttyACM0``,
        or None to find the board by its USB ids.
    config
        The robot; None: the paper's.
    seed
        Seed of the simulator.
    leave
        What the end of a ``with`` block does to a robot that holds.
    pollables
        Looked at whenever the session waits.

    Returns
    -------
    Robot
        Use it as a context manager.

    Raises
    ------
    PortNotFoundError, PortBusyError, BoardSilentError, ProtocolMismatchError
        Why there is no connection, and what to do.

    Examples
    --------
    >>> with connect("sim://") as robot:
    ...     robot.enable()
    ...     robot.move_to((0, 0, 60))
    ...     round(float(robot.position_mm[2]), 1)
    60.0
    """
    return open(url, config=config, seed=seed, leave=leave, pollables=pollables).robot


def open(  # noqa: A001  # rig.open() is what it does
    url: str | None = None,
    *,
    config: Config | None = None,
    seed: int = 0,
    scene: Scene | None = None,
    stage: Stage | str | None = None,
    leave: Leave = "relax",
    pollables: Sequence[Pollable] = (),
) -> Rig:
    """Connect to a robot with its arm.

    Parameters
    ----------
    url, config, seed, leave, pollables
        As in `connect`.
    scene
        What the simulated robot hangs in; None: the empty tube. A real robot
        hangs in what is there; the scene then only goes into the log.
    stage
        The arm, or ``ur://ADDRESS`` for a UR arm (`setae.ur.UrStage`). None: the
        simulated one, or for a real robot a person (`setae.stage.ManualStage`). A
        simulated robot on a real arm lives in real time, and the simulated arm follows
        the real one.

    Returns
    -------
    Rig
        Use it as a context manager.
    """
    if leave not in ("relax", "hold"):
        raise InputError(f"leave is {leave!r}.", "It must be 'relax' or 'hold'.")
    config = config or load()
    scene = scene or tube_scene(config)
    if isinstance(stage, str):
        with ExitStack() as undo:
            arm = undo.enter_context(UrStage(stage, config))
            opened = _open(url, config, seed, scene, arm, leave, pollables, arm_is_real=True)
            opened.closes(undo.pop_all())
            return opened
    return _open(url, config, seed, scene, stage, leave, pollables, arm_is_real=False)


def _open(
    url: str | None,
    config: Config,
    seed: int,
    scene: Scene,
    stage: Stage | None,
    leave: Leave,
    pollables: Sequence[Pollable],
    *,
    arm_is_real: bool,
) -> Rig:
    followers: list[Pollable] = []
    if url is not None and url.startswith(("sim://", plugin.PREFIX)):
        foreign = url if url.startswith(plugin.PREFIX) else None
        asked = {} if foreign else _asked(url)
        seed = _seed(asked.get("seed", str(seed)))
        speed = _speed(asked["speed"]) if "speed" in asked else None
        world = _world(config, scene, seed, foreign)
        transport: Transport = SimTransport(world, speed=1.0 if arm_is_real else speed)
        if stage is not None and arm_is_real:
            followers.append(Follower(world, stage))
        stage = stage or SimulatedStage(world, config.stage)
        session_id: int | None = seed % 255 + 1
    elif url is not None and "://" in url:
        foreign = None
        world = _world(config, scene, seed)
        transport = boards.connect(url, world)
        stage = stage or SimulatedStage(world, config.stage)
        session_id = seed % 255 + 1
    else:
        world = None
        transport = SerialTransport(url or find_port())
        stage = stage or ManualStage()
        session_id = None
    session = Session(transport, session_id=session_id, pollables=[stage, *followers, *pollables])
    try:
        session.open()
        robot = Robot(session, config, leave=leave)
        robot.prepare()
    except BaseException:
        session.close()
        raise
    if world is None:
        return Rig(robot, stage, scene, None, None)
    return Rig(robot, stage, scene, seed, world, foreign or plants.resolve(config.plant, seed))


def simulator_parameters(config: Config, seed: int) -> dict[str, float]:
    """The named plant's, and what the configuration says itself above them."""
    return {**plants.parameters(config.plant, seed), **dict(config.simulator)}


def _asked(url: str) -> dict[str, str]:
    """What a simulator's URL asks for, such as sim://?seed=3&speed=1."""
    parts = urlsplit(url)
    asked = dict(parse_qsl(parts.query, keep_blank_values=True))
    unknown = sorted(asked.keys() - {"seed", "speed"})
    if unknown or parts.netloc or parts.path:
        raise InputError(
            f"The simulator's URL {url!r} asks for what there is not.",
            "Give sim://, or sim://?seed=3&speed=1: speed 1 is real time.",
        )
    return asked


def _speed(text: str) -> float:
    try:
        return positive("speed", float(text))
    except ValueError:
        raise InputError(
            f"The simulator's speed is {text!r}.", "Give a number above 0; 1 is real time."
        ) from None


def _seed(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = -1
    if number < 0:
        raise InputError(f"The simulator's seed is {text!r}.", "Give 0 or a whole number above.")
    return number


def _world(config: Config, scene: Scene, seed: int, foreign: str | None = None) -> World:
    world = World(
        seed=seed,
        parameters=simulator_parameters(config, seed),
        plant=plugin.make(foreign, config, seed) if foreign else None,
    )
    for solid in scene.solids:
        add_solid(world, solid)
    world.start((0.0, 0.0, 0.0))
    return world


def try_simulator(config: Config, seed: int = 0) -> None:
    """Make a simulated robot, and drop it: so that what it can't have is told beforehand.

    A spring that finds no equilibrium is not: its values are in range, and a run says so itself.

    Raises
    ------
    InputError
        There is no such plant or parameter, or a value is out of range.
    SimulatorMissingError
        The simulator isn't part of this installation.
    """
    with suppress(SimulationError):
        _world(config, tube_scene(config), seed).close()


def simulator_version() -> str:
    """Say that the compiled simulator is there, by stepping one world.

    Raises
    ------
    SimulatorMissingError
        It isn't part of this installation.
    """
    config = load()
    world = _world(config, tube_scene(config), seed=0)
    world.run(1_000)
    return "compiled in, runs"


# ------------------------------------------------------------------------------- rig


class Rig:
    """A robot, the arm that carries it, and where both are logged.

    Attributes
    ----------
    robot : Robot
    stage : Stage
    scene : Scene
    seed : int or None
        Of the simulator; None for a real robot.
    plant : str or None
        Name of the simulated robot, or the plug-in's; None for a real robot.
    world : World or None
        The simulated world, to look at its truth; None for a real robot.
    """

    def __init__(
        self,
        robot: Robot,
        stage: Stage,
        scene: Scene,
        seed: int | None,
        world: World | None,
        plant: str | None = None,
    ) -> None:
        self.robot = robot
        self.stage = stage
        self.scene = scene
        self.seed = seed
        self.plant = plant
        self.world = world
        self._log: RigLog | None = None
        self._open = ExitStack()

    def closes(self, context: ExitStack) -> None:
        """Have this left together with the rig, last."""
        self._open.push(context)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with self._open:
            try:
                if error is not None:
                    stop_all(error, self.stage.stop)
                self.robot.__exit__(kind, error, traceback)
            finally:
                # After it, so that the log holds how the robot was left.
                self._close_log(error)

    def _close_log(self, error: BaseException | None) -> None:
        if self._log is None:
            return
        try:
            self._log.close()
        except LogError as failure:
            if error is None:
                raise
            error.add_note(f"Closing the log failed too: {failure}")

    def record(self, path: Path | str, *, metadata: Mapping[str, Any] | None = None) -> Recorder:
        """Log everything from now on, until the rig is left.

        Parameters
        ----------
        path
            The log to make; it must not exist.
        metadata
            Added to what the rig says of itself: configuration, seed, versions,
            scene.

        Returns
        -------
        Recorder
            For an experiment's own events.
        """
        if self._log is not None:
            raise LogError(
                f"{self._log.recorder.path} is being written already.", "A rig has one log."
            )
        about = {**self._metadata(), **(metadata or {})}
        self._log = RigLog(self.robot, self.stage, self.world, Recorder(path, metadata=about))
        return self._log.recorder

    def _metadata(self) -> dict[str, Any]:
        about = self.scene.describe()
        return {
            "simulated": self.world is not None,
            "seed": self.seed,
            "plant": self.plant,
            "plant_parameters": None
            if self.seed is None
            else simulator_parameters(self.robot.config, self.seed),
            "config": self.robot.config.to_toml(),
            "versions": {
                "setae": setae.__version__,
                "firmware": self.robot.firmware_version,
                "protocol": str(PROTOCOL_VERSION),
                "numpy": importlib.metadata.version("numpy"),
            },
            **about,
            "scene": {**about["scene"], "arm_start_mm": list(self.stage.position_mm)},
        }
