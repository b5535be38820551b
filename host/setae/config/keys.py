"""What a key of the configuration may hold, and sections that check theirs."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from setae.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """What a key may hold.

    Attributes
    ----------
    toml_name
        The key's name in a file, where it differs from the field's.
    scale
        A file's value times this is the field's.
    count
        Entries of a list: (fewest, most). None: a single value.
    single
        A single value will do where a list may stand.
    """

    low: float
    high: float
    toml_name: str = ""
    scale: float = 1.0
    integer: bool = False
    count: tuple[int, int] | None = None
    single: bool = False
    choices: tuple[Any, ...] = ()

    def describe(self, name: str) -> str:
        """What a key of this name must be, for a message."""
        if self.choices:
            what = "one of " + ", ".join(json.dumps(choice) for choice in self.choices)
        else:
            low, high = self.low / self.scale, self.high / self.scale
            what = f"{'an integer' if self.integer else 'a number'}{_unit(name)}"
            what += f" from {low:.6g} to {high:.6g}"
        if self.count is None:
            return f"must be {what}"
        fewest, most = self.count
        number = str(fewest) if fewest == most else f"{fewest} to {most}"
        if self.single:
            return f"must be {what}, or a list of {number} of them"
        return f"must be a list of {number}, each {what}"

    def check(self, value: Any) -> Any:
        """The value in the field's own type; raises ValueError if it can't be."""
        # An array of numpy without axes can't be iterated, though it looks as if it could.
        one = not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0
        if self.count is None or (self.single and one):
            return self._check_one(value)
        if isinstance(value, (str, bytes)) or one:
            raise ValueError
        entries = tuple(self._check_one(entry) for entry in value)
        if not self.count[0] <= len(entries) <= self.count[1]:
            raise ValueError
        return entries

    def _check_one(self, value: Any) -> Any:
        if isinstance(value, bool):
            raise ValueError
        if self.choices:
            if value not in self.choices:
                raise ValueError
            return next(choice for choice in self.choices if choice == value)
        if isinstance(value, str) or not hasattr(value, "__float__"):
            raise ValueError
        number = float(value)
        # Converting degrees may push a value at the very end of its range beyond it.
        slack = 1e-12 * max(abs(self.low), abs(self.high))
        if not self.low - slack <= number <= self.high + slack:
            raise ValueError
        if not self.integer:
            return number
        if number != math.floor(number):
            raise ValueError
        return int(number)


_UNITS = {
    "n_per_mm": "N/mm",
    "us_per_degree": "µs/°",
    "mm_per_turn": "mm/turn",
    "mm_s3": "mm/s³",
    "mm_s2": "mm/s²",
    "mm_s": "mm/s",
    "mm": "mm",
    "deg": "degrees",
    "rad": "radians",
    "us": "µs",
    "ms": "ms",
    "s": "s",
    "hpa": "hPa",
    "n_m": "N·m",
    "hz": "Hz",
    "kg": "kg",
    "um": "µm",
    "n": "N",
}


def _unit(name: str) -> str:
    for suffix, unit in _UNITS.items():
        if name == suffix or name.endswith("_" + suffix):
            return f" of {unit}"
    return ""


def key(default: Any = dataclasses.MISSING, /, **limits: Any) -> Any:
    """Make a field of a section; `limits` as in `Key`."""
    return dataclasses.field(default=default, metadata={"key": Key(**limits)})


def keys(section: type[Section]) -> dict[str, tuple[str, Key]]:
    """Name in a file → (field, what it may hold)."""
    return {
        field.metadata["key"].toml_name or field.name: (field.name, field.metadata["key"])
        for field in dataclasses.fields(section)  # type: ignore[arg-type]  # subclasses are dataclasses
    }


class Section:
    """Checks its fields when it is made, wherever the values come from."""

    __slots__ = ()

    def __post_init__(self) -> None:
        section = type(self).__name__.lower()
        for field in dataclasses.fields(self):  # type: ignore[arg-type]  # subclasses are dataclasses
            key: Key = field.metadata["key"]
            value = getattr(self, field.name)
            try:
                object.__setattr__(self, field.name, key.check(value))
            except ValueError:
                plain = dataclasses.replace(key, scale=1.0)
                raise ConfigError(
                    f"[{section}] {field.name} = {value!r}: it {plain.describe(field.name)}."
                ) from None
        problem = self._contradiction()
        if problem:
            raise ConfigError(f"[{section}] {problem}")

    def _contradiction(self) -> str:
        """What is wrong between fields that are each in range; empty if nothing is."""
        return ""


def toml_lines(section: Section) -> Iterator[str]:
    """Write a section's keys as a file has them."""
    for toml_name, (field, key) in keys(type(section)).items():
        yield f"{toml_name} = {_format(getattr(section, field), key.scale)}"


def _format(value: Any, scale: float) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_format(entry, scale) for entry in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    # 15 digits: degrees come out as they were written.
    return repr(float(f"{value / scale:.15g}") if scale != 1.0 else value)
