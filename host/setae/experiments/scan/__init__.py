"""The paper's scan of a surface.

The arm carries the robot over a square, from place to place, and the bristle feels from above
how high the surface is there. Three ways of going about it, see `MODES`:

paper
    Extended steps until something is touched; then retract, extend to the contact that is the
    measurement, retract, step, extend, until a full extension feels nothing.
safe
    Retracted in every step.
adaptive
    Beyond the paper: sweeps over the empty, retracts only as far as is safe, visits what can't
    be inferred.

The world begins at frame D's origin above the first place; x and y go along the square's sides,
z up. Robot and arm may be real or simulated; nothing here can tell.
"""

from __future__ import annotations

from setae.experiments.scan.reading import (
    is_vain,
    part_of,
    read,
    read_parts,
    scans_of,
    settings_of,
)
from setae.experiments.scan.run import (
    EXPERIMENT,
    MODES,
    Mode,
    ScanResult,
    arm_targets_mm,
    in_scene,
    record_true_surface,
    recorded,
    scan,
    simulate,
    true_surface,
)
from setae.experiments.scan.survey import Place, Survey
from setae.experiments.scan.window import require_free_start, require_window, window_mm

__all__ = [
    "EXPERIMENT",
    "MODES",
    "Mode",
    "Place",
    "ScanResult",
    "Survey",
    "arm_targets_mm",
    "in_scene",
    "is_vain",
    "part_of",
    "read",
    "read_parts",
    "record_true_surface",
    "recorded",
    "require_free_start",
    "require_window",
    "scan",
    "scans_of",
    "settings_of",
    "simulate",
    "true_surface",
    "window_mm",
]
