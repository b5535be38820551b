"""Which runs a study has: every combination of what is given."""

from __future__ import annotations

import hashlib
import itertools
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from setae import config as robot
from setae import rig
from setae.config import Config
from setae.errors import ConfigError, InputError
from setae.experiments.scan import MODES, Mode
from setae.objects import SHAPES, random_object

__all__ = ["EMPTY", "Plan", "Run", "load", "of_options"]

EMPTY: Final = "none"
"""Name of the object that isn't there: a bare table."""

_PLANT: Final = "simulator.plant_name"
_RUNS_MAX: Final = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One simulated scan.

    Attributes
    ----------
    name
        Of its folder: the same for the same run.
    object
        Shape; its size, place and yaw follow from the seed (`setae.objects.random_object`).
    seed
        Of the object and of the simulator.
    mode
        Of the scan.
    changes
        Keys of the configuration that the study varies, and those that differ from the paper's
        robot, with this run's values, as a file has them.
    config
        The whole configuration, as TOML.
    keep_log
        Whether its log is kept.
    """

    name: str
    object: str
    seed: int
    mode: Mode
    changes: tuple[tuple[str, Any], ...]
    config: str
    keep_log: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a study combines.

    Parameters
    ----------
    objects
        Shapes, or ``none`` for a bare table.
    seeds
        One object of random size, place and yaw for each.
    modes
        Of the scan.
    plants
        Simulated robots.
    vary
        Keys of the configuration, such as ``scan.step_mm``, each with its values.
    config
        The robot without these changes.
    keep_logs
        Whether every run's log is kept: some megabytes each.

    Raises
    ------
    InputError
        Something is empty, doubled, or has no such name, an object doesn't fit into an area, the
        simulator can't have a value, or the runs are too many.
    ConfigError
        There is no such key, or it can't have such a value.
    SimulatorMissingError
        The simulator isn't part of this installation.
    """

    objects: tuple[str, ...] = SHAPES
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    modes: tuple[str, ...] = ("adaptive",)
    plants: tuple[str, ...] = ()
    vary: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    config: Config = field(default_factory=lambda: robot.load())
    keep_logs: bool = False

    def __post_init__(self) -> None:
        count = len(self.objects) * len(self.seeds) * len(self.modes)
        for values in self._varied().values():
            count *= len(values)
        if count > _RUNS_MAX:
            raise InputError(f"study: {count} runs are too many.", "Give fewer combinations.")
        _require_some("objects", self.objects, (*SHAPES, EMPTY))
        _require_some("seeds", self.seeds)
        _require_some("modes", self.modes, MODES)
        for name, values in self.vary.items():
            _require_some(name, values)
        if _PLANT in self.vary and self.plants:
            raise InputError("study: plants are given twice.", f"Leave out {_PLANT}.")
        bad = [seed for seed in self.seeds if isinstance(seed, bool) or not isinstance(seed, int)]
        if bad or min(self.seeds) < 0:
            raise InputError("study: a seed is a whole number from 0.", "Give such seeds.")
        # Before anything runs, every name and value has been tried.
        configs = [robot.replaced(self.config, changes) for changes in self._combinations()]
        for config in {(one.plant, one.simulator): one for one in configs}.values():
            rig.try_simulator(config, min(self.seeds))
        for area_mm in {config.scan.area_mm for config in configs}:
            for shape, seed in itertools.product(self.objects, self.seeds):
                if shape != EMPTY:
                    random_object(shape, seed, area_mm=area_mm)

    @property
    def varied(self) -> tuple[str, ...]:
        """Keys of the configuration that differ between runs, or are at least given."""
        return tuple(self._varied())

    def runs(self) -> tuple[Run, ...]:
        """All runs: objects first, then seeds, modes and changes."""
        found = []
        varied = self.varied
        texts = [robot.replaced(self.config, c).to_toml() for c in self._combinations()]
        paper = _keys(robot.load().to_toml())
        # Studies of several robots share a folder, so what they don't vary counts too.
        configs = [
            ({k: v for k, v in _keys(text).items() if k in varied or v != paper.get(k)}, text)
            for text in texts
        ]
        for shape, seed, mode in itertools.product(self.objects, self.seeds, self.modes):
            for changes, config in configs:
                found.append(_run(shape, seed, mode, changes, config, keep_log=self.keep_logs))
        return tuple(found)

    def _varied(self) -> dict[str, tuple[Any, ...]]:
        return {**({_PLANT: self.plants} if self.plants else {}), **self.vary}

    def _combinations(self) -> Iterator[dict[str, Any]]:
        varied = self._varied()
        for values in itertools.product(*varied.values()):
            yield dict(zip(varied, values, strict=True))


def load(path: Path, *, keep_logs: bool = False) -> Plan:
    """Read a plan from a TOML file.

    It has a section ``[study]`` with ``objects``, ``seeds`` (a list, or how many, from 0),
    ``modes``, ``plants`` and ``config`` (a file beside this one), and a section ``[vary]`` with
    keys of the configuration and their values.

    Raises
    ------
    InputError, ConfigError
        The file can't be read, or says something that isn't possible.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path} can't be read: {error.strerror or error}.", "Check the file's name."
        ) from error
    except ValueError as error:
        raise InputError(f"{path} isn't valid TOML: {error}.", "Correct that line.") from error
    known = {"study": ("objects", "seeds", "modes", "plants", "config"), "vary": None}
    for section, table in document.items():
        if section not in known or not isinstance(table, dict):
            raise InputError(f"{path}: there is no {section!r}.", "There are [study] and [vary].")
        for key in table:
            names = known[section]
            if names and key not in names:
                raise InputError(
                    f"{path}: [study] has no key {key!r}.", f"There are {', '.join(names)}."
                )
    study = document.get("study", {})
    given: dict[str, Any] = {}
    for key in ("objects", "modes", "plants"):
        if key in study:
            given[key] = _listed(study[key])
    if "seeds" in study:
        given["seeds"] = _seeds(study["seeds"])
    if "config" in study:
        given["config"] = robot.load(path.parent / str(study["config"]))
    vary = {name: _listed(value) for name, value in _flat(document.get("vary", {}))}
    try:
        return Plan(**given, vary=vary, keep_logs=keep_logs)
    except (InputError, ConfigError) as error:
        raise type(error)(f"{path}: {error.problem}", error.remedy) from error


def of_options(
    *,
    objects: Sequence[str] = (),
    seeds: int | None = None,
    modes: Sequence[str] = (),
    plants: Sequence[str] = (),
    vary: Sequence[str] = (),
    config: Path | None = None,
    keep_logs: bool = False,
) -> Plan:
    """Make a plan of a command's options; ``vary`` as in ``scan.step_mm=10,20``.

    Raises
    ------
    InputError, ConfigError
        Something that isn't possible.

    Examples
    --------
    >>> plan = of_options(objects=["orange"], seeds=2, vary=["scan.step_mm=10,20"])
    >>> [(run.seed, run.changes) for run in plan.runs()][:2]
    [(0, (('scan.step_mm', 10.0),)), (0, (('scan.step_mm', 20.0),))]
    """
    given: dict[str, Any] = {}
    for name, values in (("objects", objects), ("modes", modes), ("plants", plants)):
        if values:
            given[name] = tuple(values)
    if seeds is not None:
        given["seeds"] = _seeds(seeds)
    changes: dict[str, tuple[Any, ...]] = {}
    for text in vary:
        key, sign, values_text = text.partition("=")
        try:
            values = tomllib.loads(f"v = [{values_text}]")["v"] if sign else []
        except tomllib.TOMLDecodeError:
            values = []
        if not values:
            raise InputError(
                f"--vary {text!r} is no key with its values.",
                "Give for example --vary scan.step_mm=10,20; texts in quotes.",
            )
        if key.strip() in changes:
            raise InputError(
                f"--vary {key.strip()} is given twice.", f"Give all its values in one: {text},…"
            )
        changes[key.strip()] = tuple(values)
    return Plan(**given, vary=changes, config=robot.load(config), keep_logs=keep_logs)


def _run(
    shape: str, seed: int, mode: str, changes: Mapping[str, Any], config: str, *, keep_log: bool
) -> Run:
    text = json.dumps([shape, seed, mode, config])
    digest = hashlib.sha256(text.encode()).hexdigest()[:8]
    return Run(
        name=f"{shape}-{seed}-{mode}-{digest}",
        object=shape,
        seed=seed,
        mode=next(known for known in MODES if known == mode),
        changes=tuple(changes.items()),
        config=config,
        keep_log=keep_log,
    )


def _seeds(given: Any) -> tuple[int, ...]:
    if isinstance(given, list | tuple):
        return tuple(given)
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise InputError(f"study: seeds = {given!r}.", "Give how many, or a list of them.")
    return tuple(range(given))


def _listed(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, list) else (value,)


def _keys(config: str) -> dict[str, Any]:
    return dict(_flat(tomllib.loads(config)))


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _require_some(name: str, values: Sequence[Any], known: Sequence[str] = ()) -> None:
    if not values:
        raise InputError(f"study: {name} is empty.", "Give one or more.")
    if len({json.dumps(value, default=str) for value in values}) != len(values):
        raise InputError(f"study: {name} has something twice.", "Give each once.")
    for value in values:
        if known and value not in known:
            raise InputError(f"study: {name} can't be {value!r}.", f"There are {', '.join(known)}.")
