"""From TOML to a checked `Config`; every mistake is told with file and key."""

from __future__ import annotations

import difflib
import json
import math
import os
import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from setae.config.keys import keys
from setae.config.sections import DEFAULT_PLANT, PLANT_KEY, SECTIONS, Config
from setae.errors import ConfigError


def load(path: str | os.PathLike[str] | None = None) -> Config:
    """Read a robot's configuration.

    Parameters
    ----------
    path
        A TOML file that gives what differs from the paper's robot. None: the
        paper's robot.

    Raises
    ------
    ConfigError
        The file can't be read, a key is unknown, a value is out of range. The
        message names the file, the key and what it may hold.
    """
    if path is None:
        return loads("")
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(
            f"Can't read the configuration {os.fspath(path)}: {error.strerror or error}.",
            "Give the path of a TOML file, or none for the paper's robot.",
        ) from error
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"The configuration {os.fspath(path)} isn't text in UTF-8.", "Save it as UTF-8."
        ) from error
    return loads(text, source=os.fspath(path))


def loads(text: str, *, source: str = "configuration") -> Config:
    r"""Like `load`, from a text in TOML.

    Parameters
    ----------
    text
        What differs from the paper's robot.
    source
        What error messages call the text.

    Raises
    ------
    ConfigError
        As in `load`.

    Examples
    --------
    >>> loads("[geometry]\ntendon_radius_mm = 8.0").geometry.tendon_radius_mm
    8.0
    >>> loads("[geometry]\ntendon_radius = 8.0", source="my.toml")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    setae.errors.ConfigError: my.toml: [geometry] has no key 'tendon_radius'. Did you mean ...
    """
    paper = _parse(
        resources.files("setae").joinpath("robots", "paper.toml").read_text(encoding="utf-8"),
        "robots/paper.toml",
    )
    return _config(_parse(text, source), paper, source)


def _config(
    theirs: Mapping[str, dict[str, Any]], paper: Mapping[str, dict[str, Any]], source: str
) -> Config:
    """Make the configuration of checked values, theirs before the paper's."""
    sections: dict[str, Any] = {}
    for name, section in SECTIONS.items():
        values = {**paper.get(name, {}), **theirs.get(name, {})}
        try:
            sections[name] = section(**values)
        except ConfigError as error:
            raise ConfigError(f"{source}: {error.problem}") from None
    plant = theirs.get("simulator", {}).pop(PLANT_KEY, DEFAULT_PLANT)
    parameters = {**paper.get("simulator", {}), **theirs.get("simulator", {})}
    try:
        return Config(**sections, simulator=tuple(sorted(parameters.items())), plant=plant)
    except ConfigError as error:
        raise ConfigError(f"{source}: {error.problem}", error.remedy) from None


def replaced(config: Config, changes: Mapping[str, Any]) -> Config:
    """Return a configuration in which some keys have other values.

    Parameters
    ----------
    config
        The robot.
    changes
        Values by section and key, as a file has them: ``{"scan.step_mm": 20}``.

    Raises
    ------
    ConfigError
        There is no such key, or it can't have that value.

    Examples
    --------
    >>> replaced(loads(""), {"bristle.threshold_hpa": 20}).bristle.threshold_hpa
    20.0
    """
    document = tomllib.loads(config.to_toml())
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if not key:
            raise ConfigError(f"{name!r} is no key.", "Give section and key: scan.step_mm.")
        document.setdefault(section, {})[key] = value
    return _config(_parse_document(document, "configuration"), {}, "configuration")


def _parse(text: str, source: str) -> dict[str, dict[str, Any]]:
    """Checked values by section and field."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source} isn't valid TOML: {error}.", "Correct that line.") from None
    return _parse_document(document, source)


def _parse_document(document: Mapping[str, Any], source: str) -> dict[str, dict[str, Any]]:
    result: dict[str, dict[str, Any]] = {}
    for name, table in document.items():
        known = [*SECTIONS, "simulator"]
        if not isinstance(table, dict):
            raise ConfigError(
                f"{source}: {name!r} stands outside of any section.",
                f"Put it below one of: {', '.join(f'[{section}]' for section in known)}.",
            )
        if name == "simulator":
            result[name] = _parse_simulator(table, source)
        elif name in SECTIONS:
            result[name] = _parse_section(name, table, source)
        else:
            raise ConfigError(
                f"{source}: there is no section [{name}].", _suggest(name, known, "[{}]")
            )
    return result


def _parse_simulator(table: Mapping[str, Any], source: str) -> dict[str, Any]:
    numbers = {name: value for name, value in table.items() if name != PLANT_KEY}
    result: dict[str, Any] = dict(_flatten(numbers, source))
    if PLANT_KEY in table:
        plant = table[PLANT_KEY]
        if not isinstance(plant, str):
            raise ConfigError(
                f"{source}: [simulator] {PLANT_KEY} = {_show(plant)}: it must be a text.",
                'Such as "ideal".',
            )
        result[PLANT_KEY] = plant
    return result


def _parse_section(name: str, table: Mapping[str, Any], source: str) -> dict[str, Any]:
    known = keys(SECTIONS[name])
    values = {}
    for toml_name, value in table.items():
        if toml_name not in known:
            raise ConfigError(
                f"{source}: [{name}] has no key {toml_name!r}.", _suggest(toml_name, known, "{!r}")
            )
        field, key = known[toml_name]
        try:
            values[field] = key.check(_scaled(value, key.scale))
        except ValueError:
            raise ConfigError(
                f"{source}: [{name}] {toml_name} = {_show(value)}: it {key.describe(toml_name)}."
            ) from None
    return values


def _scaled(value: Any, scale: float) -> Any:
    if scale == 1.0:
        return value
    if isinstance(value, list):
        return [_scaled(entry, scale) for entry in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        # math.radians, so that 90 degrees are π/2 to the last bit.
        return math.radians(value)
    return value


def _show(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)


def _suggest(name: str, known: Iterable[str], style: str) -> str:
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    if close:
        return f"Did you mean {style.format(close[0])}?"
    return f"There are: {', '.join(style.format(entry) for entry in known)}."


def _flatten(
    table: Mapping[str, Any], source: str, prefix: str = ""
) -> Iterable[tuple[str, float]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flatten(value, source, f"{prefix}{name}.")
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ConfigError(
                f"{source}: [simulator] {prefix}{name} = {_show(value)}: it must be a number."
            )
        elif not math.isfinite(value):
            raise ConfigError(f"{source}: [simulator] {prefix}{name} = {value}: it must be finite.")
        else:
            yield f"{prefix}{name}", float(value)
