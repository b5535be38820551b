"""Puts a robot together: board or simulator, arm, log.

`connect` gives a `setae.robot.Robot`. `open` gives a `Rig`: robot and arm, and
what is simulated of them shares one world with one clock. Nothing else in the
package knows whether anything is simulated.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, TypeAlias
from urllib.parse import parse_qs, urlsplit

import numpy as np
from serial.tools import list_ports

import setae
from setae.config import Config, load
from setae.errors import InputError, LogError, PortNotFoundError, StageError
from setae.link.events import Event, FaultReported, Refused, TelemetryReceived, Tripped
from setae.link.serial_transport import SerialTransport
from setae.link.session import Pollable, Session
from setae.link.transport import Transport
from setae.record import Recorder
from setae.robot import Robot
from setae.scene import Scene, tube_scene
from setae.sim import (
    Follower,
    SimTransport,
    SimulatedStage,
    World,
    add_solid,
    boards,
    plants,
    plugin,
)
from setae.stage import ManualStage, Stage
from setae.ur import UrStage
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    PROTOCOL_VERSION,
    PULSE_TICKS_PER_US,
    Guard,
    MessageType,
    TripCause,
)

__all__ = ["Leave", "PortInfo", "Rig", "connect", "find_port", "open", "plants", "ports"]

Leave: TypeAlias = Literal["relax", "hold"]

# USB vendor and product of a UNO, its clones (CH340) and FTDI's adapters.
_USB_IDS = {
    (0x2341, 0x0043), (0x2341, 0x0001), (0x2341, 0x0243), (0x2A03, 0x0043),
    (0x1A86, 0x7523), (0x0403, 0x6001),
}  # fmt: skip

_STAGE_PERIOD_US = 40_000
_TRUTH_FRAMES = 2


# ---------------------------------------------------------------------------- ports


@dataclass(frozen=True, slots=True, kw_only=True)
class PortInfo:
    """A serial port of this computer.

    Attributes
    ----------
    device
        Its name, such as /dev/ttyACM0.
    description
        What the system says of it.
    likely
        Whether its USB ids are those of a UNO or of a usual clone.
    """

    device: str
    description: str
    likely: bool


def ports() -> list[PortInfo]:
    """List the serial ports, by name."""
    return sorted(
        (
            PortInfo(
                device=port.device,
                description=port.description or "",
                likely=(port.vid, port.pid) in _USB_IDS,
            )
            for port in list_ports.comports()
        ),
        key=lambda port: port.device,
    )


def find_port() -> str:
    """Find the one port with a board.

    Raises
    ------
    PortNotFoundError
        There is none, or more than one; the message lists the ports.
    """
    there = ports()
    likely = [port.device for port in there if port.likely]
    if len(likely) == 1:
        return likely[0]
    if likely:
        raise PortNotFoundError(
            f"{len(likely)} ports may hold the board: {', '.join(likely)}.",
            "Choose one with --port, or connect(port).",
        )
    others = ", ".join(port.device for port in there) or "none at all"
    raise PortNotFoundError(
        f"No port has the USB ids of a UNO; ports here: {others}.",
        "Plug the board in, name its port with --port, or use the simulator: --sim.",
    )


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
        ``sim://`` for the simulator, ``python:module:factory`` for the simulator with
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
        seed = seed if foreign else _seed(url, seed)
        world = _world(config, scene, seed, foreign)
        transport: Transport = SimTransport(world, speed=1.0 if arm_is_real else None)
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


def _seed(url: str, seed: int) -> int:
    """The seed: the URL's own, such as sim://?seed=3, or the given one."""
    text = parse_qs(urlsplit(url).query).get("seed", [str(seed)])[-1]
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
        self._log: _Log | None = None
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
        try:
            if error is not None:
                self._stop_stage(error)
            self.robot.__exit__(kind, error, traceback)
        finally:
            # After it, so that the log holds how the robot was left.
            self._close_log(error)
            self._open.close()

    def _stop_stage(self, error: BaseException) -> None:
        try:
            self.stage.stop()
        except StageError as failure:
            error.add_note(f"Stopping the arm failed too: {failure}")

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
            raise LogError(f"{self._log.recorder.path} is being written already.")
        about = {**self._metadata(), **(metadata or {})}
        self._log = _Log(self, Recorder(path, metadata=about))
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


class _Log:
    """Writes what the link, the arm and the simulator tell into a recorder."""

    def __init__(self, rig: Rig, recorder: Recorder) -> None:
        self.recorder = recorder
        self._rig = rig
        self._robot = rig.robot
        self._stage_due_us = 0
        self._stage_moving: bool | None = None
        self._frames = 0
        self._robot.on_command = self._on_command
        self._unsubscribe = self._robot.session.subscribe(self._on_event)

    def close(self) -> None:
        self._detach()
        self.recorder.close()

    def _detach(self) -> None:
        self._unsubscribe()
        self._robot.on_command = None

    def _on_command(self, name: str, args: Mapping[str, Any]) -> None:
        with self._told_once():
            self.recorder.command(self._robot.now_us, name, args)

    def _on_event(self, event: Event) -> None:
        with self._told_once():
            self._write(event)

    @contextmanager
    def _told_once(self) -> Iterator[None]:
        """A full disk is told once. The robot still has to be stopped, and that comes by here."""
        try:
            yield
        except LogError:
            self._detach()
            raise

    def _write(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self._telemetry(event)
        elif isinstance(event, Tripped):
            self._trip(event)
        elif isinstance(event, FaultReported):
            fault = event.record
            self.recorder.fault(
                event.time_us,
                record_id=fault.record_id,
                fault=fault.fault.name.lower(),
                detail=fault.detail,
                pulse_us=np.array(fault.pulse_ticks) / PULSE_TICKS_PER_US,
            )
        elif isinstance(event, Refused):
            refusal = event.record
            self.recorder.refusal(
                event.time_us,
                record_id=refusal.record_id,
                command=MessageType(refusal.command_type).name.lower(),
                reason=refusal.reason.name.lower(),
                index=refusal.index,
                value=refusal.value,
                limit=refusal.limit,
            )

    def _telemetry(self, event: TelemetryReceived) -> None:
        telemetry = event.telemetry
        baseline_hpa = telemetry.baseline_raw / PRESSURE_LSB_PER_HPA
        pulses_us = [
            ticks / PULSE_TICKS_PER_US if telemetry.attached >> index & 1 else 0.0
            for index, ticks in enumerate(telemetry.pulse_ticks)
        ]
        # By the board's own time: the line's delays don't belong into the log.
        time_us = self._robot.host_time_us(telemetry.frame, telemetry.phase_us)
        self.recorder.telemetry(
            time_us,
            frame=telemetry.frame,
            state=event.state.name.lower(),
            epoch=event.epoch,
            pulse_us=pulses_us,
            guard=telemetry.guard.name.lower(),
            reflex_running=bool(telemetry.reflex_running),
            queued=telemetry.queued,
            baseline_hpa=baseline_hpa,
        )
        for sample in telemetry.samples[: telemetry.sample_count]:
            self.recorder.pressure(
                time_us - sample.age_us,
                pressure_hpa=sample.pressure_raw / PRESSURE_LSB_PER_HPA,
                baseline_hpa=baseline_hpa,
                armed=telemetry.guard is Guard.ARMED,
            )
        self._stage(event.time_us)
        self._frames += 1
        if self._rig.world is not None and self._frames % _TRUTH_FRAMES == 0:
            self._truth(self._rig.world)

    def _trip(self, event: Tripped) -> None:
        record = event.record
        self.recorder.trip(
            event.time_us,
            record_id=record.record_id,
            cause=record.cause.name.lower(),
            sample_time_us=self._robot.host_time_us(record.sample_frame, record.sample_phase_us),
            pressure_hpa=record.pressure_raw / PRESSURE_LSB_PER_HPA,
            baseline_hpa=record.baseline_raw / PRESSURE_LSB_PER_HPA,
            pulse_us=np.array(record.pulse_ticks) / PULSE_TICKS_PER_US,
            contact=None if record.cause is TripCause.DEADLINE else self._robot.contact_of(event),
        )

    def _stage(self, time_us: int) -> None:
        if time_us < self._stage_due_us:
            return
        self._stage_due_us = time_us + _STAGE_PERIOD_US
        stage = self._rig.stage
        moving = stage.moving
        if moving or self._stage_moving is not False:
            self.recorder.stage(time_us, position_mm=stage.position_mm, moving=moving)
        self._stage_moving = moving

    def _truth(self, world: World) -> None:
        truth = world.truth()
        self.recorder.truth(
            truth.time_us,
            backbone_mm=truth.backbone_mm,
            filament_mm=truth.filament_mm,
            arm_mm=truth.arm_mm,
            contact_depth_mm=truth.contact_depth_mm,
            contact_point_mm=np.full(3, np.nan)
            if truth.contact_point_mm is None
            else truth.contact_point_mm,
            tension_n=truth.tension_n,
            pressure_hpa=truth.pressure_hpa,
        )
