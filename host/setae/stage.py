"""What carries the robot: an arm or a linear stage that moves frame D through the world.

A stage is driven without waiting: `Stage.move_to` starts a move and returns,
`Stage.poll` looks at what became of it. The session's one waiting loop polls
the stage together with the robot, so each is watched while the other moves.
"""

from __future__ import annotations

import contextlib
import math
import select
import sys
import termios
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import IO, Protocol, runtime_checkable

import numpy as np

from setae.config import Stage as Bounds
from setae.errors import StageError


@runtime_checkable
class Stage(Protocol):
    """Moves the origin of frame D. Positions are world coordinates in mm, z up."""

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Where the origin of frame D is now."""
        ...

    @property
    def moving(self) -> bool:
        """True from `move_to` until the target is reached or the stage has stopped."""
        ...

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
            Target of frame D's origin, (3,).
        speed_mm_s, acceleration_mm_s2
            Bounds of the move; None takes the configured ones.

        Raises
        ------
        StageError
            The stage can't take the move; the message says why.
        """
        ...

    def stop(self) -> None:
        """Brake now; returns without waiting for rest."""
        ...

    def poll(self, now_us: int) -> None:
        """Look at the stage at this time. Raises StageError once it has failed."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A straight move that a stage can take.

    Attributes
    ----------
    target_mm
        Of frame D's origin in the world, (3,).
    speed_mm_s, acceleration_mm_s2
        Bounds.
    """

    target_mm: tuple[float, float, float]
    speed_mm_s: float
    acceleration_mm_s2: float


def checked_move(
    position_mm: Sequence[float],
    speed_mm_s: float | None,
    acceleration_mm_s2: float | None,
    bounds: Bounds,
) -> Move:
    """Check what `Stage.move_to` was given; `bounds` stand in for None.

    Raises
    ------
    StageError
        A value is no good.
    """
    target = np.asarray(position_mm, dtype=np.float64)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise StageError(f"The arm can't go to {position_mm}.", "Give three finite numbers, in mm.")
    speed = bounds.speed_mm_s if speed_mm_s is None else speed_mm_s
    acceleration = bounds.acceleration_mm_s2 if acceleration_mm_s2 is None else acceleration_mm_s2
    for name, value in (("speed_mm_s", speed), ("acceleration_mm_s2", acceleration)):
        if not (math.isfinite(value) and value > 0):
            raise StageError(f"{name} is {value}.", "Give a positive number.")
    x_mm, y_mm, z_mm = target.tolist()
    return Move(target_mm=(x_mm, y_mm, z_mm), speed_mm_s=speed, acceleration_mm_s2=acceleration)


# Beyond the time that speed and acceleration ask for, before a move counts as failed.
_SLACK_S = 5.0


def move_timeout_s(
    bounds: Bounds, position_mm: Sequence[float], target_mm: Sequence[float]
) -> float:
    """Longest time for a move from a position to a target, (3,) each.

    Parameters
    ----------
    bounds
        Speed and acceleration of the move.
    """
    distance_mm = math.dist(position_mm, target_mm)
    return (
        distance_mm / bounds.speed_mm_s + bounds.speed_mm_s / bounds.acceleration_mm_s2 + _SLACK_S
    )


class Enter:
    """The Enter key of a person who was asked for something; never waited for.

    Parameters
    ----------
    answers
        Where Enter is read from: an open text file that `select` can watch. None:
        the terminal.
    """

    def __init__(self, answers: IO[str] | None = None) -> None:
        self._answers = answers if answers is not None else sys.stdin

    def forget(self) -> None:
        """Drop what was typed before the question: it can't be the answer."""
        with contextlib.suppress(AttributeError, OSError, ValueError, termios.error):
            termios.tcflush(self._answers.fileno(), termios.TCIFLUSH)

    def pressed(self) -> bool:
        """Whether Enter was pressed since the last one.

        Raises
        ------
        StageError
            There is nobody to press it: the input ended, or there is none.
        """
        try:
            readable, _, _ = select.select([self._answers], [], [], 0)
            if not readable:
                return False
            line = self._answers.readline()
        except (AttributeError, OSError, TypeError, ValueError):  # closed, or never opened
            line = ""
        if not line:
            raise StageError("Nobody can press Enter: the input ended.", "Run it in a terminal.")
        return True


class ManualStage:
    """A stage that a person moves, with the arm's own pendant or by hand.

    Each move is asked for in words, and ends when the person presses Enter.
    Positions count from where it was made: they are what was asked for, not
    measured.

    Parameters
    ----------
    ask
        Shows a line to the person.
    answers
        Where Enter is read from: an open text file that `select` can watch.
    """

    def __init__(
        self, *, ask: Callable[[str], object] = print, answers: IO[str] | None = None
    ) -> None:
        self._ask = ask
        self._enter = Enter(answers)
        self._position_mm = (0.0, 0.0, 0.0)
        self._target_mm: tuple[float, float, float] | None = None

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """The last position that the person confirmed."""
        return self._position_mm

    @property
    def moving(self) -> bool:
        """True until the person has confirmed the move."""
        return self._target_mm is not None

    def move_to(
        self,
        position_mm: Sequence[float],
        *,
        speed_mm_s: float | None = None,
        acceleration_mm_s2: float | None = None,
    ) -> None:
        """Ask for a move; speed and acceleration are the person's."""
        del speed_mm_s, acceleration_mm_s2
        x_mm, y_mm, z_mm = (float(value) for value in position_mm)
        self._target_mm = (x_mm, y_mm, z_mm)
        self._enter.forget()
        self._ask(
            f"Move the arm to x {x_mm:g}, y {y_mm:g}, z {z_mm:g} mm from its start, slowly,"
            " then press Enter."
        )

    def stop(self) -> None:
        """Tell the person to stop, if a move was asked for."""
        if self._target_mm is not None:
            self._target_mm = None
            self._ask("STOP THE ARM.")

    def poll(self, now_us: int) -> None:
        """Look whether Enter was pressed; never waits."""
        del now_us
        if self._target_mm is not None and self._enter.pressed():
            self._position_mm, self._target_mm = self._target_mm, None
