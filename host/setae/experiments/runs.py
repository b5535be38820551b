"""Validations as their logs hold them: one run for each tendon model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from setae import kinematics, workspace
from setae.config import Config
from setae.errors import LogError
from setae.experiments.accuracy import Pose
from setae.experiments.targets import Target, find, paper_targets
from setae.record import Log

__all__ = ["EXPERIMENT", "UNSOLVED", "Run", "of_kind", "read"]

EXPERIMENT: Final = "validate"
"""What the metadata of such a log names."""


UNSOLVED: Final = "unsolved"
"""Event of a target at which the simulated spring had come to no solution: label, residual."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Run:
    """All that was measured under one tendon model.

    Attributes
    ----------
    model
        Tendon model of the commands.
    poses
        The measured ones, by the order of all targets.
    visited
        Labels of all targets that the robot was sent to, measured or not.
    cut_mm
        By how much the commands fell short of what the model asked for, by label,
        where they did.
    unsolved
        Labels of the targets that were not measured, because the simulated spring had come to
        no solution there, with the residual.
    complete
        Whether a log came to its end: one that is resumed drives to all that is left.
    targets
        All targets of the robot.
    config
        Its configuration.
    logs
        The logs, in their order.
    """

    model: str
    poses: tuple[Pose, ...]
    visited: tuple[str, ...]
    cut_mm: dict[str, float]
    unsolved: dict[str, float]
    complete: bool
    targets: tuple[Target, ...]
    config: Config
    logs: tuple[Log, ...]

    def held(self, targets: Sequence[Target]) -> NDArray[np.bool_]:
        """Whether tendons that only pull can hold each of some targets, (p,)."""
        wanted_mm = np.array([target.position_mm for target in targets]).reshape(-1, 3)
        return workspace.check(kinematics.inverse(wanted_mm), self.config, "paper").holdable

    @property
    def metadata(self) -> dict[str, Any]:
        """Of the first log."""
        return self.logs[0].metadata

    @property
    def simulated(self) -> bool:
        """Whether the robot was simulated."""
        return self.logs[0].simulated

    @property
    def noise_sd_mm(self) -> float:
        """What was added to true positions, along each axis."""
        return float(self.metadata.get("noise_sd_mm") or 0.0)

    @property
    def unsolved_text(self) -> str:
        """Which targets were not measured for want of a solution, in words; empty without any."""
        if not self.unsolved:
            return ""
        places = ", ".join(f"{label} (residual {value:.1g})" for label, value in
                           self.unsolved.items())  # fmt: skip
        return f"not measured, for the simulated spring had no solution there: {places}"

    @property
    def source(self) -> str:
        """Where the positions come from, in words."""
        if files := self.metadata.get("positions"):
            return f"measured, from {', '.join(files)}"
        if not self.simulated:
            return "driven, not measured yet"
        text = "the simulator's truth"
        if self.noise_sd_mm:
            text += f" with noise of {self.noise_sd_mm:g} mm (SD) along each axis"
        return text


def of_kind(logs: Iterable[Log], experiment: str) -> list[Log]:
    """Those logs whose metadata name an experiment."""
    return [log for log in logs if log.metadata.get("experiment") == experiment]


def read(logs: Iterable[Log]) -> tuple[Run, ...]:
    """Gather the runs of a validation from its logs.

    Parameters
    ----------
    logs
        In any order; those of other experiments are no good.

    Raises
    ------
    LogError
        One of them holds no validation.
    """
    by_model: dict[str, list[Log]] = {}
    for log in logs:
        if log.metadata.get("experiment") != EXPERIMENT:
            raise LogError(
                f"{log.path} holds no validation.", "Give the log of a run of `setae validate`."
            )
        by_model.setdefault(str(log.metadata.get("model")), []).append(log)
    return tuple(_run(model, parts) for model, parts in by_model.items())


def _run(model: str, logs: Sequence[Log]) -> Run:
    config = logs[0].config
    targets = paper_targets(config)
    found: dict[str, Pose | None] = {}
    cut_mm: dict[str, float] = {}
    unsolved: dict[str, float] = {}
    for log in logs:
        for event in log.events(UNSOLVED):
            unsolved[str(event.data["label"])] = float(event.data["residual"])
        for event in log.events("target"):
            target = find(str(event.data["label"]), targets)
            if target is None:
                continue
            position = event.data["position_mm"]
            if position is not None:
                # A coordinate that was not seen is null.
                found[target.label] = Pose(target, np.array(position, dtype=float))
            else:
                found.setdefault(target.label, None)
            if event.data.get("cut_mm"):
                cut_mm[target.label] = float(event.data["cut_mm"])
    poses = [found.get(target.label) for target in targets]
    return Run(
        model=model,
        poses=tuple(pose for pose in poses if pose is not None),
        visited=tuple(found),
        cut_mm=cut_mm,
        unsolved={
            label: residual for label, residual in unsolved.items() if found.get(label) is None
        },
        complete=any(log.events("validate_end") for log in logs),
        targets=targets,
        config=config,
        logs=tuple(logs),
    )
