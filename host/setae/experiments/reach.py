"""Whether the arm may go everywhere that an experiment would send it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from setae.stage import Stage
from setae.ur import UrStage

__all__ = ["require_reachable"]


def require_reachable(stage: Stage, targets_mm: Iterable[Sequence[float]]) -> None:
    """Check all targets of an experiment before it moves anything.

    Parameters
    ----------
    stage
        The arm, at its start. Only a UR arm has a box.
    targets_mm
        Of frame D's origin, from where the arm is now, (3,) each. What lies on the straight
        lines between them is inside where they are.

    Raises
    ------
    ArmBoxError
        A target lies outside the box.
    """
    if not isinstance(stage, UrStage):
        return
    start_mm = stage.position_mm
    for target_mm in targets_mm:
        stage.require_reachable(
            [start + way for start, way in zip(start_mm, target_mm, strict=True)]
        )
