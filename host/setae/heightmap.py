"""A height map: what was felt of a surface, on a grid of places seen from above.

Rows go along y, columns along x. Heights are z of the world, which begins at frame D's origin
above the first point of the scanned square; z points up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from setae.errors import InputError

__all__ = ["MARKS", "TOUCHED", "HeightMap"]

MARKS: Final = ("felt", "empty", "slipped", "double", "lost", "inferred", "unvisited")
"""What can be said of a place.

felt
    Touched, and its height measured.
empty
    Extended to the full, and nothing was there.
slipped, double
    Measured too, but doubtful: the touches at this place disagree, or the bristle was in touch
    again as soon as it should have been free.
lost
    Touched once, and then no more: there is something, of unknown height.
inferred
    Not touched; the height follows from the places around it.
unvisited
    Nobody has been there.
"""

TOUCHED: Final = ("felt", "slipped", "double")
"""Marks of the places whose height was measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightMap:
    """Heights on a grid.

    Parameters
    ----------
    x_mm, y_mm
        Places of the columns, (C,), and rows, (R,), rising.
    height_mm
        (R, C); NaN where there is no height.
    mark
        One of `MARKS` each, (R, C).

    Raises
    ------
    InputError
        The shapes don't fit, or there is no such mark.
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    height_mm: NDArray[np.float64]
    mark: NDArray[np.str_]

    def __post_init__(self) -> None:
        for name in ("x_mm", "y_mm", "height_mm"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        object.__setattr__(self, "mark", np.asarray(self.mark, dtype=np.str_))
        for name in ("x_mm", "y_mm"):
            places = getattr(self, name)
            if places.ndim != 1 or not len(places) or not (np.diff(places) > 0).all():
                raise InputError(f"height map: {name} is no list of rising places.")
        shape = (len(self.y_mm), len(self.x_mm))
        for name in ("height_mm", "mark"):
            if getattr(self, name).shape != shape:
                raise InputError(
                    f"height map: {name} has shape {getattr(self, name).shape}.",
                    f"The grid has {shape}: rows of y, columns of x.",
                )
        if unknown := set(self.mark.ravel().tolist()) - set(MARKS):
            raise InputError(
                f"height map: there is no mark {sorted(unknown)[0]!r}.",
                f"There are {', '.join(MARKS)}.",
            )

    def same_as(self, other: HeightMap) -> bool:
        """Whether both say exactly the same of the same places."""
        return all(
            np.array_equal(getattr(self, name), getattr(other, name), equal_nan=name != "mark")
            for name in ("x_mm", "y_mm", "height_mm", "mark")
        )

    def points_mm(self) -> NDArray[np.float64]:
        """Points that were touched, in the world, (N, 3); what was only inferred isn't among them.

        Examples
        --------
        >>> grid = HeightMap(
        ...     x_mm=[0.0, 10.0], y_mm=[0.0], height_mm=[[-95.0, np.nan]], mark=[["felt", "empty"]]
        ... )
        >>> grid.points_mm()
        array([[  0.,   0., -95.]])
        """
        rows, columns = np.nonzero(np.isin(self.mark, TOUCHED) & np.isfinite(self.height_mm))
        return np.stack(
            [self.x_mm[columns], self.y_mm[rows], self.height_mm[rows, columns]], axis=1
        )
