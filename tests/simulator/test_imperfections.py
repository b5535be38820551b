"""Each imperfection does what its name says, and no more than it may."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest
from tests.simulator import shooting

if TYPE_CHECKING:
    from tests.simulator.conftest import Driver, MakeDriver

Array = npt.NDArray[np.float64]
FREE_MM = 70.0
BENT_MM = (48.0, 58.0, 68.0, 58.0)
STILL = {"plant.gravity_m_s2": 0.0}
EXACT = {**STILL, "servo.dead_band_us": 0.0}
# Nothing holds the rod but its base: ten mm of slack in each tendon.
LOOSE = {**STILL, **{f"tendon.offset_mm_{i}": 10.0 for i in range(4)}}


def tip(driver: Driver, lengths_mm: npt.ArrayLike = BENT_MM) -> Array:
    return np.array(driver.pull(lengths_mm).backbone_mm[-1])


# ------------------------------------------------------------------ servos and winding


def test_gain_and_offset_belong_to_one_tendon(make_driver: MakeDriver) -> None:
    driver = make_driver({**EXACT, "tendon.winding_error_0": -0.1, "tendon.offset_mm_2": 1.5})
    lengths_mm = driver.pull([50.0, 60.0, 60.0, 60.0]).servo_length_mm
    # Pulses are rounded to half a microsecond: 0.03 mm.
    assert lengths_mm == pytest.approx([52.0, 60.0, 61.5, 60.0], abs=0.03)


def test_winding_slips_by_chance_within_its_bound_and_comes_back(make_driver: MakeDriver) -> None:
    driver = make_driver({**EXACT, "tendon.winding_slip": 0.05})
    seen = []
    for _ in range(5):
        slipped_mm = driver.pull(50.0).servo_length_mm - 50.0
        assert (slipped_mm > -0.03).all()
        assert (slipped_mm < 0.05 * 20.0 + 0.03).all()
        seen.append(slipped_mm)
        assert driver.pull(FREE_MM).servo_length_mm == pytest.approx(np.full(4, FREE_MM), abs=0.05)
    # Another part of it with each winding and each tendon, the same with the same seed.
    assert np.std(seen) > 0.1
    again = make_driver({**EXACT, "tendon.winding_slip": 0.05})
    assert again.pull(50.0).servo_length_mm - 50.0 == pytest.approx(seen[0], abs=1e-12)
    other = make_driver({**EXACT, "tendon.winding_slip": 0.05}, seed=2)
    assert np.abs(other.pull(50.0).servo_length_mm - 50.0 - seen[0]).max() > 0.05


def test_tendon_and_servo_yield_in_series(make_driver: MakeDriver) -> None:
    stretch_mm = {}
    for servo in (5.0, 1e6):
        truth = make_driver({**EXACT, "servo.stiffness_n_per_mm": servo}).pull(40.0)
        yielded = truth.backbone_mm[-1, 2] - truth.servo_length_mm[0]
        stretch_mm[servo] = yielded
        assert yielded == pytest.approx(truth.tension_n[0] * (1 / 10.0 + 1 / servo), rel=0.02)
    assert stretch_mm[5.0] > 2 * stretch_mm[1e6]


# ------------------------------------------------------------------------------ friction


def _loop(driver: Driver) -> tuple[Array, Array]:
    """Tip and tension of tendon 0, wound and unwound to the same length in turn."""
    tips, tensions = [], []
    for length_mm in (55.0, 40.0, 55.0, 70.0, 55.0, 40.0, 55.0):
        truth = driver.pull([length_mm, 60.0, 70.0, 60.0])
        tips.append(truth.backbone_mm[-1])
        tensions.append(truth.tension_n[0])
    return np.array(tips), np.array(tensions)


def test_friction_makes_a_loop_that_closes(make_driver: MakeDriver) -> None:
    tips, tensions = _loop(make_driver({**EXACT, "tendon.friction": 0.2}))
    wound, unwound, wound_again, unwound_again = 0, 2, 4, 6
    assert tensions[wound_again] == pytest.approx(tensions[wound], rel=0.01)
    assert tensions[unwound_again] == pytest.approx(tensions[unwound], rel=0.01)
    assert tips[unwound_again] == pytest.approx(tips[unwound], abs=0.02)
    # Winding pulls against friction, unwinding lets it help to hold.
    assert tensions[wound] > 1.05 * tensions[unwound]
    assert np.linalg.norm(tips[wound] - tips[unwound]) > 0.1


def test_without_friction_the_way_does_not_matter(make_driver: MakeDriver) -> None:
    tips, tensions = _loop(make_driver(EXACT))
    assert tips[2] == pytest.approx(tips[0], abs=0.02)
    assert tensions[2] == pytest.approx(tensions[0], rel=0.01)


def test_what_friction_takes_grows_as_the_capstan_s(make_driver: MakeDriver) -> None:
    """The tension at the base, wound over unwound, is about exp(mu times twice an angle)."""
    ratio = {}
    for friction in (0.1, 0.2):
        _, tensions = _loop(make_driver({**EXACT, "tendon.friction": friction}))
        ratio[friction] = float(np.log(tensions[0] / tensions[2]))
    assert ratio[0.2] == pytest.approx(2 * ratio[0.1], rel=0.15)
    assert 0 < ratio[0.2] < 2 * 0.2 * np.pi / 2


def test_a_tendon_sticks_before_it_slides(make_driver: MakeDriver) -> None:
    """To and fro by a mm: a loop where it slides at once, none where it only creeps."""
    gap_n = {}
    for presliding_mm in (0.05, 5.0):
        driver = make_driver(
            {**EXACT, "tendon.friction": 0.2, "tendon.presliding_mm": presliding_mm}
        )
        tension_n = [
            driver.pull([length_mm, 60.0, 70.0, 60.0]).tension_n[0]
            for length_mm in (46.0, 47.0, 46.5, 46.0, 46.5)
        ]
        gap_n[presliding_mm] = float(tension_n[2] - tension_n[4])  # wound, unwound
    assert gap_n[0.05] > 5 * abs(gap_n[5.0])


# ---------------------------------------------------------------- holes, bore, stiffness


def test_tendons_at_other_angles_bend_it_there(make_driver: MakeDriver) -> None:
    turned = {f"tendon.angle_deg_{i}": 90.0 * i + 30.0 for i in range(4)}
    x, y, _ = tip(make_driver({**EXACT, **turned}))
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(30.0, abs=0.1)


def test_holes_further_out_bend_less_for_the_same_pull(make_driver: MakeDriver) -> None:
    out = {f"tendon.{plate}_radial_mm_{i}": 0.6 for plate in ("base", "top") for i in (0, 2)}
    mild = (52.0, 56.0, 60.0, 56.0)
    inner, plain, outer = (
        tip(make_driver({**EXACT, **dict.fromkeys(out, sign * 0.6)}), mild)[0]
        for sign in (-1, 0, 1)
    )
    assert inner > plain + 0.3 > outer + 0.6


def test_holes_that_are_turned_against_each_other_twist_the_spring(make_driver: MakeDriver) -> None:
    for sign in (1.0, -1.0):
        turned = {f"tendon.top_tangential_mm_{i}": 0.8 * sign for i in range(4)}
        rotation = make_driver({**EXACT, **turned}).pull(50.0).rotation
        assert -sign * rotation[1, 0] > 0.01  # the tendons pull the top back


def test_a_thick_tendon_has_less_bore(make_driver: MakeDriver) -> None:
    with pytest.raises(Exception, match="diameter"):
        make_driver({"tendon.diameter_mm": 2.0})
    bent = (40.0, 60.0, 75.0, 60.0)
    thin, thick = (
        make_driver({**EXACT, "tendon.diameter_mm": diameter}).pull(bent).backbone_mm[-1]
        for diameter in (0.0, 1.2)
    )
    assert np.linalg.norm(thick - thin) > 0.05


def test_it_bends_most_where_it_is_soft(make_driver: MakeDriver) -> None:
    """A gradient of stiffness makes the base bend more than the top, or less."""
    ratio = {}
    for gradient in (-0.4, 0.0, 0.4):
        driver = make_driver({**EXACT, "spring.stiffness_gradient": gradient})
        points = driver.pull(BENT_MM).backbone_mm
        steps = np.diff(points, axis=0)
        turned = np.unwrap(np.arctan2(steps[:, 0], steps[:, 2]))
        ratio[gradient] = (turned[9] - turned[0]) / (turned[-1] - turned[10])
    assert ratio[0.4] > 1.1 * ratio[0.0] > 1.2 * ratio[-0.4]


def test_a_soft_direction_draws_the_bend_aside(make_driver: MakeDriver) -> None:
    """A force along x bends an uneven spring along x only if its axes are the force's."""
    uneven = {"spring.bending_scale_x": 0.5, "spring.bending_scale_y": 1.0, "plant.load_x_n": 0.01}
    aside = {
        axis: make_driver({**LOOSE, **uneven, "spring.bending_axis_deg": axis}).pull(FREE_MM)
        for axis in (0.0, 90.0, 45.0)
    }
    along = {axis: truth.backbone_mm[-1, 0] for axis, truth in aside.items()}
    assert along[90.0] > 1.5 * along[0.0]
    for axis in (0.0, 90.0):
        assert abs(aside[axis].backbone_mm[-1, 1]) < 1e-3
    assert abs(aside[45.0].backbone_mm[-1, 1]) > 0.1 * along[45.0]


# ------------------------------------------------------------------------- loads, weight


@pytest.mark.parametrize("offset_mm", [0.0, 65.0])
def test_a_small_load_bends_it_as_a_cantilever(make_driver: MakeDriver, offset_mm: float) -> None:
    load_n = 0.004
    driver = make_driver({**LOOSE, "plant.load_y_n": load_n, "plant.load_offset_mm": offset_mm})
    expected_mm = load_n * (
        FREE_MM**3 / (3 * shooting.BENDING)
        + FREE_MM / shooting.SHEAR_N
        + offset_mm * FREE_MM**2 / (2 * shooting.BENDING)
    )
    assert driver.pull(FREE_MM).backbone_mm[-1] == pytest.approx(
        [0, expected_mm, FREE_MM], abs=0.02 * expected_mm
    )


def test_weight_pulls_where_gravity_points(make_driver: MakeDriver) -> None:
    loose = {name: value for name, value in LOOSE.items() if "gravity" not in name}
    pull = {"plant.gravity_m_s2": 0.2, "plant.gravity_tilt_deg": 90.0}
    # Half of the spring's mass acts at 3/8 of the deflection of the tip's.
    load_n = 0.2e-3 * (15.0 + 25.0 * 3 / 8)
    for azimuth in (0.0, 120.0):
        driver = make_driver({**loose, **pull, "plant.gravity_azimuth_deg": azimuth})
        top = driver.pull(FREE_MM).backbone_mm[-1]
        assert np.degrees(np.arctan2(top[1], top[0])) == pytest.approx(azimuth, abs=0.5)
        expected_mm = load_n * FREE_MM**3 / (3 * shooting.BENDING)
        assert np.hypot(top[0], top[1]) == pytest.approx(expected_mm, rel=0.1)
    up = make_driver({**loose, "plant.gravity_tilt_deg": 180.0}).pull(FREE_MM).backbone_mm[-1]
    down = make_driver(loose).pull(FREE_MM).backbone_mm[-1]
    assert down[2] - FREE_MM == pytest.approx(FREE_MM - up[2], rel=0.05)
    assert down[2] > FREE_MM + 0.5


# --------------------------------------------------------------------- the whole of them


def test_energy_and_mirror(make_driver: MakeDriver) -> None:
    """Without friction a closed way of the tendons does no work; mirrored pulls mirror."""
    driver = make_driver({**EXACT, "spring.damping_time_s": 0.0})
    corners = ((60.0,) * 4, (50.0, 60.0, 66.0, 60.0), (50.0, 52.0, 66.0, 66.0), (60.0,) * 4)
    work = exchanged = 0.0
    before = driver.pull(corners[0])
    for end in corners[1:]:
        start = before.servo_length_mm
        for u in np.linspace(0, 1, 13)[1:]:
            now = driver.pull(start + u * (np.array(end) - start), 0.1, 0.1)
            wound_mm = before.servo_length_mm - now.servo_length_mm
            done = float(0.5 * (before.tension_n + now.tension_n) @ wound_mm)
            work, exchanged, before = work + done, exchanged + abs(done), now
    assert abs(work) < 0.01 * exchanged
    left = driver.pull((54.0, 48.0, 58.0, 64.0)).backbone_mm[-1]
    driver.pull(60.0)
    right = driver.pull((54.0, 64.0, 58.0, 48.0)).backbone_mm[-1]
    assert right == pytest.approx(left * [1, -1, 1], abs=0.01)


def test_a_finer_rod_is_the_same_robot(make_driver: MakeDriver) -> None:
    """Twice the stations and one more mode of each strain, with all that is modelled."""
    rough = {
        **EXACT, "tendon.friction": 0.15, "spring.bending_scale_x": 0.7,
        "spring.stiffness_gradient": 0.2, "plant.load_y_n": 0.03, "tendon.top_radial_mm_1": 0.4,
    }  # fmt: skip
    fine = {**rough, "plant.rod_elements": 20.0, "plant.rod_extra_modes": 1.0}
    coarse_driver, fine_driver = make_driver(rough), make_driver(fine)
    for lengths_mm in ((45.0,) * 4, BENT_MM, (52.0, 50.0, 66.0, 66.0)):
        coarse, finer = tip(coarse_driver, lengths_mm), tip(fine_driver, lengths_mm)
        assert np.linalg.norm(coarse - finer) < 0.1


def test_exactly_between_two_ways_it_takes_one(make_driver: MakeDriver) -> None:
    """A load that pushes the loose spring down: straight is a rest, but not one that lasts."""
    driver = make_driver({**LOOSE, "plant.load_z_n": -2.0, "spring.solid_length_mm": 1.0})
    driver.wait(3.0)
    truth = driver.world.truth()
    assert np.hypot(*truth.backbone_mm[-1, :2]) > 5
    assert truth.plant_residual < 1e-4
