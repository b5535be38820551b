"""What the serial line of the simulated UNO carries: questions, frames, a queue of motion."""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import pairwise

from bench.avr import CYCLES_PER_MS, board
from tests.avr.aimed import RATE_SPREAD
from tests.avr.driver import Driver, Load, Ticks, ramp
from tests.avr.simavr import AvrTransport, Uno

from setae_protocol.frame import BoardDecoder, encode_host
from setae_protocol.messages import (
    SEGMENT_QUEUE_SLOTS,
    SEGMENTS_PER_MESSAGE,
    Ping,
    Pong,
    Segment,
    Segments,
    State,
)

_LOW: Ticks = (1700, 1800, 1900, 2000)
_HIGH: Ticks = (3500, 3600, 3700, 3800)
_LINE_FRAMES = 500
# Vector numbers as avr-libc counts them.
_USART_RX = 18


class _Tap(AvrTransport):
    """Notes when each answer to a ping has come."""

    def __init__(self, uno: Uno) -> None:
        super().__init__(uno)
        self._decoder = BoardDecoder()
        self.pongs: dict[int, int] = {}

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        got = super().receive(deadline_us)
        for frame in self._decoder.feed(got[0]) if got else ():
            if isinstance(frame.message, Pong):
                self.pongs.setdefault(frame.message.token, self._uno.cycle)
        return got


@dataclass(frozen=True, slots=True, kw_only=True)
class Timed:
    """A time, and the deepest stack of its board so far."""

    time_ms: float
    stack_bytes: int


def round_trips(count: int, seed: int, *, loaded: bool) -> list[Timed]:
    """From a ping's first start bit to its answer's last stop bit, at random phases.

    Loaded: the line full in both directions and four servos moving. Else the line is silent, so
    that no telemetry is on its way first.
    """
    rng = random.Random(seed)
    found = []
    with Uno() as uno:
        tap = _Tap(uno)
        driver = Driver(uno, transport=tap)
        driver.open()
        if loaded:
            driver.enable(_LOW)
            Load(driver)
        for number in range(count):
            uno.set_sensor_rate(rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD))
            if loaded and number % 20 == 0:
                target = _LOW if number % 40 else _HIGH
                driver.queue([target], frames_each=_LINE_FRAMES)
                driver.wait_for(State.MOVING)
            driver.session.run_for(round(rng.uniform(20_000, 40_000)))
            if not loaded:
                while tap.receive(tap.now_us() + 2_000) is not None:
                    pass
            found.append(
                Timed(
                    time_ms=_ask(driver, tap, 0xB0000000 + number) / CYCLES_PER_MS,
                    stack_bytes=uno.statistics().stack_bytes,
                )
            )
            if loaded and number % 20 == 19:
                driver.session.stop()
                driver.resume()
    return found


def _ask(driver: Driver, tap: _Tap, token: int) -> int:
    """Cycles from a ping to its answer.

    The board answers the last ping of those that came together: where that was the session's own,
    this one is asked again.

    Raises
    ------
    TimeoutError
        No ping was answered.
    """
    uno = driver.uno
    while True:
        sent = max(uno.cycle, uno.line_free)
        uno.send(encode_host(Ping(token=token), session=driver.session_id))
        _await_pong(driver, tap, token)
        if token in tap.pongs:
            return tap.pongs[token] - sent
        if max(tap.pongs.values(), default=0) < sent:
            raise TimeoutError(f"the board answers no ping: {token:#x}")


def _await_pong(driver: Driver, tap: _Tap, token: int) -> None:
    until_us = driver.session.now_us + 100_000
    driver.session.run_until(
        lambda: token in tap.pongs or driver.session.now_us > until_us, 200_000
    )


def refills(count: int, seed: int) -> list[Timed]:
    """From a silent line and an empty queue to one second of motion that the board has confirmed.

    One segment a frame: the most bytes that a second can take.
    """
    rng = random.Random(seed)
    found = []
    with board() as driver:
        uno = driver.uno
        driver.enable(_LOW)
        for _ in range(count):
            driver.session.run_for(round(rng.uniform(40_000, 60_000)))
            start = uno.cycle
            tickets = driver.queue(ramp(_LOW, _HIGH, SEGMENT_QUEUE_SLOTS))
            driver.session.run_until(lambda: all(ticket.done for ticket in tickets), 500_000)  # noqa: B023  # only here
            time_ms = (uno.cycle - start) / CYCLES_PER_MS
            found.append(Timed(time_ms=time_ms, stack_bytes=uno.statistics().stack_bytes))
            driver.session.stop()
            driver.resume()
            driver.play([_LOW], frames_each=2)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class FullLine:
    """Valid frames without a gap between them, all servos moving."""

    sent_per_s: float
    valid_per_s: float
    lost: int
    overruns: int
    stack_bytes: int


def full_line(duration_ms: int = 2000) -> FullLine:
    """Send pings as fast as the line carries them, and count those that got lost."""
    with board() as driver:
        uno = driver.uno
        driver.enable(_LOW)
        driver.queue([_HIGH], frames_each=_LINE_FRAMES)
        driver.session.run_for(100_000)
        first = len(driver.reports) - 1
        start = uno.cycle
        sent = 0
        while uno.line_free < start + duration_ms * CYCLES_PER_MS:
            uno.send(encode_host(Ping(token=0xA0000000 + sent), session=driver.session_id))
            sent += 1
        took_s = (uno.line_free - start) / (1000 * CYCLES_PER_MS)
        driver.session.run_for(duration_ms * 1000 + 60_000)
        lost = _damaged(driver, first)
        seen = uno.statistics()
        return FullLine(
            sent_per_s=sent / took_s,
            valid_per_s=(sent - lost) / took_s,
            lost=lost,
            overruns=seen.receive_overruns,
            stack_bytes=seen.stack_bytes,
        )


def _damaged(driver: Driver, first: int) -> int:
    """Frames that the board dropped since a report; its counter wraps at 256."""
    counts = [event.telemetry.rx_damaged for event in driver.reports[first:]]
    return sum((later - earlier) % 256 for earlier, later in pairwise(counts))


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoding:
    """Cycles that a received byte costs the board, in frames of full length."""

    with_interrupt: float
    interrupt: float
    stack_bytes: int


def decoding(duration_ms: int = 1000) -> Decoding:
    """Fill the line with another session's frames, which the board decodes, checks and drops.

    What its loop can't turn any more, against a silent line, is what they cost.
    """
    with board() as driver:
        uno = driver.uno
        slot = Segment(duration_frames=257, target_ticks=(1601, 1702, 1803, 1904))
        frame = encode_host(
            Segments(epoch=1, count=SEGMENTS_PER_MESSAGE, segments=(slot,) * SEGMENTS_PER_MESSAGE),
            session=driver.session_id + 1,
            sequence=1,
        )
        silent = _observe(uno, duration_ms)
        end = uno.cycle + (duration_ms + 10) * CYCLES_PER_MS
        while uno.line_free < end:
            uno.send(frame)
        uno.run_for_us(5_000)
        full = _observe(uno, duration_ms)
        cost = 1 - full.turns_per_cycle / silent.turns_per_cycle
        return Decoding(
            with_interrupt=cost / full.bytes_per_cycle,
            interrupt=full.interrupt_per_byte,
            stack_bytes=uno.statistics().stack_bytes,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Observed:
    turns_per_cycle: float
    bytes_per_cycle: float
    interrupt_per_byte: float


def _observe(uno: Uno, duration_ms: int) -> _Observed:
    start, turns, received = uno.cycle, uno.statistics().turns, uno.handler(_USART_RX)
    uno.run_for_us(1000 * duration_ms)
    cycles, now = uno.cycle - start, uno.handler(_USART_RX)
    count = now.count - received.count
    return _Observed(
        turns_per_cycle=(uno.statistics().turns - turns) / cycles,
        bytes_per_cycle=count / cycles,
        interrupt_per_byte=(now.total - received.total) / max(1, count),
    )
