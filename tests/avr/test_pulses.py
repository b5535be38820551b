"""Servo pulses, measured at the pins in cycles of the core: 62.5 ns."""

from __future__ import annotations

import random
from itertools import pairwise

from tests.avr.driver import Driver, Ticks, first_still, ramp
from tests.avr.simavr import CYCLES_PER_TICK, CYCLES_PER_US, FRAME_CYCLES, by_servo

from setae_protocol.messages import (
    ATTACH_INTERVAL_FRAMES,
    PULSE_TICKS_ABSOLUTE_MAX,
    PULSE_TICKS_ABSOLUTE_MIN,
    SERVOS,
    Enable,
    Limp,
    Resume,
    State,
)

POSE = (1700, 1800, 1900, 2000)
LOW: Ticks = (1000, 1000, 1000, 1000)
HIGH: Ticks = (5000, 5000, 5000, 5000)
# All through a servo frame, and at its edges.
PHASES_US = (0, 3_000, 6_500, 9_100, 13_000, 16_900, 19_950)


def _random_poses(count: int, seed: int) -> list[Ticks]:
    rng = random.Random(seed)

    def width() -> int:
        return rng.randint(PULSE_TICKS_ABSOLUTE_MIN, PULSE_TICKS_ABSOLUTE_MAX)

    return [(width(), width(), width(), width()) for _ in range(count)]


def _assert_every_pulse_is_as_told(driver: Driver) -> None:
    """Every frame that was reported shows its pulses at the pins, to the cycle, and no other."""
    driver.session.run_for(40_000)
    seen = {frame.frame: frame.ticks for frame in driver.frames()}
    reports = [event.telemetry for event in driver.reports][:-2]
    assert reports
    for report in reports:
        told = tuple(
            float(ticks) if report.attached >> servo & 1 else None
            for servo, ticks in enumerate(report.pulse_ticks)
        )
        assert seen.get(report.frame, (None,) * SERVOS) == told, f"frame {report.frame}"


def test_servos_attach_one_after_the_other_at_the_commanded_pose(driver: Driver) -> None:
    driver.enable(POSE)
    driver.session.run_for(100_000)

    found = by_servo(driver.pulses())
    first_rises = [pulses[0].rise for pulses in found]
    for servo in range(SERVOS):
        assert {pulse.width for pulse in found[servo]} == {POSE[servo] * CYCLES_PER_TICK}
    for earlier, later in pairwise(first_rises):
        frames = (later - earlier) / FRAME_CYCLES
        assert ATTACH_INTERVAL_FRAMES - 1 < frames < ATTACH_INTERVAL_FRAMES + 1


def test_pulses_come_every_20_ms_to_the_cycle(driver: Driver) -> None:
    driver.enable(POSE)
    driver.session.run_for(200_000)
    for pulses in by_servo(driver.pulses()):
        rises = [pulse.rise for pulse in pulses]
        periods = {later - earlier for earlier, later in pairwise(rises)}
        assert periods == {FRAME_CYCLES}


def test_no_pulse_is_a_cycle_long_or_short_over_the_whole_range(driver: Driver) -> None:
    poses = [LOW, HIGH, LOW, *_random_poses(77, seed=1)]
    driver.enable(LOW)
    driver.play(poses)

    _assert_every_pulse_is_as_told(driver)
    shown = [frame.ticks for frame in driver.frames()]
    # All of them were shown, in order: none was skipped, none mixed with the next.
    position = 0
    for pose in poses:
        position = shown.index(tuple(map(float, pose)), position)


def test_all_four_new_widths_come_in_the_same_frame(driver: Driver) -> None:
    driver.enable(LOW)
    driver.play(ramp(LOW, HIGH, 40))
    for frame in driver.frames():
        if None not in frame.ticks:
            assert len(set(frame.ticks)) == 1


def test_a_stop_freezes_whole_pulses(driver: Driver) -> None:
    driver.enable(LOW)
    pose = LOW
    for phase_us in PHASES_US:
        target = HIGH if pose[0] < 3000 else LOW
        driver.queue(ramp(pose, target, 50))
        driver.session.run_for(160_000)
        driver.uno.run_for_us(phase_us)
        sent = driver.uno.cycle
        driver.session.stop()
        driver.session.run_for(80_000)

        assert driver.session.state is State.STOPPED
        frames = driver.frames()
        assert frames[-1].ticks not in (tuple(map(float, pose)), tuple(map(float, target)))
        # The stop's 0.4 ms on the line, and the frame that has begun already.
        assert first_still(frames).first_rise - sent < FRAME_CYCLES + 1_000 * CYCLES_PER_US
        pose = driver.reports[-1].telemetry.pulse_ticks
        driver.resume()
    _assert_every_pulse_is_as_told(driver)


def test_pulses_end_whole_where_they_are_switched_off(driver: Driver) -> None:
    for phase_us in PHASES_US:
        driver.enable(POSE)
        driver.session.run_for(20_000)
        driver.uno.run_for_us(phase_us)
        driver.session.request(Limp(reserved=0))
        driver.session.run_for(30_000)
        assert driver.session.state is State.RELAXED
        ended = driver.pulses()
        driver.session.run_for(30_000)
        assert driver.pulses() == ended
    for servo, pulses in enumerate(by_servo(driver.pulses())):
        assert {pulse.width for pulse in pulses} == {POSE[servo] * CYCLES_PER_TICK}


def test_a_stop_while_attaching_leaves_no_partial_pulse(driver: Driver) -> None:
    driver.session.send(Enable(pulse_ticks=POSE))
    driver.session.run_for(170_000)
    driver.session.stop()
    driver.session.run_for(100_000)
    half = {pulse.servo for pulse in driver.pulses()}
    driver.session.request(Resume(epoch=driver.session.epoch))
    driver.wait_for(State.HOLDING)
    driver.session.run_for(60_000)

    assert 0 < len(half) < SERVOS
    for servo, pulses in enumerate(by_servo(driver.pulses())):
        assert {pulse.width for pulse in pulses} == {POSE[servo] * CYCLES_PER_TICK}


def test_a_stop_at_a_frames_very_start_does_not_pull_back(driver: Driver) -> None:
    """The frame began between the look at the time and the freeze: its pulses stepped back."""
    driver.enable((1500, 1500, 1500, 1500))
    driver.session.run_for(60_000)
    edge = driver.frames()[-1].first_rise
    for before_us in range(720, 280, -10):  # of which the stop is on the line for 0.4 ms
        at = driver.session.telemetry
        assert at is not None
        a, b, c, d = at.pulse_ticks
        driver.queue(ramp((a, b, c, d), (a + 80, b + 80, c + 80, d + 80), 10))
        driver.wait_for(State.MOVING)
        driver.session.run_for(20_000)
        frames = -(-(driver.uno.cycle - edge + before_us * CYCLES_PER_US) // FRAME_CYCLES)
        driver.uno.run_to(edge + frames * FRAME_CYCLES - before_us * CYCLES_PER_US)
        driver.session.stop()
        driver.session.run_for(25_000)
        driver.resume()
    for pulses in by_servo(driver.pulses()):
        widths = [pulse.width for pulse in pulses]
        assert widths == sorted(widths)
    _assert_every_pulse_is_as_told(driver)


def test_all_four_pulses_rise_together_whatever_their_widths(driver: Driver) -> None:
    poses: list[Ticks] = [LOW, HIGH, (5000, 1000, 5000, 1000), (1000, 5000, 1000, 5000)]
    driver.enable(LOW)
    driver.play([*poses, (3001, 3000, 2999, 3000)])
    driver.session.run_for(40_000)
    whole = [frame for frame in driver.frames() if None not in frame.ticks]
    assert {frame.ticks for frame in whole} > {tuple(map(float, pose)) for pose in poses}
    for frame in whole:
        assert (
            frame.last_fall - frame.first_rise == max(filter(None, frame.ticks)) * CYCLES_PER_TICK
        )
    _assert_every_pulse_is_as_told(driver)
