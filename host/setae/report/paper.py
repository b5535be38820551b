"""The paper's own results, for comparison. The numbers live in ``paper.json``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources
from typing import Any

from setae.experiments.accuracy import Spread


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperTrial:
    """One trial of the paper's tube exploration.

    Attributes
    ----------
    obstacle_below_tip_mm
        Distance from the compressed bristle's tip at the start down to the
        cube's top; None in the trial without an obstacle.
    descent_mm
        Where the arm ended its way down.
    contact
        Whether a contact was detected.
    """

    obstacle_below_tip_mm: float | None
    descent_mm: float
    contact: bool


def trials() -> tuple[PaperTrial, ...]:
    """All trials that the paper reports.

    Examples
    --------
    >>> [trial.descent_mm for trial in trials()]
    [40, 60, 80, 100, 100]
    """
    return tuple(
        PaperTrial(
            obstacle_below_tip_mm=trial["obstacle_below_tip_mm"],
            descent_mm=trial["descent_mm"],
            contact=trial["contact"],
        )
        for trial in _data()["trials"]
    )


def trial_like(obstacle_below_tip_mm: float | None) -> PaperTrial | None:
    """Return the paper's trial with this obstacle; None where it has none."""
    for trial in trials():
        theirs = trial.obstacle_below_tip_mm
        if theirs is None or obstacle_below_tip_mm is None:
            if theirs is obstacle_below_tip_mm:
                return trial
        elif abs(theirs - obstacle_below_tip_mm) < 0.5:
            return trial
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperErrors:
    """The paper's errors of one group of targets, in the bending plane.

    Attributes
    ----------
    targets
        How many.
    distance
        Of the distance from the target.
    lateral, height
        Of the sizes of the errors along x (or y) and z; None where it gives none.
    """

    targets: int
    distance: Spread
    lateral: Spread | None
    height: Spread | None


def validation() -> dict[str, PaperErrors]:
    """The errors of the paper's five groups, and of all targets together as ``"all"``.

    Examples
    --------
    >>> validation()["+X"].distance
    Spread(mean_mm=5.47, sd_mm=3.48)
    """
    return {
        group: PaperErrors(
            targets=row["targets"],
            distance=Spread(*row["distance"]),
            lateral=Spread(*row["lateral"]) if "lateral" in row else None,
            height=Spread(*row["height"]) if "height" in row else None,
        )
        for group, row in _data()["validation"]["groups"].items()
    }


def validation_source() -> str:
    """Where those numbers come from."""
    return str(_data()["validation"]["source"])


def source() -> str:
    """Where the numbers come from."""
    return str(_data()["source"])


def _data() -> dict[str, Any]:
    text = resources.files("setae.report").joinpath("paper.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data
