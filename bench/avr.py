"""The built firmware on the cycle-accurate UNO of tests/avr: boards, and a minute of load."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TypeVar

from bench import elf
from tests.avr.aimed import RATE_SPREAD
from tests.avr.driver import Driver, Load, Ticks
from tests.avr.simavr import (
    CYCLES_PER_TICK,
    CYCLES_PER_US,
    FIRMWARE,
    FRAME_CYCLES,
    Uno,
)

from setae_protocol.messages import (
    PULSE_TICKS_ABSOLUTE_MAX,
    PULSE_TICKS_ABSOLUTE_MIN,
    SERVOS,
)

CYCLES_PER_MS = 1000 * CYCLES_PER_US
# Between looks at the pins, so that few edges are at hand at a time.
_POSES_AT_A_TIME = 50
_WORKERS = 2
_FRAME_START = "servo_pulses.*11frame_startE$"

T = TypeVar("T")


@contextmanager
def board() -> Iterator[Driver]:
    """A board with an open session and wide limits."""
    with Uno() as uno:
        driver = Driver(uno)
        driver.open()
        yield driver


def parallel(measure: Callable[[int, int], Sequence[T]], count: int, seed: int) -> list[T]:
    """Share `count` repeats among processes; how many there are changes no result."""
    parts = 8
    counts = [count // parts + (part < count % parts) for part in range(parts)]
    seeds = [seed * 1000 + part for part in range(parts)]
    with ProcessPoolExecutor(_WORKERS, mp_context=get_context("fork")) as pool:
        return [result for part in pool.map(measure, counts, seeds) for result in part]


def frame_start(uno: Uno) -> int:
    """The cycle at which a servo frame began, by the firmware's own variable.

    Every 20 ms before and after it another one begins.
    """
    address = elf.symbol_address(FIRMWARE, _FRAME_START)
    return uno.timer1_was_at(uno.peek(address, 2)) % FRAME_CYCLES


def random_ticks(rng: random.Random, low: int, high: int) -> Ticks:
    """Four random pulses."""
    a, b, c, d = (rng.randint(low, high) for _ in range(SERVOS))
    return (a, b, c, d)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """What the chip showed with the line full and all servos moving.

    Attributes
    ----------
    servo_span_ms
        From a frame's start to the end of its last pulse, pulses at their widest.
    split_updates
        Frames in which a servo had a width, or none, that the board did not tell.
    idle_percent
        Turns of the board's loop, in percent of those of a board at rest with the line silent.
    """

    duration_s: float
    pulses: int
    servo_error_cycles_max: float
    servo_span_ms: float
    split_updates: int
    rx_overruns: int
    interrupts_off_us_max: float
    idle_percent: float
    stack_bytes: int


def loaded(updates: int, seed: int = 1) -> Loaded:
    """Play random widths over the whole range, new ones each frame, under load."""
    rng = random.Random(seed)
    with board() as driver:
        uno = driver.uno
        at_rest = _turns_per_cycle(driver)
        driver.enable((PULSE_TICKS_ABSOLUTE_MAX,) * SERVOS)
        driver.session.run_for(100_000)
        phase = frame_start(uno)
        span = max(
            (frame.last_fall - phase) % FRAME_CYCLES
            for frame in driver.frames()
            if None not in frame.ticks
        )

        Load(driver)
        uno.watch_interrupts()
        start, turns = uno.cycle, uno.statistics().turns
        errors: list[float] = []
        split = 0
        for _ in range(updates // _POSES_AT_A_TIME):
            uno.set_sensor_rate(rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD))
            first_report = len(driver.reports)
            driver.play(
                [
                    random_ticks(rng, PULSE_TICKS_ABSOLUTE_MIN, PULSE_TICKS_ABSOLUTE_MAX)
                    for _ in range(_POSES_AT_A_TIME)
                ]
            )
            part_errors, part_split = _compare(driver, first_report)
            errors += part_errors
            split += part_split
            driver.forget()
        took = uno.cycle - start
        seen = uno.statistics()
        return Loaded(
            duration_s=took / (1000 * CYCLES_PER_MS),
            pulses=len(errors),
            servo_error_cycles_max=max(errors),
            servo_span_ms=span / CYCLES_PER_MS,
            split_updates=split,
            rx_overruns=seen.receive_overruns,
            interrupts_off_us_max=seen.interrupts_off_cycles / CYCLES_PER_US,
            idle_percent=100 * (seen.turns - turns) / took / at_rest,
            stack_bytes=seen.stack_bytes,
        )


def _turns_per_cycle(driver: Driver) -> float:
    """How often the loop turns while there is next to nothing to do: limp, the line silent."""
    uno = driver.uno
    uno.run_for_us(20_000)
    start, turns = uno.cycle, uno.statistics().turns
    uno.run_for_us(200_000)
    return (uno.statistics().turns - turns) / (uno.cycle - start)


def _compare(driver: Driver, first_report: int) -> tuple[list[float], int]:
    """Widths at the pins against the told ones: errors in cycles, and frames that differ."""
    shown = {frame.frame: frame.ticks for frame in driver.frames()}
    errors: list[float] = []
    split = 0
    for event in driver.reports[first_report:]:
        report = event.telemetry
        if report.frame not in shown:  # it still runs, or was looked at before
            continue
        wrong = 0
        for told, seen in zip(report.pulse_ticks, shown[report.frame], strict=True):
            if seen is None:
                wrong += 1
                continue
            error = abs(seen - told) * CYCLES_PER_TICK
            errors.append(error)
            wrong += error >= CYCLES_PER_TICK
        split += wrong > 0
    return errors, split
