"""The section that kinematics alone needs: the robot's measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from setae.config.keys import Section, key


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry(Section):
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

    tendon_radius_mm: float | Sequence[float] = key(
        8.3, low=0.1, high=500, count=(1, 64), single=True
    )
    tendon_angles_rad: tuple[float, ...] = key(
        (0.0, math.pi / 2, math.pi, 1.5 * math.pi),
        low=-2 * math.pi,
        high=2 * math.pi,
        toml_name="tendon_angles_deg",
        scale=math.pi / 180,
        count=(1, 64),
    )
    tendon_diameter_mm: float = key(0.0, low=0, high=50)
    free_length_mm: float = key(70.0, low=1, high=5000)
    min_length_mm: float = key(20.0, low=0.1, high=5000)
    max_bend_rad: float = key(
        math.pi / 2,
        low=math.pi / 180,
        high=math.pi,
        toml_name="max_bend_deg",
        scale=math.pi / 180,
    )
    bore_radius_mm: float = key(9.0, low=0.1, high=500)
    pulley_radius_mm: float = key(35.0, low=0.1, high=500)
    tip_offset_mm: float = key(65.0, low=0, high=5000)
    filament_length_mm: float = key(53.0, low=0, high=5000)
    spring_outer_diameter_mm: float = key(21.0, low=0.2, high=1000)

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
