"""Where the robot starts: over nothing that it touches, above all that it is carried over."""

from __future__ import annotations

import numpy as np

from setae import kinematics, workspace
from setae.config import Config
from setae.errors import HeightWindowError
from setae.objects import TableScene, table_scene
from setae.perception import surface

__all__ = ["require_free_start", "require_window", "window_mm"]


def window_mm(config: Config) -> float:
    """How far above the extended bristle's tip something may rise, to be stepped over.

    Examples
    --------
    >>> from setae.config import load
    >>> window_mm(load())
    45.0
    """
    short_mm, long_mm = config.scan_lengths_mm
    return long_mm - short_mm - config.scan.clearance_mm


def require_window(config: Config, tallest_mm: float) -> None:
    """Refuse a scan whose retracted bristle would not clear what is there.

    Parameters
    ----------
    tallest_mm
        Of what is scanned, above the extended bristle's tip.

    Raises
    ------
    HeightWindowError
        It is too tall.
    UnreachableError
        The robot can't take a length of the scan.
    """
    for length_mm in config.scan_lengths_mm:
        workspace.require(kinematics.inverse((0.0, 0.0, length_mm)), config)
    too_much_mm = tallest_mm - window_mm(config)
    if too_much_mm > 1e-6:
        raise HeightWindowError(
            f"What is scanned rises {tallest_mm:g} mm above the extended bristle's tip; the "
            f"retracted one clears {window_mm(config):g} mm with {config.scan.clearance_mm:g} mm "
            "to spare.",
            f"Raise the arm's start by {too_much_mm:.3g} mm, or give a smaller clearance_mm in "
            "[scan].",
        )


def require_free_start(config: Config, scene: TableScene) -> None:
    """Refuse a simulated scene into which the robot at rest would press at the first place.

    Its bristle would be in touch when its pressure at rest is measured, and blind from then on.

    Raises
    ------
    HeightWindowError
        It would.
    """
    top_mm = float(surface.height_mm(scene.solids, *np.zeros((2, 1)))[0])
    deep_mm = top_mm - config.rest_reach_mm
    if deep_mm > 0:
        raise HeightWindowError(
            f"The robot at rest reaches {deep_mm:.3g} mm into what is below the first place: its "
            f"tip is at z = {config.rest_reach_mm:g} mm, and the scene rises to {top_mm:g} mm.",
            f"Put everything there lower: table_z_mm = {table_scene(config).table_z_mm:g}, and no "
            "object at the first place.",
        )
