"""How all still pictures look, and how they become files."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
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


def headline(drawn: Any, text: str, note: str) -> float:
    """Write a title and a paler note above everything, whatever the figure's size.

    Returns
    -------
    float
        Where the rest may begin: a share of the figure's height.
    """
    width, height = drawn.get_size_inches()
    # So many letters of the note's size fit into an inch.
    lines = textwrap.wrap(note, int(12.5 * (width - 0.5)))
    left = 0.24 / width
    drawn.text(left, 1 - 0.3 / height, text, fontsize=16, weight="bold", va="center")
    for number, line in enumerate(lines):
        drawn.text(
            left, 1 - (0.64 + 0.2 * number) / height, line, fontsize=10, color=palette.MUTED,
            va="center",
        )  # fmt: skip
    return float(1 - (0.62 + 0.2 * len(lines)) / height)


def arrange(drawn: Any, *, bottom: float, top: float) -> None:
    """Let axes that are drawn later fill it between two shares of its height, without overlaps."""
    drawn.set_layout_engine("compressed", rect=(0, bottom, 1, top - bottom))
    drawn.get_layout_engine().set(w_pad=0.1, h_pad=0.1)


def colours(scale: Sequence[str]) -> Any:
    """Make matplotlib's map of a scale of the palette."""
    return extras.load("matplotlib.colors").LinearSegmentedColormap.from_list("scale", list(scale))


def save(drawn: Any, path: Path, dpi: int = 160) -> None:
    """Write a figure: the same run gives the same bytes."""
    # No version of matplotlib in the file.
    drawn.savefig(path, dpi=dpi, metadata={"Software": None})
