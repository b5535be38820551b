"""What every scan is made of: guarded steps of the arm, extensions, retractions."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from setae.config import Config
from setae.contact import Contact
from setae.errors import HeightWindowError, RefusedError, TrippedError
from setae.experiments.events import Event, OnEvent
from setae.experiments.scan.pressure import PressureWatch
from setae.robot import Approach, Robot
from setae.stage import Stage, move_timeout_s
from setae.stopping import stop_all

# A contact so soon after an extension's start was there before it.
_AT_ONCE_MM = 2.5
# Shorter moves of the arm are none.
_HERE_MM = 0.02
# Shorter differences of length are not worth a move of the spring.
_SAME_LENGTH_MM = 0.3
_WORTH_LOWERING_MM = 3.0
_RETRACTIONS = 4
# The board's reason where the pressure at rest is not what it is without a contact.
_IN_TOUCH = "tare_far"


@dataclass(frozen=True, slots=True, kw_only=True)
class Feeling:
    """What an extension felt.

    Attributes
    ----------
    mark
        ``felt``, ``slipped``, ``double``, ``lost`` or ``empty``, see `setae.heightmap.MARKS`.
    height_mm
        Of the surface in the world; NaN without a contact.
    contact
        What the board's record tells, or None.
    """

    mark: str
    height_mm: float
    contact: Contact | None


class Steps:
    """Arm and robot, moved with the bristle watching.

    Parameters
    ----------
    robot, stage
        Enabled robot, and the arm at the first place.
    config
        The robot's, with the settings of this scan.
    on_event
        Called with each `Event`.
    arm_timeout_s
        Longest time for a move of the arm; None: what its configured speed asks for.
    """

    def __init__(
        self,
        robot: Robot,
        stage: Stage,
        config: Config,
        *,
        on_event: OnEvent | None = None,
        arm_timeout_s: float | None = None,
    ) -> None:
        self._robot = robot
        self._stage = stage
        self._settings = config.scan
        self._on_event = on_event
        self._fixed_arm_timeout_s = arm_timeout_s
        self._origin_mm = stage.position_mm
        self.short_mm, self.long_mm = config.scan_lengths_mm
        self._watch = PressureWatch()
        self._unsubscribe = robot.session.subscribe(self._watch.take)

    def close(self) -> None:
        """Stop listening."""
        self._unsubscribe()

    # ---------------------------------------------------------------------------- facts

    @property
    def now_us(self) -> int:
        """The session's clock."""
        return self._robot.now_us

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Of frame D's origin, from the first place."""
        now, origin = self._stage.position_mm, self._origin_mm
        return (now[0] - origin[0], now[1] - origin[1], now[2] - origin[2])

    @property
    def length_mm(self) -> float:
        """Commanded length of the spring."""
        return float(self._robot.pose.length_mm)

    @property
    def extended(self) -> bool:
        """Whether the spring has its full length."""
        return self.length_mm > self.long_mm - _SAME_LENGTH_MM

    @property
    def short(self) -> bool:
        """Whether the spring is as short as it gets in the scan."""
        return self.length_mm - self.short_mm < _SAME_LENGTH_MM

    def length_over_mm(self, height_mm: float) -> float:
        """Longest spring whose tip clears a height of the world, within what the scan may take."""
        offset_mm = self._robot.config.geometry.tip_offset_mm + self._settings.clearance_mm
        length_mm = self.position_mm[2] - height_mm - offset_mm
        return min(max(length_mm, self.short_mm), self.long_mm)

    # ---------------------------------------------------------------------------- moves

    def retract(self, length_mm: float | None = None) -> None:
        """Shorten the spring; to its least length of the scan, unless told otherwise."""
        target_mm = self.short_mm if length_mm is None else length_mm
        for attempt in range(1, _RETRACTIONS + 1):
            if self.length_mm - target_mm <= _SAME_LENGTH_MM:
                return
            try:
                self._robot.compress(target_mm, speed_mm_s=self._settings.retract_speed_mm_s)
            except TrippedError:
                # A bristle that is bent against something may press harder before it comes
                # free. The board allows for that once it is told to go on.
                if attempt == _RETRACTIONS:
                    raise
                self._robot.resume()

    def _end_retraction(self, length_mm: float) -> None:
        """After a contact: the board's own retraction ends early where the bristle presses harder.

        What follows takes the robot for as short as it was told to get.
        """
        self.retract(max(length_mm, self.short_mm))

    def lower(self, length_mm: float) -> None:
        """Extend to a length that is known to be free, where that saves more than it takes."""
        if length_mm - self.length_mm <= _WORTH_LOWERING_MM:
            return
        try:
            self._robot.compress(length_mm, speed_mm_s=self._settings.retract_speed_mm_s)
        except TrippedError:
            self._robot.resume()
            self.retract()

    def go(self, x_mm: float, y_mm: float, *, retract_to_mm: float | None = None) -> bool:
        """Take the arm to a place with the bristle watching.

        On a contact the board makes the robot short by itself, and the arm stops where it is.

        Parameters
        ----------
        retract_to_mm
            The length after a contact; None: the least.

        Returns
        -------
        bool
            Whether something was touched.

        Raises
        ------
        HeightWindowError
            The robot is short already: what it touched is too high to be stepped over.
        """
        if self._is_here(x_mm, y_mm):
            return False
        approach = self._approach(x_mm, y_mm)
        retract_mm = self.short_mm if retract_to_mm is None else retract_to_mm
        try:
            contact = self._robot.hold_guarded(
                approach.begin,
                approach.busy,
                approach.abort,
                timeout_s=approach.timeout_s,
                retract_mm=None if self.short else (0.0, 0.0, min(retract_mm, self.length_mm)),
            )
        except RefusedError as refusal:
            self._in_touch(refusal)
            return True
        if contact is not None:
            self._stopped(contact)
            self._end_retraction(retract_mm)
        return contact is not None

    def feel(self, *, near_mm: float | None = None) -> Feeling | None:
        """Extend to the full length or the first contact.

        After a contact the robot is as long as before, otherwise extended. Extended already, it
        feels nothing further.

        Parameters
        ----------
        near_mm
            How far down the surface is expected; from there on the robot extends faster.
            None: nobody knows.

        Returns
        -------
        Feeling or None
            None where the bristle was in touch before: the robot is short now.
        """
        return self._feel(None, near_mm)

    def go_and_feel(
        self, x_mm: float, y_mm: float, *, near_mm: float | None = None
    ) -> Feeling | None:
        """`go` and `feel` under one watch, which saves a baseline.

        Returns
        -------
        Feeling or None
            None after a contact on the way: the arm has stopped there.
        """
        if self._is_here(x_mm, y_mm):
            return self._feel(None, near_mm)
        if self.extended:  # no extension would take the arm along
            return None if self.go(x_mm, y_mm) else self._feel(None, near_mm)
        aborted = False
        approach = self._approach(x_mm, y_mm)

        def abort() -> None:
            nonlocal aborted
            aborted = True
            approach.abort()

        def busy() -> bool:
            moving = approach.busy()
            if not moving:  # what was grazed on the way is no slip of this place
                self._watch.begin()
            return moving

        feeling = self._feel(dataclasses.replace(approach, busy=busy, abort=abort), near_mm)
        if not aborted or feeling is None or feeling.contact is None:
            return feeling
        self._stopped(feeling.contact)
        return None

    def _feel(self, approach: Approach | None, near_mm: float | None) -> Feeling | None:
        begin_mm = min(max(self.length_mm, self.short_mm), self.long_mm)
        slow_mm = self.long_mm if near_mm is None else min(begin_mm + near_mm, self.long_mm)
        settings = self._settings
        stages = [(slow_mm, settings.extend_speed_mm_s), (self.long_mm, settings.seek_speed_mm_s)]
        contact = None
        self._watch.begin()
        try:
            for target_mm, speed_mm_s in stages:
                if target_mm - self.length_mm > _SAME_LENGTH_MM and contact is None:
                    contact = self._robot.probe(
                        (0.0, 0.0, target_mm),
                        speed_mm_s=speed_mm_s,
                        retract_mm=(0.0, 0.0, begin_mm),
                        approach=approach,
                    )
                    approach = None
            if contact is not None:
                self._end_retraction(begin_mm)
        except RefusedError as refusal:
            self._in_touch(refusal)
            return None
        slipped = self._watch.fell_hpa() > self._settings.slip_hpa
        if contact is None:
            return Feeling(mark="lost" if slipped else "empty", height_mm=math.nan, contact=None)
        tip_mm = contact.tip_mm[2] - self._settings.contact_depth_mm
        mark = "felt"
        if contact.position_mm[2] - begin_mm < _AT_ONCE_MM:
            mark = "double"
        elif slipped:
            mark = "slipped"
        return Feeling(mark=mark, height_mm=self.position_mm[2] - tip_mm, contact=contact)

    def _in_touch(self, refusal: RefusedError) -> None:
        """After a refused baseline: too little pressure for a contact, too much for none."""
        if refusal.reason == _IN_TOUCH and self.short:
            x_mm, y_mm, _ = self.position_mm
            hint = "See that the bristle hangs free there, and begin where it touches nothing."
            if self._is_here(0.0, 0.0):
                # Its pressure at rest was measured before the robot retracted.
                hint = (
                    "The bristle was in touch already when the board was connected, or it is "
                    "caught now. Raise the arm's start until the robot at its free length touches "
                    "nothing, then scan anew."
                )
            refusal.add_note(
                f"That was {x_mm:.0f}, {y_mm:.0f} mm from the first place, with the robot short. "
                + hint
            )
        if refusal.reason != _IN_TOUCH or self.short:
            raise refusal
        self.emit("in_touch", position_mm=list(self.position_mm), length_mm=self.length_mm)
        self.retract()

    def _is_here(self, x_mm: float, y_mm: float) -> bool:
        return math.dist(self.position_mm[:2], (x_mm, y_mm)) < _HERE_MM

    def _approach(self, x_mm: float, y_mm: float) -> Approach:
        origin_mm = self._origin_mm
        target_mm = (origin_mm[0] + x_mm, origin_mm[1] + y_mm, origin_mm[2])
        self.emit("step", target_mm=[x_mm, y_mm], length_mm=round(self.length_mm, 3))
        return Approach(
            begin=lambda: self._stage.move_to(target_mm),
            busy=lambda: self._stage.moving,
            abort=self._stage.stop,
            timeout_s=self._arm_timeout_s(target_mm),
        )

    def _stopped(self, contact: Contact) -> None:
        """After a contact in a step: wait for the arm, tell of it."""
        self._robot.wait(
            lambda: not self._stage.moving,
            timeout_s=self._arm_timeout_s(self._stage.position_mm),
            what="the arm to come to rest",
        )
        self.emit("step_contact", position_mm=list(self.position_mm), contact=contact_data(contact))
        if self._short_at_contact(contact):
            raise self.too_high()

    def too_high(self) -> HeightWindowError:
        """What the short robot touched, where the arm is."""
        x_mm, y_mm, _ = self.position_mm
        return HeightWindowError(
            f"The retracted bristle touched something {x_mm:.0f}, {y_mm:.0f} mm from the first "
            "place: it can't be stepped over.",
            "Raise the arm's start, see that the short robot is straight, and scan anew.",
        )

    def _short_at_contact(self, contact: Contact) -> bool:
        return contact.position_mm[2] - self.short_mm < _SAME_LENGTH_MM

    def stop(self, error: BaseException) -> None:
        """Stop arm and robot."""
        stop_all(error, self._stage.stop, self._robot.stop)

    def emit(self, name: str, **data: Any) -> None:
        """Tell of something that happened."""
        if self._on_event is not None:
            self._on_event(Event(time_us=self.now_us, name=name, data=data))

    def _arm_timeout_s(self, target_mm: tuple[float, float, float]) -> float:
        if self._fixed_arm_timeout_s is not None:
            return self._fixed_arm_timeout_s
        return move_timeout_s(self._robot.config.stage, self._stage.position_mm, target_mm)


def contact_data(contact: Contact) -> dict[str, Any]:
    """Of a contact, for a log; JSON-ready."""
    return {
        "time_us": contact.time_us,
        "tip_mm": list(contact.tip_mm),
        "uncertainty_mm": contact.uncertainty_mm,
        "pressure_hpa": contact.pressure_hpa,
        "baseline_hpa": contact.baseline_hpa,
    }
