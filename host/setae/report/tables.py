"""The results as rows: for the page's table, and as CSV files for other programs."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from setae.report import paper
from setae.report.trial import Contact, Trial


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One trial beside the paper's trial with the same obstacle.

    Attributes
    ----------
    agrees
        Whether both stopped at the same depth and both touched or both didn't;
        None where the paper has no such trial, or this one isn't complete.
    """

    trial: Trial
    theirs: paper.PaperTrial | None
    agrees: bool | None


def compare(trials: Sequence[Trial]) -> tuple[Comparison, ...]:
    """Put each trial beside the paper's."""
    rows = []
    for trial in trials:
        theirs = paper.trial_like(trial.obstacle_below_tip_mm)
        agrees = None
        if theirs is not None and trial.complete:
            agrees = (
                abs(theirs.descent_mm - trial.descent_mm) < 0.5 and theirs.contact == trial.touched
            )
        rows.append(Comparison(trial=trial, theirs=theirs, agrees=agrees))
    return tuple(rows)


def write_all(folder: Path, trials: Sequence[Trial]) -> tuple[Path, ...]:
    """Write all tables into a folder."""
    paths = tuple(folder / f"{name}.csv" for name in ("trials", "contacts", "pressure"))
    for path, write in zip(paths, (write_trials, write_contacts, write_pressure), strict=True):
        write(path, trials)
    return paths


def write_trials(path: Path, trials: Sequence[Trial]) -> None:
    """One row a trial."""
    _write(
        path,
        (
            "trial", "obstacle_below_tip_mm", "descent_mm", "paper_descent_mm", "touched",
            "paper_touched", "contacts", "levels", "directions", "duration_s", "complete",
            "simulated",
        ),
        (
            (
                trial.number,
                _number(trial.obstacle_below_tip_mm, 1),
                _number(trial.descent_mm, 1),
                _number(row.theirs.descent_mm if row.theirs else None, 1),
                _flag(trial.touched),
                _flag(row.theirs.contact) if row.theirs else "",
                len(trial.contacts),
                len(trial.levels),
                sum(len(level.directions) for level in trial.levels),
                _number(float(trial.seconds(trial.end_us)), 3),
                _flag(trial.complete),
                _flag(trial.simulated),
            )
            for row in compare(trials)
            for trial in (row.trial,)
        ),
    )  # fmt: skip


def write_contacts(path: Path, trials: Sequence[Trial]) -> None:
    """One row a touch. Points are in the world (z up, 0 at the robot's base at the start)."""
    _write(
        path,
        (
            "trial", "contact", "time_s", "descent_mm", "alpha_deg", "pressure_hpa",
            "baseline_hpa", "change_hpa", "tip_x_mm", "tip_y_mm", "tip_z_mm",
            "tip_uncertainty_mm", "true_x_mm", "true_y_mm", "true_z_mm",
        ),
        (
            (trial.number, index, *_contact_row(trial, contact))
            for trial in trials
            for index, contact in enumerate(trial.contacts, start=1)
        ),
    )  # fmt: skip


def _contact_row(trial: Trial, contact: Contact) -> tuple[str, ...]:
    return (
        _number(float(trial.seconds(contact.time_us)), 4),
        _number(contact.descent_mm, 1),
        _number(contact.alpha_deg, 1),
        _number(contact.pressure_hpa, 4),
        _number(contact.baseline_hpa, 4),
        _number(contact.change_hpa, 4),
        *(_number(value, 2) for value in contact.point_mm),
        _number(contact.uncertainty_mm, 2),
        *(_number(value, 2) for value in contact.true_point_mm),
    )


def write_pressure(path: Path, trials: Sequence[Trial]) -> None:
    """One row a sample of the bristle's sensor. Level and direction are empty in between."""
    _write(
        path,
        (
            "trial", "time_s", "pressure_hpa", "baseline_hpa", "watched", "descent_mm", "alpha_deg",
        ),
        (row for trial in trials for row in _pressure_rows(trial)),
    )  # fmt: skip


def _pressure_rows(trial: Trial) -> Iterable[tuple[object, ...]]:
    pressure = trial.pressure
    times_us = pressure.time_us
    descent = np.full(times_us.shape, np.nan)
    alpha = np.full(times_us.shape, np.nan)
    for level in trial.levels:
        descent[(times_us >= level.start_us) & (times_us <= level.end_us)] = level.descent_mm
        for direction in level.directions:
            within = (times_us >= direction.start_us) & (times_us <= direction.end_us)
            alpha[within] = direction.alpha_deg
    for index, time_us in enumerate(times_us):
        baseline_hpa = float(pressure.baseline_hpa[index])
        yield (
            trial.number,
            _number(float(trial.seconds(time_us)), 4),
            _number(float(pressure.pressure_hpa[index]), 4),
            _number(baseline_hpa, 4),
            _flag(not math.isnan(baseline_hpa)),
            _number(float(descent[index]), 1),
            _number(float(alpha[index]), 1),
        )


def _number(value: float | None, digits: int) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _flag(value: bool) -> str:
    return "yes" if value else "no"


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
