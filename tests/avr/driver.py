"""Drives a simulated UNO through the host's own link, and looks at its pins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tests.avr.simavr import (
    CYCLES_PER_TICK,
    CYCLES_PER_US,
    FRAME_CYCLES,
    AvrTransport,
    Edge,
    Pulse,
    Sample,
    Uno,
    pulses,
)

from setae.link.events import Event, FaultReported, TelemetryReceived, Ticket, Tripped
from setae.link.session import Session
from setae_protocol.frame import encode_host
from setae_protocol.messages import (
    BAUD,
    BOARD_OVERHEAD_BYTES,
    PRESSURE_LSB_PER_HPA,
    SEGMENTS_PER_MESSAGE,
    SERVO_FRAME_US,
    SERVOS,
    Enable,
    GuardMessage,
    Ping,
    ReadLimits,
    Reflex,
    Resume,
    Segment,
    Segments,
    SetLimits,
    State,
)

Ticks = tuple[int, int, int, int]

# The edges of what the board accepts at all.
WIDE_LIMITS = SetLimits(
    pulse_min_ticks=(1000,) * SERVOS,
    pulse_max_ticks=(5000,) * SERVOS,
    slew_ticks=4000,
    pair_sum_min_ticks=(0, 0),
    pair_sum_max_ticks=(10000, 10000),
    pair_difference_min_ticks=(-4000, -4000),
    pair_difference_max_ticks=(4000, 4000),
    coarse_threshold_raw=0,
    hold_timeout_s=0,
    stop_switch=0,
)
# So much is on a loaded line ahead of whatever the host sends.
_BACKLOG_CYCLES = 8_000 * CYCLES_PER_US
# The level at rest has settled so long after power-on.
_SETTLED_US = 400_000
_BYTE_US = 10_000_000 // BAUD
_UNUSED = Segment(duration_frames=0, target_ticks=(0, 0, 0, 0))
# A pulse begins within this of its frame's start, which telemetry tells to better than 2 ms.
_EARLY_CYCLES = 2_000 * CYCLES_PER_US


@dataclass(frozen=True, slots=True)
class FramePulses:
    """What the pins showed in one servo frame; None where a servo had no pulse."""

    frame: int
    first_rise: int
    last_fall: int
    ticks: tuple[float | None, ...]


class Driver:
    """A session with a simulated UNO, and all that was seen on its pins."""

    def __init__(
        self, uno: Uno, *, session_id: int = 7, transport: AvrTransport | None = None
    ) -> None:
        self.uno = uno
        self.session_id = session_id
        self.session = Session(transport or AvrTransport(uno), session_id=session_id)
        self.events: list[Event] = []
        self._edges: list[Edge] = []
        self._samples: list[Sample] = []
        # The start of the board's frame 0, from above: nothing is told before it happens.
        self._origin: float | None = None
        self.session.subscribe(self._keep)

    def _keep(self, event: Event) -> None:
        self.events.append(event)
        if isinstance(event, TelemetryReceived):
            report = event.telemetry
            wire_us = _BYTE_US * (report.SIZE + BOARD_OVERHEAD_BYTES)
            origin = event.time_us - wire_us - report.phase_us - report.frame * SERVO_FRAME_US
            self._origin = origin if self._origin is None else min(self._origin, origin)

    # ------------------------------------------------------------------------- commands

    def open(self) -> None:
        """Open the session, and let the board play everything it can."""
        self.session.open()
        self.session.request(WIDE_LIMITS)
        self.session.run_for(2 * SERVO_FRAME_US)

    def enable(self, ticks: Ticks) -> None:
        """Attach the servos, and wait until they all are."""
        self.session.request(Enable(pulse_ticks=ticks))
        self.wait_for(State.HOLDING)

    def wait_for(self, state: State, timeout_us: int = 2_000_000) -> None:
        """Wait until the board shows a state."""
        self.session.run_until(lambda: self.session.state is state, timeout_us, what=state.name)

    def queue(self, targets: Sequence[Ticks], *, frames_each: int = 1) -> list[Ticket]:
        """Send straight segments without waiting."""
        tickets = []
        for first in range(0, len(targets), SEGMENTS_PER_MESSAGE):
            part = targets[first : first + SEGMENTS_PER_MESSAGE]
            slots = [Segment(duration_frames=frames_each, target_ticks=ticks) for ticks in part]
            a, b, c, d, e = slots + [_UNUSED] * (SEGMENTS_PER_MESSAGE - len(part))
            tickets.append(
                self.session.send(
                    Segments(epoch=self.session.epoch, count=len(part), segments=(a, b, c, d, e))
                )
            )
        return tickets

    def play(self, targets: Sequence[Ticks], *, frames_each: int = 1) -> None:
        """Play straight segments to their end."""
        tickets = self.queue(targets, frames_each=frames_each)
        longest_us = len(targets) * frames_each * SERVO_FRAME_US + 2_000_000
        self.session.run_until(lambda: all(ticket.done for ticket in tickets), longest_us)
        self.session.run_for(2 * SERVO_FRAME_US)
        self.session.run_until(lambda: self.session.state is State.HOLDING, longest_us)

    def guard(self, threshold_hpa: float, *, deadline_frames: int = 1000) -> None:
        """Start a guarded move whose reflex is to hold."""
        settled = _SETTLED_US - self.session.now_us
        if settled > 0:
            self.session.run_for(settled)
        self.session.request(
            GuardMessage(
                epoch=self.session.epoch,
                threshold_raw=round(threshold_hpa * PRESSURE_LSB_PER_HPA),
                consecutive=1,
                deadline_frames=deadline_frames,
                reflex=Reflex.HOLD,
                retract_ticks=(0, 0, 0, 0),
                retract_slew_ticks=1,
            )
        )

    def resume(self) -> None:
        """Leave stopped, tripped or fault."""
        self.session.request(Resume(epoch=self.session.epoch))
        self.wait_for(State.HOLDING)

    # ------------------------------------------------------------------- what was seen

    @property
    def reports(self) -> list[TelemetryReceived]:
        """All telemetry so far."""
        return [event for event in self.events if isinstance(event, TelemetryReceived)]

    @property
    def trips(self) -> list[Tripped]:
        """All trip records so far."""
        return [event for event in self.events if isinstance(event, Tripped)]

    @property
    def faults(self) -> list[FaultReported]:
        """All fault records so far."""
        return [event for event in self.events if isinstance(event, FaultReported)]

    @property
    def frame_zero_us(self) -> float:
        """When the board's frame 0 began; up to 1 ms too late."""
        assert self._origin is not None, "no telemetry yet"
        return self._origin

    def pulses(self) -> list[Pulse]:
        """All whole pulses at the pins since power-on."""
        self._edges += self.uno.edges()
        return pulses(self._edges)

    def forget(self) -> None:
        """Drop the edges and samples so far, to keep long runs fast."""
        self._edges += self.uno.edges()
        last = {edge.servo: edge for edge in self._edges}
        self._edges = [edge for edge in last.values() if edge.level]  # their pulses still run
        self.uno.samples()
        self._samples.clear()

    def samples(self) -> list[Sample]:
        """All samples that the sensor took."""
        self._samples += self.uno.samples()
        return self._samples

    def frames(self) -> list[FramePulses]:
        """What the pins showed, frame by frame, as the board's telemetry counts them.

        The frame that still runs is left out.
        """
        origin = self.frame_zero_us * CYCLES_PER_US - _EARLY_CYCLES
        found: dict[int, list[Pulse]] = {}
        for pulse in self.pulses():
            found.setdefault(int((pulse.rise - origin) // FRAME_CYCLES), []).append(pulse)
        frames = []
        for number, inside in sorted(found.items()):
            if origin + (number + 1) * FRAME_CYCLES > self.uno.cycle:
                break
            ticks: list[float | None] = [None] * SERVOS
            for pulse in inside:
                assert ticks[pulse.servo] is None, f"two pulses of {pulse.servo} in frame {number}"
                ticks[pulse.servo] = pulse.width / CYCLES_PER_TICK
            frames.append(
                FramePulses(
                    frame=number,
                    first_rise=min(pulse.rise for pulse in inside),
                    last_fall=max(pulse.rise + pulse.width for pulse in inside),
                    ticks=tuple(ticks),
                )
            )
        return frames


class Load:
    """Keeps the line full in both directions, while the session waits.

    Questions for the limits fill the way back. The rest of the way there are
    pings of another session: the board decodes them and drops them.
    """

    def __init__(self, driver: Driver) -> None:
        self._uno = driver.uno
        self._foreign = encode_host(Ping(token=0x01020304), session=driver.session_id + 1)
        question = encode_host(ReadLimits(token=0), session=driver.session_id)
        self._filler = question + 3 * self._foreign
        driver.session.pollables.append(self)

    def poll(self, now_us: int) -> None:
        """Put more on the line."""
        del now_us
        while self._uno.line_free < self._uno.cycle + _BACKLOG_CYCLES:
            self._uno.send(self._filler)

    def fill_until(self, cycle: int, *, leave_bytes: int) -> None:
        """Put so much more on the line that a frame of that size passes at that cycle."""
        room = (cycle - self._uno.line_free) // (_BYTE_US * CYCLES_PER_US) - leave_bytes
        assert room >= 0, "there is more on the line already"
        for part in (self._filler, self._foreign, bytes(1)):
            self._uno.send(part * (room // len(part)))
            room %= len(part)


def first_still(frames: Sequence[FramePulses]) -> FramePulses:
    """Return the first frame of the still ones at the end: it repeats the frame before it."""
    still = len(frames) - 1
    while frames[still - 1].ticks == frames[-1].ticks:
        still -= 1
    return frames[still + 1]


def ramp(start: Ticks, end: Ticks, count: int) -> list[Ticks]:
    """Points of a straight line in pulse space, without its start."""

    def point(index: int) -> Ticks:
        a, b, c, d = (
            first + (last - first) * index // count for first, last in zip(start, end, strict=True)
        )
        return (a, b, c, d)

    return [point(index) for index in range(1, count + 1)]
