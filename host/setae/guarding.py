"""Guarded motions: the board takes a baseline, watches the bristle, and freezes on a contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from setae import contact as contacts
from setae.board import REPLY_S, Board
from setae.config import Config
from setae.contact import Contact
from setae.errors import DeadlineError
from setae.link.events import Tripped
from setae.link.session import refused_error
from setae.planning import Planned
from setae.servo import ServoModel, Ticks
from setae.stopping import stop_all
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    SERVO_FRAME_US,
    Disarm,
    Guard,
    GuardMessage,
    Reflex,
    Refusal,
    RefusalMessage,
    Sensor,
    State,
    TripCause,
)

# After a motion the spring and the bristle swing on, and the servos lag.
_SETTLE_S = 0.16
# Attempts at a baseline; a bristle that swings gives a noisy one.
_TARE_ATTEMPTS = 4
_TARE_S = 0.5
_RETRIED = (Refusal.TARE_NOISY, Refusal.TARE_FAR)
_GUARD_FRAMES_MAX = 0xFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """What moves while the robot holds and the bristle watches.

    Attributes
    ----------
    begin
        Called once the bristle watches; starts the other motion.
    busy
        True while the other motion lasts.
    abort
        Ends the other motion at once: called before anything else is done about a
        contact, or about whatever else went wrong.
    timeout_s
        For the other motion.
    """

    begin: Callable[[], object]
    busy: Callable[[], bool]
    abort: Callable[[], object]
    timeout_s: float


class Guarding:
    """Has the bristle watched while the robot, or something else, moves.

    Parameters
    ----------
    board
        A board that holds.
    config
        The robot.
    """

    def __init__(self, board: Board, config: Config) -> None:
        self._board = board
        self._config = config
        self._retract_slew_ticks = ServoModel(config).speed_ticks(config.motion.retract_speed_mm_s)

    def extend(
        self, planned: Planned, *, retract_ticks: Ticks, approach: Approach | None = None
    ) -> Contact | None:
        """Play a motion, after an approach if there is one.

        After a contact the board is tripped, and retracts.
        """

        def play_all() -> None:
            if approach is not None:
                self._await(approach)
                if self._board.trip is not None:
                    return
            play = self._board.playing(planned.segments)
            self._board.wait(
                lambda: (
                    self._board.trip is not None
                    or (play() and self._board.at_rest(planned.final_ticks))
                ),
                planned.duration_s + REPLY_S,
                "the extension to end",
                trips=True,
            )
            # The servos lag, and so does the pressure: it watches on for a moment.
            self._board.pause(_SETTLE_S)

        approach_s = 0.0 if approach is None else approach.timeout_s
        return self._guarded(
            play_all,
            limit_s=approach_s + planned.duration_s + _SETTLE_S + 2 * REPLY_S,
            reflex=Reflex.RETRACT,
            retract_ticks=retract_ticks,
        )

    def watch(self, approach: Approach, *, retract_ticks: Ticks | None = None) -> Contact | None:
        """Hold while something else moves; after a contact the board is tripped.

        It then holds, or retracts by itself where it is told whereto.
        """
        return self._guarded(
            lambda: self._await(approach),
            limit_s=approach.timeout_s + 2 * REPLY_S,
            reflex=Reflex.HOLD if retract_ticks is None else Reflex.RETRACT,
            retract_ticks=retract_ticks or self._board.telemetry.pulse_ticks,
        )

    def _await(self, approach: Approach) -> None:
        """See another motion through; after a contact it is aborted."""
        try:
            approach.begin()
            self._board.wait(
                lambda: self._board.trip is not None or not approach.busy(),
                approach.timeout_s,
                "the guarded motion to end",
                trips=True,
            )
        except BaseException as error:
            stop_all(error, approach.abort)
            raise
        if self._board.trip is not None:
            approach.abort()

    def contact_of(self, trip: Tripped) -> Contact:
        """What a trip's record tells about the contact."""
        return contacts.estimate(
            trip.record,
            self._config,
            time_us=self._board.host_time_us(trip.record.sample_frame, trip.record.sample_phase_us),
        )

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
                    or (ticket.done and self._board.state is not State.TRIPPED)
                ),
                REPLY_S,
                "the board to disarm",
                trips=True,
            )
        trip = self._board.trip
        if trip is None:
            return None
        if trip.record.cause == TripCause.DEADLINE:
            raise DeadlineError(
                f"The guarded move took longer than its {limit_s:.1f} s, so the board froze it.",
                "Call resume(), or give `setae enable`, then try again with more time.",
            )
        return self.contact_of(trip)

    def _arm(self, limit_s: float, reflex: Reflex, retract_ticks: Ticks) -> None:
        """Have the baseline taken. A bristle that still swings gets another chance.

        So does one that was shaken so hard that the board took its sensor for broken.
        """
        for attempt in range(1, _TARE_ATTEMPTS + 1):
            refusal = self._try_to_arm(limit_s, reflex, retract_ticks)
            if refusal is None:
                return
            shaken = refusal.reason is Refusal.SENSOR_UNAVAILABLE and refusal.value == Sensor.NOISY
            if not (shaken or refusal.reason in _RETRIED) or attempt == _TARE_ATTEMPTS:
                raise refused_error(refusal)
            self._board.pause(_TARE_S)

    def _try_to_arm(
        self, limit_s: float, reflex: Reflex, retract_ticks: Ticks
    ) -> RefusalMessage | None:
        bristle = self._config.bristle
        ticket = self._board.send(
            GuardMessage(
                epoch=self._board.epoch,
                threshold_raw=round(bristle.threshold_hpa * PRESSURE_LSB_PER_HPA),
                consecutive=bristle.consecutive,
                deadline_frames=min(math.ceil(limit_s * 1e6 / SERVO_FRAME_US), _GUARD_FRAMES_MAX),
                reflex=reflex,
                retract_ticks=retract_ticks,
                retract_slew_ticks=self._retract_slew_ticks,
            ),
            watch=False,
        )
        self._board.wait(
            lambda: ticket.refusal is not None or self._board.telemetry.guard == Guard.ARMED,
            REPLY_S,
            "the board to take the baseline",
        )
        return ticket.refusal
