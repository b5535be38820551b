"""The paper's confined space exploration.

The arm lowers the robot in steps of 2 cm. After each step the robot compresses
to 45 mm and extends to (15 cos α, 15 sin α, 60) mm in frame D for eight α, with
a re-compression between them. A contact stops the extension; the board itself
retracts to the compressed state, and the remaining directions are still
scanned. After a scan with a contact the arm returns to its start; otherwise it
takes the next step.

Beyond the paper, the bristle also watches while the arm lowers: a contact then
stops the arm, and the arm returns without a scan.

Robot and arm may be real or simulated; nothing here can tell.

Its events are trial_start, arm_lowering, lowering_contact, level_start,
direction_start, direction_end, level_end, arm_return, trial_end and
trial_aborted.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from setae.errors import SetaeError
from setae.experiments.descent import (
    Point,
    arm_targets_mm,
    scan_directions_deg,
    targets_mm,
    tip_in_world,
)
from setae.experiments.events import Event, OnEvent
from setae.experiments.reach import require_reachable
from setae.robot import Contact, Robot
from setae.scene import Obstacle
from setae.stage import Stage, move_timeout_s
from setae.stopping import stop_all


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """A contact of the exploration.

    Attributes
    ----------
    level
        1 for the first step down.
    descent_mm
        How far the arm had gone down.
    alpha_deg
        Direction of the extension; None for a contact while the arm lowered.
    tip_mm, tip_world_mm
        Estimated place of the bristle's tip, in frame D and in the world.
    uncertainty_mm
        Of the spring's top at the contact, as in `setae.contact.Contact`; the tip
        swings farther.
    pressure_hpa, baseline_hpa
        The deciding sample, and what it was compared with.
    time_us
        Of the deciding sample, by the session's clock.
    """

    level: int
    descent_mm: float
    alpha_deg: float | None
    tip_mm: Point
    tip_world_mm: Point
    uncertainty_mm: float
    pressure_hpa: float
    baseline_hpa: float
    time_us: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExploreResult:
    """Outcome of one trial.

    Attributes
    ----------
    obstacle
        What had been put into the tube, if it was told; the cycle doesn't know it.
    descent_mm
        How far the arm went down.
    levels
        Steps taken.
    directions_scanned
        Extensions carried out, with or without contact.
    contacts
        All contacts, in their order.
    duration_s
        By the session's clock.
    """

    obstacle: Obstacle | None
    descent_mm: float
    levels: int
    directions_scanned: int
    contacts: tuple[Touch, ...]
    duration_s: float


def explore(
    robot: Robot,
    stage: Stage,
    *,
    obstacle: Obstacle | None = None,
    on_event: OnEvent | None = None,
    arm_timeout_s: float | None = None,
) -> ExploreResult:
    """Run one trial from where the arm stands.

    The robot must be enabled. Whatever goes wrong, Ctrl-C included, arm and
    robot are stopped before the exception leaves.

    Parameters
    ----------
    robot
        Enabled robot.
    stage
        Arm that carries it, at its start.
    obstacle
        What was put into the tube, for result and log only.
    on_event
        Called with each `Event` as it happens.
    arm_timeout_s
        Longest time for a move of the arm; None: what its configured speed asks
        for, and some seconds.

    Returns
    -------
    ExploreResult

    Raises
    ------
    UnreachableError
        The robot can't reach a target of the scan; nothing has moved.
    ArmBoxError
        A level lies outside the arm's box; nothing has moved.
    SetaeError
        Whatever ended the trial; the arm stays where it stopped.
    """
    trial = _Trial(robot, stage, obstacle, on_event, arm_timeout_s)
    require_reachable(stage, arm_targets_mm(robot.config))
    return trial.run()


class _Trial:
    def __init__(
        self,
        robot: Robot,
        stage: Stage,
        obstacle: Obstacle | None,
        on_event: OnEvent | None,
        arm_timeout_s: float | None,
    ) -> None:
        self._robot = robot
        self._stage = stage
        self._settings = robot.config.explore
        self._targets_mm = targets_mm(robot.config)
        self._obstacle = obstacle
        self._on_event = on_event
        self._fixed_arm_timeout_s = arm_timeout_s
        self._start_mm = stage.position_mm
        self._start_us = robot.now_us
        self._contacts: list[Touch] = []
        self._level = 0
        self._scanned = 0

    def run(self) -> ExploreResult:
        self._emit(
            "trial_start",
            obstacle=_obstacle_data(self._obstacle),
            start_mm=list(self._start_mm),
            steps=self._settings.steps,
            step_mm=self._settings.step_mm,
        )
        try:
            descent_mm = self._descend()
            self._return()
        except BaseException as error:
            self._make_safe(error)
            raise
        result = ExploreResult(
            obstacle=self._obstacle,
            descent_mm=descent_mm,
            levels=self._level,
            directions_scanned=self._scanned,
            contacts=tuple(self._contacts),
            duration_s=(self._robot.now_us - self._start_us) / 1e6,
        )
        self._emit(
            "trial_end",
            descent_mm=result.descent_mm,
            levels=result.levels,
            directions_scanned=result.directions_scanned,
            contacts=[_touch_data(touch) for touch in result.contacts],
            duration_s=result.duration_s,
        )
        return result

    def _descend(self) -> float:
        """Step down and scan until something was touched; how far the arm went."""
        # The arm lowers only with the robot short: its tip then goes first.
        self._compress()
        for level in range(1, self._settings.steps + 1):
            self._level = level
            if not self._lower():
                break
            self._scan()
            if self._contacts:
                break
        return self._descent_mm()

    def _lower(self) -> bool:
        """One step down with the bristle watching. False after a contact."""
        x_mm, y_mm, z_mm = self._start_mm
        target_mm = (x_mm, y_mm, z_mm - self._level * self._settings.step_mm)
        self._emit("arm_lowering", level=self._level, target_mm=list(target_mm))
        contact = self._robot.hold_guarded(
            begin=lambda: self._stage.move_to(target_mm),
            busy=lambda: self._stage.moving,
            abort=self._stage.stop,
            timeout_s=self._arm_timeout_s(target_mm),
        )
        if contact is None:
            return True
        self._wait_for_arm(self._stage.position_mm)
        self._contacts.append(self._touch(contact, alpha_deg=None))
        self._emit("lowering_contact", contact=_touch_data(self._contacts[-1]))
        return False

    def _scan(self) -> None:
        self._emit("level_start", level=self._level, descent_mm=self._descent_mm())
        directions_deg = scan_directions_deg(self._settings.directions)
        for alpha_deg, target_mm in zip(directions_deg, self._targets_mm, strict=True):
            self._compress()
            self._probe(alpha_deg, target_mm)
        self._compress()
        touched = [touch.alpha_deg for touch in self._contacts]
        self._emit(
            "level_end", level=self._level, descent_mm=self._descent_mm(), touched_deg=touched
        )

    def _probe(self, alpha_deg: float, target_mm: Point) -> None:
        settings = self._settings
        self._emit("direction_start", alpha_deg=alpha_deg, target_mm=list(target_mm))
        contact = self._robot.probe(
            target_mm,
            duration_s=settings.extend_duration_s,
            retract_mm=(0.0, 0.0, settings.compressed_length_mm),
        )
        self._scanned += 1
        if contact is None:
            self._emit("direction_end", alpha_deg=alpha_deg, touched=False)
            return
        touch = self._touch(contact, alpha_deg=alpha_deg)
        self._contacts.append(touch)
        self._emit("direction_end", alpha_deg=alpha_deg, touched=True, contact=_touch_data(touch))

    def _return(self) -> None:
        self._compress()
        self._emit("arm_return", target_mm=list(self._start_mm), descent_mm=self._descent_mm())
        self._stage.move_to(self._start_mm)
        self._wait_for_arm(self._start_mm)

    def _make_safe(self, error: BaseException) -> None:
        """Stop arm and robot."""
        stop_all(error, self._stage.stop, self._robot.stop)
        # If the log is what failed, it can't be told there.
        with contextlib.suppress(SetaeError):
            self._emit("trial_aborted", reason=f"{type(error).__name__}: {error}".strip(": "))

    def _compress(self) -> None:
        self._robot.compress(
            self._settings.compressed_length_mm, duration_s=self._settings.retract_duration_s
        )

    def _wait_for_arm(self, target_mm: Sequence[float]) -> None:
        self._robot.wait(
            lambda: not self._stage.moving,
            timeout_s=self._arm_timeout_s(target_mm),
            what="the arm to come to rest",
        )

    def _arm_timeout_s(self, target_mm: Sequence[float]) -> float:
        if self._fixed_arm_timeout_s is not None:
            return self._fixed_arm_timeout_s
        return move_timeout_s(self._robot.config.stage, self._stage.position_mm, target_mm)

    def _descent_mm(self) -> float:
        return round(self._start_mm[2] - self._stage.position_mm[2], 3)

    def _touch(self, contact: Contact, *, alpha_deg: float | None) -> Touch:
        return Touch(
            level=self._level,
            descent_mm=self._descent_mm(),
            alpha_deg=alpha_deg,
            tip_mm=contact.tip_mm,
            tip_world_mm=tip_in_world(contact.tip_mm, self._stage.position_mm),
            uncertainty_mm=contact.uncertainty_mm,
            pressure_hpa=contact.pressure_hpa,
            baseline_hpa=contact.baseline_hpa,
            time_us=contact.time_us,
        )

    def _emit(self, name: str, **data: object) -> None:
        if self._on_event is not None:
            self._on_event(Event(time_us=self._robot.now_us, name=name, data=data))


class Setup(Protocol):
    """What `run_trials` needs of a rig."""

    @property
    def robot(self) -> Robot:
        """The robot, enabled."""
        ...

    @property
    def stage(self) -> Stage:
        """The arm that carries it, at its start."""
        ...


def run_trials(
    setup: Callable[[int, Obstacle | None], AbstractContextManager[tuple[Setup, OnEvent | None]]],
    *,
    obstacles: Iterable[Obstacle | None],
    arm_timeout_s: float | None = None,
) -> list[ExploreResult]:
    """Run one trial per obstacle, each with a set-up of its own.

    Parameters
    ----------
    setup
        Called with the trial's number, from 1, and its obstacle. Its context
        holds an enabled robot with its arm, and where the events go.
    obstacles
        What is put into the tube; None for nothing.
    arm_timeout_s
        As in `explore`.

    Returns
    -------
    list of ExploreResult
        In the order of the obstacles.
    """
    results = []
    for number, obstacle in enumerate(obstacles, start=1):
        with setup(number, obstacle) as (rig, on_event):
            results.append(
                explore(
                    rig.robot,
                    rig.stage,
                    obstacle=obstacle,
                    on_event=on_event,
                    arm_timeout_s=arm_timeout_s,
                )
            )
    return results


def _obstacle_data(obstacle: Obstacle | None) -> dict[str, float] | None:
    if obstacle is None:
        return None
    return {
        "below_tip_mm": obstacle.below_tip_mm,
        "azimuth_deg": obstacle.azimuth_deg,
        "edge_mm": obstacle.edge_mm,
    }


def _touch_data(touch: Touch) -> dict[str, Any]:
    return {
        "level": touch.level,
        "descent_mm": touch.descent_mm,
        "alpha_deg": touch.alpha_deg,
        "tip_mm": list(touch.tip_mm),
        "tip_world_mm": list(touch.tip_world_mm),
        "uncertainty_mm": touch.uncertainty_mm,
        "pressure_hpa": touch.pressure_hpa,
        "baseline_hpa": touch.baseline_hpa,
        "time_us": touch.time_us,
    }
