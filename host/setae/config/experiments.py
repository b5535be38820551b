"""The sections of the experiments."""

from __future__ import annotations

from dataclasses import dataclass

from setae.config.keys import Section, key


@dataclass(frozen=True, slots=True, kw_only=True)
class Explore(Section):
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

    step_mm: float = key(low=0.1, high=1000)
    steps: int = key(low=1, high=1000, integer=True)
    compressed_length_mm: float = key(low=0.1, high=5000)
    target_radius_mm: float = key(low=0, high=5000)
    target_height_mm: float = key(low=0.1, high=5000)
    directions: int = key(low=1, high=360, integer=True)
    extend_duration_s: float = key(low=0.02, high=600)
    retract_duration_s: float = key(low=0.02, high=600)


SCAN_ORDERS = ("zigzag", "raster")
"""Names that the key ``order`` may have: rows to and fro, or all from the same side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Section):
    """The scan of a surface, section III-C of the paper.

    Attributes
    ----------
    area_mm
        Extent along x and y.
    step_mm
        From place to place.
    order
        Of the rows, see `SCAN_ORDERS`.
    extended_length_mm, retracted_length_mm
        Of the spring, straight; 0: its free length, and its least one.
    extend_speed_mm_s, retract_speed_mm_s
        Of the bristle's tip at its fastest.
    tallest_mm
        How far anything may rise above the extended bristle's tip.
    clearance_mm
        Between a surface and the tip that steps over it.
    contact_depth_mm
        How much lower than the surface a contact is estimated; added to every height.
    slip_hpa
        A rise of pressure that falls back by as much before the contact is a slip.
    seek_speed_mm_s
        Adaptive: of the tip, beyond where a surface is expected.
    coarse_mm
        Adaptive: anything this wide is found.
    flat_mm
        Adaptive: heights that differ by less belong to one surface, and what lies between
        them is inferred.
    """

    area_mm: tuple[float, ...] = key(low=0, high=2000, count=(2, 2))
    step_mm: float = key(low=0.5, high=500)
    order: str = key(low=0, high=0, choices=SCAN_ORDERS)
    extended_length_mm: float = key(low=0, high=5000)
    retracted_length_mm: float = key(low=0, high=5000)
    extend_speed_mm_s: float = key(low=0.1, high=5000)
    retract_speed_mm_s: float = key(low=0.1, high=5000)
    tallest_mm: float = key(low=0, high=5000)
    clearance_mm: float = key(low=1, high=1000)
    contact_depth_mm: float = key(low=-100, high=100)
    slip_hpa: float = key(low=0.1, high=1000)
    seek_speed_mm_s: float = key(low=0.1, high=5000)
    coarse_mm: float = key(low=0.5, high=2000)
    flat_mm: float = key(low=0, high=1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube(Section):
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

    inner_radius_mm: float = key(low=1, high=10000)
    axis_offset_mm: float = key(low=0, high=10000)
    cube_edge_mm: float = key(low=0.1, high=10000)
    obstacle_below_tip_mm: tuple[float, ...] = key(low=-1000, high=10000, count=(1, 100))
