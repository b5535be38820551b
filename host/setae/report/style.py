"""How all still pictures look, and how they become files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from setae.report import extras, palette

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": palette.INK,
    "axes.labelcolor": palette.INK,
    "axes.edgecolor": palette.MUTED,
    "axes.linewidth": 0.8,
    "axes.titlesize": 12,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": palette.MUTED,
    "ytick.color": palette.MUTED,
    "figure.facecolor": palette.PAPER,
    "savefig.facecolor": palette.PAPER,
    "svg.hashsalt": "setae",
}


def figure(width_in: float, height_in: float) -> Any:
    """Make a figure that no window system knows of."""
    return extras.load("matplotlib.figure").Figure(figsize=(width_in, height_in))


def used() -> Any:
    """Context in which figures have this style."""
    return extras.load("matplotlib").rc_context(_STYLE)


def save(drawn: Any, path: Path, dpi: int = 160) -> None:
    """Write a figure: the same run gives the same bytes."""
    # No version of matplotlib in the file.
    drawn.savefig(path, dpi=dpi, metadata={"Software": None})
