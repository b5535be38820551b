"""Colours of all pictures and pages, so that a thing looks the same everywhere."""

from __future__ import annotations

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
HEAT = ("#2b7bba", "#58a892", "#e0b43c", "#e07b1a", "#d4213d")
"""From small to large, evenly spaced."""


def direction(alpha_deg: float) -> str:
    """Return a pale colour for the direction α, round the circle once."""
    import colorsys

    red, green, blue = colorsys.hls_to_rgb((alpha_deg % 360.0) / 360.0, 0.90, 0.55)
    return f"#{round(red * 255):02x}{round(green * 255):02x}{round(blue * 255):02x}"


def heat(share: float) -> str:
    """Return the colour at a place on the scale `HEAT`, which runs from 0 to 1.

    Examples
    --------
    >>> heat(0.0), heat(0.5), heat(7.0)
    ('#2b7bba', '#e0b43c', '#d4213d')
    """
    place = min(max(share, 0.0), 1.0) * (len(HEAT) - 1)
    low = min(int(place), len(HEAT) - 2)
    return mix(HEAT[low], HEAT[low + 1], place - low)


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
