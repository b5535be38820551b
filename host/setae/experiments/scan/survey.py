"""What is known of the scanned square: a grid of places, filled one by one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from setae.config import Scan
from setae.errors import InputError
from setae.heightmap import MARKS, HeightMap

Cell: TypeAlias = tuple[int, int]
"""Column and row of a place."""

_PLACES_MAX = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """What is known of a place.

    Attributes
    ----------
    cell
        Its column, along x, and row, along y.
    x_mm, y_mm
        Where it is, from the first place.
    mark
        One of `setae.heightmap.MARKS`.
    height_mm
        Of the surface in the world; NaN where it is not known.
    uncertainty_mm
        As in `setae.contact.Contact`; NaN where nothing was touched.
    time_us
        When that became known, by the session's clock.
    """

    cell: Cell
    x_mm: float
    y_mm: float
    mark: str
    height_mm: float = math.nan
    uncertainty_mm: float = math.nan
    time_us: int = 0

    def data(self) -> dict[str, Any]:
        """For a log; JSON-ready."""
        return {
            "column": self.cell[0],
            "row": self.cell[1],
            "x_mm": self.x_mm,
            "y_mm": self.y_mm,
            "mark": self.mark,
            "height_mm": _or_none(self.height_mm),
            "uncertainty_mm": _or_none(self.uncertainty_mm),
        }

    @classmethod
    def of(cls, data: Mapping[str, Any], time_us: int) -> Place:
        """Read back what `data` wrote."""
        height_mm, uncertainty_mm = data.get("height_mm"), data.get("uncertainty_mm")
        return cls(
            cell=(int(data["column"]), int(data["row"])),
            x_mm=float(data["x_mm"]),
            y_mm=float(data["y_mm"]),
            mark=str(data["mark"]),
            height_mm=math.nan if height_mm is None else float(height_mm),
            uncertainty_mm=math.nan if uncertainty_mm is None else float(uncertainty_mm),
            time_us=time_us,
        )


class Survey:
    """A grid of places, and what is known of each.

    Parameters
    ----------
    settings
        Area and step.

    Raises
    ------
    InputError
        So many places would take days, or the step is longer than the area.

    Examples
    --------
    >>> from setae.config import load
    >>> survey = Survey(load().scan)
    >>> survey.columns, survey.rows
    (21, 21)
    >>> survey.order("zigzag")[20:23]
    [(20, 0), (20, 1), (19, 1)]
    """

    def __init__(self, settings: Scan) -> None:
        self.step_mm = settings.step_mm
        # A whole number of steps; the tiny part makes 0.3 / 0.1 three of them.
        self.columns, self.rows = (
            math.floor(extent_mm / settings.step_mm + 1e-6) + 1 for extent_mm in settings.area_mm
        )
        if self.columns * self.rows > _PLACES_MAX:
            raise InputError(
                f"The scan would have {self.columns} × {self.rows} places.",
                f"Give a longer step or a smaller area: at most {_PLACES_MAX} places.",
            )
        if settings.step_mm > max(settings.area_mm) > 0:
            width_mm, depth_mm = settings.area_mm
            raise InputError(
                f"A step of {settings.step_mm:g} mm leaves {width_mm:g} × {depth_mm:g} mm at once.",
                "Give a shorter step; for a single place, an area of 0.",
            )
        self._known: dict[Cell, Place] = {}

    def __len__(self) -> int:
        return self.columns * self.rows

    @property
    def known(self) -> int:
        """How many places something is known of."""
        return len(self._known)

    @property
    def places(self) -> tuple[Place, ...]:
        """Them, in the order in which they became known."""
        return tuple(self._known.values())

    def x_mm(self, column: int) -> float:
        """Where a column is."""
        return column * self.step_mm

    def y_mm(self, row: int) -> float:
        """Where a row is."""
        return row * self.step_mm

    def order(self, order: str) -> list[Cell]:
        """All places, row by row: ``zigzag`` to and fro, ``raster`` always along x."""
        places = []
        for row in range(self.rows):
            columns = range(self.columns)
            back = order == "zigzag" and row % 2
            places += [(column, row) for column in (reversed(columns) if back else columns)]
        return places

    def get(self, cell: Cell) -> Place | None:
        """What is known of a place."""
        return self._known.get(cell)

    def height_mm(self, cell: Cell) -> float:
        """Height of a place; NaN where it has none, or nothing is known."""
        place = self._known.get(cell)
        return place.height_mm if place else math.nan

    def put(self, place: Place) -> None:
        """Keep what has become known of a place."""
        self._known[place.cell] = place

    def make(
        self,
        cell: Cell,
        mark: str,
        *,
        height_mm: float = math.nan,
        uncertainty_mm: float = math.nan,
        time_us: int = 0,
    ) -> Place:
        """Keep what has become known of a place, and return it."""
        place = Place(
            cell=cell,
            x_mm=self.x_mm(cell[0]),
            y_mm=self.y_mm(cell[1]),
            mark=mark,
            height_mm=height_mm,
            uncertainty_mm=uncertainty_mm,
            time_us=time_us,
        )
        self.put(place)
        return place

    def resume(self, known: Iterable[Place]) -> None:
        """Take over what an earlier run found out.

        Raises
        ------
        InputError
            It had another grid.
        """
        for place in known:
            column, row = place.cell
            fits = (
                0 <= column < self.columns
                and 0 <= row < self.rows
                and math.isclose(place.x_mm, self.x_mm(column), abs_tol=1e-6)
                and math.isclose(place.y_mm, self.y_mm(row), abs_tol=1e-6)
                and place.mark in MARKS
            )
            if not fits:
                raise InputError(
                    f"The earlier run's place at {place.x_mm:g}, {place.y_mm:g} mm is none of "
                    "this scan.",
                    "Give the area and the step of the earlier run.",
                )
            self.put(place)

    def height_map(self) -> HeightMap:
        """All that is known, as a map."""
        shape = (self.rows, self.columns)
        height_mm = np.full(shape, np.nan)
        mark = np.full(shape, "unvisited", dtype="<U9")
        for (column, row), place in self._known.items():
            height_mm[row, column] = place.height_mm
            mark[row, column] = place.mark
        return HeightMap(
            x_mm=np.array([self.x_mm(column) for column in range(self.columns)]),
            y_mm=np.array([self.y_mm(row) for row in range(self.rows)]),
            height_mm=height_mm,
            mark=mark,
        )


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
