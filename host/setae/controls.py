"""A robot's controls without its motions: on, off, stop, and what it reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from setae import kinematics
from setae.arc import Arc
from setae.board import REPLY_S, Board, name_of
from setae.config import Config
from setae.errors import ConfigError, PoseUnknownError, UnreachableError
from setae.link.session import Session
from setae.planning import Planner
from setae.servo import Ticks
from setae_protocol.crc import crc32c
from setae_protocol.messages import (
    SERVO_FRAME_US,
    Enable,
    HelloReply,
    Limits,
    Limp,
    Relax,
    Resume,
    SetLimits,
    State,
    Status,
    StoreLimits,
    Telemetry,
)

OnCommand = Callable[[str, Mapping[str, Any]], None]


class Controls:
    """What `setae.robot.Robot` is besides its motions; parameters as there."""

    def __init__(
        self, session: Session, config: Config, *, leave: Literal["relax", "hold"] = "relax"
    ) -> None:
        self.session = session
        self.config = config
        self.leave = leave
        self.on_command: OnCommand | None = None
        self._planner = Planner(config)
        self._pose_known = False
        # What the last motion was to reach: under `paper` the lengths alone leave that open.
        self._aim: Arc | None = None
        self._aim_model = config.motion.model
        # The last pose that was asked for, behind all that it was made of.
        self._fitted: tuple[tuple[Ticks, str, Arc | None], Arc] | None = None
        self._board = Board(session)

    # ------------------------------------------------------------------- life

    def prepare(self) -> None:
        """Give the board the configuration's limits, and check that it holds them.

        Raises
        ------
        ConfigError
            The board isn't relaxed and holds other limits.
        """
        # A board that an earlier host left stopped can be looked at, and resumed.
        self.wait(
            lambda: self._board.reported,
            timeout_s=REPLY_S,
            what="the board's first telemetry",
            watch=False,
        )
        wanted = self._planner.limits
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
        return self._planner.servos.lengths_mm(self._ticks)

    @property
    def _ticks(self) -> Ticks:
        """Commanded pulses, of known meaning."""
        if not self.pose_known:
            raise PoseUnknownError("Nobody knows where the servos are.")
        return self.telemetry.pulse_ticks

    @property
    def pose(self) -> Arc:
        """The commanded pose: the arc that fits the commanded lengths best.

        Of several that do, the one nearest to the last target. In the tendon model that
        the last move was made with.
        """
        asked = (self._ticks, self._aim_model, self._aim)
        # A scan asks many times between two motions, and a fit takes milliseconds.
        if self._fitted is None or self._fitted[0] != asked:
            arc = kinematics.forward(
                self.lengths_mm, self.config.geometry, model=self._aim_model, near=self._aim
            )
            self._fitted = asked, arc
        return self._fitted[1]

    @property
    def position_mm(self) -> npt.NDArray[np.float64]:
        """Commanded place of the spring's top U in frame D, (3,)."""
        return np.asarray(kinematics.position(self.pose), dtype=float)

    @property
    def pressure_hpa(self) -> float | None:
        """The latest sample of the bristle's sensor; None before the first."""
        return self._board.pressure_hpa

    @property
    def limits_stored(self) -> bool | None:
        """Whether the board's EEPROM holds this configuration's limits; None where it holds none.

        They are in force from the board's start until a host sets its own.
        """
        stored_crc = self.status.stored_crc
        return None if stored_crc == 0 else stored_crc == crc32c(self._planner.limits.pack())

    @property
    def status(self) -> Status:
        """The board's supply, EEPROM, stop switch and counters, as told now."""
        return self._board.next_status()

    def store_limits(self) -> None:
        """Write this configuration's limits to the board's EEPROM, for its next starts.

        Raises
        ------
        RefusedError
            The board isn't relaxed, or its supply is low.
        ConfigError
            The EEPROM does not hold what was written.
        """
        self._told("store_limits")
        self._board.request(StoreLimits(reserved=0))
        self._board.stored()
        if not self.limits_stored:
            raise ConfigError(
                "The board's EEPROM does not hold the limits that were written.",
                "Store them again; if it comes back, use another board.",
            )

    # ------------------------------------------------------------ on, off, stop

    def enable(self, *, accept_jump: bool = False) -> None:
        """Switch the servos on at the commanded pose, one after the other.

        Parameters
        ----------
        accept_jump
            Go on though nobody knows where the servos are, or they were left where
            this configuration doesn't allow them: they jump to the free length, which
            can release up to 50 mm of tendon at full speed.

        Raises
        ------
        PoseUnknownError
            The pose is unknown and `accept_jump` is False.
        UnreachableError
            The pose is outside of this configuration's limits, as after a change of the
            configuration, and `accept_jump` is False.
        TrippedError
            A far jump swung the bristle, and the board stopped half-way: `resume`
            switches the other servos on.
        """
        self._told("enable", accept_jump=accept_jump)
        if self.state is State.HOLDING:
            return
        if self.state is not State.RELAXED:
            self._board.require_holding()
        ticks = self._first_ticks(accept_jump)
        self._board.request(Enable(pulse_ticks=ticks))
        self._pose_known = True
        self._board.wait(lambda: self._board.at_rest(ticks), REPLY_S, "the servos to attach")

    def _first_ticks(self, accept_jump: bool) -> Ticks:
        """Where to switch the servos on: where they are, unless they have to jump."""
        left = self.telemetry.pulse_ticks
        why = self._planner.excluded(left) if self.pose_known else ""
        if self.pose_known and not why:
            return left
        if accept_jump:
            return self._planner.free_ticks
        if why:
            raise UnreachableError(
                f"The robot was left where this configuration doesn't allow it. {why}",
                "Enable it with the configuration that it was left under. Or: "
                + PoseUnknownError.default_remedy,
            )
        raise PoseUnknownError("Nobody knows where the servos are: the first pulse may jump.")

    def relax(self) -> None:
        """Unwind slowly to the free length, then switch the servos off."""
        self._told("relax")
        if self.state is State.RELAXED:
            return
        speed_mm_s = self.config.motion.relax_speed_mm_s
        slew = self._planner.servos.speed_ticks(speed_mm_s)
        free = self._planner.free_ticks
        distance = max(abs(a - b) for a, b in zip(free, self.telemetry.pulse_ticks, strict=True))
        self._board.request(Relax(slew_ticks=slew, free_ticks=free))
        self._board.wait(
            lambda: self.state is State.RELAXED,
            distance / slew * SERVO_FRAME_US / 1e6 + REPLY_S,
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

    # ---------------------------------------------------------------------- waits

    def wait(
        self, done: Callable[[], bool], *, timeout_s: float, what: str, watch: bool = True
    ) -> None:
        """Wait for something, with the robot watched meanwhile.

        Parameters
        ----------
        done
            Asked after everything that happens.
        timeout_s
            After this long, DeadlineError.
        what
            What is waited for, for the message.
        watch
            Whether a stop, trip or fault ends the wait with its error.
        """
        self._board.wait(done, timeout_s, what, watch=watch)

    def host_time_us(self, frame: int, phase_us: int) -> int:
        """A board time on the session's clock."""
        return self._board.host_time_us(frame, phase_us)

    def _aim_at(self, position_mm: npt.ArrayLike | None, model: str | None = None) -> None:
        """Note where a motion under a tendon model ends; None: at lengths of no certain pose."""
        self._aim = None if position_mm is None else kinematics.inverse(position_mm)
        self._aim_model = model or self.config.motion.model

    def _told(self, name: str, **args: Any) -> None:
        if self.on_command is not None:
            self.on_command(name, args)


def _values(limits: Limits | SetLimits) -> bytes:
    # Both messages have the same payload.
    return limits.pack()
