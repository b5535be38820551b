"""Height maps as files and as points."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from setae.arc import FloatArray
from setae.errors import InputError
from setae.heightmap import HeightMap

__all__ = ["as_bytes", "known", "read", "write"]

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
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            return HeightMap(**{name: file[name] for name in _FIELDS})
    except OSError as error:
        raise InputError(
            f"{path} can't be read: {error.strerror or error}.", "Check the file's name."
        ) from error
    except Exception as error:  # a damaged file fails in as many ways as zip, zlib and NumPy have
        what = error.problem if isinstance(error, InputError) else f"{error}."
        raise InputError(
            f"{path} holds no height map: {what}", "Give a file that `setae cloud` wrote."
        ) from error


def known(heights: HeightMap) -> FloatArray:
    """Points with a height, touched or inferred, (N, 3)."""
    rows, columns = np.nonzero(np.isfinite(heights.height_mm))
    return np.stack(
        [heights.x_mm[columns], heights.y_mm[rows], heights.height_mm[rows, columns]], axis=1
    )
