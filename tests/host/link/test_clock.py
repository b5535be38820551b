"""Board time and host time over a line that delays the uplink by up to 4 ms."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from setae.link.clock import Clock


def fill(clock: Clock, *, rate: float, offset_us: float, seconds: float, seed: int) -> float:
    """Feed telemetry and pings as a USB chip delivers them; return the last board time."""
    rng = random.Random(seed)
    board_us = 0
    for frame in range(int(seconds * 50)):
        board_us = 20_000 * frame + 300
        host_us = offset_us + board_us * rate
        clock.add(board_us=board_us, received_us=round(host_us + rng.uniform(0, 4_000)))
        if frame % 50 == 0:
            clock.add_sent(sent_us=round(host_us - rng.uniform(0, 300)), board_us=board_us)
    return board_us


@settings(max_examples=50)
@given(
    rate=st.floats(0.995, 1.005),
    offset_us=st.integers(-(10**9), 10**9),
    seed=st.integers(0, 10**6),
)
def test_resonator_half_a_percent_off(rate: float, offset_us: int, seed: int) -> None:
    clock = Clock()
    end_us = fill(clock, rate=rate, offset_us=offset_us, seconds=20, seed=seed)
    estimate = clock.estimate()
    assert estimate.rate == pytest.approx(rate, abs=100e-6)
    for board_us in (end_us - 5_000_000, end_us, end_us + 1_000_000):
        true_us = offset_us + board_us * rate
        assert abs(estimate.to_host_us(board_us) - true_us) < 500
        assert abs(estimate.to_host_us(board_us) - true_us) <= estimate.uncertainty_at_us(board_us)
        assert estimate.to_board_us(estimate.to_host_us(board_us)) == pytest.approx(board_us)
    assert estimate.uncertainty_us < 1_500


def test_one_late_second_does_not_move_the_clock() -> None:
    """A host that was busy for a second reads everything late; the envelope ignores it."""
    clock = Clock()
    for frame in range(1_000):
        late_us = 900_000 - 20_000 * (frame - 500) if 500 <= frame < 545 else 0
        clock.add(board_us=20_000 * frame, received_us=20_000 * frame + 7_000 + late_us)
    assert clock.estimate().to_host_us(10_000_000) == pytest.approx(10_007_000, abs=1)


def test_exact_line_is_met_exactly() -> None:
    clock = Clock()
    for frame in range(500):
        clock.add(board_us=20_000 * frame, received_us=20_000 * frame + 123)
        clock.add_sent(sent_us=20_000 * frame + 123, board_us=20_000 * frame)
    estimate = clock.estimate()
    assert estimate.rate == 1.0
    assert estimate.uncertainty_us <= 25, "what the resonator makes of a frame's bytes"
    assert estimate.to_host_us(0) == 123


@pytest.mark.parametrize("rate", [0.995, 1.005])
def test_the_first_seconds_claim_no_more_than_is_known(rate: float) -> None:
    """The bound was the gap at one ping, as if the resonator were exact.

    Two seconds into a session the clock was 10 ms off, and said 1 ms.
    """
    clock = Clock()
    clock.add_sent(sent_us=-1_000, board_us=0)
    for frame in range(95):
        board_us = 20_000 * frame
        clock.add(board_us=board_us, received_us=round(board_us * rate) + frame % 4_000)
        estimate = clock.estimate()
        error_us = estimate.to_host_us(board_us) - board_us * rate
        assert abs(error_us) <= estimate.uncertainty_at_us(board_us)


def test_nothing_known_is_an_error() -> None:
    assert not Clock().known
    with pytest.raises(ValueError, match="no frame"):
        Clock().estimate()
