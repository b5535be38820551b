"""Colours of all pictures and pages, so that a thing looks the same everywhere."""

from __future__ import annotations

from collections.abc import Sequence

INK = "#1f2933"
MUTED = "#66727f"
GRID = "#e4e9ee"
PAPER = "#ffffff"
PANEL = "#f6f8fa"

SPRING = "#41566b"
TENDON = "#12888a"
BRISTLE = "#e07b1a"
SILICONE = "#f2c48d"
HOLDER = "#c3ccd5"
TUBE = "#8fb0cc"
CUBE = "#caa472"
CONTACT = "#d4213d"
CLEAR = "#cfe0ec"
PRESSURE = "#2b5c8a"
AGREES = "#1f7a4d"
UNKNOWN = "#e4e9ee"
"""Where a map knows nothing."""

HEIGHTS = ("#2d2f73", "#31639c", "#2c9093", "#6fb36a", "#e3c33a")
"""From low to high, in every picture and on every page; also from early to late.

Like `AMOUNTS` even in lightness (CIELAB L* 23 to 79), so that the order stays without colour too:
neighbours stay 17 and 10 ΔE apart at least for who sees no red or no green.
"""
AMOUNTS = ("#e8bd4f", "#e8913a", "#d95f36", "#ad2b47", "#641642")
"""From near or right to far or wrong: distances and errors, which are never negative."""
DIFFERENCES = ("#1f4e8c", "#6fa3cf", "#fbf6d5", "#e08a5b", "#a3172f")
"""From too low over none to too high; none is yellowish, to differ from `UNKNOWN`."""


def direction(alpha_deg: float) -> str:
    """Return a pale colour for the direction α, round the circle once."""
    import colorsys

    red, green, blue = colorsys.hls_to_rgb((alpha_deg % 360.0) / 360.0, 0.90, 0.55)
    return f"#{round(red * 255):02x}{round(green * 255):02x}{round(blue * 255):02x}"


def at(scale: Sequence[str], share: float) -> str:
    """Return the colour at a place on a scale, which runs from 0 to 1.

    Examples
    --------
    >>> at(HEIGHTS, 0.0), at(HEIGHTS, 0.5), at(HEIGHTS, 7.0)
    ('#2d2f73', '#2c9093', '#e3c33a')
    """
    place = min(max(share, 0.0), 1.0) * (len(scale) - 1)
    low = min(int(place), len(scale) - 2)
    return mix(scale[low], scale[low + 1], place - low)


def stops(scale: Sequence[str]) -> list[list[float | str]]:
    """Return a scale as Plotly takes it: pairs of a place from 0 to 1 and a colour."""
    return [[index / (len(scale) - 1), colour] for index, colour in enumerate(scale)]


def mix(colour: str, other: str, share: float) -> str:
    """Blend `share` (0…1) of `other` into a colour, both as #rrggbb.

    Examples
    --------
    >>> mix("#000000", "#ffffff", 0.5)
    '#808080'
    """
    parts = [
        round(int(a, 16) * (1 - share) + int(b, 16) * share)
        for a, b in zip(
            (colour[1:3], colour[3:5], colour[5:7]),
            (other[1:3], other[3:5], other[5:7]),
            strict=True,
        )
    ]
    return "#" + "".join(f"{part:02x}" for part in parts)
