"""The board as the robot sees it: its latest reports, and waits that raise what went wrong."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import IntEnum

from setae.errors import (
    DeadlineError,
    FaultError,
    RefusedError,
    StoppedError,
    TrippedError,
)
from setae.link.events import (
    Event,
    FaultReported,
    StatusReceived,
    TelemetryReceived,
    Ticket,
    Tripped,
)
from setae.link.session import Session, refused_error
from setae.servo import Ticks, segment_messages
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    SERVO_FRAME_US,
    HostMessage,
    Refusal,
    Segment,
    State,
    Status,
    Telemetry,
    TripCause,
)

REPLY_S = 2.0
"""What an answer may take beyond the motion itself, the link's retries included."""

_AFTER_FAULT = "Then call resume(), or give `setae enable`."
# What the board has of a motion, in servo frames: a second, which it goes on without the host.
_AHEAD_FRAMES = 50


class Board:
    """Keeps what the board last told, and turns its records into errors.

    Parameters
    ----------
    session
        Open session with the board.

    Attributes
    ----------
    trip, fault
        Record of this session that nobody has resumed from; None without.
    pressure_hpa
        Latest sample of the bristle's sensor; None before the first.
    status
        Latest of supply, EEPROM, stop switch and counters; None before the first.
    """

    def __init__(self, session: Session) -> None:
        self.trip: Tripped | None = None
        self.fault: FaultReported | None = None
        self.pressure_hpa: float | None = None
        self.status: Status | None = None
        # Of any session: why the board is tripped or in fault, where it is.
        self._last_trip: Tripped | None = None
        self._last_fault: FaultReported | None = None
        self._session = session
        self._report: TelemetryReceived | None = None
        self._tickets: list[Ticket] = []
        session.subscribe(self._on_event)

    @property
    def state(self) -> State:
        """What the board does."""
        return self._session.state

    @property
    def epoch(self) -> int:
        """What motions have to name for the board to take them."""
        return self._session.epoch

    @property
    def reported(self) -> bool:
        """Whether there is any telemetry yet."""
        return self._report is not None

    @property
    def telemetry(self) -> Telemetry:
        """The latest report."""
        if self._report is None:
            raise DeadlineError("The board has not reported yet.", "Call prepare() first.")
        return self._report.telemetry

    def forget_records(self) -> None:
        """Trip and fault were seen; from now on only new ones count."""
        self.trip = self.fault = None

    def send(self, message: HostMessage, *, watch: bool = True) -> Ticket:
        """Send a command; `watch`: its refusal ends the next wait with an error."""
        ticket = self._session.send(message)
        # A refusal stays until it is told.
        self._tickets = [
            known for known in self._tickets if not known.done or known.refusal is not None
        ]
        if watch:
            self._tickets.append(ticket)
        return ticket

    def request(self, message: HostMessage, *, watch: bool = True) -> None:
        """Send a command and wait until the board has carried it out."""
        ticket = self.send(message, watch=False)
        self.wait(lambda: ticket.done, REPLY_S, f"the board to take `{name_of(message.TYPE)}`",
                   watch=watch)  # fmt: skip
        if ticket.refusal is not None:
            raise refused_error(ticket.refusal)

    def at_rest(self, ticks: Ticks) -> bool:
        """Whether the board holds at these pulses, with nothing left to play."""
        telemetry = self.telemetry
        return (
            self.state is State.HOLDING and telemetry.queued == 0 and telemetry.pulse_ticks == ticks
        )

    def play(self, segments: Sequence[Segment], duration_s: float) -> None:
        """Have the board play segments, and wait until it has."""
        if not segments:
            return
        final = segments[-1].target_ticks
        play = self.playing(segments)
        self.wait(lambda: play() and self.at_rest(final), duration_s + REPLY_S, "the move to end")

    def playing(self, segments: Sequence[Segment]) -> Callable[[], bool]:
        """Make what hands segments to the link, call after call; True once all are.

        The board holds fifty, which may be many seconds. It gets them about a second
        ahead, so that it soon holds if the host dies.
        """
        waiting = deque(segment_messages(segments, epoch=self.epoch, max_frames=_AHEAD_FRAMES // 2))
        begin_us = self._session.now_us
        sent_us = 0

        def play() -> bool:
            nonlocal sent_us
            while waiting:
                frames = sum(part.duration_frames for part in waiting[0].segments)
                ahead_us = sent_us - (self._session.now_us - begin_us)
                if ahead_us + frames * SERVO_FRAME_US > _AHEAD_FRAMES * SERVO_FRAME_US:
                    return False
                sent_us += frames * SERVO_FRAME_US
                self.send(waiting.popleft())
            return True

        return play

    def wait(
        self,
        done: Callable[[], bool],
        timeout_s: float,
        what: str,
        *,
        trips: bool = False,
        watch: bool = True,
    ) -> None:
        """Wait in the session's loop.

        Parameters
        ----------
        trips
            A trip is what `done` looks for; otherwise it is an error.
        watch
            Whether a stop, trip or fault ends the wait with its error.
        """

        def settled() -> bool:
            if watch:
                self._raise_problem(trips=trips)
            return done()

        try:
            self._session.run_until(settled, round(timeout_s * 1e6))
        except DeadlineError:
            raise DeadlineError(
                f"Waited {timeout_s:.1f} s for {what}; the board is {name_of(self.state)}.",
                "Look at the robot; `setae doctor` checks the board.",
            ) from None

    def _raise_problem(self, *, trips: bool) -> None:
        for ticket in self._tickets:
            if ticket.refusal is not None:
                self._tickets.clear()
                raise refused_error(ticket.refusal)
        if self.state is State.STOPPED:
            raise StoppedError("The robot is stopped.")
        if self.fault is not None:
            raise _fault(self.fault)
        if self.trip is not None and not trips:
            raise _trip_error(self.trip)

    def require_holding(self) -> None:
        """Raise what keeps the robot from moving."""
        state = self.state
        if state is State.HOLDING:
            return
        if state is State.RELAXED:
            raise RefusedError(
                "not_enabled", Refusal.NOT_ENABLED.remedy, command="the motion",
                detail="The servos have no pulses.",
            )  # fmt: skip
        if state is State.STOPPED:
            raise StoppedError("The robot is stopped.")
        if state is State.TRIPPED:
            raise (
                TrippedError("The robot is tripped: the bristle touched something.")
                if (self._last_trip is None)
                else _trip_error(self._last_trip)
            )
        if state is State.FAULT:
            raise (
                FaultError("unknown", Refusal.FAULT.remedy)
                if (self._last_fault is None)
                else _fault(self._last_fault)
            )
        raise RefusedError("busy", "Wait for the motion to end.", command="the motion",
                           detail="The board is moving.")  # fmt: skip

    def _on_event(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self._report = event
            telemetry = event.telemetry
            if telemetry.sample_count:
                sample = telemetry.samples[telemetry.sample_count - 1]
                self.pressure_hpa = sample.pressure_raw / PRESSURE_LSB_PER_HPA
        elif isinstance(event, StatusReceived):
            self.status = event.status
        elif isinstance(event, Tripped):
            self._last_trip = event
            if not event.earlier:
                self.trip = event
        elif isinstance(event, FaultReported):
            self._last_fault = event
            if not event.earlier:
                self.fault = event

    def reflex_ended(self) -> bool:
        """Whether the board is tripped and its reflex is over."""
        # The latest report may be from before the trip.
        last = self._report
        return (
            last is not None and last.state is State.TRIPPED and not last.telemetry.reflex_running
        )

    def next_status(self) -> Status:
        """Wait for a status that was made after now."""
        before = self.status
        self.wait(lambda: self.status is not before, REPLY_S, "the board's status", watch=False)
        assert self.status is not None
        return self.status

    def stored(self) -> None:
        """Wait until nothing is being written to EEPROM."""
        before = self.status

        def done() -> bool:
            now = self.status
            return now is not None and now is not before and not now.storing

        self.wait(done, REPLY_S, "the board to store its limits")

    def next_report(self) -> None:
        """Wait for a report that was made after now."""
        before = self._report
        self.wait(lambda: self._report is not before, REPLY_S, "telemetry", watch=False)

    def pause(self, duration_s: float) -> None:
        """Let time pass. Ends early with a trip, which is no error here."""
        end_us = self._session.now_us + round(duration_s * 1e6)
        self.wait(
            lambda: self.trip is not None or self._session.now_us >= end_us,
            duration_s + REPLY_S,
            "time to pass",
            trips=True,
        )

    def host_time_us(self, frame: int, phase_us: int) -> int:
        """A board time on the session's clock."""
        return round(self._session.clock.to_host_us(frame * SERVO_FRAME_US + phase_us))


def name_of(code: IntEnum) -> str:
    """Name of a protocol code, as the schema writes it."""
    return code.name.lower()


def _fault(report: FaultReported) -> FaultError:
    fault = report.record.fault
    detail = fault.doc
    if report.record.further:
        detail += f" {report.record.further} more came before this one was read."
    return FaultError(name_of(fault), f"{fault.remedy} {_AFTER_FAULT}", detail=detail)


def _trip_error(trip: Tripped) -> TrippedError:
    record = trip.record
    change_hpa = (record.pressure_raw - record.baseline_raw) / PRESSURE_LSB_PER_HPA
    if record.cause == TripCause.DEADLINE:
        return TrippedError(
            "The guarded move passed its deadline and was frozen.",
            "Call resume(), or give `setae enable`, then try again with more time.",
        )
    return TrippedError(
        f"The bristle touched something ({change_hpa:+.1f} hPa) and the robot froze."
    )
