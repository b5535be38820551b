"""The simulated arm as a stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from setae.config import Stage as Bounds
from setae.errors import StageError
from setae.sim.world import World
from setae.stage import checked_move

__all__ = ["Follower", "SimulatedStage"]


class HasPosition(Protocol):
    """What moves the arm from outside."""

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Where the origin of frame D is now."""
        ...


class Follower:
    """Makes the arm of a world follow a stage that lives outside of it.

    Put it behind the stage in a session's pollables.
    """

    def __init__(self, world: World, stage: HasPosition) -> None:
        self._world = world
        self._stage = stage
        self._followed_mm = world.arm_mm

    def poll(self, now_us: int) -> None:
        """Send the arm to where the stage is."""
        del now_us
        position_mm = self._stage.position_mm
        if position_mm != self._followed_mm:
            self._followed_mm = position_mm
            self._world.arm_follow(position_mm)


class SimulatedStage:
    """A `setae.stage.Stage` that moves the arm of a world.

    Parameters
    ----------
    world
        The world that the robot's board lives in too; it has been started.
    bounds
        Speed and acceleration of a move that names none, and of braking.
    """

    def __init__(self, world: World, bounds: Bounds) -> None:
        self._world = world
        self._bounds = bounds

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Where the origin of frame D is now, in the world."""
        return self._world.arm_mm

    @property
    def moving(self) -> bool:
        """Whether the arm moves."""
        return self._world.arm_moving

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
            Bounds of the move; None takes the stage's own.

        Raises
        ------
        StageError
            The arm is moving, or a value is no good.
        """
        move = checked_move(position_mm, speed_mm_s, acceleration_mm_s2, self._bounds)
        if self.moving:
            raise StageError("The arm is moving already.", "Wait for it, or stop it first.")
        self._world.arm_move(move.target_mm, move.speed_mm_s, move.acceleration_mm_s2)

    def stop(self) -> None:
        """Brake now; returns without waiting for rest."""
        self._world.arm_stop(self._bounds.acceleration_mm_s2)

    def poll(self, now_us: int) -> None:
        """Do nothing: the world moves the arm, and it can't fail."""
        del now_us
