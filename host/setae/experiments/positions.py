"""Positions that a person measured, from a file.

Two kinds are read, told apart by their columns. *Plain*: ``x_mm, y_mm, z_mm`` in frame
D. *ImageJ*: a table of results with ``X`` and ``Y`` in the picture, which a `View` turns
into a plane of frame D. In both, a column ``target`` or ``Label`` names the target, such
as ``+X z40 b10``; ImageJ writes the picture's name there, so ``IMG_+X_z40_b10.png`` does
too. A file of one group may leave the names out and have its targets in their order.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from setae.errors import InputError
from setae.experiments.accuracy import Pose
from setae.experiments.targets import GROUPS, Target, find
from setae.experiments.view import Frame
from setae.wording import counted

__all__ = ["named", "read"]

_PLAIN: Final = ("x_mm", "y_mm", "z_mm")
_PICTURE: Final = ("x", "y")
_NAMES: Final = ("target", "label")

# "+X z40 b10" and "C z30", also as part of a file's name.
_NUMBER = r"(\d+(?:\.\d+)?)"
_BENT = re.compile(rf"([+-])([XY])[\s_.-]*z{_NUMBER}[\s_.-]*b{_NUMBER}", re.IGNORECASE)
_STRAIGHT = re.compile(rf"(?<![A-Za-z])C[\s_.-]*z{_NUMBER}", re.IGNORECASE)
# ImageJ puts the picture's ending, and the slice of a stack, behind the name.
_ENDING = re.compile(r"\.(?=[A-Za-z:])")


@dataclass(frozen=True, slots=True)
class _Cell:
    """Where something stands, for messages."""

    path: Path
    line: int
    column: str

    def error(self, problem: str, remedy: str) -> InputError:
        return InputError(f"{self.path}, line {self.line}, column {self.column}: {problem}", remedy)


def named(text: str, targets: Sequence[Target]) -> Target | None:
    """Find the target that a label or a picture's name tells; None where it tells none.

    Examples
    --------
    >>> from setae.config import load
    >>> from setae.experiments.targets import paper_targets
    >>> named("shot_-Y_z45_b20.jpg", paper_targets(load())).label
    '-Y z45 b20'
    """
    text = _ENDING.split(text)[0] if "." in text else text
    if bent := _BENT.search(text):
        sign, axis, height, bend = bent.groups()
        label = f"{sign}{axis.upper()} z{float(height):g} b{float(bend):g}"
    elif straight := _STRAIGHT.search(text):
        label = f"C z{float(straight.group(1)):g}"
    else:
        return None
    return find(label, targets)


def read(
    given: str | Path, targets: Sequence[Target], frame: Frame | None = None
) -> tuple[Pose, ...]:
    """Read the positions of some targets.

    Parameters
    ----------
    given
        A file, or ``GROUP=FILE`` for one whose rows are the targets of a group in
        their order, such as ``+X=plus_x.csv``.
    targets
        All targets that there are.
    frame
        Scale and axes of pictures; needed for ImageJ's tables.

    Raises
    ------
    InputError
        The file can't be read or says something wrong: with line and column.
    """
    group, path = _parted(given)
    rows = list(_rows(path))
    if not rows:
        raise InputError(f"{path} holds no rows.", "It needs a line of names, then a line a pose.")
    _, header = rows[0]
    columns = {name.strip().lower(): place for place, name in enumerate(header) if name.strip()}
    plain = all(name in columns for name in _PLAIN)
    wanted = _PLAIN if plain else _PICTURE
    for name in wanted:
        if name not in columns:
            raise InputError(
                f"{path}, line 1: there is no column {name.upper() if not plain else name}; "
                f"it has: {', '.join(text for text in header if text.strip()) or 'none'}.",
                "Give x_mm, y_mm and z_mm in frame D, or ImageJ's X and Y.",
            )
    if not plain and frame is None:
        raise InputError(
            f"{path} holds places in pictures, and nobody said what they mean.",
            "Give --frame FILE with scale, origin and axes; docs/validate.md has one.",
        )
    name_column = next((columns[name] for name in _NAMES if name in columns), None)
    order = [target for target in targets if group is None or target.group == group]
    body = [(line, row) for line, row in rows[1:] if any(text.strip() for text in row)]
    if not body:
        raise InputError(f"{path} is empty below its line of names.", "Give a line a pose.")
    by_order = _in_order(body, name_column, targets)
    if by_order and len(body) != len(order):
        what = f"group {group}" if group else "the run"
        raise InputError(
            f"{path} has {counted(len(body), 'row')} without names of targets, and "
            f"{what} has {counted(len(order), 'target')}.",
            "Name the target of each row, such as +X z40 b10, or give GROUP=FILE.",
        )
    poses: list[Pose] = []
    lines: dict[str, int] = {}
    for place, (line, row) in enumerate(body):
        if by_order:
            target = order[place]
        else:
            assert name_column is not None
            target = _target(_Cell(path, line, header[name_column]), row, name_column, order)
        if target.label in lines:
            raise InputError(
                f"{path}, line {line}: {target.label} is there already, in line "
                f"{lines[target.label]}.",
                "Leave one of them out.",
            )
        lines[target.label] = line
        values = [
            _number(_Cell(path, line, header[columns[name]]), row, columns[name]) for name in wanted
        ]
        position = np.array(values) if plain else None
        if position is None:
            assert frame is not None
            position = frame.position_mm(target.group, values[0], values[1])
        _require_near(_Cell(path, line, ", ".join(wanted)), position, target, plain=plain)
        poses.append(Pose(target, position))
    return tuple(poses)


def _parted(given: str | Path) -> tuple[str | None, Path]:
    text = str(given)
    group, equals, rest = text.partition("=")
    if equals and group in GROUPS:
        return group, Path(rest)
    if equals and not Path(text).exists():
        raise InputError(f"{group!r} is no group of targets.", f"Groups: {', '.join(GROUPS)}.")
    return None, Path(text)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is no text file.", "Save ImageJ's results as CSV: File > Save As."
        ) from None
    except OSError as error:
        raise InputError(
            f"{path} can't be read: {error.strerror}.", "Check the file's name."
        ) from error
    first = text.partition("\n")[0]
    delimiter = max("\t;,", key=first.count)
    reader = csv.reader(io.StringIO(text), delimiter=delimiter)
    for row in reader:
        if row and not row[0].lstrip().startswith("#"):
            yield reader.line_num, row


def _in_order(
    body: Sequence[tuple[int, list[str]]], column: int | None, targets: Sequence[Target]
) -> bool:
    """Whether no row names a target: then their order does."""
    if column is None:
        return True
    texts = [row[column] if column < len(row) else "" for _, row in body]
    return not any(named(text, targets) for text in texts) and not any(
        _BENT.search(text) or _STRAIGHT.search(text) for text in texts
    )


def _target(cell: _Cell, row: Sequence[str], column: int, targets: Sequence[Target]) -> Target:
    text = row[column] if column < len(row) else ""
    found = named(text, targets)
    if found is None:
        raise cell.error(
            f"{text.strip() or 'nothing'!r} names no target of this run.",
            "Write it like +X z40 b10 or C z30; `setae validate --list` prints all.",
        )
    return found


def _number(cell: _Cell, row: Sequence[str], column: int) -> float:
    text = row[column].strip() if column < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        comma = "," in text
        raise cell.error(
            f"{text or 'nothing'!r} is no number.",
            "Write decimals with a point." if comma else "Measure it again, or leave the line out.",
        ) from None
    if not math.isfinite(value):
        raise cell.error(f"{text} is not finite.", "Measure it again, or leave the line out.")
    return value


_FAR_MM: Final = 60.0


def _require_near(cell: _Cell, position_mm: np.ndarray, target: Target, *, plain: bool) -> None:
    """Refuse what can only be a wrong unit, scale or axis: no robot misses by its own length."""
    error = np.abs(position_mm - np.array(target.position_mm))
    if np.nanmax(error) <= _FAR_MM:
        return
    shown = ", ".join("not seen" if math.isnan(v) else f"{v:.1f}" for v in position_mm)
    where = ", ".join(f"{v:.1f}" for v in target.position_mm)
    raise cell.error(
        f"that is ({shown}) mm, and {target.label} is at ({where}) mm.",
        "Check that it is in mm and in frame D, z away from the base."
        if plain
        else "Check scale, origin and axes in the --frame file.",
    )


def merged(parts: Sequence[Sequence[Pose]]) -> tuple[Pose, ...]:
    """Join the poses of several files.

    Raises
    ------
    InputError
        A target is in two of them.
    """
    found: Mapping[str, Pose] = {}
    for part in parts:
        for pose in part:
            if pose.target.label in found:
                raise InputError(
                    f"{pose.target.label} is in two of the files.", "Leave one of them out."
                )
            found = {**found, pose.target.label: pose}
    return tuple(found.values())
