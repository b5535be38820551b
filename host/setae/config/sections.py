"""The other sections, and the robot that they make together."""

from __future__ import annotations

import json
from dataclasses import dataclass

from setae.config.experiments import Explore, Scan, Tube
from setae.config.geometry import Geometry
from setae.config.keys import Section, key, toml_lines
from setae.errors import ConfigError

SERVOS = 4
"""How many the board drives."""

PLANT_KEY = "plant_name"
"""Key in ``[simulator]`` that names the simulated robot; all its others are numbers."""

DEFAULT_PLANT = "ideal"

TENDON_MODELS = ("paper", "parallel", "taut")
"""Names that the key ``model`` may have; `setae.tendons` has a function for each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring(Section):
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

    axial_rate_n_per_mm: float = key(low=1e-4, high=1000)
    mean_diameter_mm: float = key(low=0.1, high=1000)
    poisson_ratio: float = key(low=0, high=0.5)
    bending_factor: float = key(low=0.01, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo(Section):
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

    pulse_min_us: tuple[float, ...] = key(low=500, high=2500, count=(SERVOS, SERVOS))
    pulse_max_us: tuple[float, ...] = key(low=500, high=2500, count=(SERVOS, SERVOS))
    pulse_free_us: tuple[float, ...] = key(low=500, high=2500, count=(SERVOS, SERVOS))
    direction: tuple[int, ...] = key(low=-1, high=1, choices=(1, -1), count=(SERVOS, SERVOS))
    us_per_degree: tuple[float, ...] = key(low=1, high=100, count=(SERVOS, SERVOS))
    growth_mm_per_turn: tuple[float, ...] = key(low=0, high=50, count=(SERVOS, SERVOS))
    speed_mm_s: float = key(low=1, high=5000)
    lag_ms: float = key(low=0, high=1000)
    stall_torque_n_m: float = key(low=1e-4, high=1000)
    torque_part: float = key(low=0.01, high=1)
    min_tension_n: float = key(low=0, high=1000)

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
class Motion(Section):
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
    stop_switch
        1 where a normally closed switch from D4 to ground stops the robot when it opens.
    """

    model: str = key(low=0, high=0, choices=TENDON_MODELS)
    slew_mm_s: float = key(low=1, high=5000)
    move_speed_mm_s: float = key(low=0.1, high=5000)
    probe_speed_mm_s: float = key(low=0.1, high=5000)
    retract_speed_mm_s: float = key(low=0.1, high=5000)
    relax_speed_mm_s: float = key(low=0.1, high=5000)
    acceleration_mm_s2: float = key(low=1, high=1e6)
    jerk_mm_s3: float = key(low=1, high=1e9)
    tolerance_um: float = key(low=0, high=1e4)
    hold_timeout_s: int = key(low=0, high=65535, integer=True)
    stop_switch: int = key(low=0, high=1, choices=(0, 1))

    def _contradiction(self) -> str:
        for name in ("move_speed_mm_s", "retract_speed_mm_s", "relax_speed_mm_s"):
            if getattr(self, name) > self.slew_mm_s:
                return (
                    f"{name} = {getattr(self, name):g} must not exceed "
                    f"slew_mm_s = {self.slew_mm_s:g}."
                )
        return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bristle(Section):
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

    threshold_hpa: float = key(low=0.1, high=1000)
    consecutive: int = key(low=1, high=8, integer=True)
    coarse_threshold_hpa: float = key(low=0, high=1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage(Section):
    """How the robot arm that carries setae moves.

    Attributes
    ----------
    speed_mm_s, acceleration_mm_s2
        Of its linear moves.
    """

    speed_mm_s: float = key(low=0.1, high=1000)
    acceleration_mm_s2: float = key(low=1, high=10000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ur(Section):
    """A Universal Robots arm as the stage, and where it may carry the robot.

    Attributes
    ----------
    frame_d_mm, frame_d_rotation_deg
        Pose of frame D on the flange: origin, and rotation vector (axis times angle).
        D's z axis points along the spring, away from the flange.
    payload_kg, payload_centre_mm
        What hangs from the flange, and its centre of mass in the flange's frame.
    box_min_mm, box_max_mm
        Corners of the box that frame D's origin stays in, in the arm's base frame as
        the pendant shows it.
    state_age_s
        Age of the arm's last state above which the controller counts as frozen.
    command_deadline_s
        Longest time for the controller to take a command.
    watchdog_hz
        The controller stops the arm by itself where it hears less often from the host.
    tilt_max_deg
        Most that frame D's z axis may be off straight down.
    """

    frame_d_mm: tuple[float, ...] = key(low=-2000, high=2000, count=(3, 3))
    frame_d_rotation_deg: tuple[float, ...] = key(low=-360, high=360, count=(3, 3))
    payload_kg: float = key(low=0, high=100)
    payload_centre_mm: tuple[float, ...] = key(low=-1000, high=1000, count=(3, 3))
    box_min_mm: tuple[float, ...] = key(low=-3000, high=3000, count=(3, 3))
    box_max_mm: tuple[float, ...] = key(low=-3000, high=3000, count=(3, 3))
    state_age_s: float = key(low=0.05, high=10)
    command_deadline_s: float = key(low=0.1, high=60)
    watchdog_hz: float = key(low=0.5, high=50)
    tilt_max_deg: float = key(low=0, high=180)

    def _contradiction(self) -> str:
        for axis, low, high in zip("xyz", self.box_min_mm, self.box_max_mm, strict=True):
            if not low < high:
                return f"{axis}: box_min_mm = {low:g} must be below box_max_mm = {high:g}."
        return ""


SECTIONS: dict[str, type[Section]] = {
    "geometry": Geometry,
    "spring": Spring,
    "servo": Servo,
    "motion": Motion,
    "bristle": Bristle,
    "stage": Stage,
    "ur": Ur,
    "explore": Explore,
    "tube": Tube,
    "scan": Scan,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A whole robot. Made by `load`; change a copy with `dataclasses.replace`.

    Attributes
    ----------
    geometry, spring, servo, motion, bristle, stage, ur, explore, tube, scan
        The sections.
    simulator
        Parameters of the simulator, (its own name, value), sorted by name; they stand
        above the plant's.
    plant
        Name of the simulated robot: ``plant_name`` in ``[simulator]``.

    Examples
    --------
    >>> from setae import config
    >>> config.load().motion.model
    'paper'
    """

    geometry: Geometry
    spring: Spring
    servo: Servo
    motion: Motion
    bristle: Bristle
    stage: Stage
    ur: Ur
    explore: Explore
    tube: Tube
    scan: Scan
    simulator: tuple[tuple[str, float], ...] = ()
    plant: str = DEFAULT_PLANT

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
        low, high = self.geometry.min_length_mm, self.geometry.free_length_mm
        retracted, extended = self.scan_lengths_mm
        for name, length in (
            ("[explore] compressed_length_mm", self.explore.compressed_length_mm),
            ("[scan] retracted_length_mm", retracted),
            ("[scan] extended_length_mm", extended),
        ):
            if not low <= length <= high:
                raise ConfigError(
                    f"{name} = {length:g} must lie from "
                    f"min_length_mm = {low:g} to free_length_mm = {high:g}."
                )
        if retracted >= extended:
            raise ConfigError(
                f"[scan] retracted_length_mm = {retracted:g} must be below "
                f"extended_length_mm = {extended:g}."
            )

    @property
    def scan_lengths_mm(self) -> tuple[float, float]:
        """Lengths of the spring between which a scan goes to and fro: short, long."""
        return (
            self.scan.retracted_length_mm or self.geometry.min_length_mm,
            self.scan.extended_length_mm or self.geometry.free_length_mm,
        )

    @property
    def scan_reach_mm(self) -> float:
        """Height of the extended tip in a scan, z of the world: what is lower is out of reach."""
        return -(self.scan_lengths_mm[1] + self.geometry.tip_offset_mm)

    @property
    def rest_reach_mm(self) -> float:
        """Height of the tip of the robot at rest, at its free length, z of the world."""
        return -(self.geometry.free_length_mm + self.geometry.tip_offset_mm)

    def to_toml(self) -> str:
        """The whole configuration as TOML, for logs: `loads` reads it back."""
        lines: list[str] = []
        for name in SECTIONS:
            lines += [f"[{name}]", *toml_lines(getattr(self, name)), ""]
        lines += ["[simulator]", f"{PLANT_KEY} = {json.dumps(self.plant)}"]
        lines.extend(f"{json.dumps(name)} = {value!r}" for name, value in self.simulator)
        return "\n".join(lines) + "\n"
