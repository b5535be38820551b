"""The bristle's filament: bends at the side, is pushed into its gel, buckles, slides and slips off.

The robot hangs still; the arm carries it. Without a board: pressure and tip are the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from setae.sim import World, parameter_names

Array = npt.NDArray[np.float64]
Setup = Callable[[World], object]

TIP_MM = -(70.0 + 65.0)  # of the free robot under the arm
LENGTH_MM, DIAMETER_MM, MODULUS = 53.0, 1.0, 2500.0
BENDING = MODULUS * np.pi / 64 * DIAMETER_MM**4
GEL, GEL_ROTATION = 0.08, 8.0
HPA_PER_N, HPA_PER_N_MM = 150.0, 100.0
STILL = {
    "sensor.noise_hpa": 0.0,
    "sensor.drift_hpa_per_sqrt_s": 0.0,
    "plant.gravity_m_s2": 0.0,
    "bristle.relaxation_fraction": 0.0,
    "bristle.pressure_saturation_hpa": 240.0,
    "bristle.motion_axial_hpa_s2_per_mm": 0.0,
    "bristle.motion_lateral_hpa_s2_per_mm": 0.0,
}
THRESHOLD_HPA = 15.0
BALL_MM = 35.0


@dataclass(frozen=True, slots=True)
class Touch:
    """Pressure against rest, and where arm and tip were, at each sample."""

    hpa: Array
    arm_mm: Array
    tip_mm: Array


def touch(
    setup: Setup,
    *to_mm: tuple[float, float, float],
    parameters: Mapping[str, float] | None = None,
    speed_mm_s: float = 20.0,
) -> Touch:
    """Carry the bristle from one place to the next."""
    hpa, arm_mm, tip_mm = [], [], []
    with World(seed=1, parameters={**STILL, **(parameters or {})}) as world:
        setup(world)
        world.start()
        world.remove_board()
        rest_hpa = world.sense()
        for place in to_mm:
            world.arm_move(place, speed_mm_s, 400.0)
            left = 20
            while left:
                left = 20 if world.arm_moving else left - 1
                world.run(world.now_us + 13_333)
                hpa.append(world.sense() - rest_hpa)
                truth = world.truth()
                arm_mm.append(truth.arm_mm)
                tip_mm.append(truth.bent_tip_mm)
    return Touch(np.array(hpa), np.array(arm_mm), np.array(tip_mm))


def floor(world: World) -> None:
    world.add_box((0, 0, TIP_MM - 10 - 20), (80, 80, 20))


def peg(world: World) -> None:
    """Beside the tip, 2 mm away, and up to 1 mm above it."""
    world.add_box((42, 0, TIP_MM - 19), (80, 80, 40))


def ball(off_mm: float) -> Setup:
    def setup(world: World) -> None:
        world.add_ellipsoid((off_mm, 0, TIP_MM - 2 - BALL_MM), (BALL_MM,) * 3)

    return setup


def pressed(depth_mm: float, **parameters: float) -> Touch:
    named = {f"bristle.{name}": value for name, value in parameters.items()}
    return touch(floor, (0, 0, -20 - depth_mm), parameters=named)


def pushed_aside(by_mm: float, **parameters: float) -> Touch:
    named = {f"bristle.{name}": value for name, value in parameters.items()}
    return touch(peg, (2 + by_mm, 0, 0), parameters=named)


def test_a_light_push_goes_into_the_gel() -> None:
    for stiffness in (0.05, GEL, 0.12):
        found = pressed(1.0, gel_stiffness_n_per_mm=stiffness, pressure_hpa_per_n_mm=0).hpa[-1]
        assert unsaturated(found) == pytest.approx(stiffness * HPA_PER_N, rel=0.05)
    double = pressed(1.0, pressure_hpa_per_n=300, pressure_hpa_per_n_mm=0).hpa[-1]
    once = pressed(1.0, pressure_hpa_per_n_mm=0).hpa[-1]
    assert unsaturated(double) == pytest.approx(2 * unsaturated(once), rel=1e-3)


@pytest.mark.parametrize("diameter_mm", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("gel_rotation", [2.0, 50.0])
def test_a_push_at_the_tip_s_side_bends_it_as_a_beam_does(
    diameter_mm: float, gel_rotation: float
) -> None:
    bending = BENDING * (diameter_mm / DIAMETER_MM) ** 4
    found = pushed_aside(
        3.0, filament_diameter_mm=diameter_mm, gel_rotation_n_mm_per_rad=gel_rotation,
        filament_bow_mm=0, friction=0,
    ).hpa[-1]  # fmt: skip
    deflection_mm = 3.0 + diameter_mm / 2
    force = deflection_mm / (LENGTH_MM**3 / (3 * bending) + LENGTH_MM**2 / gel_rotation)
    assert unsaturated(found) == pytest.approx(HPA_PER_N_MM * force * LENGTH_MM, rel=0.12)
    stiffer = pushed_aside(3.0, filament_modulus_n_per_mm2=2 * MODULUS).hpa[-1]
    assert stiffer > 1.2 * pushed_aside(3.0).hpa[-1]


def test_a_push_at_the_side_bends_and_does_not_compress() -> None:
    assert abs(pushed_aside(3.0, pressure_hpa_per_n_mm=0).hpa[-1]) < 0.5
    assert pushed_aside(3.0).hpa[-1] > 10.0


def test_pressure_saturates() -> None:
    soft = pressed(5.0, pressure_saturation_hpa=40).hpa
    assert soft[-1] == pytest.approx(40 * (1 - np.exp(-unsaturated(pressed(5.0).hpa[-1]) / 40)))


def unsaturated(hpa: float, most_hpa: float = 240.0) -> float:
    return float(-most_hpa * np.log(1 - hpa / most_hpa))


@pytest.mark.parametrize("diameter_mm", [0.6, 0.8])
def test_it_buckles_where_euler_says(diameter_mm: float) -> None:
    """A column, pinned at the tip by friction, its root turned against the gel."""
    bending = BENDING * (diameter_mm / DIAMETER_MM) ** 4
    root = GEL_ROTATION * LENGTH_MM / bending

    def hinge(x: Array) -> Array:
        return np.asarray(np.sin(x) * (root + x * x) - root * x * np.cos(x))

    # Between hinges at both ends and a clamped root.
    x = np.linspace(np.pi, 4.4934, 10_001)
    euler_n = x[np.argmin(np.abs(hinge(x)))] ** 2 * bending / LENGTH_MM**2
    found = pressed(
        8.0, filament_diameter_mm=diameter_mm, friction=2, filament_bow_mm=0.2,
        pressure_hpa_per_n_mm=0,
    )  # fmt: skip
    assert unsaturated(found.hpa[-1]) / HPA_PER_N == pytest.approx(euler_n, rel=0.15)


def test_it_buckles_to_the_side_of_its_bow() -> None:
    """Seen at a tip that nothing holds."""
    for angle_deg, way in ((0.0, (1, 0)), (90.0, (0, -1)), (180.0, (-1, 0))):
        found = pressed(3.0, friction=0, filament_bow_mm=2, filament_bow_angle_deg=angle_deg)
        off_mm = found.tip_mm[-1, :2] - found.arm_mm[-1, :2]
        assert abs(np.dot(off_mm, way)) > 0.9 * np.linalg.norm(off_mm)
        assert np.linalg.norm(off_mm) > 5.0


def test_friction_holds_the_tip_on_a_slope_that_is_not_too_steep() -> None:
    """Half the ball's radius off its middle: 30 degrees, a friction of 0.58."""
    moved_mm = {}
    for friction in (0.2, 0.9):
        found = touch(ball(BALL_MM / 2), (0, 0, -8.5), parameters={"bristle.friction": friction})
        moved_mm[friction] = abs(found.tip_mm[-1, 0])
    assert moved_mm[0.9] < 0.5
    assert moved_mm[0.2] > 2 * moved_mm[0.9]


def test_dragged_over_an_edge_it_slips_off_and_springs_back() -> None:
    def table(world: World) -> None:
        world.add_box((-30, 0, TIP_MM - 12), (80, 80, 20))  # its edge is at x = 10

    found = touch(table, (0, 0, -4), (30, 0, -4))
    lag_mm = found.arm_mm[:, 0] - found.tip_mm[:, 0]
    on_top = found.tip_mm[:, 0] < 9.5
    # It drags behind as far as friction holds it, ...
    assert 3 < lag_mm[on_top].max() < 25
    assert abs(found.hpa[on_top]).max() > THRESHOLD_HPA
    # ... slips, and hangs straight and below the top beyond the edge.
    assert found.tip_mm[-1] == pytest.approx([30, 0, TIP_MM - 4], abs=0.1)
    assert abs(found.hpa[-1]) < 0.5


def test_dragged_back_it_lags_less_than_on_the_way_there() -> None:
    # Friction that for ever pulled to where a sliding tip touched first passed all tests.
    found = touch(
        floor, (-15, 0, 0), (-15, 0, -21), (15, 0, -21), (0, 0, -21),
        parameters={"bristle.friction": 0.1},
    )  # fmt: skip
    lag_mm = found.arm_mm[:, 0] - found.tip_mm[:, 0]
    turn = int(found.arm_mm[:, 0].argmax())
    assert lag_mm[turn - 20 : turn].min() > 6
    assert lag_mm[-20:].max() < 5


def felt_at_mm(off_mm: float, friction: float = 0.4) -> float:
    """Height error of a touch from above, that far from the ball's middle; NaN: not felt."""
    found = touch(
        ball(off_mm), (0, 0, -45), parameters={"bristle.friction": friction}, speed_mm_s=25
    )
    felt = np.flatnonzero(np.abs(found.hpa) > THRESHOLD_HPA)
    if not len(felt):
        return float("nan")
    true_mm = TIP_MM - 2 - BALL_MM + np.sqrt(BALL_MM**2 - off_mm**2)
    return float(TIP_MM + found.arm_mm[felt[0], 2] - true_mm)


def test_edges_come_out_ragged_and_the_middle_does_not() -> None:
    """The paper: edges fluctuate "due to the slippery of the bristle filament"."""
    middle = np.array([felt_at_mm(off) for off in (0.0, 4.0, 8.0)])
    edge = np.array([felt_at_mm(off) for off in (20.0, 24.0, 28.0, 31.0, 33.0)])
    assert np.all(np.abs(middle) < 2.0)
    assert np.nanmin(edge) < -3.0  # felt late, so too low
    spread_mm = np.nanmax(edge) - np.nanmin(edge)
    assert spread_mm > 1.5 or np.isnan(edge).any()
    held = np.array([felt_at_mm(off, friction=2.0) for off in (20.0, 24.0, 28.0)])
    assert np.all(np.abs(held) < np.abs(edge[:3]))  # it is the slip that does it


def test_a_round_end_slips_off_beside_a_sharp_edge() -> None:
    def beside(gap_mm: float) -> Setup:
        def setup(world: World) -> None:
            world.add_box((40 + gap_mm, 0, TIP_MM - 12), (80, 80, 20))

        return setup

    # Just on the top: felt. Just off it: pushed aside by its own radius, hardly felt.
    assert touch(beside(-0.5), (0, 0, -5)).hpa.max() > THRESHOLD_HPA
    assert touch(beside(0.3), (0, 0, -10)).hpa.max() < THRESHOLD_HPA
    assert -1.0 < touch(beside(0.3), (0, 0, -10)).tip_mm[-1, 0] < -0.05


def test_a_swinging_filament_settles_at_its_own_rate() -> None:
    slow = touch(
        peg, (8, 0, 0), (-10, 0, 0), parameters={"bristle.natural_frequency_hz": 1},
        speed_mm_s=200,
    )  # fmt: skip
    fast = touch(peg, (8, 0, 0), (-10, 0, 0), speed_mm_s=200)
    free = fast.arm_mm[:, 0] < 0
    assert slow.hpa[free].max() > 3 * max(fast.hpa[free].max(), 0.1)


def test_every_number_of_the_bristle_is_looked_at_here_or_beside() -> None:
    """A parameter without effect would be a name without meaning."""
    named = {name for name in parameter_names() if name.startswith("bristle.")}
    base = _mark({})
    for name in sorted(named):
        with World() as world:
            value = world.get(name)
        changed = {name: value * 1.3 + (0.2 if value == 0 else 0)}
        if name == "bristle.filament_length_mm":
            changed = {name: value * 0.9}
        assert not np.array_equal(_mark(changed), base), name


def _mark(parameters: Mapping[str, float]) -> Array:
    """A slanting touch with everything in it."""
    on = {"bristle.relaxation_fraction": 0.15, "bristle.motion_axial_hpa_s2_per_mm": 0.007,
          "bristle.motion_lateral_hpa_s2_per_mm": 0.004}  # fmt: skip
    return touch(ball(15.0), (2, 1, -12), parameters={**on, **parameters}).hpa
