"""The robot as a program uses it: moves, probes, stops.

A `Robot` has no clock and no thread. Every call that takes time waits in the
session's one loop, with a deadline, and raises what went wrong with what to do.
The board keeps the robot safe on its own; nothing here is needed for that.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from setae import contact as contacts
from setae import kinematics, servo, trajectory, workspace
from setae.arc import Arc, finite_array
from setae.board import REPLY_S, Board, Ticks, name_of
from setae.config import Config
from setae.contact import Contact
from setae.errors import (
    ConfigError,
    DeadlineError,
    InputError,
    PoseUnknownError,
    TrajectoryError,
    UnreachableError,
)
from setae.link.events import (
    Tripped,
)
from setae.link.session import Session, refused_error
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    SERVO_FRAME_US,
    Disarm,
    Enable,
    Guard,
    GuardMessage,
    HelloReply,
    Limits,
    Limp,
    Reflex,
    Refusal,
    RefusalMessage,
    Relax,
    Resume,
    Segment,
    SetLimits,
    State,
    Telemetry,
    TripCause,
)

__all__ = ["Contact", "Robot"]

_FRAME_S = SERVO_FRAME_US / 1e6
# After a motion the spring and the bristle swing on, and the servos lag.
_SETTLE_S = 0.16
# Attempts at a baseline; a bristle that swings gives a noisy one.
_TARE_ATTEMPTS = 4
_TARE_S = 0.5
_RETRIED = (Refusal.TARE_NOISY, Refusal.TARE_FAR)
_GUARD_FRAMES_MAX = 0xFFFF
# What the board has of a motion, in servo frames: a second, which it goes on without the host.
_AHEAD_FRAMES = 50

# Half a second of work, and the same for every robot of a configuration.
_board_limits = lru_cache(maxsize=8)(servo.board_limits)

OnCommand = Callable[[str, Mapping[str, Any]], None]


class Robot:
    """One robot, reached through an open session.

    As a context manager it leaves the robot safe: after an exception it stops
    (the servos hold, nothing is released); otherwise it relaxes slowly, or
    holds where `leave` is ``"hold"``.

    Parameters
    ----------
    session
        Open session with the board.
    config
        The robot's description.
    leave
        What the end of the ``with`` block does to a robot that holds.
    """

    def __init__(
        self, session: Session, config: Config, *, leave: Literal["relax", "hold"] = "relax"
    ) -> None:
        self.session = session
        self.config = config
        self.leave = leave
        self.on_command: OnCommand | None = None
        self._servos = servo.ServoModel(config)
        self._pose_known = False
        self._board = Board(session)

    # ------------------------------------------------------------------- life

    def prepare(self) -> None:
        """Give the board the configuration's limits, and check that it holds them.

        Raises
        ------
        ConfigError
            The board isn't relaxed and holds other limits.
        """
        self._board.wait(lambda: self._board.reported, REPLY_S, "the board's first telemetry")
        wanted = _board_limits(self.config)
        if self.state is State.RELAXED:
            self._board.request(wanted)
        held = self.session.read_limits()
        if _values(held) == _values(wanted):
            return
        if self.state is State.RELAXED:
            raise ConfigError(
                "The board took the limits, but reads back others.",
                "Flash the firmware of this version with `setae flash`.",
            )
        raise ConfigError(
            f"The board is {name_of(self.state)} under other limits than this configuration's.",
            "Relax it with the configuration it was started with, or reset it.",
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                if self.leave == "relax" and self.state is State.HOLDING:
                    self.relax()
            elif self.state not in (State.RELAXED, State.STOPPED):
                self.stop()
        except Exception as failure:
            if error is None:
                raise
            error.add_note(f"Stopping failed too: {failure}")
        finally:
            self.session.close()

    # ------------------------------------------------------------------ facts

    @property
    def now_us(self) -> int:
        """The session's clock."""
        return self.session.now_us

    @property
    def state(self) -> State:
        """What the board does."""
        return self.session.state

    @property
    def hello(self) -> HelloReply:
        """What the board said of itself when the session opened."""
        assert self.session.hello is not None, "a Robot gets an open session"
        return self.session.hello

    @property
    def firmware_version(self) -> str:
        """Version of the board's firmware, such as 0.1.0."""
        reply = self.hello
        return f"{reply.firmware_major}.{reply.firmware_minor}.{reply.firmware_patch}"

    @property
    def telemetry(self) -> Telemetry:
        """The board's latest report."""
        return self._board.telemetry

    @property
    def pose_known(self) -> bool:
        """Whether the board knows where its servos are."""
        return self._pose_known or bool(self.hello.pose_known)

    @property
    def lengths_mm(self) -> npt.NDArray[np.float64]:
        """Commanded tendon lengths, (4,).

        Raises
        ------
        PoseUnknownError
            Nobody knows them before the first enable().
        """
        if not self.pose_known:
            raise PoseUnknownError("Nobody knows where the servos are.")
        return self._servos.lengths_mm(self.telemetry.pulse_ticks)

    @property
    def pose(self) -> Arc:
        """The commanded pose: the arc that fits the commanded lengths best."""
        return kinematics.forward(
            self.lengths_mm, self.config.geometry, model=self.config.motion.model
        )

    @property
    def position_mm(self) -> npt.NDArray[np.float64]:
        """Commanded place of the spring's top U in frame D, (3,)."""
        return np.asarray(kinematics.position(self.pose), dtype=float)

    @property
    def pressure_hpa(self) -> float | None:
        """The latest sample of the bristle's sensor; None before the first."""
        return self._board.pressure_hpa

    # ------------------------------------------------------------ on, off, stop

    def enable(self, *, accept_jump: bool = False) -> None:
        """Switch the servos on at the commanded pose, one after the other.

        Parameters
        ----------
        accept_jump
            Go on though nobody knows where the servos are: they jump to the
            free length, which can release up to 50 mm of tendon at full speed.

        Raises
        ------
        PoseUnknownError
            The pose is unknown and `accept_jump` is False.
        """
        self._told("enable", accept_jump=accept_jump)
        if self.state is State.HOLDING:
            return
        if self.state is not State.RELAXED:
            self._board.require_holding()
        if self.pose_known:
            ticks = self._ticks_now()
        elif accept_jump:
            ticks = self._free_ticks()
        else:
            raise PoseUnknownError("Nobody knows where the servos are: the first pulse may jump.")
        self._board.request(Enable(pulse_ticks=ticks))
        self._board.wait(lambda: self._board.at_rest(ticks), REPLY_S, "the servos to attach")
        self._pose_known = True

    def relax(self) -> None:
        """Unwind slowly to the free length, then switch the servos off."""
        self._told("relax")
        if self.state is State.RELAXED:
            return
        speed_mm_s = self.config.motion.relax_speed_mm_s
        slew = self._servos.speed_ticks(speed_mm_s)
        free = self._free_ticks()
        distance = max(abs(a - b) for a, b in zip(free, self._ticks_now(), strict=True))
        self._board.request(Relax(slew_ticks=slew, free_ticks=free))
        self._board.wait(
            lambda: self.state is State.RELAXED,
            distance / slew * _FRAME_S + REPLY_S,
            "the robot to relax",
        )

    def limp(self) -> None:
        """Switch the servos off at once, in whatever state; their gears still hold.

        A stopped, tripped or faulty board stays so until `resume`.
        """
        self._told("limp")
        self._board.request(Limp(reserved=0), watch=False)
        self._board.wait(
            lambda: self.telemetry.attached == 0, REPLY_S, "the servos to go off", watch=False
        )

    def stop(self) -> None:
        """Freeze now, and wait until the board says so. Only `resume` ends it.

        Raises
        ------
        LinkError
            The board didn't confirm. It goes on with what it has queued, at most
            a second, then holds.
        """
        ticket = self.session.send_stop()
        try:
            self._told("stop")
        finally:
            # Whatever the log says: the stop is on its way, and is seen through.
            self.session.run_until(
                lambda: ticket.done, round(REPLY_S * 1e6), what="The stop's confirmation"
            )

    def resume(self) -> None:
        """Leave stopped, tripped or fault; a running reflex is waited for."""
        if self.state in (State.RELAXED, State.HOLDING):
            return
        if self.state is State.TRIPPED:
            self._board.wait(
                lambda: self.state is not State.TRIPPED or self._board.reflex_ended(),
                REPLY_S + 60.0,
                "the reflex to end",
                watch=False,
            )
        self._told("resume")
        self._board.forget_records()
        self._board.request(Resume(epoch=self.session.epoch), watch=False)
        self._board.wait(
            lambda: self.state in (State.HOLDING, State.RELAXED),
            REPLY_S,
            "the board to resume",
            watch=False,
        )
        self._board.next_report()

    # ------------------------------------------------------------------ motion

    def move_to(
        self,
        position_mm: npt.ArrayLike,
        *,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
        model: str | None = None,
    ) -> None:
        """Move the spring's top to a position and wait until it is there.

        Parameters
        ----------
        position_mm
            Target in frame D, (3,).
        duration_s
            Time for the move; with neither this nor a speed, the configured
            speed sets it.
        speed_mm_s
            Speed of the fastest tendon, at its fastest.
        model
            Tendon model; None takes the configured one.

        Raises
        ------
        InputError, UnreachableError
            The target means nothing, or the robot can't take it.
        TrajectoryError
            Too fast for the servos.
        StoppedError, TrippedError, FaultError, RefusedError, LinkError
            What ended the motion.
        """
        lengths_mm = self._lengths_for(position_mm, model)
        self._told("move_to", position_mm=_list(position_mm), duration_s=duration_s,
                   speed_mm_s=speed_mm_s, model=model)  # fmt: skip
        self._move(lengths_mm, duration_s, speed_mm_s)

    def move_lengths(
        self,
        lengths_mm: npt.ArrayLike,
        *,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
    ) -> None:
        """Like `move_to`, for tendon lengths, (4,), in a straight line between them."""
        lengths = finite_array("lengths_mm", lengths_mm, last_axis=4, what="one a tendon")
        if lengths.shape != (4,):
            raise InputError(f"lengths_mm has shape {lengths.shape}.", "Give four lengths.")
        self._require_allowed(self._ticks_for(lengths))
        self._told("move_lengths", lengths_mm=_list(lengths), duration_s=duration_s,
                   speed_mm_s=speed_mm_s)  # fmt: skip
        self._move(lengths, duration_s, speed_mm_s)

    def compress(
        self,
        length_mm: float,
        *,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
    ) -> None:
        """Straighten and shorten (or lengthen) the spring to a length; otherwise as `move_to`."""
        self.move_to((0.0, 0.0, length_mm), duration_s=duration_s, speed_mm_s=speed_mm_s)

    def move_along(
        self,
        waypoints_mm: npt.ArrayLike,
        *,
        blend_mm: float = 0.0,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
        model: str | None = None,
        at_jump: Literal["refuse", "bridge"] = "refuse",
    ) -> None:
        """Move to the first of some positions as `move_to` does, then along the others.

        Parameters
        ----------
        waypoints_mm
            Positions of the spring's top in frame D, (m, 3), m ≥ 2; straight between
            them in length and bending.
        blend_mm
            How far before a waypoint the motion may cut its corner, to pass it
            without a stop. 0: it stops at each.
        duration_s
            Time from the first waypoint to the last; with neither this nor a speed,
            the shortest that the configured speed, acceleration and jerk allow.
        speed_mm_s
            Constant speed of the spring's top between the ramps.
        model
            Tendon model; None takes the configured one.
        at_jump
            Where the model jumps: refuse the way, or bridge the jump at rest.

        Raises
        ------
        InputError, UnreachableError, TrajectoryError
            As `move_to`, and `setae.trajectory.along`.
        """
        points = finite_array("waypoints_mm", waypoints_mm, last_axis=3, what="x, y, z")
        if points.ndim != 2 or len(points) < 2:
            raise InputError(f"waypoints_mm has shape {points.shape}.", "Give two x, y, z or more.")
        arcs = kinematics.inverse(points)
        lengths_mm = workspace.require(arcs, self.config, model)
        motion = trajectory.along(
            arcs,
            self.config.geometry,
            model or self.config.motion.model,
            limits=self._limits(self._path_speed(speed_mm_s, duration_s)),
            blend_mm=blend_mm,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            at_jump=at_jump,
        )
        self._told("move_along", waypoints_mm=points.tolist(), blend_mm=blend_mm,
                   duration_s=duration_s, speed_mm_s=speed_mm_s, model=model,
                   at_jump=at_jump)  # fmt: skip
        self._move(lengths_mm[0], None, None)
        self._follow(motion)

    def circle(
        self,
        radius_mm: float,
        height_mm: float,
        *,
        start_deg: float = 0.0,
        turns: float = 1.0,
        duration_s: float | None = None,
        speed_mm_s: float | None = None,
        model: str | None = None,
        at_jump: Literal["refuse", "bridge"] = "refuse",
    ) -> None:
        """Move to a point beside the axis as `move_to` does, then round it in a circle.

        The spring's length and bending stay the same, only its direction α turns.

        Parameters
        ----------
        radius_mm, height_mm
            Of the circle of the spring's top in frame D.
        start_deg
            Direction α in which it starts.
        turns
            How often round, positive from x towards y.
        duration_s, speed_mm_s, model, at_jump
            As in `move_along`. Under the model ``paper`` every circle jumps.

        Raises
        ------
        InputError, UnreachableError, TrajectoryError
            As `move_along`.
        """
        start_rad = math.radians(float(finite_array("start_deg", start_deg)))
        radius = _positive("radius_mm", radius_mm)
        arc = kinematics.inverse(
            (radius * math.cos(start_rad), radius * math.sin(start_rad), height_mm)
        )
        lengths_mm = workspace.require(arc, self.config, model)
        motion = trajectory.circle(
            float(arc.length_mm),
            float(arc.theta_rad),
            self.config.geometry,
            model or self.config.motion.model,
            limits=self._limits(self._path_speed(speed_mm_s, duration_s)),
            start_rad=start_rad,
            turns=turns,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            at_jump=at_jump,
        )
        self._told("circle", radius_mm=radius, height_mm=height_mm, start_deg=start_deg,
                   turns=turns, duration_s=duration_s, speed_mm_s=speed_mm_s, model=model,
                   at_jump=at_jump)  # fmt: skip
        self._move(lengths_mm, None, None)
        self._follow(motion)

    def probe(
        self,
        position_mm: npt.ArrayLike,
        *,
        speed_mm_s: float | None = None,
        duration_s: float | None = None,
        retract_mm: npt.ArrayLike | None = None,
    ) -> Contact | None:
        """Move towards a position until the bristle touches something.

        The board takes the pressure's baseline at rest, then moves, and watches
        by itself. On a contact it freezes, retracts, and this call returns where
        the contact was; the robot then holds at the retract position. Without
        one the robot holds at the target.

        Parameters
        ----------
        position_mm
            Target in frame D, (3,).
        speed_mm_s
            Highest speed of the bristle's tip; default: the configured probe speed.
        duration_s
            Time for the extension, instead of a speed.
        retract_mm
            Where the board retracts to after a contact, (3,); None: to where the
            probe started.

        Returns
        -------
        Contact or None
            None where nothing was touched.

        Raises
        ------
        RefusedError
            The pressure was not steady enough for a baseline, or far from its
            rest value: the bristle touches something already.
        """
        self._board.require_holding()
        target = self._lengths_for(position_mm, None)
        retract = (
            self._ticks_now()
            if retract_mm is None
            else self._ticks_for(self._lengths_for(retract_mm, None))
        )
        if duration_s is not None and speed_mm_s is not None:
            raise InputError("Both duration_s and speed_mm_s are given.", "Give one of them.")
        if duration_s is None:
            duration_s = max(_FRAME_S, self._duration_for(position_mm, speed_mm_s))
        self._told("probe", position_mm=_list(position_mm), duration_s=duration_s,
                   retract_mm=None if retract_mm is None else _list(retract_mm))  # fmt: skip
        segments, duration_s = self._plan(target, duration_s, None)
        final = segments[-1].target_ticks if segments else self._ticks_now()

        def extend() -> None:
            play = self._playing(segments)
            self._board.wait(
                lambda: self._board.trip is not None or (play() and self._board.at_rest(final)),
                duration_s + REPLY_S,
                "the extension to end",
                trips=True,
            )
            # The servos lag, and so does the pressure: it watches on for a moment.
            self._board.pause(_SETTLE_S)

        return self._guarded(
            extend,
            limit_s=duration_s + _SETTLE_S + 2 * REPLY_S,
            reflex=Reflex.RETRACT,
            retract_ticks=retract,
        )

    def hold_guarded(
        self,
        begin: Callable[[], object],
        busy: Callable[[], bool],
        abort: Callable[[], object],
        *,
        timeout_s: float,
    ) -> Contact | None:
        """Hold still with the bristle watching, while something else moves.

        Parameters
        ----------
        begin
            Called once the bristle watches; starts the other motion.
        busy
            True while the other motion lasts.
        abort
            Ends the other motion at once: called before anything else is done
            about a contact, or about whatever else went wrong.
        timeout_s
            For the other motion.

        Returns
        -------
        Contact or None
            After a contact the robot holds; the other motion was aborted, and may
            still be braking.
        """
        self._board.require_holding()
        self._told("hold_guarded", timeout_s=timeout_s)

        def watch() -> None:
            try:
                begin()
                self._board.wait(
                    lambda: self._board.trip is not None or not busy(),
                    timeout_s,
                    "the guarded motion to end",
                    trips=True,
                )
            except BaseException:
                abort()
                raise
            if self._board.trip is not None:
                abort()

        return self._guarded(
            watch,
            limit_s=timeout_s + 2 * REPLY_S,
            reflex=Reflex.HOLD,
            retract_ticks=self._ticks_now(),
        )

    def wait(self, done: Callable[[], bool], *, timeout_s: float, what: str) -> None:
        """Wait for something, with the robot watched meanwhile.

        Parameters
        ----------
        done
            Asked after everything that happens.
        timeout_s
            After this long, DeadlineError.
        what
            What is waited for, for the message.
        """
        self._board.wait(done, timeout_s, what)

    def host_time_us(self, frame: int, phase_us: int) -> int:
        """A board time on the session's clock."""
        return self._board.host_time_us(frame, phase_us)

    # -------------------------------------------------------------- guarded moves

    def _guarded(
        self,
        act: Callable[[], object],
        *,
        limit_s: float,
        reflex: Reflex,
        retract_ticks: Ticks,
    ) -> Contact | None:
        """Arm, act, disarm; what was touched meanwhile."""
        self._board.pause(_SETTLE_S)
        self._arm(limit_s, reflex, retract_ticks)
        act()
        if self._board.trip is None:
            # A contact in the very last moment still wins over the disarming.
            ticket = self._board.send(Disarm(reserved=0))
            self._board.wait(
                lambda: (
                    self._board.trip is not None
                    or (ticket.done and self.state is not State.TRIPPED)
                ),
                REPLY_S,
                "the board to disarm",
                trips=True,
            )
        if self._board.trip is None:
            return None
        return self._end_of_trip(self._board.trip, limit_s)

    def _arm(self, limit_s: float, reflex: Reflex, retract_ticks: Ticks) -> None:
        """Have the baseline taken. A bristle that still swings gets another chance."""
        for attempt in range(1, _TARE_ATTEMPTS + 1):
            refusal = self._try_to_arm(limit_s, reflex, retract_ticks)
            if refusal is None:
                return
            if refusal.reason not in _RETRIED or attempt == _TARE_ATTEMPTS:
                raise refused_error(refusal)
            self._board.pause(_TARE_S)

    def _try_to_arm(
        self, limit_s: float, reflex: Reflex, retract_ticks: Ticks
    ) -> RefusalMessage | None:
        bristle = self.config.bristle
        ticket = self._board.send(
            GuardMessage(
                epoch=self.session.epoch,
                threshold_raw=round(bristle.threshold_hpa * PRESSURE_LSB_PER_HPA),
                consecutive=bristle.consecutive,
                deadline_frames=min(math.ceil(limit_s / _FRAME_S), _GUARD_FRAMES_MAX),
                reflex=reflex,
                retract_ticks=retract_ticks,
                retract_slew_ticks=self._servos.speed_ticks(self.config.motion.retract_speed_mm_s),
            ),
            watch=False,
        )
        self._board.wait(
            lambda: ticket.refusal is not None or self.telemetry.guard == Guard.ARMED,
            REPLY_S,
            "the board to take the baseline",
        )
        return ticket.refusal

    def _end_of_trip(self, trip: Tripped, limit_s: float) -> Contact:
        """Wait for the reflex, then hold again."""
        if trip.record.cause == TripCause.DEADLINE:
            raise DeadlineError(
                f"The guarded move took longer than its {limit_s:.1f} s, so the board froze it.",
                "Call resume(), then try again with more time.",
            )
        found = self.contact_of(trip)
        self._board.forget_records()
        self.resume()
        return found

    def contact_of(self, trip: Tripped) -> Contact:
        """What a trip's record tells about the contact."""
        return contacts.estimate(
            trip.record,
            self.config,
            time_us=self.host_time_us(trip.record.sample_frame, trip.record.sample_phase_us),
        )

    # -------------------------------------------------------------------- motion

    def _lengths_for(
        self, position_mm: npt.ArrayLike, model: str | None
    ) -> npt.NDArray[np.float64]:
        position = finite_array("position_mm", position_mm, last_axis=3, what="x, y, z")
        if position.shape != (3,):
            raise InputError(f"position_mm has shape {position.shape}.", "Give one x, y, z.")
        arc = kinematics.inverse(position)
        return workspace.require(arc, self.config, model)

    def _duration_for(self, position_mm: npt.ArrayLike, speed_mm_s: float | None) -> float:
        """Time for an extension whose tip is at most so fast."""
        if speed_mm_s is None:
            speed_mm_s = self.config.motion.probe_speed_mm_s
        return trajectory.duration_for_speed(
            self.pose,
            kinematics.inverse(position_mm),
            speed_mm_s,
            tip_offset_mm=self.config.geometry.tip_offset_mm,
        )

    def _require_allowed(self, ticks: Ticks) -> None:
        """Refuse here what the board would refuse: sums and differences of opposite tendons."""
        limits = _board_limits(self.config)
        for pair, (a, b) in enumerate(((0, 2), (1, 3))):
            total, difference = ticks[a] + ticks[b], ticks[a] - ticks[b]
            low, high = limits.pair_sum_min_ticks[pair], limits.pair_sum_max_ticks[pair]
            least = limits.pair_difference_min_ticks[pair]
            most = limits.pair_difference_max_ticks[pair]
            if not (low <= total <= high and least <= difference <= most):
                raise UnreachableError(
                    f"Tendons {a} and {b} at these lengths would crush or over-bend the spring.",
                    "Choose lengths that belong to a pose inside the workspace.",
                )

    def _move(
        self,
        lengths_mm: npt.NDArray[np.float64],
        duration_s: float | None,
        speed_mm_s: float | None,
    ) -> None:
        self._board.require_holding()
        segments, duration_s = self._plan(lengths_mm, duration_s, speed_mm_s)
        self._play(segments, duration_s)

    def _play(self, segments: Sequence[Segment], duration_s: float) -> None:
        """Have the board play segments, and wait until it has."""
        if not segments:
            return
        final = segments[-1].target_ticks
        play = self._playing(segments)
        self._board.wait(
            lambda: play() and self._board.at_rest(final), duration_s + REPLY_S, "the move to end"
        )

    def _playing(self, segments: Sequence[Segment]) -> Callable[[], bool]:
        """Make what hands segments to the link, call after call; True once all are.

        The board holds fifty, which may be many seconds. It gets them about a second
        ahead, so that it soon holds if the host dies.
        """
        waiting = deque(
            servo.segment_messages(
                segments, epoch=self.session.epoch, max_frames=_AHEAD_FRAMES // 2
            )
        )
        begin_us = self.now_us
        sent_us = 0

        def play() -> bool:
            nonlocal sent_us
            while waiting:
                frames = sum(part.duration_frames for part in waiting[0].segments)
                ahead_us = sent_us - (self.now_us - begin_us)
                if ahead_us + frames * SERVO_FRAME_US > _AHEAD_FRAMES * SERVO_FRAME_US:
                    return False
                sent_us += frames * SERVO_FRAME_US
                self._board.send(waiting.popleft())
            return True

        return play

    def _plan(
        self,
        lengths_mm: npt.NDArray[np.float64],
        duration_s: float | None,
        speed_mm_s: float | None,
    ) -> tuple[list[Segment], float]:
        """Segments from the present pulses to tendon lengths, and the time they take."""
        limit = self._servos.max_speed_mm_s
        if duration_s is not None and speed_mm_s is not None:
            raise InputError("Both duration_s and speed_mm_s are given.", "Give one of them.")
        if duration_s is None:
            speed = self.config.motion.move_speed_mm_s if speed_mm_s is None else speed_mm_s
            speed = _positive("speed_mm_s", speed)
            if speed > limit.min():
                raise TrajectoryError(
                    f"{speed:g} mm/s is faster than the servos' {limit.min():.0f} mm/s.",
                    "Give a lower speed.",
                )
            limit = np.minimum(limit, speed)
        if self._ticks_for(lengths_mm) == self._ticks_now():
            return [], 0.0
        motion = trajectory.line(
            self.lengths_mm, lengths_mm, limits=self._limits(limit), duration_s=duration_s
        )
        return self._packed(motion), motion.duration_s

    def _path_speed(
        self, speed_mm_s: float | None, duration_s: float | None
    ) -> npt.NDArray[np.float64]:
        """What limits the tendons on a way: the configured speed, unless time or speed is given."""
        limit = self._servos.max_speed_mm_s
        if speed_mm_s is None and duration_s is None:
            limit = np.minimum(limit, self.config.motion.move_speed_mm_s)
        return np.asarray(limit)

    def _limits(self, speed_mm_s: npt.ArrayLike) -> trajectory.Limits:
        motion = self.config.motion
        return trajectory.Limits(
            speed_mm_s=speed_mm_s,
            acceleration_mm_s2=motion.acceleration_mm_s2,
            jerk_mm_s3=motion.jerk_mm_s3,
        )

    def _packed(self, motion: trajectory.FrameTrajectory) -> list[Segment]:
        """Segments for a motion that starts at the present pulses."""
        return list(self._servos.segments(motion.lengths_mm, start_ticks=self._ticks_now()))

    def _follow(self, motion: trajectory.FrameTrajectory) -> None:
        """Play a motion through poses, each of which the board would take."""
        segments = self._packed(motion)
        for segment in segments:
            self._require_allowed(segment.target_ticks)
        self._play(segments, motion.duration_s)

    # ------------------------------------------------------------------- details

    def _told(self, name: str, **args: Any) -> None:
        if self.on_command is not None:
            self.on_command(name, args)

    def _ticks_now(self) -> Ticks:
        return self.telemetry.pulse_ticks

    def _free_ticks(self) -> Ticks:
        return _four(self._servos.free_ticks())

    def _ticks_for(self, lengths_mm: npt.NDArray[np.float64]) -> Ticks:
        return _four(self._servos.ticks(lengths_mm))


def _four(ticks: npt.NDArray[np.int64]) -> Ticks:
    a, b, c, d = (int(tick) for tick in ticks)
    return a, b, c, d


def _values(limits: Limits | SetLimits) -> bytes:
    # Both messages have the same payload.
    return limits.pack()


def _list(values: npt.ArrayLike) -> list[float]:
    return [float(value) for value in np.asarray(values, dtype=float).ravel()]


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value}.", "Give a number above 0.")
    return value
