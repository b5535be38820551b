"""The few shapes that the protocol's pictures are made of, as SVG."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from setae.report import palette

_FONT = "font-family='DejaVu Sans, Verdana, Helvetica, Arial, sans-serif'"


@dataclass
class Svg:
    """A picture; lengths in pixels, y downwards."""

    width: float
    height: float = 0.0
    parts: list[str] = field(default_factory=list)

    def text(
        self, x: float, y: float, words: str, *, size: float = 13, colour: str = palette.INK,
        anchor: str = "start", weight: str = "normal", halo: bool = False,
    ) -> None:  # fmt: skip
        """Write a line. A halo keeps it readable over lines."""
        edge = (
            f" stroke='{palette.PAPER}' stroke-width='4' paint-order='stroke'"
            " stroke-linejoin='round'"
        )
        self.parts.append(
            f"<text x='{x:g}' y='{y:g}' font-size='{size:g}' fill='{colour}'"
            f" text-anchor='{anchor}' font-weight='{weight}'{edge if halo else ''}>"
            f"{escape(words)}</text>"
        )

    def path(
        self, data: str, *, colour: str = palette.INK, width: float = 1.5, dashed: bool = False,
        arrow: bool = False,
    ) -> None:  # fmt: skip
        """Draw a line along an SVG path."""
        dash = " stroke-dasharray='5 4'" if dashed else ""
        head = f" marker-end='url(#{colour.lstrip('#')})'" if arrow else ""
        self.parts.append(
            f"<path d='{data}' fill='none' stroke='{colour}' stroke-width='{width:g}'{dash}{head}/>"
        )

    def box(
        self, x: float, y: float, width: float, height: float, *, fill: str, edge: str = "none",
        radius: float = 8,
    ) -> None:  # fmt: skip
        """Draw a rectangle."""
        self.parts.append(
            f"<rect x='{x:g}' y='{y:g}' width='{width:g}' height='{height:g}' rx='{radius:g}'"
            f" fill='{fill}' stroke='{edge}' stroke-width='1.5'/>"
        )

    def cross(self, x: float, y: float, *, colour: str) -> None:
        """Mark a place."""
        self.path(f"M{x - 5:g},{y - 5:g} l10,10 M{x - 5:g},{y + 5:g} l10,-10", colour=colour,
                  width=2.5)  # fmt: skip

    def save(self, path: Path, title: str) -> None:
        """Write the file; the same picture gives the same bytes."""
        colours = (palette.INK, palette.MUTED, palette.PRESSURE, palette.TENDON, palette.CONTACT)
        heads = "".join(
            f"<marker id='{colour.lstrip('#')}' viewBox='0 0 10 10' refX='9' refY='5'"
            " markerWidth='7' markerHeight='7' orient='auto-start-reverse'>"
            f"<path d='M0,1 L10,5 L0,9 z' fill='{colour}'/></marker>"
            for colour in colours
        )
        body = "\n".join(self.parts)
        path.write_text(
            f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {self.width:g} {self.height:g}'"
            f" width='{self.width:g}' height='{self.height:g}' {_FONT} role='img'>\n"
            f"<title>{escape(title)}</title>\n<defs>{heads}</defs>\n"
            f"<rect width='100%' height='100%' fill='{palette.PAPER}'/>\n{body}\n</svg>\n",
            encoding="utf-8",
        )
