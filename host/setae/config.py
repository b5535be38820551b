"""The robot's description: what it measures, how its servos are set up, how it moves.

`load` reads TOML. A user's file gives only what differs from the paper's robot,
``robots/paper.toml``. Every key is checked; the unit is part of its name.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import os
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from setae.errors import ConfigError

__all__ = [
    "TENDON_MODELS",
    "Bristle",
    "Config",
    "Explore",
    "Geometry",
    "Motion",
    "Servo",
    "Spring",
    "Stage",
    "Tube",
    "load",
    "loads",
]

SERVOS = 4
TENDON_MODELS = ("paper", "parallel", "taut")
"""Names that the key ``model`` may have; `setae.tendons` has a function for each."""


# ------------------------------------------------------------------ kinds of keys


@dataclass(frozen=True, slots=True, kw_only=True)
class _Key:
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
    "um": "µm",
    "n": "N",
}


def _unit(name: str) -> str:
    for suffix, unit in _UNITS.items():
        if name == suffix or name.endswith("_" + suffix):
            return f" of {unit}"
    return ""


def _key(default: Any = dataclasses.MISSING, /, **limits: Any) -> Any:
    return dataclasses.field(default=default, metadata={"key": _Key(**limits)})


def _keys(section: type) -> dict[str, tuple[str, _Key]]:
    """Name in a file → (field, what it may hold)."""
    return {
        field.metadata["key"].toml_name or field.name: (field.name, field.metadata["key"])
        for field in dataclasses.fields(section)
    }


class _Section:
    """Checks its fields when it is made, wherever the values come from."""

    __slots__ = ()

    def __post_init__(self) -> None:
        section = type(self).__name__.lower()
        for field in dataclasses.fields(self):  # type: ignore[arg-type]  # subclasses are dataclasses
            key: _Key = field.metadata["key"]
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


# ----------------------------------------------------------------------- sections


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry(_Section):
    """The robot's measures. The defaults are the paper's.

    Attributes
    ----------
    tendon_radius_mm
        Distance of the tendons from the spring's axis, the paper's d: one for all, or
        one each. The paper doesn't state it: exactly 34 of its 63 targets are
        reachable, as it reports, for 7.82 to 8.75 mm.
    tendon_angles_rad
        Where each tendon sits, about frame D's z axis. Any number, any angles.
    tendon_diameter_mm
        Of the line; the model ``taut`` keeps half of it between the tendon's centre and
        the spring's coils.
    free_length_mm, min_length_mm
        Effective length of the spring, relaxed and fully compressed.
    max_bend_rad
        Largest bending angle θ.
    bore_radius_mm
        Inner radius of the spring.
    pulley_radius_mm
        Radius on which the tendon winds.
    tip_offset_mm
        Distance l from the spring's top U to the bristle's tip E.
    filament_length_mm
        Free length of the bristle's filament.
    spring_outer_diameter_mm
        Outer diameter of the spring.

    Examples
    --------
    >>> Geometry(tendon_radius_mm=8.0).tendon_count
    4
    >>> Geometry(tendon_radius_mm=[8.0, 8.0, 7.5, 8.0]).tendon_radii_mm
    (8.0, 8.0, 7.5, 8.0)
    """

    tendon_radius_mm: float | Sequence[float] = _key(
        8.3, low=0.1, high=500, count=(1, 64), single=True
    )
    tendon_angles_rad: tuple[float, ...] = _key(
        (0.0, math.pi / 2, math.pi, 1.5 * math.pi),
        low=-2 * math.pi,
        high=2 * math.pi,
        toml_name="tendon_angles_deg",
        scale=math.pi / 180,
        count=(1, 64),
    )
    tendon_diameter_mm: float = _key(0.0, low=0, high=50)
    free_length_mm: float = _key(70.0, low=1, high=5000)
    min_length_mm: float = _key(20.0, low=0.1, high=5000)
    max_bend_rad: float = _key(
        math.pi / 2,
        low=math.pi / 180,
        high=math.pi,
        toml_name="max_bend_deg",
        scale=math.pi / 180,
    )
    bore_radius_mm: float = _key(9.0, low=0.1, high=500)
    pulley_radius_mm: float = _key(35.0, low=0.1, high=500)
    tip_offset_mm: float = _key(65.0, low=0, high=5000)
    filament_length_mm: float = _key(53.0, low=0, high=5000)
    spring_outer_diameter_mm: float = _key(21.0, low=0.2, high=1000)

    @property
    def tendon_count(self) -> int:
        """Number of tendons."""
        return len(self.tendon_angles_rad)

    @property
    def tendon_radii_mm(self) -> tuple[float, ...]:
        """Distance of each tendon from the spring's axis."""
        if isinstance(self.tendon_radius_mm, Sequence):
            return tuple(self.tendon_radius_mm)
        return (self.tendon_radius_mm,) * self.tendon_count

    @property
    def lumen_radius_mm(self) -> float:
        """How far from the spring's axis the centre of a tendon can get."""
        return self.bore_radius_mm - self.tendon_diameter_mm / 2

    def _contradiction(self) -> str:
        if self.min_length_mm >= self.free_length_mm:
            return (
                f"min_length_mm = {self.min_length_mm:g} must be below "
                f"free_length_mm = {self.free_length_mm:g}."
            )
        if len(self.tendon_radii_mm) != self.tendon_count:
            return (
                f"tendon_radius_mm has {len(self.tendon_radii_mm)} entries and tendon_angles_deg "
                f"{self.tendon_count}: give one radius for all tendons, or one each."
            )
        if max(self.tendon_radii_mm) > self.lumen_radius_mm:
            less = " less half of tendon_diameter_mm" if self.tendon_diameter_mm else ""
            return (
                f"tendon_radius_mm = {max(self.tendon_radii_mm):g} must not exceed "
                f"bore_radius_mm{less} = {self.lumen_radius_mm:g}: the tendons run inside the "
                "spring."
            )
        if 2 * self.bore_radius_mm >= self.spring_outer_diameter_mm:
            return (
                f"bore_radius_mm = {self.bore_radius_mm:g} must be below half of "
                f"spring_outer_diameter_mm = {self.spring_outer_diameter_mm:g}."
            )
        if self.filament_length_mm > self.tip_offset_mm:
            return (
                f"filament_length_mm = {self.filament_length_mm:g} must not exceed "
                f"tip_offset_mm = {self.tip_offset_mm:g}, which includes the filament."
            )
        return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring(_Section):
    """The backbone's elasticity.

    Attributes
    ----------
    axial_rate_n_per_mm
        Spring constant.
    mean_diameter_mm
        Mean diameter of the coils.
    poisson_ratio
        Of the wire's material.
    bending_factor
        Measured bending stiffness over theory's.
    """

    axial_rate_n_per_mm: float = _key(low=1e-4, high=1000)
    mean_diameter_mm: float = _key(low=0.1, high=1000)
    poisson_ratio: float = _key(low=0, high=0.5)
    bending_factor: float = _key(low=0.01, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo(_Section):
    """The servos and how they are mounted; one entry for each tendon.

    Attributes
    ----------
    pulse_min_us, pulse_max_us
        Pulses that the servo can follow without running into its end stop.
    pulse_free_us
        Pulse at which the tendon has the spring's free length: the servo's trim.
    direction
        +1 where a longer pulse winds the tendon up, -1 where it unwinds.
    us_per_degree
        Change of the pulse for a degree of the horn.
    growth_mm_per_turn
        How much the winding radius grows with each turn, as layers pile up; 0 where
        the turns lie side by side. At the free length it is `pulley_radius_mm`.
    speed_mm_s
        Fastest tendon that the servo manages.
    lag_ms
        Time from a pulse to the horn's motion.
    stall_torque_n_m
        Torque at which the servo stalls, at the voltage that it gets.
    torque_part
        Part of the stall torque that it holds for long without getting hot.
    min_tension_n
        Preload: tension that each tendon needs to count as taut.
    """

    pulse_min_us: tuple[float, ...] = _key(low=500, high=2500, count=(SERVOS, SERVOS))
    pulse_max_us: tuple[float, ...] = _key(low=500, high=2500, count=(SERVOS, SERVOS))
    pulse_free_us: tuple[float, ...] = _key(low=500, high=2500, count=(SERVOS, SERVOS))
    direction: tuple[int, ...] = _key(low=-1, high=1, choices=(1, -1), count=(SERVOS, SERVOS))
    us_per_degree: tuple[float, ...] = _key(low=1, high=100, count=(SERVOS, SERVOS))
    growth_mm_per_turn: tuple[float, ...] = _key(low=0, high=50, count=(SERVOS, SERVOS))
    speed_mm_s: float = _key(low=1, high=5000)
    lag_ms: float = _key(low=0, high=1000)
    stall_torque_n_m: float = _key(low=1e-4, high=1000)
    torque_part: float = _key(low=0.01, high=1)
    min_tension_n: float = _key(low=0, high=1000)

    def _contradiction(self) -> str:
        for index, (low, free, high) in enumerate(
            zip(self.pulse_min_us, self.pulse_free_us, self.pulse_max_us, strict=True)
        ):
            if not low < high:
                return (
                    f"servo {index}: pulse_min_us = {low:g} must be below pulse_max_us = {high:g}."
                )
            if not low <= free <= high:
                return (
                    f"servo {index}: pulse_free_us = {free:g} must lie from "
                    f"pulse_min_us = {low:g} to pulse_max_us = {high:g}."
                )
        return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion(_Section):
    """How fast the robot moves, and which tendon model it uses unless told otherwise.

    Attributes
    ----------
    model
        Tendon model, see `setae.tendons`.
    slew_mm_s
        The board refuses and limits any tendon faster than this.
    move_speed_mm_s, retract_speed_mm_s, relax_speed_mm_s
        Fastest tendon in an ordinary move, in the reflex, while unwinding.
    probe_speed_mm_s
        Tip in a guarded move.
    acceleration_mm_s2, jerk_mm_s3
        Highest of any tendon, in every planned motion.
    tolerance_um
        How far the straight lines that the board plays may leave the planned motion
        of a tendon, besides the rounding to ticks.
    hold_timeout_s
        Holding this long without a host relaxes the robot; 0 never does.
    """

    model: str = _key(low=0, high=0, choices=TENDON_MODELS)
    slew_mm_s: float = _key(low=1, high=5000)
    move_speed_mm_s: float = _key(low=0.1, high=5000)
    probe_speed_mm_s: float = _key(low=0.1, high=5000)
    retract_speed_mm_s: float = _key(low=0.1, high=5000)
    relax_speed_mm_s: float = _key(low=0.1, high=5000)
    acceleration_mm_s2: float = _key(low=1, high=1e6)
    jerk_mm_s3: float = _key(low=1, high=1e9)
    tolerance_um: float = _key(low=0, high=1e4)
    hold_timeout_s: int = _key(low=0, high=65535, integer=True)

    def _contradiction(self) -> str:
        for name in ("move_speed_mm_s", "retract_speed_mm_s", "relax_speed_mm_s"):
            if getattr(self, name) > self.slew_mm_s:
                return (
                    f"{name} = {getattr(self, name):g} must not exceed "
                    f"slew_mm_s = {self.slew_mm_s:g}."
                )
        return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bristle(_Section):
    """When a change of pressure is a contact.

    Attributes
    ----------
    threshold_hpa
        Absolute change against the baseline, in a guarded move.
    consecutive
        Samples in a row that must cross it.
    coarse_threshold_hpa
        The same for unguarded motion; 0 switches it off.
    """

    threshold_hpa: float = _key(low=0.1, high=1000)
    consecutive: int = _key(low=1, high=8, integer=True)
    coarse_threshold_hpa: float = _key(low=0, high=1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage(_Section):
    """How the robot arm that carries setae moves.

    Attributes
    ----------
    speed_mm_s, acceleration_mm_s2
        Of its linear moves.
    """

    speed_mm_s: float = _key(low=0.1, high=1000)
    acceleration_mm_s2: float = _key(low=1, high=10000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Explore(_Section):
    """The exploration of a tube, section III-D of the paper.

    Attributes
    ----------
    step_mm, steps
        The arm's steps downwards.
    compressed_length_mm
        Length between two directions.
    target_radius_mm, target_height_mm
        Targets (radius·cos α, radius·sin α, height) in frame D.
    directions
        Number of directions α.
    extend_duration_s, retract_duration_s
        Of the two motions of a direction.
    """

    step_mm: float = _key(low=0.1, high=1000)
    steps: int = _key(low=1, high=1000, integer=True)
    compressed_length_mm: float = _key(low=0.1, high=5000)
    target_radius_mm: float = _key(low=0, high=5000)
    target_height_mm: float = _key(low=0.1, high=5000)
    directions: int = _key(low=1, high=360, integer=True)
    extend_duration_s: float = _key(low=0.02, high=600)
    retract_duration_s: float = _key(low=0.02, high=600)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube(_Section):
    """The scene of the exploration.

    Attributes
    ----------
    inner_radius_mm
        Of the tube.
    axis_offset_mm
        Distance of the tube's axis from the robot's, opposite the obstacle.
    cube_edge_mm
        Edge of the cube that is the obstacle.
    obstacle_below_tip_mm
        Depths of the cube's top below the compressed bristle's tip, one a trial.
    """

    inner_radius_mm: float = _key(low=1, high=10000)
    axis_offset_mm: float = _key(low=0, high=10000)
    cube_edge_mm: float = _key(low=0.1, high=10000)
    obstacle_below_tip_mm: tuple[float, ...] = _key(low=-1000, high=10000, count=(1, 100))


# ------------------------------------------------------------------------- config

_SECTIONS: dict[str, type] = {
    "geometry": Geometry,
    "spring": Spring,
    "servo": Servo,
    "motion": Motion,
    "bristle": Bristle,
    "stage": Stage,
    "explore": Explore,
    "tube": Tube,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A whole robot. Made by `load`; change a copy with `dataclasses.replace`.

    Attributes
    ----------
    geometry, spring, servo, motion, bristle, stage, explore, tube
        The sections.
    simulator
        Parameters of the simulator, (its own name, value), sorted by name.

    Examples
    --------
    >>> load().motion.model
    'paper'
    """

    geometry: Geometry
    spring: Spring
    servo: Servo
    motion: Motion
    bristle: Bristle
    stage: Stage
    explore: Explore
    tube: Tube
    simulator: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        count = self.geometry.tendon_count
        if count != SERVOS:
            raise ConfigError(
                f"[geometry] tendon_angles_deg has {count} entries.",
                f"The board drives {SERVOS} servos: give {SERVOS}. "
                "`Geometry` alone takes any number.",
            )
        most_n = self.servo.stall_torque_n_m * self.servo.torque_part * 1e3
        most_n /= self.geometry.pulley_radius_mm
        if self.servo.min_tension_n >= most_n:
            raise ConfigError(
                f"[servo] min_tension_n = {self.servo.min_tension_n:g} must be below the "
                f"{most_n:.3g} N that a servo holds.",
                "That is stall_torque_n_m times torque_part over pulley_radius_mm.",
            )
        length, low, high = (
            self.explore.compressed_length_mm,
            self.geometry.min_length_mm,
            self.geometry.free_length_mm,
        )
        if not low <= length <= high:
            raise ConfigError(
                f"[explore] compressed_length_mm = {length:g} must lie from "
                f"min_length_mm = {low:g} to free_length_mm = {high:g}."
            )

    def to_toml(self) -> str:
        """The whole configuration as TOML, for logs: `loads` reads it back."""
        lines: list[str] = []
        for name, section in _SECTIONS.items():
            lines.append(f"[{name}]")
            for toml_name, (field, key) in _keys(section).items():
                value = getattr(getattr(self, name), field)
                lines.append(f"{toml_name} = {_format(value, key.scale)}")
            lines.append("")
        lines.append("[simulator]")
        lines.extend(f"{json.dumps(name)} = {value!r}" for name, value in self.simulator)
        return "\n".join(lines) + "\n"


def _format(value: Any, scale: float) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_format(entry, scale) for entry in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    # 15 digits: degrees come out as they were written.
    return repr(float(f"{value / scale:.15g}") if scale != 1.0 else value)


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
    theirs = _parse(text, source)
    sections: dict[str, Any] = {}
    for name, section in _SECTIONS.items():
        values = {**paper.get(name, {}), **theirs.get(name, {})}
        try:
            sections[name] = section(**values)
        except ConfigError as error:
            raise ConfigError(f"{source}: {error.problem}") from None
    parameters = {**paper.get("simulator", {}), **theirs.get("simulator", {})}
    try:
        return Config(**sections, simulator=tuple(sorted(parameters.items())))
    except ConfigError as error:
        raise ConfigError(f"{source}: {error.problem}", error.remedy) from None


def _parse(text: str, source: str) -> dict[str, dict[str, Any]]:
    """Checked values by section and field."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source} isn't valid TOML: {error}.") from None
    result: dict[str, dict[str, Any]] = {}
    for name, table in document.items():
        known = [*_SECTIONS, "simulator"]
        if not isinstance(table, dict):
            raise ConfigError(
                f"{source}: {name!r} stands outside of any section.",
                f"Put it below one of: {', '.join(f'[{section}]' for section in known)}.",
            )
        if name == "simulator":
            result[name] = dict(_flatten(table, source))
        elif name in _SECTIONS:
            result[name] = _parse_section(name, table, source)
        else:
            raise ConfigError(
                f"{source}: there is no section [{name}].", _suggest(name, known, "[{}]")
            )
    return result


def _parse_section(name: str, table: Mapping[str, Any], source: str) -> dict[str, Any]:
    keys = _keys(_SECTIONS[name])
    values = {}
    for toml_name, value in table.items():
        if toml_name not in keys:
            raise ConfigError(
                f"{source}: [{name}] has no key {toml_name!r}.", _suggest(toml_name, keys, "{!r}")
            )
        field, key = keys[toml_name]
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
