"""Which imperfection costs how much: each alone, each mended, and all together.

A plant is a set of the simulator's parameters. Here it is taken apart into causes, and
the same targets are driven on plants that have some of them. What a cause adds alone
and what mending it gains are two questions: causes hide one another, and the second
tells a lab what to mend first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from setae.errors import InputError
from setae.experiments.accuracy import OVERALL, Pose, by_group
from setae.record import Log

__all__ = [
    "EXPERIMENT", "Case", "Effect", "cases", "compared", "effects", "known", "left_out", "told"
]  # fmt: skip

EXPERIMENT: Final = "causes"
"""What the metadata of such a log names."""

MODEL: Final = "tendon model"

Kind = Literal["none", "alone", "mended", "all"]

# What every simulated robot has, however ideal: what a lab could still mend.
_ALWAYS: Final[Mapping[str, Mapping[str, float]]] = {
    "servo dead band": {"servo.dead_band_us": 0.0},
    "weight and load": {"plant.gravity_m_s2": 0.0},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One plant to drive on.

    Attributes
    ----------
    kind
        ``none``: no imperfection; ``alone``: only this cause; ``mended``: all but this
        cause; ``all``.
    cause
        Its name; empty for ``none`` and ``all``.
    model
        Tendon model of the commands.
    parameters
        Of the simulator, above those of the plant ``ideal``.
    """

    kind: Kind
    cause: str
    model: str
    parameters: Mapping[str, float]

    @property
    def name(self) -> str:
        """What no other case of a study has."""
        return f"{self.kind} {self.cause}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """What a cause does to the mean error in the bending plane, in mm.

    All means are of the same targets: those that were measured on each plant.

    Attributes
    ----------
    cause
        Its name.
    alone_mm, mended_mm
        Mean error with it alone, and with everything but it.
    none_mm, all_mm
        Mean error with no imperfection, and with all.
    """

    cause: str
    alone_mm: float
    mended_mm: float
    none_mm: float
    all_mm: float

    @property
    def adds_mm(self) -> float:
        """What it adds alone."""
        return self.alone_mm - self.none_mm

    @property
    def gains_mm(self) -> float:
        """What mending it gains on the robot as it is."""
        return self.all_mm - self.mended_mm


def cases(
    parts: Mapping[str, Mapping[str, float]], model: str, models: Sequence[str]
) -> tuple[Case, ...]:
    """Make the plants of a study.

    Parameters
    ----------
    parts
        The plant's parameters by cause, such as `setae.sim.plants.by_cause` gives them.
    model
        Tendon model of the commands.
    models
        All models; each other one counts as a way to mend the host's part.

    Examples
    --------
    >>> made = cases({"backlash": {"tendon.backlash_mm": 0.6}}, "paper", ["paper", "taut"])
    >>> [(case.kind, case.cause) for case in made][:3]
    [('none', ''), ('all', ''), ('alone', 'backlash')]
    >>> made[-1].cause, made[-1].kind, made[-1].model
    ('tendon model taut', 'mended', 'taut')
    """
    names = [*parts, *(name for name in _ALWAYS if name not in parts)]
    found = [_case("none", "", model, parts, ()), _case("all", "", model, parts, names)]
    for name in names:
        found.append(_case("alone", name, model, parts, (name,)))
        found.append(_case("mended", name, model, parts, [n for n in names if n != name]))
    for other in models:
        if other != model:
            # Alone: what this model does better where nothing else is wrong.
            found.append(_case("alone", f"{MODEL} {other}", other, parts, ()))
            found.append(_case("mended", f"{MODEL} {other}", other, parts, names))
    return tuple(found)


def _case(
    kind: Kind,
    cause: str,
    model: str,
    parts: Mapping[str, Mapping[str, float]],
    there: Sequence[str],
) -> Case:
    parameters: dict[str, float] = {}
    for name, absent in _ALWAYS.items():
        if name not in there:
            parameters.update(absent)
    for name in there:
        parameters.update(parts.get(name, {}))
    return Case(kind=kind, cause=cause, model=model, parameters=parameters)


def told(case: Case, poses: Sequence[Pose], unsolved: Sequence[str] = ()) -> dict[str, Any]:
    """What a log keeps of a case.

    Parameters
    ----------
    case
        The plant.
    poses
        What was measured on it.
    unsolved
        Labels of the targets that were not, because the simulated spring had no solution there.
    """
    whole = by_group(poses)[OVERALL].in_plane
    return {
        "kind": case.kind,
        "cause": case.cause,
        "model": case.model,
        "parameters": dict(case.parameters),
        "targets": len(poses),
        "mean_mm": whole.mean_mm,
        "sd_mm": whole.sd_mm,
        "errors_mm": {pose.target.label: pose.in_plane_mm for pose in poses},
        "unsolved": list(unsolved),
    }


def known(log: Log, metadata: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Read what a study that ended early has found already, by the cases' names.

    Raises
    ------
    InputError
        It was another study: of another plant, of other targets or another noise.
    """
    for key, value in metadata.items():
        if log.metadata.get(key) != value:
            raise InputError(
                f"The causes in {log.path} were driven with another {key}.",
                "Resume them with the options of the first call, or begin in a new folder.",
            )
    return {f"{case.data['kind']} {case.data['cause']}".strip(): dict(case.data)
            for case in log.events("case")}  # fmt: skip


def compared(log: Log) -> tuple[str, ...]:
    """Read the labels of the targets that were measured on every plant."""
    each = [event.data.get("errors_mm", {}) for event in log.events("case")]
    return tuple(label for label in each[0] if all(label in row for row in each)) if each else ()


def left_out(log: Log) -> str:
    """Say which targets are compared on no plant, and on which they have no solution; or nothing.

    A mean over fewer targets would not compare with the others.
    """
    where: dict[str, list[str]] = {}
    for event in log.events("case"):
        for label in event.data.get("unsolved", ()):
            name = f"{event.data['kind']} {event.data['cause']}".strip()
            where.setdefault(str(label), []).append(name)
    if not where:
        return ""
    parts = "; ".join(f"{label} ({', '.join(names)})" for label, names in where.items())
    rest = "" if compared(log) else " No target is left to compare them by."
    return f"Left out, for the simulated spring had no solution there: {parts}.{rest}"


def effects(log: Log) -> tuple[Effect, ...]:
    """Read the effects from a log, what gains most first.

    Empty where the study ended early, or no target was measured on every plant.
    """
    labels = compared(log)
    if not labels:
        return ()
    mean_mm = {
        (str(event.data["kind"]), str(event.data["cause"])): float(
            np.mean([event.data["errors_mm"][label] for label in labels])
        )
        for event in log.events("case")
    }
    if ("none", "") not in mean_mm or ("all", "") not in mean_mm:
        return ()
    none_mm, all_mm = mean_mm["none", ""], mean_mm["all", ""]
    found = [
        Effect(
            cause=cause,
            alone_mm=mean_mm["alone", cause],
            mended_mm=mean_mm["mended", cause],
            none_mm=none_mm,
            all_mm=all_mm,
        )
        for kind, cause in mean_mm
        if kind == "alone" and ("mended", cause) in mean_mm
    ]
    return tuple(sorted(found, key=lambda effect: -effect.gains_mm))
