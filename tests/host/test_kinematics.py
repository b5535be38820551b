"""Inverse, position, forward: round trips, shapes, dtypes and bad input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from setae import kinematics, tendons
from setae.arc import Arc
from setae.config import TENDON_MODELS, Geometry
from setae.errors import InputError, SetaeError

GEOMETRY = Geometry()

lengths = st.floats(20, 70)
alphas = st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 2, math.pi, -math.pi / 2])
thetas = (
    st.floats(0, math.pi / 2)
    | st.floats(-12, -3).map(lambda exponent: 10**exponent)
    | st.sampled_from([0.0, math.pi / 2])
)


@given(lengths, thetas, alphas)
def test_position_and_inverse_are_each_others_inverse(
    length: float, theta: float, alpha: float
) -> None:
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    back = kinematics.inverse(kinematics.position(arc))
    assert float(np.abs(back.length_mm - arc.length_mm)) < 1e-9
    assert float(np.abs(back.bend_rad - arc.bend_rad).max()) < 1e-11
    assert np.abs(kinematics.position(back) - kinematics.position(arc)).max() < 1e-9


@pytest.mark.parametrize("model", TENDON_MODELS)
@given(length=lengths, theta=thetas, alpha=alphas)
@example(length=20.0, theta=1.0, alpha=4.5e-7)  # inside the boundary's tolerance
@example(length=20.0, theta=1.0, alpha=1e-6)  # at its very edge
@example(length=20.0, theta=1.0, alpha=2e-6)  # just outside
@example(length=20.0, theta=1.0, alpha=-2e-6)
def test_forward_finds_the_arc_that_made_the_lengths(
    model: str, length: float, theta: float, alpha: float
) -> None:
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    back = kinematics.forward(tendons.lengths(arc, GEOMETRY, model), GEOMETRY, model)
    error = np.abs(kinematics.position(back) - kinematics.position(arc)).max()
    # Where a tendon almost lies on the boundary of a spring that is almost straight, several arcs
    # have the same lengths to the last bit.
    on_boundary = abs(math.remainder(alpha, math.pi / 2)) < 1e-3
    ambiguous = model == "paper" and theta < 1e-2 and on_boundary
    assert error < (1e-5 if ambiguous else 1e-9)


@pytest.mark.parametrize("count", [3, 5, 6])
def test_forward_of_the_paper_rule_with_other_numbers_of_tendons(count: int) -> None:
    geometry = Geometry(tendon_angles_rad=tuple(2 * math.pi * i / count for i in range(count)))
    random = np.random.default_rng(1)
    arc = Arc.from_angles(
        length_mm=random.uniform(20, 70, 200),
        theta_rad=random.uniform(0, math.pi / 2, 200),
        alpha_rad=random.uniform(-math.pi, math.pi, 200),
    )
    q = tendons.lengths(arc, geometry, "paper")
    back = kinematics.forward(q, geometry, "paper", near=arc)
    np.testing.assert_allclose(tendons.lengths(back, geometry, "paper"), q, atol=1e-9)


offsets = st.sampled_from([0.0, 1e-300, 1e-12, 1e-9, 1e-6, 1e-3]) | st.floats(0, 70)


@given(offsets, st.floats(20, 70), st.integers(0, 15) | st.floats(0, 16))
def test_a_position_comes_back_through_arc_and_lengths(
    offset: float, z: float, sixteenth: float
) -> None:
    alpha = sixteenth * math.pi / 8  # every boundary between tendons, and between
    p = (offset * math.cos(alpha), offset * math.sin(alpha), z)
    arc = kinematics.inverse(p)
    assert np.abs(kinematics.position(arc) - p).max() < 1e-9
    if float(arc.theta_rad) <= math.pi / 2 and 20 <= float(arc.length_mm) <= 70:
        for model in ("parallel", "taut"):
            back = kinematics.forward(tendons.lengths(arc, GEOMETRY, model), GEOMETRY, model)
            assert np.abs(kinematics.position(back) - p).max() < 1e-9


def test_one_position_gives_what_an_array_of_it_gives() -> None:
    random = np.random.default_rng(2)
    positions = random.uniform([-40, -40, 20], [40, 40, 70], (200, 3))
    positions[:5, :2] = [(0, 0), (1e-12, 0), (0, -1e-5), (1e-160, 1e-160), (-30, 0)]
    many = kinematics.inverse(positions)
    for i, position in enumerate(positions):
        for same in (position, tuple(position.tolist()), position.tolist()):
            one = kinematics.inverse(same)
            assert float(one.length_mm) == pytest.approx(float(many.length_mm[i]), rel=1e-14)
            np.testing.assert_allclose(one.bend_rad, many.bend_rad[i], rtol=1e-14)
        for model in TENDON_MODELS:
            np.testing.assert_allclose(
                tendons.model(model).lengths(one, GEOMETRY),
                tendons.model(model).lengths(many[i : i + 1], GEOMETRY)[0],
                rtol=1e-13,
            )


@pytest.mark.parametrize("dtype", [np.float32, np.float16, np.int16, np.uint8, np.int64])
def test_other_types_of_numbers_are_computed_in_double_precision(dtype: type) -> None:
    rows: npt.NDArray[Any] = np.array([(12, 5, 60), (0, 0, 45)], dtype=dtype)
    for given_ in (rows, rows[0]):
        arc = kinematics.inverse(given_)
        assert arc.length_mm.dtype == arc.bend_rad.dtype == np.float64
        np.testing.assert_allclose(kinematics.position(arc), given_.astype(float), atol=1e-12)
    assert float(kinematics.inverse((12, 5, 60)).length_mm) == float(
        kinematics.inverse(rows[0]).length_mm
    )


def test_arrays_in_any_layout() -> None:
    rows = np.random.default_rng(0).uniform(20, 40, (3, 7, 5)).T  # neither contiguous nor a copy
    arc = kinematics.inverse(rows)
    assert arc.shape == (5, 7)
    np.testing.assert_allclose(kinematics.position(arc), rows, atol=1e-12)
    turned = Arc(length_mm=arc.length_mm.T, bend_rad=np.swapaxes(arc.bend_rad, 0, 1))
    for model in TENDON_MODELS:
        np.testing.assert_array_equal(
            tendons.model(model).lengths(turned, GEOMETRY),
            np.swapaxes(tendons.model(model).lengths(arc, GEOMETRY), 0, 1),
        )


def test_near_straight_the_angle_does_not_collapse() -> None:
    # The paper's arccos gives θ = 0 here; the offset of the tip still shows it.
    for x in (1e-3, 1e-7, 1e-12):
        arc = kinematics.inverse((x, 0, 60))
        assert float(arc.theta_rad) == pytest.approx(2 * x / 60, rel=1e-9)
        assert float(arc.length_mm) == pytest.approx(60, abs=1e-6)


def test_single_precision_keeps_its_digits_near_straight() -> None:
    position = np.array([0.01, 0, 60], dtype=np.float32)
    arc = kinematics.inverse(position)
    assert float(arc.theta_rad) == pytest.approx(2 * 0.01 / 60, rel=1e-6)
    assert arc.length_mm.dtype == np.float64


def test_integers_are_numbers() -> None:
    np.testing.assert_array_equal(
        kinematics.position(kinematics.inverse([0, 0, 60])), [0.0, 0.0, 60.0]
    )


@pytest.mark.parametrize("shape", [(), (1,), (7,), (2, 7), (0,)])
def test_any_leading_shape(shape: tuple[int, ...]) -> None:
    one = np.array([12.0, -5.0, 55.0])
    arc = kinematics.inverse(np.broadcast_to(one, (*shape, 3)))
    assert arc.length_mm.shape == shape
    assert arc.bend_rad.shape == (*shape, 2)
    assert kinematics.position(arc, tip_offset_mm=65.0).shape == (*shape, 3)
    assert kinematics.transform(arc).shape == (*shape, 4, 4)
    for model in TENDON_MODELS:
        q = tendons.lengths(arc, GEOMETRY, model)
        assert q.shape == (*shape, 4)
        back = kinematics.forward(q, GEOMETRY, model)
        assert back.length_mm.shape == shape
        np.testing.assert_allclose(
            kinematics.position(back), np.broadcast_to(one, (*shape, 3)), atol=1e-9
        )


def test_transform_is_a_rotation_everywhere() -> None:
    arc = Arc.from_angles(
        length_mm=50, theta_rad=np.linspace(0, math.pi, 50), alpha_rad=np.linspace(-3, 3, 50)
    )
    R = kinematics.transform(arc)[..., :3, :3]
    np.testing.assert_allclose(
        R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)


def test_frame_c_stands_in_the_centre_of_the_arc() -> None:
    random = np.random.default_rng(6)
    theta, alpha = random.uniform(1e-3, 3, 50), random.uniform(-3, 3, 50)
    arc = Arc.from_angles(length_mm=50, theta_rad=theta, alpha_rad=alpha)
    to_centre = kinematics.transform_to_centre(arc)
    radius = np.linalg.norm(to_centre[..., :3, 3], axis=-1)
    np.testing.assert_allclose(radius, 50 / theta, rtol=1e-12)
    to_top = np.linalg.norm(arc.top_mm - to_centre[..., :3, 3], axis=-1)
    np.testing.assert_allclose(to_top, radius, rtol=1e-12)


def test_a_straight_arc_has_no_frame_c() -> None:
    with pytest.raises(InputError, match=r"arc\[1\] is straight"):
        kinematics.transform_to_centre(Arc(length_mm=50, bend_rad=[(0.1, 0), (0, 0)]))


near_and_far = thetas | st.floats(0, 3)


@given(lengths, near_and_far, alphas, st.floats(0, 100))
def test_jacobian_of_the_tip_agrees_with_differences(
    length: float, theta: float, alpha: float, offset: float
) -> None:
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    jacobian = kinematics.jacobian(arc, tip_offset_mm=offset)
    for column, step in enumerate(np.eye(3) * 1e-5):
        ends = [
            Arc(length_mm=arc.length_mm + way * step[0], bend_rad=arc.bend_rad + way * step[1:])
            for way in (-1, 1)
        ]
        low, high = (kinematics.position(end, tip_offset_mm=offset) for end in ends)
        measured = (high - low) / 2e-5
        np.testing.assert_allclose(jacobian[:, column], measured, atol=1e-7)


@pytest.mark.parametrize("model", TENDON_MODELS)
@given(length=lengths, theta=st.floats(0, 1.5), alpha=st.floats(0.01, 1.56))
def test_jacobian_of_the_lengths_agrees_with_differences(
    model: str, length: float, theta: float, alpha: float
) -> None:
    geometry = Geometry(tendon_radius_mm=(8.3, 8.0, 7.5, 8.3))
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    jacobian = tendons.jacobian(arc, geometry, model)
    for column, step in enumerate(np.eye(3) * 1e-6):
        ends = [
            Arc(length_mm=arc.length_mm + way * step[0], bend_rad=arc.bend_rad + way * step[1:])
            for way in (-1, 1)
        ]
        if np.any(
            tendons.model(model).pieces(ends[0], geometry)
            != tendons.model(model).pieces(ends[1], geometry)
        ):
            continue  # across the jump there is no derivative
        low, high = (tendons.lengths(end, geometry, model) for end in ends)
        # A second derivative may step where a tendon begins to touch: half of it is left over.
        np.testing.assert_allclose(jacobian[:, column], (high - low) / 2e-6, atol=1e-4)


@pytest.mark.parametrize("model", TENDON_MODELS)
@pytest.mark.parametrize("count", [3, 4, 6])
def test_the_tip_follows_the_tendons_as_their_jacobian_says(model: str, count: int) -> None:
    geometry = Geometry(
        tendon_angles_rad=tuple(0.2 + 2 * math.pi * i / count for i in range(count))
    )
    random = np.random.default_rng(7)
    arc = Arc.from_angles(
        length_mm=random.uniform(25, 65, (5, 20)),
        theta_rad=random.uniform(0.05, 1.5, (5, 20)),
        alpha_rad=random.uniform(-3, 3, (5, 20)),
    )
    jacobian = kinematics.tendon_jacobian(arc, geometry, model, tip_offset_mm=65)
    assert jacobian.shape == (5, 20, 3, count)
    # A small change of the arc, by which the tip and all lengths move.
    other = Arc(length_mm=arc.length_mm + 1e-6, bend_rad=arc.bend_rad + np.array([2e-6, -1e-6]))
    moved = kinematics.position(other, tip_offset_mm=65) - kinematics.position(
        arc, tip_offset_mm=65
    )
    change = tendons.lengths(other, geometry, model) - tendons.lengths(arc, geometry, model)
    predicted = np.einsum("...ij,...j->...i", jacobian, change)
    np.testing.assert_allclose(predicted, moved, atol=1e-9)


def test_too_few_tendons_have_no_jacobian() -> None:
    arc = Arc(length_mm=50, bend_rad=(0.1, 0))
    with pytest.raises(InputError, match="three different angles"):
        kinematics.tendon_jacobian(arc, Geometry(tendon_angles_rad=(0, math.pi)))


def test_least_squares_spreads_the_error_of_lengths_that_belong_to_no_arc() -> None:
    q = np.array([60.0, 60.0, 60.0, 60.4])
    arc = kinematics.forward(q, GEOMETRY)
    assert float(arc.length_mm) == pytest.approx(60.1)
    np.testing.assert_allclose(
        np.abs(tendons.lengths(arc, GEOMETRY, "parallel") - q), 0.1, atol=1e-9
    )


def test_paper_fit_survives_rounding_to_ticks_when_it_knows_where_to_look() -> None:
    # Found by search: arcs 21 mm apart whose lengths agree to less than 0.1 mm.
    arc = Arc.from_angles(
        length_mm=68.8074467518179, theta_rad=1.2414373615598033, alpha_rad=math.radians(9.59219)
    )
    q = tendons.lengths(arc, GEOMETRY, "paper") + np.array([-0.007, 0.05, 0.002, 0.019])
    lost = kinematics.forward(q, GEOMETRY, "paper")
    assert np.linalg.norm(lost.top_mm - arc.top_mm) > 15
    assert np.abs(tendons.lengths(lost, GEOMETRY, "paper") - q).max() < 0.1
    found = kinematics.forward(q, GEOMETRY, "paper", near=arc)
    assert np.linalg.norm(found.top_mm - arc.top_mm) < 0.3


def test_one_hint_serves_many_lengths() -> None:
    positions = np.array([(15.0, 3.0, 60.0), (14.0, 4.0, 60.0)])
    q = tendons.lengths(kinematics.inverse(positions), GEOMETRY, "paper")
    back = kinematics.forward(q, GEOMETRY, "paper", near=kinematics.inverse(positions[0]))
    np.testing.assert_allclose(back.top_mm, positions, atol=1e-9)


BAD_POSITIONS: list[tuple[Any, str]] = [
    ((math.nan, 0, 60), r"position_mm\[0\] is nan"),
    ([(0, 0, 60), (0, math.inf, 60)], r"position_mm\[1, 1\] is inf"),
    ((0, 0), r"position_mm has shape \(2,\).*x, y, z"),
    (60.0, r"position_mm has shape \(\)"),
    ((0, 0, 0), "z = 0 mm"),
    (np.zeros(3), "z = 0 mm"),
    ((0, 0, math.nan), r"position_mm\[2\] is nan"),
    ((1e308, 1e308, 1), "too large"),
    ((True, False, True), "not an array of real numbers"),
    ([(0, 0, 60), (0, 0, -3)], r"position_mm\[1\] has z = -3 mm"),
    ("straight up", "not an array of real numbers"),
    ([(0, 0, 60), (1, 2)], "not an array of real numbers"),
    ((1j, 0, 60), "not an array of real numbers"),
    (None, "not an array of real numbers"),
]


@pytest.mark.parametrize(("position", "message"), BAD_POSITIONS)
def test_bad_positions_say_what_is_wrong(position: npt.ArrayLike, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        kinematics.inverse(position)
    assert isinstance(raised.value, SetaeError)
    assert isinstance(raised.value, ValueError)


def test_bad_arcs_say_what_is_wrong() -> None:
    with pytest.raises(InputError, match="length_mm is 0"):
        Arc(length_mm=0, bend_rad=(0, 0))
    with pytest.raises(InputError, match=r"bend_rad\[1\] is nan"):
        Arc(length_mm=60, bend_rad=(0, math.nan))
    with pytest.raises(InputError, match=r"bend_rad has shape \(3,\)"):
        Arc(length_mm=60, bend_rad=(0, 0, 0))
    with pytest.raises(InputError, match=r"length_mm has shape \(3,\) and bend_rad \(2, 2\)"):
        Arc(length_mm=[60, 60, 60], bend_rad=[(0, 0), (0, 0)])


def test_bad_lengths_say_what_is_wrong() -> None:
    with pytest.raises(InputError, match=r"lengths_mm has shape \(3,\).*4 entries"):
        kinematics.forward([60, 60, 60], GEOMETRY)
    with pytest.raises(InputError, match=r"lengths_mm\[2\] is -1"):
        kinematics.forward([60, 60, -1, 60], GEOMETRY)
    with pytest.raises(InputError, match="three different angles"):
        kinematics.forward([60, 60], Geometry(tendon_angles_rad=(0, math.pi)))
    with pytest.raises(InputError, match="There are: paper, parallel, taut"):
        kinematics.forward([60, 60, 60, 60], GEOMETRY, "tight")
    with pytest.raises(InputError, match=r"near has shape \(2,\)"):
        kinematics.forward(
            [60, 60, 60, 60], GEOMETRY, "paper", near=Arc(length_mm=[60, 60], bend_rad=(0, 0))
        )


def test_an_arc_cannot_be_changed_behind_its_back() -> None:
    bend = np.zeros(2)
    arc = Arc(length_mm=60, bend_rad=bend)
    bend[0] = 1
    assert float(arc.theta_rad) == 0
    with pytest.raises(ValueError, match="read-only"):
        arc.bend_rad[0] = 1


def test_an_arc_can_be_indexed_like_its_poses() -> None:
    arc = Arc(length_mm=[[40, 50], [60, 70]], bend_rad=(0.1, 0.2))
    assert arc[1].length_mm.tolist() == [60, 70]
    assert float(arc[1, 0].length_mm) == 60
    assert arc[..., 0].bend_rad.shape == (2, 2)
