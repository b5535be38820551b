"""What a command with a robot arm would do, without doing it."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from setae.cli.common import console
from setae.config import Config
from setae.errors import ArmBoxError, InputError
from setae.ur import UrStage


def show_arm_targets(
    stage: str | None, config: Config, targets_mm: Sequence[tuple[float, float, float]]
) -> None:
    """Connect to the arm and show where it would go; nothing moves.

    Parameters
    ----------
    stage
        The arm's URL.
    targets_mm
        Of frame D's origin in the world, which begins where the arm is now.

    Raises
    ------
    InputError
        No arm was named.
    ArmBoxError
        A target lies outside the box; the table says which.
    StageError
        The arm can't be driven.
    """
    if stage is None:
        raise InputError("--dry-run looks at an arm.", "Give --stage ur://ADDRESS too.")
    outside = 0
    table = Table()
    for name in ("x, y, z from the start, mm", "in the arm's base frame, mm", "in the box"):
        table.add_column(name, overflow="fold")
    with UrStage(stage, config) as arm:
        for target_mm in targets_mm:
            try:
                arm.require_reachable(target_mm)
                inside = "yes"
            except ArmBoxError:
                outside += 1
                inside = "no"
            table.add_row(_row(target_mm), _row(arm.base_mm(target_mm)), inside)
        console.print(f"{arm.name}: running, remote control, no safety stop. Nothing was moved.")
    console.print(table)
    if outside:
        raise ArmBoxError(f"{outside} of {len(targets_mm)} targets lie outside the box.")


def _row(point_mm: Sequence[float]) -> str:
    return ", ".join(f"{value_mm:z.1f}" for value_mm in point_mm)
