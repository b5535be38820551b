"""From places in pictures to frame D: scale, origin and axes, as a small TOML file.

    px_per_mm = 8.53          # or marker_mm and marker_px: a known length, and how long it looks
    origin_px = [640, 212]    # where the origin of frame D is: the middle of the spring's lower end
    right = "+X"              # axis of frame D that points to the right in the picture
    down = "+Z"               # axis that points down

    [view."+Y"]               # what differs in the pictures of one group
    right = "+Y"

ImageJ counts Y downwards. Where its own scale is set, its results are in mm: then
``px_per_mm = 1`` and the origin in mm.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from setae.arc import FloatArray
from setae.errors import InputError
from setae.experiments.targets import GROUPS

__all__ = ["Frame", "View", "load"]

_AXES: Final = {f"{sign}{name}": (place, float(f"{sign}1"))
                for place, name in enumerate("XYZ") for sign in "+-"}  # fmt: skip
_PX_PER_MM: Final = "px_per_mm"
_MARKER: Final = ("marker_mm", "marker_px")
_KEYS: Final = (
    _PX_PER_MM, *_MARKER, "origin_px", "right", "down", "rotation_deg",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How one camera looks at the plane in which the robot bends.

    Attributes
    ----------
    px_per_mm
        Scale in that plane.
    origin_px
        Origin of frame D in the picture.
    right, down
        Axes of frame D, such as ``+X``.
    rotation_deg
        By how much the picture has to be turned clockwise for the axes to be level.
    """

    px_per_mm: float
    origin_px: tuple[float, float]
    right: str
    down: str
    rotation_deg: float = 0.0

    def position_mm(self, x_px: float, y_px: float) -> FloatArray:
        """Frame D, (3,), of a place in the picture; NaN along the camera's axis.

        Examples
        --------
        >>> view = View(px_per_mm=2.0, origin_px=(100.0, 50.0), right="-Y", down="+Z")
        >>> view.position_mm(110.0, 170.0)
        array([nan, -5., 60.])
        """
        x, y = x_px - self.origin_px[0], y_px - self.origin_px[1]
        turn = math.radians(self.rotation_deg)
        # y points down, so this turns clockwise as one sees it.
        level = (x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn))
        position = np.full(3, np.nan)
        for name, value in zip((self.right, self.down), level, strict=True):
            axis, sign = _AXES[name]
            position[axis] = sign * value / self.px_per_mm
        return position


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The views of all groups, each checked when it is first asked for.

    Attributes
    ----------
    path
        The file that says them.
    common
        What holds for all pictures.
    special
        What differs, by group.
    """

    path: Path
    common: Mapping[str, Any]
    special: Mapping[str, Mapping[str, Any]]

    def view(self, group: str) -> View:
        """How the pictures of a group were taken.

        Raises
        ------
        InputError
            A key is missing or wrong; the message names it.
        """
        special = self.special.get(group, {})
        table = {**self.common, **special}
        # A scale of its own takes the place of the common one, however each is given.
        if _PX_PER_MM in special:
            table = {key: table[key] for key in table if key in special or key not in _MARKER}
        elif any(name in special for name in _MARKER):
            table.pop(_PX_PER_MM, None)
        return _view(table, f"{self.path}, pictures of {group}", group)

    def position_mm(self, group: str, x_px: float, y_px: float) -> FloatArray:
        """As `View.position_mm`, in the pictures of a group."""
        return self.view(group).position_mm(x_px, y_px)


def load(path: Path) -> Frame:
    """Read the file.

    Raises
    ------
    InputError
        It isn't there, isn't TOML, or has a view of no group.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path} can't be read: {error.strerror}.", "Check its name.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} isn't valid TOML: {error}.", "Mend that place.") from None
    special = document.pop("view", {})
    for group in special:
        if group not in GROUPS:
            raise InputError(
                f'{path}: there is no group [view."{group}"].', f"Groups: {', '.join(GROUPS)}."
            )
    return Frame(path, document, special)


def _view(table: Mapping[str, Any], where: str, group: str) -> View:
    for name in table:
        if name not in _KEYS:
            raise InputError(f"{where}: there is no key {name!r}.", f"Keys: {', '.join(_KEYS)}.")
    default = "+Y" if group in ("+Y", "-Y") else "+X"
    right, down = table.get("right", default), table.get("down", "+Z")
    for name, value in (("right", right), ("down", down)):
        if value not in _AXES:
            raise InputError(f"{where}: {name} = {value!r}.", f"Give one of {', '.join(_AXES)}.")
    if right[1] == down[1]:
        raise InputError(
            f"{where}: right and down are both along {right[1]}.", "Give two different axes."
        )
    if group in ("+X", "-X", "+Y", "-Y") and {right[1], down[1]} != {group[1], "Z"}:
        raise InputError(
            f"{where}: the axes are {right} and {down}, and {group} bends in the plane of "
            f"{group[1]} and Z.",
            f'Give right = "+{group[1]}" or "-{group[1]}" in [view."{group}"].',
        )
    return View(
        px_per_mm=_scale(table, where),
        origin_px=_pair(table, where),
        right=right,
        down=down,
        rotation_deg=_number(table, "rotation_deg", where) if "rotation_deg" in table else 0.0,
    )


def _scale(table: Mapping[str, Any], where: str) -> float:
    if _PX_PER_MM in table and any(name in table for name in _MARKER):
        raise InputError(
            f"{where}: the scale is given twice, as px_per_mm and by a marker.",
            "Leave px_per_mm out, or marker_mm and marker_px.",
        )
    if _PX_PER_MM in table:
        scale = _number(table, _PX_PER_MM, where)
    elif "marker_mm" in table and "marker_px" in table:
        marker_mm = _number(table, "marker_mm", where)
        scale = _number(table, "marker_px", where) / marker_mm if marker_mm > 0 else -1.0
    else:
        raise InputError(f"{where}: the scale is missing.",
                         "Give px_per_mm, or marker_mm and marker_px.")  # fmt: skip
    if scale <= 0:
        raise InputError(f"{where}: the scale is not positive.", "Give lengths above 0.")
    return scale


def _pair(table: Mapping[str, Any], where: str) -> tuple[float, float]:
    value = table.get("origin_px")
    good = isinstance(value, list) and len(value) == 2 and all(_is_number(v) for v in value)
    if not good:
        raise InputError(f"{where}: origin_px is {value!r}.", "Give [x, y] in pixels.")
    assert isinstance(value, list)
    return float(value[0]), float(value[1])


def _number(table: Mapping[str, Any], name: str, where: str) -> float:
    value = table[name]
    if not _is_number(value):
        raise InputError(f"{where}: {name} = {value!r}.", "Give a number.")
    return float(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
