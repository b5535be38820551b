"""Figures of the built firmware, measured on the cycle-accurate UNO of tests/avr."""

from __future__ import annotations

import random
import statistics
from dataclasses import dataclass

from tests.avr.driver import Driver, Load, Ticks, first_still, ramp
from tests.avr.simavr import CYCLES_PER_TICK, CYCLES_PER_US, AvrTransport, Uno

from setae_protocol.frame import encode_host
from setae_protocol.messages import (
    PULSE_TICKS_ABSOLUTE_MAX,
    PULSE_TICKS_ABSOLUTE_MIN,
    SERVOS,
    Ping,
    State,
)

_START: Ticks = (1500, 1600, 1700, 1800)
_END: Ticks = (3300, 3400, 3500, 3600)
_RAMP_FRAMES = 45
_REST_HPA = 1013.25
_TOUCH_HPA = 1040.0
_THRESHOLD_HPA = 15.0
_RATE_SPREAD = 0.03
_CYCLES_PER_MS = 1000 * CYCLES_PER_US


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """What the chip showed with the line full and all servos moving."""

    duration_s: float
    pulses: int
    servo_error_cycles_max: float
    servo_span_ms: float
    servo_split_updates: int
    rx_overruns: int
    interrupts_off_us_max: float
    stack_deepest_bytes: int


def loaded(updates: int = 1000, seed: int = 1) -> Loaded:
    """Play random widths over the whole range, new ones each frame, under load."""
    rng = random.Random(seed)
    with Uno() as uno:
        driver = Driver(uno)
        driver.open()
        widest: Ticks = (PULSE_TICKS_ABSOLUTE_MAX,) * SERVOS
        driver.enable(widest)
        driver.session.run_for(100_000)
        # Between the first edge and the last one, at the widest pulses.
        whole = [frame for frame in driver.frames() if None not in frame.ticks]
        span_cycles = max(frame.last_fall - frame.first_rise for frame in whole)

        Load(driver)
        uno.watch_interrupts()
        start = uno.cycle
        first_report = len(driver.reports)
        played = 0
        while played < updates:
            uno.set_sensor_rate(rng.uniform(1 - _RATE_SPREAD, 1 + _RATE_SPREAD))
            driver.play([_random_pose(rng) for _ in range(50)])
            played += 50
        end = uno.cycle
        driver.session.run_for(60_000)

        shown = {frame.frame: frame.ticks for frame in driver.frames()}
        errors: list[float] = []
        split = 0
        for event in driver.reports[first_report:-3]:
            told = event.telemetry.pulse_ticks
            seen = shown[event.telemetry.frame]
            wrong = 0
            for told_ticks, seen_ticks in zip(told, seen, strict=True):
                if seen_ticks is None:
                    wrong += 1
                    continue
                error = abs(seen_ticks - told_ticks) * CYCLES_PER_TICK
                errors.append(error)
                wrong += error >= CYCLES_PER_TICK
            split += wrong > 0
        statistics_now = uno.statistics()
        return Loaded(
            duration_s=(end - start) / (1000 * _CYCLES_PER_MS),
            pulses=len(errors),
            servo_error_cycles_max=max(errors),
            servo_span_ms=span_cycles / _CYCLES_PER_MS,
            servo_split_updates=split,
            rx_overruns=statistics_now.receive_overruns,
            interrupts_off_us_max=statistics_now.interrupts_off_cycles / CYCLES_PER_US,
            stack_deepest_bytes=statistics_now.stack_bytes,
        )


def _random_pose(rng: random.Random) -> Ticks:
    a, b, c, d = (
        rng.randint(PULSE_TICKS_ABSOLUTE_MIN, PULSE_TICKS_ABSOLUTE_MAX) for _ in range(SERVOS)
    )
    return (a, b, c, d)


def contact_to_freeze_ms(count: int, seed: int = 2) -> list[float]:
    """From the pressure's step to the first pulse of the first frame that repeats the one before.

    Under load, at random phases, with the sensor's rate drawn anew each time.
    """
    rng = random.Random(seed)
    times_ms = []
    with Uno() as uno:
        driver = Driver(uno)
        driver.open()
        driver.enable(_START)
        Load(driver)
        for _ in range(count):
            uno.set_sensor_rate(rng.uniform(1 - _RATE_SPREAD, 1 + _RATE_SPREAD))
            driver.guard(_THRESHOLD_HPA)
            driver.queue(ramp(_START, _END, _RAMP_FRAMES))
            driver.wait_for(State.MOVING)
            crossed = uno.cycle + rng.randrange(60 * _CYCLES_PER_MS, 260 * _CYCLES_PER_MS)
            uno.set_pressure(_TOUCH_HPA, from_cycle=crossed)
            driver.wait_for(State.TRIPPED)
            driver.session.run_for(60_000)
            still = first_still(driver.frames())
            times_ms.append((still.first_rise - crossed) / _CYCLES_PER_MS)
            driver.forget()
            uno.set_pressure(_REST_HPA)
            driver.session.run_for(40_000)
            driver.resume()
            driver.play([_START], frames_each=5)
    return times_ms


def stop_to_freeze_ms(count: int, seed: int = 3) -> list[float]:
    """From a stop's last byte to the first pulse of the first frame that repeats the one before.

    Under load, at random phases.
    """
    rng = random.Random(seed)
    times_ms = []
    with Uno() as uno:
        driver = Driver(uno)
        driver.open()
        driver.enable(_START)
        Load(driver)
        for _ in range(count):
            driver.queue(ramp(_START, _END, _RAMP_FRAMES))
            driver.wait_for(State.MOVING)
            driver.session.run_for(60_000)
            uno.run_for_us(rng.uniform(0, 20_000))
            driver.session.send_stop()
            arrived = uno.line_free
            driver.wait_for(State.STOPPED)
            driver.session.run_for(60_000)
            times_ms.append((first_still(driver.frames()).first_rise - arrived) / _CYCLES_PER_MS)
            driver.forget()
            driver.resume()
            driver.play([_START], frames_each=5)
    return times_ms


def query_round_trip_ms(count: int = 200, seed: int = 4) -> float:
    """From a ping's first start bit to its answer's last stop bit: median, line else idle."""
    rng = random.Random(seed)
    times_ms = []
    with Uno() as uno:
        driver = Driver(uno)
        driver.open()
        transport = AvrTransport(uno)
        for token in range(count):
            driver.session.run_for(20_000)
            uno.run_for_us(rng.uniform(0, 20_000))
            # Telemetry that is on its way first.
            while transport.receive(transport.now_us() + 3_000) is not None:
                pass
            sent = uno.cycle
            uno.send(encode_host(Ping(token=token), session=driver.session_id))
            answer = transport.receive(transport.now_us() + 20_000)
            assert answer is not None
            times_ms.append((uno.cycle - sent) / _CYCLES_PER_MS)
    return statistics.median(times_ms)
