"""What a simulated robot's imperfections did to an exploration, from the simulator's truth."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from setae.report import shifts
from setae.report.tables import compare
from setae.report.trial import Contact, Trial

__all__ = ["section", "sentences"]

_SLACK_N = 0.02
_BEFORE_US = 250_000


def section(trials: Sequence[Trial]) -> str:
    """Return the page's part about it; empty for a real robot and for the ideal one."""
    told, found = _look(trials)
    if not told:
        return ""
    items = "".join(f"<li>{html.escape(text)}</li>" for text in told)
    return f'<h2 id="plant">What the imperfections did</h2><ol>{items}</ol>{shifts.table(found)}'


def sentences(trials: Sequence[Trial]) -> list[str]:
    """Say where the tip was beside its target, and how each stop came about that differs."""
    return _look(trials)[0]


def _look(trials: Sequence[Trial]) -> tuple[list[str], list[shifts.Aside]]:
    first = trials[0]
    parameters = first.log.metadata.get("plant_parameters") or {}
    if not first.simulated or not parameters:
        return [], []
    told = []
    beside_mm = [value for trial in trials for value in _beside_mm(trial)]
    if beside_mm:
        told.append(
            f"The simulated robot is the plant {first.log.metadata.get('plant')}. Where nothing "
            f"was touched, the spring’s top ended {np.mean(beside_mm):.1f} mm from its target on "
            f"average, {max(beside_mm):.1f} mm at most."
        )
    aside_mm = [value for trial in trials for value in _aside_mm(trial)]
    if aside_mm:
        told.append(
            "Short and straight before each extension, as commanded, it truly hung"
            f" {np.mean(aside_mm):.1f} mm aside on average, {max(aside_mm):.1f} mm at most."
        )
    rows = compare(trials)
    differing = [row for row in rows if row.agrees is False or not row.trial.complete]
    found = []
    for row in differing:
        texts = _why(row.trial)
        if aside := shifts.look(row):
            found.append(aside)
            texts.append(shifts.sentence(aside))
        told += [f"Trial {row.trial.number} {text}" for text in texts]
    if differing:
        told.append(f"Its imperfections: {_named(parameters)}.")
    if beside_mm and all(row.agrees for row in rows):
        told.append("Every trial came out as the paper’s all the same.")
    return told, found


def _named(parameters: Mapping[str, float]) -> str:
    """Each parameter once, with the range over the tendons."""
    ranges: dict[str, list[float]] = {}
    for name, value in parameters.items():
        ranges.setdefault(re.sub(r"_\d$", "", name), []).append(value)
    return ", ".join(
        f"{name} {min(values):g}" + (f" to {max(values):g}" if len(set(values)) > 1 else "")
        for name, values in ranges.items()
    )


def _beside_mm(trial: Trial) -> list[float]:
    """How far the spring's top ended from the target of each free extension."""
    found: list[float] = []
    times_us = trial.log.times_us("/truth")
    if not times_us.size:
        return found
    top_mm = trial.log.array("/truth", "backbone_mm")[:, -1]
    starts = {}
    for event in trial.log.events("direction_start", "direction_end"):
        if event.name == "direction_start":
            starts[event.data["alpha_deg"]] = event.data.get("target_mm")
        elif not event.data.get("touched"):
            target_mm = starts.get(event.data["alpha_deg"])
            index = int(np.searchsorted(times_us, event.time_us)) - 1
            if target_mm is not None and index >= 0:
                found.append(math.dist(top_mm[index], target_mm))
    return found


def _aside_mm(trial: Trial) -> list[float]:
    """How far the spring's top was from its axis at the start of each extension."""
    times_us = trial.log.times_us("/truth")
    if not times_us.size:
        return []
    top_mm = trial.log.array("/truth", "backbone_mm")[:, -1]
    starts_us = [event.time_us for event in trial.log.events("direction_start")]
    at = np.minimum(np.searchsorted(times_us, starts_us), len(times_us) - 1)
    return [float(aside) for aside in np.hypot(*top_mm[at, :2].T)]


def _why(trial: Trial) -> list[str]:
    told = [text for contact in trial.contacts[:3] if (text := _in_the_air(trial, contact))]
    if not trial.complete:
        told.append(f"ended early: {trial.problem or 'its log ends before it does'}")
    if not told:
        felt = "something" if trial.touched else "nothing"
        told.append(
            f"went {trial.descent_mm:g} mm down and truly touched {felt}: its bristle went other "
            f"ways than commanded{_towards_the_cube(trial)}."
        )
    return told


def _towards_the_cube(trial: Trial) -> str:
    """What the spring did at the deepest free extension towards the cube; empty without one."""
    ends = [
        event
        for event in trial.log.events("direction_end")
        if event.data.get("alpha_deg") == trial.azimuth_deg and not event.data.get("touched")
    ]
    times_us = trial.log.times_us("/truth")
    if trial.cube is None or not ends or not times_us.size:
        return ""
    index = int(np.searchsorted(times_us, ends[-1].time_us)) - 1
    target_mm = next(
        event.data["target_mm"]
        for event in trial.log.events("direction_start")
        if event.data["alpha_deg"] == trial.azimuth_deg
    )
    alpha_rad = math.radians(trial.azimuth_deg)
    missing_mm = np.array(target_mm) - trial.log.array("/truth", "backbone_mm")[index, -1]
    short_mm = missing_mm[0] * math.cos(alpha_rad) + missing_mm[1] * math.sin(alpha_rad)
    tendons = [
        f"tendon {i} {'hung slack' if tension_n < _SLACK_N else f'pulled {tension_n:.1f} N'}"
        for i, tension_n in enumerate(trial.log.array("/truth", "tension_n")[index])
    ]
    way = "short of" if short_mm > 0 else "beyond"
    return (
        f". Towards the cube, at {trial.azimuth_deg:g}°, the spring’s top ended"
        f" {math.hypot(*missing_mm):.1f} mm from its target, {abs(short_mm):.1f} mm {way} it"
        f" sideways; {', '.join(tendons)}"
    )


def _in_the_air(trial: Trial, contact: Contact) -> str:
    """How a contact came about in which the true bristle touched nothing; else empty."""
    if np.isfinite(contact.true_point_mm).all() or not trial.log.times_us("/truth").size:
        return ""
    where = "while the arm lowered" if contact.alpha_deg is None else f"at {contact.alpha_deg:g}°"
    text = (
        f"stopped {where}, {contact.descent_mm:g} mm down, by a change of "
        f"{contact.change_hpa:+.1f} hPa, though the bristle touched nothing"
    )
    times_us = trial.log.times_us("/truth")
    near = (times_us > contact.time_us - _BEFORE_US) & (times_us < contact.time_us + 60_000)
    tension_n = trial.log.array("/truth", "tension_n")[near]
    if len(tension_n) > 1:
        slack = tension_n[:-1] < _SLACK_N
        caught = (slack & (tension_n[1:] >= _SLACK_N)).any(axis=0)
        if caught.any():
            names = " and ".join(str(index) for index in np.flatnonzero(caught))
            which = f"tendon {names}" if caught.sum() == 1 else f"tendons {names}"
            return f"{text}: {which} had hung slack, and coming taut jerked the spring."
        if slack.any():
            return f"{text}: a tendon hung slack, and the spring went where the others pulled it."
    return f"{text}: the move itself shook it."
