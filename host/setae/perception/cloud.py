"""Points that were touched, and their files: PLY, CSV, NPY and NPZ."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from setae.arc import FloatArray
from setae.errors import InputError
from setae.heightmap import TOUCHED, HeightMap

__all__ = ["SUFFIXES", "PointCloud", "of_map", "read", "write"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointCloud:
    """Points in the world, z up.

    Parameters
    ----------
    points_mm
        (N, 3).
    mark
        What is said of each (`setae.heightmap.TOUCHED`), (N,).

    Raises
    ------
    InputError
        The shapes don't fit, or a coordinate isn't finite.
    """

    points_mm: FloatArray
    mark: NDArray[np.str_]

    def __post_init__(self) -> None:
        points = np.asarray(self.points_mm, dtype=np.float64).reshape(-1, 3)
        mark = np.asarray(self.mark, dtype=np.str_)
        if mark.shape != (len(points),) or not np.isfinite(points).all():
            raise InputError(
                "point cloud: each point needs three finite numbers and a mark.",
                "Check where the points come from.",
            )
        object.__setattr__(self, "points_mm", points)
        object.__setattr__(self, "mark", mark)


def of_map(heights: HeightMap) -> PointCloud:
    """Return the touched points of a height map."""
    touched = np.isin(heights.mark, TOUCHED) & np.isfinite(heights.height_mm)
    return PointCloud(points_mm=heights.points_mm(), mark=heights.mark[touched])


def write(path: str | Path, cloud: PointCloud) -> Path:
    """Write a point cloud; the name's ending says how.

    Parameters
    ----------
    path
        ``.ply`` (text, for MeshLab, CloudCompare and others), ``.csv``, ``.npy`` (the points
        alone) or ``.npz`` (points and marks).

    Raises
    ------
    InputError
        Another ending, or the file can't be written.

    Examples
    --------
    >>> cloud = PointCloud(points_mm=[[0.0, 10.0, -95.5]], mark=["felt"])
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = read(write(Path(folder) / "cloud.ply", cloud))
    >>> again.points_mm
    array([[  0. ,  10. , -95.5]])
    """
    path = Path(path)
    writer = _way(path)[0]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        writer(path, cloud)
    except OSError as error:
        raise InputError(
            f"{path} can't be written: {error.strerror or error}.", "Give another name."
        ) from error
    return path


def read(path: str | Path) -> PointCloud:
    """Read what `write` wrote. Where a file has no marks, every point counts as felt.

    Raises
    ------
    InputError
        The file can't be read, or holds no point cloud.
    """
    path = Path(path)
    reader = _way(path)[1]
    try:
        return reader(path)
    except OSError as error:
        raise InputError(
            f"{path} can't be read: {error.strerror or error}.", "Check the file's name."
        ) from error
    except Exception as error:  # a damaged file fails in as many ways as zip, zlib and NumPy have
        what = error.problem if isinstance(error, InputError) else f"{error}."
        raise InputError(
            f"{path} holds no point cloud: {what}", "Give a file that `setae cloud` wrote."
        ) from error


_FIELDS: Final = ("x_mm", "y_mm", "z_mm", "mark")


def _write_csv(path: Path, cloud: PointCloud) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_FIELDS)
        for point, mark in zip(cloud.points_mm, cloud.mark, strict=True):
            writer.writerow((*(repr(float(value)) for value in point), mark))


def _read_csv(path: Path) -> PointCloud:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return PointCloud(
        points_mm=np.array([[float(row[name]) for name in _FIELDS[:3]] for row in rows]),
        mark=np.array([row.get("mark") or TOUCHED[0] for row in rows], dtype=np.str_),
    )


def _write_ply(path: Path, cloud: PointCloud) -> None:
    """As text: every program reads it, and a scan is a few hundred points."""
    lines = [
        "ply",
        "format ascii 1.0",
        "comment unit mm, z up",
        *(f"comment mark {number} {mark}" for number, mark in enumerate(TOUCHED)),
        f"element vertex {len(cloud.points_mm)}",
        *(f"property double {axis}" for axis in "xyz"),
        "property uchar mark",
        "end_header",
    ]
    for point, mark in zip(cloud.points_mm, cloud.mark, strict=True):
        number = TOUCHED.index(str(mark))
        lines.append(" ".join([*(repr(float(value)) for value in point), str(number)]))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _read_ply(path: Path) -> PointCloud:
    lines = path.read_text(encoding="ascii").splitlines()
    end = lines.index("end_header")
    head = [line.split() for line in lines[:end]]
    if lines[0] != "ply" or ["format", "ascii", "1.0"] not in head:
        raise ValueError("it is no PLY file as text")
    elements = [words for words in head if words[0] == "element"]
    if elements[0][1] != "vertex":
        raise ValueError("its first element isn't vertex")
    names = _properties(head)
    rows = [line.split() for line in lines[end + 1 : end + 1 + int(elements[0][2])]]
    columns = [names.index(axis) for axis in "xyz"]
    points = np.array([[float(row[column]) for column in columns] for row in rows])
    marks = [TOUCHED[int(row[names.index("mark")])] if "mark" in names else TOUCHED[0]
             for row in rows]  # fmt: skip
    if len(rows) != int(elements[0][2]):
        raise ValueError("it ends early")
    return PointCloud(points_mm=points, mark=np.array(marks, dtype=np.str_))


def _properties(head: list[list[str]]) -> list[str]:
    """Names of the vertices' properties, in order."""
    names: list[str] = []
    elements = 0
    for words in head:
        elements += words[0] == "element"
        if words[0] == "property" and elements == 1:
            names.append(words[-1])
    return names


def _write_npy(path: Path, cloud: PointCloud) -> None:
    np.save(path, cloud.points_mm, allow_pickle=False)


def _read_npy(path: Path) -> PointCloud:
    with path.open("rb") as opened:
        points = np.load(opened, allow_pickle=False)
    return PointCloud(points_mm=points, mark=np.full(len(points), TOUCHED[0]))


def _write_npz(path: Path, cloud: PointCloud) -> None:
    np.savez_compressed(path, points_mm=cloud.points_mm, mark=cloud.mark)


def _read_npz(path: Path) -> PointCloud:
    with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
        return PointCloud(points_mm=file["points_mm"], mark=file["mark"])


_WAYS: Final[dict[str, tuple[Callable[[Path, PointCloud], None], Callable[[Path], PointCloud]]]] = {
    ".ply": (_write_ply, _read_ply),
    ".csv": (_write_csv, _read_csv),
    ".npy": (_write_npy, _read_npy),
    ".npz": (_write_npz, _read_npz),
}

SUFFIXES: Final = tuple(_WAYS)
"""Endings that files may have."""


def _way(
    path: Path,
) -> tuple[Callable[[Path, PointCloud], None], Callable[[Path], PointCloud]]:
    try:
        return _WAYS[path.suffix.lower()]
    except KeyError:
        raise InputError(
            f"{path}: a point cloud can't have the ending {path.suffix or 'none'!r}.",
            f"Give one of {', '.join(SUFFIXES)}.",
        ) from None
