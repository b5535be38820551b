"""From a contact, a stop or a command to the pulses, at the pins of the simulated UNO."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

from bench.avr import CYCLES_PER_MS, board, frame_start, random_ticks
from tests.avr.aimed import RATE_SPREAD, Aimed, Range
from tests.avr.driver import Driver, FramePulses, Load, Ticks, first_still
from tests.avr.simavr import CYCLES_PER_TICK, CYCLES_PER_US, FRAME_CYCLES, Pulse

from setae_protocol.messages import SERVOS, Guard, State

_LOW: Ticks = (1700, 1800, 1900, 2000)
_HIGH: Ticks = (3500, 3600, 3700, 3800)
# So fast that every frame shows that it moves.
_TICKS_PER_FRAME = 9
_REST_HPA = 1013.25
_TOUCH_HPA = 1040.0
_THRESHOLD_HPA = 15.0
# A sample that is ready so long before a frame must freeze that frame.
_IN_TIME_CYCLES = 500 * CYCLES_PER_US
# Before a frame: when the sample of an aimed contact is ready, when the last byte of an aimed stop
# comes, and when a sample is ready beside it.
_AIMED_SAMPLE_US = (500.0, 1000.0)
_AIMED_STOP_US = (500.0, 900.0)
_SAMPLE_BESIDE_US = (-300.0, 600.0)
# What the paper's robot uses of its servos' travel.
_TRAVEL_TICKS = (1660, 4300)


@dataclass(frozen=True, slots=True, kw_only=True)
class Freeze:
    """One contact or stop.

    Attributes
    ----------
    time_ms
        From the pressure's step, an aimed contact's sample, or the stop's last byte, to the start
        of the first frame whose pulses no longer move.
    late_frames
        Frames that moved although a sample beyond the threshold was ready 0.5 ms before them.
    stack_bytes
        Deepest stack of its board so far.
    """

    time_ms: float
    late_frames: int
    stack_bytes: int


def contacts(count: int, seed: int) -> list[Freeze]:
    """Touch at random phases under load, the sensor's rate drawn anew each time."""
    rng = random.Random(seed)
    found = []
    with board() as driver:
        uno = driver.uno
        driver.enable(_LOW)
        phase = frame_start(uno)
        Load(driver)
        for _ in range(count):
            uno.set_sensor_rate(rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD))
            driver.guard(_THRESHOLD_HPA)
            _start_ramp(driver)
            driver.session.run_until(
                lambda: driver.reports[-1].telemetry.guard is Guard.ARMED, 1_000_000, what="armed"
            )
            crossed = uno.cycle + rng.randrange(50 * CYCLES_PER_MS, 150 * CYCLES_PER_MS)
            uno.set_pressure(_TOUCH_HPA, from_cycle=crossed)
            driver.wait_for(State.TRIPPED)
            uno.set_pressure(_REST_HPA)
            driver.session.run_for(45_000)
            still = _frame_of(first_still(driver.frames()), phase)
            ready = next(s.ready for s in driver.samples() if s.ready >= crossed)
            in_time = ready + _IN_TIME_CYCLES
            must = in_time + (phase - in_time) % FRAME_CYCLES
            found.append(
                Freeze(
                    time_ms=(still - crossed) / CYCLES_PER_MS,
                    late_frames=max(0, (still - must) // FRAME_CYCLES),
                    stack_bytes=uno.statistics().stack_bytes,
                )
            )
            driver.forget()
            driver.resume()
    return found


def stops(count: int, seed: int) -> list[Freeze]:
    """Stop at random phases under load."""
    rng = random.Random(seed)
    found = []
    with board() as driver:
        uno = driver.uno
        driver.enable(_LOW)
        phase = frame_start(uno)
        Load(driver)
        for _ in range(count):
            uno.set_sensor_rate(rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD))
            _start_ramp(driver)
            # The load goes on meanwhile: what lies ahead on the line is the same at each phase.
            driver.session.run_for(round(rng.uniform(60_000, 100_000)))
            driver.session.send_stop()
            arrived = uno.line_free
            driver.wait_for(State.STOPPED)
            driver.session.run_for(45_000)
            still = _frame_of(first_still(driver.frames()), phase)
            found.append(
                Freeze(
                    time_ms=(still - arrived) / CYCLES_PER_MS,
                    late_frames=0,
                    stack_bytes=uno.statistics().stack_bytes,
                )
            )
            driver.forget()
            driver.resume()
    return found


def aimed_contacts(count: int, seed: int) -> list[Freeze]:
    """Touch so that the sample is ready just in time for the next frame."""
    with board() as driver:
        aim = Range(driver, random.Random(seed))
        return [_as_freeze(driver, aim.contact(_AIMED_SAMPLE_US)) for _ in range(count)]


def aimed_stops(count: int, seed: int) -> list[Freeze]:
    """Stop just in time for the next frame, while a sample is being fetched."""
    with board() as driver:
        aim = Range(driver, random.Random(seed))
        return [
            _as_freeze(driver, aim.stop(_AIMED_STOP_US, _SAMPLE_BESIDE_US)) for _ in range(count)
        ]


def _as_freeze(driver: Driver, aimed: Aimed) -> Freeze:
    return Freeze(
        time_ms=aimed.time_ms,
        late_frames=aimed.frames_late,
        stack_bytes=driver.uno.statistics().stack_bytes,
    )


def _start_ramp(driver: Driver) -> None:
    """Move to the end that is further away, and see that it moves."""
    at = driver.reports[-1].telemetry.pulse_ticks[0]
    target = max(_LOW, _HIGH, key=lambda ticks: abs(ticks[0] - at))
    driver.queue([target], frames_each=abs(target[0] - at) // _TICKS_PER_FRAME)
    driver.wait_for(State.MOVING)


def _frame_of(frame: FramePulses, phase: int) -> int:
    """The cycle at which it began."""
    return frame.first_rise - (frame.first_rise - phase) % FRAME_CYCLES


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One new pose: from the command's last byte to each servo's first new pulse, and its end."""

    begins_ms: tuple[float, ...]
    ends_ms: tuple[float, ...]
    stack_bytes: int


def commands(count: int, seed: int) -> list[Command]:
    """Ask for new poses at random phases, the line full in both directions."""
    rng = random.Random(seed)
    found = []
    with board() as driver:
        uno = driver.uno
        driver.enable(_LOW)
        Load(driver)
        pose = _LOW
        for _ in range(count):
            uno.set_sensor_rate(rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD))
            driver.session.run_for(round(rng.uniform(40_000, 80_000)))
            driver.forget()
            pose = _another(rng, pose)
            driver.queue([pose])
            arrived = uno.line_free
            driver.session.run_for(80_000)
            first = _first_pulses(driver, pose)
            found.append(
                Command(
                    begins_ms=tuple((pulse.rise - arrived) / CYCLES_PER_MS for pulse in first),
                    ends_ms=tuple(
                        (pulse.rise + pulse.width - arrived) / CYCLES_PER_MS for pulse in first
                    ),
                    stack_bytes=uno.statistics().stack_bytes,
                )
            )
    return found


def _another(rng: random.Random, pose: Ticks) -> Ticks:
    while True:
        drawn = random_ticks(rng, *_TRAVEL_TICKS)
        if all(new != old for new, old in zip(drawn, pose, strict=True)):
            return drawn


def _first_pulses(driver: Driver, pose: Sequence[int]) -> list[Pulse]:
    """Each servo's first pulse of its new width."""
    found = driver.pulses()
    return [
        next(
            pulse
            for pulse in found
            if pulse.servo == servo and pulse.width == pose[servo] * CYCLES_PER_TICK
        )
        for servo in range(SERVOS)
    ]
