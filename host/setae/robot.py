"""The robot as a program uses it: moves, probes, stops.

A `Robot` has no clock and no thread. Every call that takes time waits in the
session's one loop, with a deadline, and raises what went wrong with what to do.
The board keeps the robot safe on its own; nothing here is needed for that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
import numpy.typing as npt

from setae.arc import finite_array, positive
from setae.config import Config
from setae.contact import Contact
from setae.controls import Controls
from setae.errors import InputError
from setae.guarding import Approach, Guarding
from setae.link.events import Tripped
from setae.link.session import Session
from setae.planning import require_one
from setae.trajectory import FrameTrajectory
from setae.trajectory.plan import TooFast

__all__ = ["Approach", "Contact", "Robot"]


class Robot(Controls):
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
        super().__init__(session, config, leave=leave)
        self._guarding = Guarding(self._board, config)

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
        lengths_mm = self._planner.reach(position_mm, model)
        self._told("move_to", position_mm=_list(position_mm), duration_s=duration_s,
                   speed_mm_s=speed_mm_s, model=model)  # fmt: skip
        self._move(lengths_mm, duration_s, speed_mm_s)
        self._aim_at(position_mm, model)

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
        self._planner.require_allowed(self._planner.ticks(lengths))
        self._told("move_lengths", lengths_mm=_list(lengths), duration_s=duration_s,
                   speed_mm_s=speed_mm_s)  # fmt: skip
        self._move(lengths, duration_s, speed_mm_s)
        self._aim_at(None)

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
        begin_mm, motion = self._planner.along(
            points,
            blend_mm=blend_mm,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            model=model,
            at_jump=at_jump,
        )
        self._told("move_along", waypoints_mm=points.tolist(), blend_mm=blend_mm,
                   duration_s=duration_s, speed_mm_s=speed_mm_s, model=model,
                   at_jump=at_jump)  # fmt: skip
        self._move(begin_mm, None, None)
        self._follow(motion)
        self._aim_at(points[-1], model)

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
        begin_mm, motion = self._planner.circle(
            radius_mm,
            height_mm,
            start_deg=start_deg,
            turns=turns,
            duration_s=duration_s,
            speed_mm_s=speed_mm_s,
            model=model,
            at_jump=at_jump,
        )
        self._told("circle", radius_mm=radius_mm, height_mm=height_mm, start_deg=start_deg,
                   turns=turns, duration_s=duration_s, speed_mm_s=speed_mm_s, model=model,
                   at_jump=at_jump)  # fmt: skip
        self._move(begin_mm, None, None)
        self._follow(motion)
        end_rad = math.radians(start_deg + 360.0 * turns)
        self._aim_at((radius_mm * math.cos(end_rad), radius_mm * math.sin(end_rad), height_mm),
                     model)  # fmt: skip

    # -------------------------------------------------------------- guarded moves

    def probe(
        self,
        position_mm: npt.ArrayLike,
        *,
        speed_mm_s: float | None = None,
        duration_s: float | None = None,
        retract_mm: npt.ArrayLike | None = None,
        approach: Approach | None = None,
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
        approach
            What moves first, with the same baseline: the robot holds meanwhile. Where the
            bristle touches something then, it is aborted, and the robot does not extend.

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
        target = self._planner.reach(position_mm, None)
        start = self.telemetry.pulse_ticks
        retract = start
        if retract_mm is not None:
            retract = self._planner.ticks(self._planner.reach(retract_mm, None))
        require_one(duration_s, speed_mm_s)
        too_fast: TooFast = "raise"
        if duration_s is None:
            duration_s = self._planner.extension_s(self.pose, position_mm, speed_mm_s)
            too_fast = "stretch"  # a short way may be too short for its highest speed
        self._told("probe", position_mm=_list(position_mm), duration_s=duration_s,
                   retract_mm=None if retract_mm is None else _list(retract_mm))  # fmt: skip
        planned = self._planner.line(start, target, duration_s=duration_s, too_fast=too_fast)
        found = self._guarding.extend(planned, retract_ticks=retract, approach=approach)
        if found is None:
            self._aim_at(position_mm)
        elif retract_mm is not None:
            self._aim_at(retract_mm)
        return self._hold_again(found)

    def hold_guarded(
        self,
        begin: Callable[[], object],
        busy: Callable[[], bool],
        abort: Callable[[], object],
        *,
        timeout_s: float,
        retract_mm: npt.ArrayLike | None = None,
    ) -> Contact | None:
        """Hold still with the bristle watching, while something else moves.

        Parameters
        ----------
        begin, busy, abort, timeout_s
            Of the other motion, see `Approach`.
        retract_mm
            Where the board retracts to after a contact, (3,); None: nowhere.

        Returns
        -------
        Contact or None
            After a contact the robot holds, where it retracted to; the other motion was
            aborted, and may still be braking.
        """
        positive("timeout_s", timeout_s)
        self._board.require_holding()
        retract = None
        if retract_mm is not None:
            retract = self._planner.ticks(self._planner.reach(retract_mm, None))
        self._told("hold_guarded", timeout_s=timeout_s,
                   retract_mm=None if retract_mm is None else _list(retract_mm))  # fmt: skip
        approach = Approach(begin=begin, busy=busy, abort=abort, timeout_s=timeout_s)
        found = self._guarding.watch(approach, retract_ticks=retract)
        if found is not None and retract_mm is not None:
            self._aim_at(retract_mm)
        return self._hold_again(found)

    def contact_of(self, trip: Tripped) -> Contact:
        """What a trip's record tells about the contact."""
        return self._guarding.contact_of(trip)

    # ------------------------------------------------------------------- details

    def _move(
        self,
        lengths_mm: npt.NDArray[np.float64],
        duration_s: float | None,
        speed_mm_s: float | None,
    ) -> None:
        self._board.require_holding()
        planned = self._planner.line(
            self.telemetry.pulse_ticks, lengths_mm, duration_s=duration_s, speed_mm_s=speed_mm_s
        )
        self._board.play(planned.segments, planned.duration_s)

    def _follow(self, motion: FrameTrajectory) -> None:
        """Play a motion that starts here."""
        planned = self._planner.pack(motion, self.telemetry.pulse_ticks)
        self._board.play(planned.segments, planned.duration_s)

    def _hold_again(self, found: Contact | None) -> Contact | None:
        """After a contact the board is tripped: have it hold once its reflex is over."""
        if found is not None:
            self._board.forget_records()
            self.resume()
        return found


def _list(values: npt.ArrayLike) -> list[float]:
    return [float(value) for value in np.asarray(values, dtype=float).ravel()]
