"""The arm's controller, through ur-rtde: what is asked of it, and what it tells."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

from setae.config import Ur
from setae.errors import (
    ArmFrozenError,
    ArmModeError,
    ArmRemoteError,
    ArmSafetyError,
    ArmStoppedError,
    ArmUnreachableError,
    ExtraMissingError,
    StageError,
)

__all__ = ["REST_MM_S", "RUNNING", "STOPPED", "ArmState", "Controller", "check"]

REST_MM_S: Final = 1.0
STOPPED: Final = "The arm's program was stopped or paused at the controller"

# Robot modes and safety modes of UR's RTDE guide.
RUNNING: Final = 7
_MODES: Final = {
    -1: "has no safety board", 0: "is disconnected", 1: "waits for a safety confirmation",
    2: "is booting", 3: "is switched off", 4: "is switching on", 5: "has its brakes on",
    6: "is in backdrive", 8: "is updating its firmware",
}  # fmt: skip
_SAFE: Final = (1, 2)  # normal, reduced
_STOPS: Final = {
    3: "It is in protective stop.", 4: "It is in recovery mode.", 5: "A safeguard stop is active.",
    6: "The emergency stop is pressed.", 7: "The robot's emergency stop is pressed.",
    8: "A safety limit was violated.", 9: "Its safety system is in fault.",
}  # fmt: skip

_STATE_HZ: Final = 125.0
_RTDE_PORT: Final = 30004
_CONNECT_TIMEOUT_S: Final = 3.0
# A protective stop ends the program too, and may be told a report later: by then it is known.
_ENDED_S: Final = 0.05
_FIELDS: Final = [
    "timestamp", "actual_TCP_pose", "actual_TCP_speed", "robot_mode", "safety_mode",
    "runtime_state",
]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmState:
    """What the controller last told.

    Attributes
    ----------
    timestamp_s
        The controller's own time; a new state has a new one.
    pose
        Frame D in the base frame: x, y, z in mm, rotation vector in rad; (6,).
    speed_mm_s
        Of frame D's origin.
    robot_mode, safety_mode
        UR's numbers.
    program_runs
        Whether it takes moves. False once it has taken none for 0.05 s.
    """

    timestamp_s: float
    pose: tuple[float, ...]
    speed_mm_s: float
    robot_mode: int
    safety_mode: int
    program_runs: bool


def check(state: ArmState) -> None:
    """Raise ArmModeError or ArmSafetyError where the arm can't move."""
    if state.safety_mode not in _SAFE:
        what = _STOPS.get(state.safety_mode, f"Its safety mode is {state.safety_mode}.")
        raise ArmSafetyError(f"The arm's safety system stopped it. {what}")
    if state.robot_mode != RUNNING:
        what = _MODES.get(state.robot_mode, f"is in mode {state.robot_mode}")
        raise ArmModeError(f"The arm {what}.")


@dataclass(frozen=True, slots=True)
class _Libraries:
    control: ModuleType
    receive: ModuleType
    dashboard: ModuleType


def _load_libraries() -> _Libraries:
    """Import ur-rtde; raises ExtraMissingError where it isn't installed."""
    try:
        import dashboard_client
        import rtde_control
        import rtde_receive
    except ImportError as error:
        raise ExtraMissingError("ur", "Driving a UR arm") from error
    return _Libraries(rtde_control, rtde_receive, dashboard_client)


class Controller:
    """A UR controller. Every method but `state` may hang, some with Python's lock held.

    So it lives in a process of its own (`setae.ur.child`).

    Parameters
    ----------
    host
        Its address.
    settings
        Frame D on the flange, payload and watchdog.
    """

    def __init__(self, host: str, settings: Ur) -> None:
        self._host = host
        self._settings = settings
        self._receive: Any = None
        self._control: Any = None
        self._moves = self._braked = False
        self._ended_s: float | None = None

    def connect(self) -> None:
        """Connect, check that the arm may move, and tell it what it carries.

        Raises
        ------
        ExtraMissingError
            ur-rtde isn't installed.
        ArmUnreachableError, ArmRemoteError, ArmModeError, ArmSafetyError
            Why it can't be driven.
        """
        libraries = _load_libraries()
        # The library itself waits far longer, and says less.
        try:
            socket.create_connection((self._host, _RTDE_PORT), _CONNECT_TIMEOUT_S).close()
        except OSError as error:
            raise ArmUnreachableError(
                f"No UR controller answers at {self._host}: {error.strerror or error}."
            ) from error
        self._require_remote(libraries)
        self._receive = self._call(
            "the state",
            lambda: libraries.receive.RTDEReceiveInterface(self._host, _STATE_HZ, _FIELDS),
            ArmUnreachableError,
        )
        check(self.state())
        self._control = self._call(
            "control",
            lambda: libraries.control.RTDEControlInterface(self._host, _STATE_HZ),
            ArmUnreachableError,
        )
        self._call("its load", self._prepare)

    def _require_remote(self, libraries: _Libraries) -> None:
        dashboard = libraries.dashboard.DashboardClient(self._host)
        try:
            dashboard.connect(int(_CONNECT_TIMEOUT_S * 1000))
            remote = dashboard.isInRemoteControl()
        except RuntimeError as error:
            raise ArmUnreachableError(
                f"The dashboard of the controller at {self._host} does not answer: {error}."
            ) from error
        finally:
            dashboard.disconnect()
        if not remote:
            raise ArmRemoteError(f"The controller at {self._host} is in local control.")

    def _prepare(self) -> None:
        settings = self._settings
        rotation_rad = [math.radians(angle) for angle in settings.frame_d_rotation_deg]
        self._control.setTcp([*(value / 1000 for value in settings.frame_d_mm), *rotation_rad])
        self._control.setPayload(
            settings.payload_kg, [value / 1000 for value in settings.payload_centre_mm]
        )
        self._control.setWatchdog(settings.watchdog_hz)

    def _call(
        self, what: str, call: Callable[[], Any], kind: type[StageError] = ArmFrozenError
    ) -> Any:
        try:
            return call()
        except RuntimeError as error:
            raise kind(f"The controller at {self._host} failed at {what}: {error}.") from error

    def state(self) -> ArmState:
        """What the controller last told; never waits.

        Raises
        ------
        ArmFrozenError
            The library has no state.
        """
        state: ArmState = self._call("its state", self._read_state)
        return state

    def _read_state(self) -> ArmState:
        receive = self._receive
        x, y, z, *turn = receive.getActualTCPPose()
        return ArmState(
            timestamp_s=receive.getTimestamp(),
            pose=(1000 * x, 1000 * y, 1000 * z, *turn),
            speed_mm_s=1000 * math.hypot(*receive.getActualTCPSpeed()[:3]),
            robot_mode=receive.getRobotMode(),
            safety_mode=receive.getSafetyMode(),
            program_runs=self._control is not None and not self._program_has_ended(),
        )

    def _program_has_ended(self) -> bool:
        now_s = time.monotonic()
        if self._control.isProgramRunning():
            self._ended_s = None
            return False
        ended_s = self._ended_s  # once: the thread that watches asks too
        if ended_s is None:
            self._ended_s = ended_s = now_s
        return now_s - ended_s > _ENDED_S

    @property
    def timestamp_s(self) -> float:
        """Of the last state; never waits. Raises ArmFrozenError where there is none."""
        timestamp_s: float = self._call("its state", lambda: self._receive.getTimestamp())
        return timestamp_s

    @property
    def rests(self) -> bool:
        """Whether there is nothing that the watchdog would have to stop."""
        if self._braked and self.state().speed_mm_s < REST_MM_S:
            self.rest()
        return self._control is not None and not self._moves

    def rest(self) -> None:
        """The arm has arrived: until the next move it needs nobody who looks after it."""
        self._moves = self._braked = False

    def kick_watchdog(self) -> None:
        """Tell the controller that the host lives."""
        self._call("a sign of life", self._control.kickWatchdog)

    def move(self, pose: Sequence[float], speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """Start a straight move of frame D; x, y, z in mm, rotation vector in rad.

        Raises
        ------
        ArmStoppedError
            The program has ended. It is never started again by itself: nobody can know why
            somebody stopped it.
        StageError
            The controller did not take it.
        """
        self._require_program()
        self._moves, self._braked = True, False
        target = [*(value / 1000 for value in pose[:3]), *pose[3:]]
        taken = self._call(
            "a move",
            lambda: self._control.moveL(target, speed_mm_s / 1000, acceleration_mm_s2 / 1000, True),
        )
        if not taken:
            self._require_program()
            raise StageError("The arm's controller refused the move.", "Look at the pendant.")

    def _require_program(self) -> None:
        if not self._call("its program", self._control.isProgramRunning):
            raise ArmStoppedError(f"{STOPPED}.")

    def brake(self, deceleration_mm_s2: float) -> None:
        """Start braking."""
        self._call("a stop", lambda: self._control.stopL(deceleration_mm_s2 / 1000, True))
        self._braked = True

    def close(self) -> None:
        """End the program on the controller; the connections end with the process."""
        if self._control is not None:
            self._control.stopScript()
