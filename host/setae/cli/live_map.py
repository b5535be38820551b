"""A height map in the terminal, as it grows; without a terminal, lines of progress."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from rich.live import Live
from rich.text import Text

from setae.cli.common import console
from setae.experiments.events import Event
from setae.experiments.scan import Place
from setae.heightmap import TOUCHED
from setae.wording import counted

_REDRAW_S = 0.1
# Without a terminal: a line each time so much more of the places is known.
_LINE_SHARE = 0.1
_SIGNS = {"empty": "· ", "lost": "L ", "slipped": "S ", "double": "D "}
_FLAGS = ("lost", "slipped", "double")


class LiveMap:
    """Shows what a scan finds; a context manager."""

    def __init__(self) -> None:
        # Not with the module: all reports come with it. Nor later: a scan would wait for it.
        from setae.report import palette

        self._palette = palette
        self._places: dict[tuple[int, int], Place] = {}
        self._columns = self._rows = 0
        self._total = 1
        self._start_us = 0
        self._first: tuple[int, int] | None = None  # when this run's first place was known
        self._drawn_s = -math.inf
        self._told_share = 0.0
        # A dumb terminal can't go back to draw anew: it would show nothing until the end.
        drawn = console.is_terminal and not console.is_dumb_terminal
        self._live = Live(console=console, auto_refresh=False) if drawn else None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.update(self._map(), refresh=True)
            self._live.stop()

    def known(self, places: tuple[Place, ...]) -> None:
        """Take over what an earlier run found out."""
        self._places.update({place.cell: place for place in places})

    def event(self, event: Event) -> None:
        """Take an event of the scan."""
        data = event.data
        if event.name == "scan_start":
            self._columns, self._rows = data["columns"], data["rows"]
            self._total = self._columns * self._rows
            self._start_us = event.time_us
        elif event.name == "place":
            place = Place.of(data, event.time_us)
            self._places[place.cell] = place
            self._show(data, event.time_us)

    def _show(self, data: Mapping[str, Any], time_us: int) -> None:
        known, total = data["known"], data["total"]
        took_s = (time_us - self._start_us) / 1e6
        left_s = self._left_s(data, time_us)
        left = "" if left_s is None else f", about {_clock(left_s)} left"
        line = (
            f"{known / total:4.0%}  {known} of {counted(total, 'place')}, "
            f"{self._touched()} touched, {_clock(took_s)} robot time{left}"
        )
        if self._live is None:
            if known / total >= self._told_share + _LINE_SHARE or known == total:
                self._told_share = known / total
                console.print(f"  {line}")
        elif time.monotonic() - self._drawn_s > _REDRAW_S:
            self._drawn_s = time.monotonic()
            self._live.update(self._map().append(f"\n{line}"), refresh=True)

    def _left_s(self, data: Mapping[str, Any], time_us: int) -> float | None:
        """Robot time left at this run's pace; None: of one place there is no pace yet.

        The way to its first place, maybe across the whole area, is no place's.
        """
        if self._first is None:
            self._first = (time_us, data["known"])
        first_us, before = self._first
        if data["known"] == before:
            return None
        pace_s = (time_us - first_us) / 1e6 / (data["known"] - before)
        return float(pace_s * (data["total"] - data["known"]))

    def _touched(self) -> int:
        return sum(place.mark in TOUCHED for place in self._places.values())

    def _map(self) -> Text:
        """The rows from above: y goes up, x to the right."""
        heights = [p.height_mm for p in self._places.values() if math.isfinite(p.height_mm)]
        low, high = (min(heights), max(heights)) if heights else (0.0, 0.0)
        text = Text(no_wrap=True)
        for row in reversed(range(self._rows)):
            text.append("  ")
            for column in range(self._columns):
                place = self._places.get((column, row))
                if place is None:
                    text.append("  ")
                elif math.isnan(place.height_mm):
                    sign = _SIGNS.get(place.mark, "· ")
                    text.append(sign, style="bold red" if place.mark in _FLAGS else "dim")
                else:
                    share = (place.height_mm - low) / max(high - low, 1.0)
                    sign = _SIGNS.get(place.mark, "+ " if place.mark == "inferred" else "  ")
                    colour = self._palette.at(self._palette.HEIGHTS, share)
                    text.append(sign, style=f"{'black' if share > 0.4 else 'white'} on {colour}")
            text.append("\n")
        return text


def _clock(seconds: float) -> str:
    """Minutes and seconds.

    Examples
    --------
    >>> _clock(125.4)
    '2:05'
    """
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
