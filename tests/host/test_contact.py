"""From a trip's record to a place."""

from __future__ import annotations

import numpy as np
import pytest

from setae import kinematics, tendons
from setae.config import load
from setae.contact import MODEL_ERROR_MM, Contact, estimate
from setae.servo import ServoModel
from setae_protocol.messages import PRESSURE_LSB_PER_HPA, Trip, TripCause

CONFIG = load()


def record(positions_mm: list[tuple[float, float, float]], *, change_hpa: float = 16.0) -> Trip:
    """A record whose last four frames were commanded to these positions."""
    lengths = tendons.lengths(kinematics.inverse(positions_mm), CONFIG.geometry, model="parallel")
    history = tuple(tuple(int(tick) for tick in row) for row in ServoModel(CONFIG).ticks(lengths))
    return Trip(
        record_id=1,
        session=7,
        cause=TripCause.CONTACT,
        sample_frame=100,
        sample_phase_us=10_000,
        pressure_raw=round((1013.0 + change_hpa) * PRESSURE_LSB_PER_HPA),
        baseline_raw=1013 * PRESSURE_LSB_PER_HPA,
        pulse_ticks=history,  # type: ignore[arg-type]  # four by four, by construction
    )


def found(*args: object, **kwargs: float) -> Contact:
    return estimate(record(*args, **kwargs), CONFIG, time_us=5)  # type: ignore[arg-type]


def test_at_rest_the_place_is_the_commanded_one_and_the_model_the_only_doubt() -> None:
    contact = found([(10.0, 5.0, 55.0)] * 4)
    assert contact.position_mm == pytest.approx((10.0, 5.0, 55.0), abs=0.05)
    assert contact.uncertainty_mm == pytest.approx(MODEL_ERROR_MM)
    assert contact.time_us == 5


def test_in_motion_the_place_lies_behind_the_frozen_one_and_its_doubt_grows() -> None:
    path = [(0.0, 0.0, height) for height in (50.0, 52.0, 54.0, 56.0)]
    contact = found(path)
    assert 50.0 <= contact.position_mm[2] < 54.0
    assert contact.uncertainty_mm > np.hypot(MODEL_ERROR_MM, 1.0)


def test_the_change_keeps_its_sign() -> None:
    assert found([(0.0, 0.0, 50.0)] * 4, change_hpa=-20.0).pressure_change_hpa == pytest.approx(
        -20.0
    )


def test_the_tip_lies_its_offset_beyond_the_springs_top() -> None:
    contact = found([(0.0, 0.0, 50.0)] * 4)
    assert contact.tip_mm == pytest.approx((0.0, 0.0, 115.0), abs=0.05)
