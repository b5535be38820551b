"""How few segments a motion takes, and that what the board plays stays within the tolerance."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from setae import config, packing, trajectory
from setae.arc import FloatArray
from setae.errors import InputError, TrajectoryError
from setae.servo import ServoModel
from setae.trajectory import Limits

CONFIG = config.load()
SERVOS = ServoModel(CONFIG)
HALF_TICK_MM = 0.5 * 0.0275


def packed(
    ticks: FloatArray, start: list[int], tolerance: float, **options: int
) -> tuple[packing.IntArray, packing.IntArray]:
    return packing.pack(
        np.asarray(ticks, dtype=float),
        start_ticks=np.array(start),
        tolerance_ticks=np.full(len(start), tolerance),
        **{"slew_ticks": 116, **options},
    )


def move(lengths_mm: list[float], duration_s: float) -> trajectory.FrameTrajectory:
    limits = Limits(speed_mm_s=SERVOS.max_speed_mm_s)
    return trajectory.line([70.0] * 4, lengths_mm, duration_s=duration_s, limits=limits)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(30, 70), min_size=4, max_size=4),
    st.floats(0.8, 2.0),
    st.sampled_from([0.0, 5.0, 10.0, 50.0]),
)
def test_what_is_played_stays_within_tolerance_and_half_a_tick(
    lengths: list[float], duration_s: float, tolerance_um: float
) -> None:
    motion = move(lengths, duration_s)
    start = SERVOS.ticks(motion.start_mm)
    segments = SERVOS.segments(motion.lengths_mm, start_ticks=start, tolerance_um=tolerance_um)
    ends = np.cumsum([segment.duration_frames for segment in segments])
    assert ends[-1] == motion.frames
    played = packing.played(start, ends, [segment.target_ticks for segment in segments])
    error_mm = np.abs(SERVOS.lengths_mm(played) - motion.lengths_mm)
    assert error_mm.max() <= HALF_TICK_MM + tolerance_um * 1e-3
    np.testing.assert_array_equal(played[-1], SERVOS.ticks(lengths))
    assert np.abs(np.diff(played, axis=0, prepend=start[None])).max() <= SERVOS.slew_ticks


def test_a_second_of_quintic_takes_a_third_of_its_frames_at_10_um() -> None:
    motion = move([60.0, 65, 70, 70], 1.0)
    start = SERVOS.ticks(motion.start_mm)
    count = {
        tolerance: len(
            SERVOS.segments(motion.lengths_mm, start_ticks=start, tolerance_um=tolerance)
        )
        for tolerance in (0, 10, 100)
    }
    assert motion.frames == 50
    assert count[0] > count[10] > count[100]
    assert count[10] <= 18
    # What the configuration says is the default.
    default = SERVOS.segments(motion.lengths_mm, start_ticks=start)
    assert len(default) == count[round(CONFIG.motion.tolerance_um)]


def fewest(ticks: FloatArray, start: int, tolerance: float) -> int:
    """All ways to choose ends, on all ticks allowed, for one servo: the fewest segments."""
    count = len(ticks)
    slack = 0.5 + tolerance + 1e-9

    def allowed(frame: int) -> range:
        if frame == count:
            last = int(np.rint(ticks[-1]))
            return range(last, last + 1)
        low, high = np.ceil(ticks[frame - 1] - slack), np.floor(ticks[frame - 1] + slack)
        return range(int(low), int(high) + 1)

    best: dict[tuple[int, int], int] = {(0, start): 0}
    for begin in range(count):
        for (frame, tick), cost in list(best.items()):
            if frame != begin:
                continue
            for end in range(begin + 1, count + 1):
                for target in allowed(end):
                    line = packing.played([tick], [end - begin], [[target]])[:, 0]
                    error = np.abs(line - ticks[begin:end])
                    if (error[:-1] <= slack).all():
                        key = (end, target)
                        best[key] = min(best.get(key, 99), cost + 1)
    return min(cost for (frame, _), cost in best.items() if frame == count)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-6, 6), min_size=2, max_size=9),
    st.sampled_from([0.0, 0.2, 0.36, 0.5]),
)
def test_no_way_to_choose_the_ends_takes_fewer_segments(
    steps: list[float], tolerance: float
) -> None:
    ticks = 1800 + np.cumsum(steps)
    ends, _ = packed(ticks[:, np.newaxis], [1800], tolerance)
    assert len(ends) == fewest(ticks, 1800, tolerance)


def test_four_servos_share_the_times_but_not_the_ticks() -> None:
    frame = np.arange(1, 41)
    kink = np.where(frame < 20, frame * 3.0, 60 + (frame - 20) * 9.0)
    steady = frame * 5.0
    ticks = 1700 + np.stack([kink, steady, 0 * steady, -steady], axis=-1)
    ends, targets = packed(ticks, [1700] * 4, 0.0)
    assert ends.tolist() == [20, 40]
    assert targets[0].tolist() == [1760, 1800, 1700, 1600]


def test_a_rest_and_a_ramp_are_as_long_as_a_segment_may_be() -> None:
    ramp = 1700 + np.arange(1, 101)[:, np.newaxis] * np.array([2.0, -1.0])
    assert packed(ramp, [1700, 1700], 0.0, max_frames=100)[0].tolist() == [100]
    assert packed(ramp, [1700, 1700], 0.0)[0].tolist() == [25, 50, 75, 100]


def test_played_is_the_boards_line() -> None:
    # firmware/lib/motion/src/motion/line.h: after k of n frames, round(d k / n), halves away.
    for way, frames in itertools.product((0, 1, 7, 10, -10, 116), (1, 2, 4, 7)):
        line = packing.played([2000], [frames], [[2000 + way]])[:, 0] - 2000
        whole, remainder = divmod(abs(way), frames)
        fraction, gone, expected = frames // 2, 0, []
        for _ in range(frames):
            carry, fraction = divmod(fraction + remainder, frames)
            gone += whole + carry
            expected.append(gone if way > 0 else -gone)
        assert line.tolist() == expected


def test_what_the_board_would_refuse_is_refused_here() -> None:
    with pytest.raises(TrajectoryError, match="slew limit"):
        packed(np.array([[1700.0], [1850.0]]), [1700], 0.0)
    with pytest.raises(InputError, match="max_frames is 0"):
        packed(np.array([[1700.0]]), [1700], 0.0, max_frames=0)
    with pytest.raises(InputError, match="tolerance is -1"):
        packed(np.array([[1700.0]]), [1700], -1.0)


def test_a_repeated_motion_comes_back_unharmed() -> None:
    ramp = 1700 + np.arange(1.0, 11)[:, np.newaxis]
    first = packed(ramp, [1700], 0.0)
    first[1][:] = 0
    assert packed(ramp, [1700], 0.0)[1].tolist() == [[1710]]


def test_a_coarser_tolerance_in_the_configuration_counts() -> None:
    coarse = dataclasses.replace(
        CONFIG, motion=dataclasses.replace(CONFIG.motion, tolerance_um=200.0)
    )
    motion = move([60.0, 65, 70, 70], 1.0)
    assert len(ServoModel(coarse).segments(motion.lengths_mm)) < len(
        SERVOS.segments(motion.lengths_mm)
    )
