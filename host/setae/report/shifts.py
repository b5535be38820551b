"""Which imperfection of a simulated robot put its tip aside or jerked it, where a trial differs."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from setae.errors import SetaeError
from setae.experiments.shifts import Shift, Shifts, find
from setae.report.tables import Comparison
from setae.report.trial import Floats, Trial
from setae.rig import plants

__all__ = ["Aside", "look", "sentence", "table"]

_SAME_MM = 1.0  # replayed within this of what the log has, it is the same motion
_TOLD_MM = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Aside:
    """What moved the tip of a trial's robot aside, at the moment that decided.

    Attributes
    ----------
    trial
        The trial.
    when
        The moment, in words.
    alpha_deg
        The direction that counts as outwards, α of frame D.
    jerk
        Whether it was a touch of nothing: then not where the tip was matters, but the pressure
        that its motion made.
    shifts
        What moved it.
    """

    trial: Trial
    when: str
    alpha_deg: float
    jerk: bool
    shifts: Shifts

    def outwards_mm(self, shift_mm: Floats) -> float:
        """The part of a shift (3,) along the direction."""
        alpha_rad = math.radians(self.alpha_deg)
        return float(shift_mm[0] * math.cos(alpha_rad) + shift_mm[1] * math.sin(alpha_rad))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Moment:
    time_us: int
    when: str
    alpha_deg: float
    jerk: bool


def look(row: Comparison) -> Aside | None:
    """Find it with the simulator, from the pulses in the trial's log.

    Returns
    -------
    None where nothing decided, the robot is none of those by name, or its motion can't be
    repeated from the log.
    """
    trial = row.trial
    parameters = trial.log.metadata.get("plant_parameters") or {}
    moment = _moment(row)
    if moment is None or not parameters:
        return None
    truth_us = trial.log.times_us("/truth")
    index = int(np.searchsorted(truth_us, moment.time_us))
    if index >= len(truth_us):
        return None
    try:
        plants.resolve(str(trial.log.metadata.get("plant")))
        shifts = find(
            parameters, int(trial.log.metadata["seed"]), _pulse_us(trial, int(truth_us[index]))
        )
    except SetaeError:
        return None
    if math.dist(shifts.here.tip_mm, trial.log.array("/truth", "filament_mm")[index, 1]) > _SAME_MM:
        return None
    return Aside(
        trial=trial,
        when=moment.when,
        alpha_deg=moment.alpha_deg,
        jerk=moment.jerk,
        shifts=shifts,
    )


def _moment(row: Comparison) -> _Moment | None:
    """The touch that ended the way down too early, or the extension that passed the cube."""
    trial = row.trial
    expected_mm = row.theirs.descent_mm if row.theirs else math.inf
    if trial.contacts and trial.descent_mm <= expected_mm:
        contact = trial.contacts[0]
        alpha_deg = trial.azimuth_deg if contact.alpha_deg is None else contact.alpha_deg
        starts_us = [event.time_us for event in trial.log.events("direction_start")]
        before_us = [start_us for start_us in starts_us if start_us < contact.time_us]
        if not trial.complete and before_us:  # it could not get clear: how it hangs matters
            return _Moment(
                time_us=before_us[-1],
                when=f"{contact.descent_mm:g} mm down, short and straight before it touched",
                alpha_deg=alpha_deg,
                jerk=False,
            )
        where = (
            "while the arm lowered"
            if contact.alpha_deg is None
            else f"in the extension at {contact.alpha_deg:g}°"
        )
        return _Moment(
            time_us=contact.time_us,
            when=f"at the first touch, {contact.descent_mm:g} mm down {where}",
            alpha_deg=alpha_deg,
            jerk=not np.isfinite(contact.true_point_mm).all(),
        )
    if trial.cube is None:
        return None
    towards = [
        (level, direction)
        for level in trial.levels
        for direction in level.directions
        if direction.alpha_deg == trial.azimuth_deg and not direction.touched
    ]
    if not towards:
        return None
    due = [pair for pair in towards if pair[0].descent_mm >= expected_mm - 0.5]
    level, direction = due[0] if due else towards[-1]
    return _Moment(
        time_us=direction.end_us,
        when=f"{level.descent_mm:g} mm down, extended towards the cube at {trial.azimuth_deg:g}°",
        alpha_deg=trial.azimuth_deg,
        jerk=False,
    )


def _pulse_us(trial: Trial, until_us: int) -> Floats:
    """Each servo frame's pulses from the log's start on, (n, 4); lost ones as the one before."""
    known = trial.log.times_us("/telemetry") <= until_us
    frame = trial.log.array("/telemetry", "frame")[known]
    at = np.searchsorted(frame, np.arange(1, int(frame[-1]) + 1), side="right") - 1
    pulse_us = np.asarray(trial.log.array("/telemetry", "pulse_us")[known][at], dtype=float)
    pulse_us[at < 0] = 0.0
    return pulse_us


def sentence(aside: Aside) -> str:
    """Say what moved the tip, and how far, what did most first; or what jerked it."""
    shifts = aside.shifts
    if aside.jerk:
        each = sorted(shifts.each, key=lambda shift: shift.without_hpa)
        parts = [f"{shift.without_hpa:.1f} hPa ({shift.cause})" for shift in each]
        mended = f" Were one imperfection mended, the same pulses would make {', '.join(parts)}."
        return (
            f"{aside.when}: motion alone made {shifts.here.loudest_hpa:.1f} hPa, and"
            f" {aside.trial.threshold_hpa:g} count as a touch."
            f"{mended if parts else ''}{_untold(shifts)}"
        )
    whole_mm = shifts.here.tip_mm - shifts.ideal.tip_mm
    each = [shift for shift in shifts.each if shift.size_mm >= _TOLD_MM]
    parts = [_part(aside, shift) for shift in each]
    if len(each) < len(shifts.each):
        parts.append(f"each other less than {_TOLD_MM:g} mm")
    moved = f" What each imperfection moved it: {', '.join(parts)}."
    return (
        f"{aside.when}: the bristle’s tip was {np.linalg.norm(whole_mm):.1f} mm from where the "
        f"same pulses put that of the plant ideal{_sideways(aside.outwards_mm(whole_mm))}."
        f"{moved if parts else ''}{_untold(shifts)}"
    )


def _untold(shifts: Shifts) -> str:
    if not shifts.untold:
        return ""
    return (
        f" Nothing is known of {' and '.join(shifts.untold)}: the same pulses leave the simulated "
        "spring without an equilibrium where it is not there, or alone."
    )


def _part(aside: Aside, shift: Shift) -> str:
    return f"{shift.cause} {shift.size_mm:.1f} mm{_sideways(aside.outwards_mm(shift.here_mm))}"


def _sideways(outwards_mm: float) -> str:
    if abs(outwards_mm) < _TOLD_MM:
        return ""
    return f" ({abs(outwards_mm):.1f} mm {'outwards' if outwards_mm > 0 else 'inwards'})"


def table(found: Sequence[Aside]) -> str:
    """Return the table of it for a page; empty where nothing was found."""
    if not found:
        return ""
    rows = "".join(
        f"<tr><td>{aside.trial.number}</td><td>{html.escape(shift.cause)}</td>"
        f"<td>{shift.size_mm:.1f}</td><td>{aside.outwards_mm(shift.here_mm):+.1f}</td>"
        f"<td>{np.linalg.norm(shift.alone_mm):.1f}</td>"
        f"<td>{aside.outwards_mm(shift.alone_mm):+.1f}</td>"
        f"<td>{shift.without_hpa:.1f}</td></tr>"
        for aside in found
        for shift in aside.shifts.each
    )
    return (
        '<p class="note">The trial’s pulses, played again in the simulator on the same robot '
        "without the imperfection, and on the plant ideal with it alone: how far it moves the "
        "bristle’s tip and how much of that outwards, mm; and the loudest pressure of the last "
        "half second that motion makes without it, hPa. Imperfections hide one another, so no "
        "column adds up to what all do. A shift of several centimetres: without it the spring "
        "gives way to the other side.</p>"
        '<div class="scroll"><table><thead><tr><th>trial</th><th>imperfection</th>'
        "<th>moves the tip</th><th>outwards</th><th>alone</th><th>outwards</th>"
        "<th>pressure without it</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )
