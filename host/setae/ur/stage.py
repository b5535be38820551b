"""A UR arm as a `setae.stage.Stage`.

Nothing here waits for the arm: moves are started and then watched. The library lives in a
process of its own (`setae.ur.process`), and the age of the controller's state is what
tells that it lives.
"""

from __future__ import annotations

import contextlib
import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import ClassVar, Final, Self
from urllib.parse import urlsplit

from setae.config import Config, load
from setae.errors import (
    ArmBoxError,
    ArmFrozenError,
    ArmStoppedError,
    InputError,
    StageError,
)
from setae.stage import checked_move
from setae.ur.controller import REST_MM_S, STOPPED, ArmState, check
from setae.ur.pose import WorldFrame
from setae.ur.process import ArmProcess, Job
from setae.ur.watch import Watch

__all__ = ["SCHEME", "UrStage"]

SCHEME: Final = "ur://"

_CONNECT_TIMEOUT_S: Final = 15.0
_GOODBYE_TIMEOUT_S: Final = 3.0
_STATE_POLL_S: Final = 0.002
# Arrived: this near, this slow. The controller itself is ten times as exact.
_NEAR_MM: Final = 0.2
# At rest this long away from its target, the arm was stopped by something else.
_STUCK_S: Final = 1.0
_KICKS_PER_PERIOD: Final = 8
# The watchdog's period, less what the controller may count otherwise.
_STARVED: Final = 0.9


@dataclass(slots=True)
class _Move:
    target_mm: tuple[float, float, float]
    job: Job
    resting_since_s: float | None = None


class UrStage:
    """A stage that is a UR arm, connected when it is made.

    The world begins where frame D is then: its origin is D's, x is D's x axis, z points
    up. The arm keeps its orientation.

    Parameters
    ----------
    url
        ``ur://ADDRESS``.
    config
        Section ``[ur]`` and the speeds of ``[stage]``.
    clock
        Seconds, real ones: the controller lives in them.

    Raises
    ------
    ArmUnreachableError, ArmRemoteError, ArmModeError, ArmSafetyError
        Why the arm can't be driven, and what to do.
    ArmBoxError
        Frame D is outside the box now.
    StageError
        Frame D doesn't hang straight down, or this program drives the arm already.
    ExtraMissingError
        ur-rtde isn't installed.

    Warns
    -----
    UserWarning
        The box is the default one.
    """

    _driven: ClassVar[set[str]] = set()  # a controller takes one host

    def __init__(
        self, url: str, config: Config, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        host = urlsplit(url).hostname if url.startswith(SCHEME) else None
        if not host:
            raise InputError(f"{url!r} names no arm.", "Give ur:// and its address: ur://10.0.0.7")
        self.name = f"{SCHEME}{host}"
        self._config = config
        self._settings = config.ur
        self._clock = clock
        self._failure: StageError | None = None
        self._lost = False  # it tells nothing, or answers no more: a brake won't reach it
        self._closed = False
        self._host = host
        if host in self._driven:
            raise StageError(
                f"This program drives the arm at {host} already.",
                "Close the earlier stage first: `stage.close()`.",
            )
        self._process = ArmProcess(host, config.ur, clock)
        self._driven.add(host)
        self._watch = Watch(lambda: self._process.told_s, clock)
        self._connecting = self._process.submit("connecting", "connect")
        try:
            self._connecting.wait(_CONNECT_TIMEOUT_S)
            self._state = self._settled_state()
            self._world = WorldFrame.at(self._state.pose)
            self._require_straight()
            self._require_inside(self._state.pose[:3], "Frame D is")
            self._warn_of_no_box()
            self._watch.start()
        except BaseException:
            self.close()
            raise
        self._move: _Move | None = None
        self._braking: Job | None = None
        self._kick: Job | None = None
        self._fed_s = self._unfed_s = 0.0

    def _settled_state(self) -> ArmState:
        """A state in which frame D is what the configuration says: two states on."""
        end_s = self._clock() + self._settings.command_deadline_s
        told_s: set[float | None] = {None}
        while len(told_s) <= 3:
            if self._process.ended is not None:
                raise ArmFrozenError(self._process.ended)
            if self._clock() > end_s:
                raise ArmFrozenError("The arm's controller answers, but does not tell its state.")
            time.sleep(_STATE_POLL_S)
            told_s.add(self._process.told_s)
        return self._process.state

    def _require_straight(self) -> None:
        tilt_deg = math.degrees(self._world.tilt_rad)
        if tilt_deg > self._settings.tilt_max_deg:
            raise StageError(
                f"Frame D is {tilt_deg:.1f}° off straight down, and"
                f" {self._settings.tilt_max_deg:g}° are allowed.",
                "Turn the flange with the pendant, or correct frame_d_rotation_deg in [ur].",
            )

    def _require_inside(self, base_mm: Sequence[float], what: str) -> None:
        limits = zip(
            "xyz", base_mm, self._settings.box_min_mm, self._settings.box_max_mm, strict=True
        )
        for axis, value_mm, low_mm, high_mm in limits:
            if not low_mm <= value_mm <= high_mm:
                raise ArmBoxError(
                    f"{what} at {axis} = {value_mm:.1f} mm in the arm's base frame; the box goes"
                    f" from {low_mm:g} to {high_mm:g} mm."
                )

    def _warn_of_no_box(self) -> None:
        default, settings = load().ur, self._settings
        if (settings.box_min_mm, settings.box_max_mm) == (default.box_min_mm, default.box_max_mm):
            warnings.warn(
                "The arm has no box of yours: it may carry the robot wherever it reaches, whatever"
                " stands there. Set box_min_mm and box_max_mm in [ur] to what is free.",
                stacklevel=2,
            )

    # ---------------------------------------------------------------------------- stage

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Where the origin of frame D was when the controller last told."""
        return self._world.to_world_mm(self._state.pose[:3])

    @property
    def moving(self) -> bool:
        """True from `move_to` until the arm is at its target, or rests after `stop`."""
        return self._move is not None or self._braking is not None

    @property
    def state_age_s(self) -> float:
        """For how long the host has watched without a new state, also between two polls."""
        return self._watch.unseen_s

    def base_mm(self, position_mm: Sequence[float]) -> tuple[float, float, float]:
        """A point of the world in the arm's base frame, as the pendant shows it, (3,)."""
        x_mm, y_mm, z_mm = self._world.to_base_mm(position_mm).tolist()
        return (x_mm, y_mm, z_mm)

    def require_reachable(self, position_mm: Sequence[float]) -> None:
        """Raise ArmBoxError where a target in the world lies outside the box."""
        self._require_inside(self.base_mm(position_mm), "The target is")

    def move_to(
        self,
        position_mm: Sequence[float],
        *,
        speed_mm_s: float | None = None,
        acceleration_mm_s2: float | None = None,
    ) -> None:
        """Start a straight move; returns at once.

        Parameters
        ----------
        position_mm
            Target of frame D's origin in the world, (3,).
        speed_mm_s, acceleration_mm_s2
            Bounds of the move; None takes those of ``[stage]``.

        Raises
        ------
        ArmBoxError
            The target lies outside the box.
        ArmFrozenError, ArmSafetyError, ArmModeError, ArmStoppedError
            It has failed since it was polled last.
        StageError
            The arm is moving, has failed before, or a value is no good.
        """
        if self._failure is not None:
            raise self._failure
        self.poll(0)
        move = checked_move(position_mm, speed_mm_s, acceleration_mm_s2, self._config.stage)
        if self.moving:
            raise StageError("The arm is moving already.", "Wait for it, or stop it first.")
        self.require_reachable(move.target_mm)
        pose = [*self.base_mm(move.target_mm), *self._state.pose[3:]]
        job = self._process.submit("a move", "move", pose, move.speed_mm_s, move.acceleration_mm_s2)
        self._move = _Move(move.target_mm, job)
        self._fed_s, self._unfed_s = job.submitted_s, 0.0

    def stop(self) -> None:
        """Brake now; returns without waiting for rest.

        Raises
        ------
        ArmFrozenError
            What `poll` raised: the controller is lost, and its own watchdog is what stops the arm.
            One that only failed at a call is braked.
        """
        if self._failure is not None and self._lost:
            raise self._failure
        self._move = None
        deceleration = self._config.stage.acceleration_mm_s2
        braking = self._process.submit("a stop", "brake", deceleration)
        # Once the arm has failed, nobody looks at what becomes of it.
        self._braking = braking if self._failure is None else None

    def poll(self, now_us: int) -> None:
        """Look at the arm; never waits.

        Raises
        ------
        ArmFrozenError, ArmSafetyError, ArmModeError, ArmStoppedError, StageError
            What has failed; once. After that `move_to` raises it.
        """
        del now_us  # the controller lives in real time, also beside a simulated robot
        if self._failure is not None:
            return
        try:
            self._look()
        except StageError as failure:
            self._failure = failure
            self._lost = self._lost or self._process.ended is not None
            self._move = self._braking = None
            raise

    def _look(self) -> None:
        now_s = self._clock()
        if self._process.ended is not None:
            raise self._lose(self._process.ended)
        self._state = state = self._process.state
        unseen_s = self._watch.unseen_s
        if unseen_s > self._settings.state_age_s:
            raise self._lose(f"The arm's controller has told nothing for {unseen_s:.2f} s.")
        check(state)
        if self.moving:
            self._unfed_s = max(self._unfed_s, now_s - self._fed_s)
        if not state.program_runs:
            raise self._program_ended()
        self._feed_watchdog(now_s)
        if self._braking is not None:
            self._watch_braking(self._braking, now_s)
        if self._move is not None:
            self._watch_move(self._move, now_s)

    def _program_ended(self) -> ArmStoppedError:
        # At rest its watchdog is fed by the process, however long the host thinks.
        if self.moving and self._unfed_s > _STARVED / self._settings.watchdog_hz:
            return ArmStoppedError(
                f"The controller's watchdog stopped the arm: for {self._unfed_s:.2f} s of its move"
                " this host gave no sign of life.",
                "Close this stage, connect anew, and poll while it moves, as `Robot.wait` does.",
            )
        if self._move is None:
            return ArmStoppedError(f"{STOPPED}.")
        left_mm = math.dist(self.position_mm, self._move.target_mm)
        return ArmStoppedError(f"{STOPPED}, {left_mm:.1f} mm before its target.")

    def _feed_watchdog(self, now_s: float) -> None:
        if self._kick is not None:
            if not self._kick.done:
                return
            self._kick.check()
            if now_s - self._fed_s < 1 / (_KICKS_PER_PERIOD * self._settings.watchdog_hz):
                return
        self._kick = self._process.submit("a sign of life", "kick_watchdog")
        self._fed_s = self._kick.submitted_s

    def _watch_braking(self, braking: Job, now_s: float) -> None:
        if self._taken(braking, now_s) and self._state.speed_mm_s < REST_MM_S:
            self._braking = None
            self._process.submit("rest", "rest")

    def _watch_move(self, move: _Move, now_s: float) -> None:
        if not self._taken(move.job, now_s):
            return
        left_mm = math.dist(self.position_mm, move.target_mm)
        if self._state.speed_mm_s >= REST_MM_S:
            move.resting_since_s = None
        elif left_mm < _NEAR_MM:
            self._move = None
            self._process.submit("rest", "rest")
        elif move.resting_since_s is None:
            move.resting_since_s = now_s
        elif now_s - move.resting_since_s > _STUCK_S:
            raise ArmStoppedError(
                f"The arm rests {left_mm:.1f} mm before its target: the speed slider may be at"
                " zero."
            )

    def _taken(self, job: Job, now_s: float) -> bool:
        """Whether the controller took a command; raises where it takes too long, or failed."""
        if job.done:
            job.check()
            return True
        if now_s - job.submitted_s > self._settings.command_deadline_s:
            raise self._lose(
                f"The arm's controller did not take {job.what} within"
                f" {self._settings.command_deadline_s:g} s."
            )
        return False

    def _lose(self, why: str) -> ArmFrozenError:
        self._lost = True
        self._process.kill()  # the library would look for the controller for ever
        return ArmFrozenError(why)

    # -------------------------------------------------------------------------- closing

    def close(self) -> None:
        """Let go of the arm; it stays where it is. Closing twice is fine."""
        if self._closed:
            return
        self._closed = True
        if self._failure is None:
            self._failure = StageError("The arm was let go of.", "Connect to it again.")
        try:
            self._watch.close()
            if self._connecting.done and not self._lost:  # else it does not answer
                with contextlib.suppress(StageError, RuntimeError):
                    self._process.submit("goodbye", "close").wait(_GOODBYE_TIMEOUT_S)
        finally:  # also after a Ctrl-C: nobody closes it a second time
            self._process.close()
            self._driven.discard(self._host)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
