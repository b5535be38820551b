"""Height maps as files, and on other grids."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from setae.arc import FloatArray
from setae.errors import InputError
from setae.heightmap import HeightMap

__all__ = ["as_bytes", "known", "read", "resampled", "write"]

_FIELDS = ("x_mm", "y_mm", "height_mm", "mark")


def write(path: str | Path, heights: HeightMap) -> Path:
    """Write a height map as NPZ.

    Raises
    ------
    InputError
        The name doesn't end in ``.npz``, or the file can't be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".npz":
        raise InputError(f"{path}: a height map is written as .npz.", "Give such a name.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(as_bytes(heights))
    except OSError as error:
        raise InputError(
            f"{path} can't be written: {error.strerror or error}.",
            "Check the folder and the room on the disk.",
        ) from error
    return path


def as_bytes(heights: HeightMap) -> bytes:
    """Return the content of such a file."""
    file = io.BytesIO()
    np.savez_compressed(file, **{name: getattr(heights, name) for name in _FIELDS})
    return file.getvalue()


def read(path: str | Path) -> HeightMap:
    """Read what `write` wrote.

    Raises
    ------
    InputError
        The file can't be read, or holds no height map.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return HeightMap(**{name: file[name] for name in _FIELDS})
    except OSError as error:
        raise InputError(
            f"{path} can't be read: {error.strerror or error}.", "Check the file's name."
        ) from error
    except (ValueError, KeyError, EOFError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path} holds no height map: {error}.", "Give a file that `setae cloud` wrote."
        ) from error


def known(heights: HeightMap) -> FloatArray:
    """Points with a height, touched or inferred, (N, 3)."""
    rows, columns = np.nonzero(np.isfinite(heights.height_mm))
    return np.stack(
        [heights.x_mm[columns], heights.y_mm[rows], heights.height_mm[rows, columns]], axis=1
    )


def resampled(heights: HeightMap, x_mm: FloatArray, y_mm: FloatArray) -> HeightMap:
    """Return the map on another grid: each place takes the nearest old one's height and mark.

    Nearest, and not between: the mean of a lid's height and the table's is neither.

    Parameters
    ----------
    heights
        The map.
    x_mm, y_mm
        Columns (C,) and rows (R,) of the new grid, rising. Places more than half a cell
        outside of the old one are unvisited.
    """
    x_mm, y_mm = np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float)
    columns, outside_x = _nearest(heights.x_mm, x_mm)
    rows, outside_y = _nearest(heights.y_mm, y_mm)
    outside = outside_y[:, np.newaxis] | outside_x
    where = np.ix_(rows, columns)
    return HeightMap(
        x_mm=x_mm,
        y_mm=y_mm,
        height_mm=np.where(outside, np.nan, heights.height_mm[where]),
        mark=np.where(outside, "unvisited", heights.mark[where]),
    )


def _nearest(old_mm: FloatArray, new_mm: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    distance = np.abs(new_mm[:, np.newaxis] - old_mm)
    half = float(np.diff(old_mm).max()) / 2 if len(old_mm) > 1 else np.inf
    return distance.argmin(axis=1), distance.min(axis=1) > half * (1 + 1e-9)
