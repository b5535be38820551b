"""The link behind a USB chip: how well the board's time is known, and what is sent again.

A UNO's own chip takes a millisecond down and hands over what comes up every four. An
FTDI chip, as on many clones, does so every 16. The resonator is up to 0.5 % off, and
the host stands still for 0.6 s now and then.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from setae.link.events import Event, TelemetryReceived
from setae.link.session import Session
from setae.link.transport import Transport
from setae.sim import SimTransport, World
from setae_protocol.messages import SERVO_FRAME_US, Disarm

SECOND_US = 1_000_000
CHIPS_US = {"16U2": 4_000, "FTDI": 16_000}
STALL_US = 600_000


class Stalling:
    """A host that reads nothing for a while; the bytes then come at once, stamped late."""

    simulated = True

    def __init__(self, inner: Transport) -> None:
        self.name = inner.name
        self.now_us = inner.now_us
        self.send = inner.send
        self.close = inner.close
        self.stall_now = False
        self._inner = inner

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        if not self.stall_now:
            return self._inner.receive(deadline_us)
        self.stall_now = False
        end_us = self.now_us() + STALL_US
        data = b""
        while (item := self._inner.receive(end_us)) is not None:
            data += item[0]
        return data, self.now_us()


@dataclass
class Watch:
    """How wrong the clock is, against the simulator's own time."""

    session: Session
    rate_ppm: int
    beyond_bound_us: list[float] = field(default_factory=list)
    bounds_us: list[float] = field(default_factory=list)

    def on_event(self, event: Event) -> None:
        if not isinstance(event, TelemetryReceived) or not self.session.engine.is_open:
            return
        board_us = event.telemetry.frame * SERVO_FRAME_US + event.telemetry.phase_us
        true_us = board_us / (1 + 1e-6 * self.rate_ppm)
        estimate = self.session.clock
        bound_us = estimate.uncertainty_at_us(board_us)
        self.bounds_us.append(bound_us)
        self.beyond_bound_us.append(abs(estimate.to_host_us(board_us) - true_us) - bound_us)


@pytest.mark.parametrize("rate_ppm", [-5_000, 0, 5_000])
@pytest.mark.parametrize("chip", CHIPS_US)
def test_the_clock_keeps_its_bound_and_nothing_is_sent_twice(chip: str, rate_ppm: int) -> None:
    parameters = {
        "line.down_latency_us": 1_000,
        "line.up_flush_us": CHIPS_US[chip],
        "board.clock_rate_ppm": rate_ppm,
    }
    with World(seed=1, parameters=parameters) as world:
        world.start()
        line = Stalling(SimTransport(world))
        session = Session(line, session_id=7)
        watch = Watch(session, rate_ppm)
        session.subscribe(watch.on_event)
        session.open()
        for step in range(200):
            for _ in range(1 if step % 3 else 6):  # alone, and more than the window takes
                session.send(Disarm(reserved=0))
            line.stall_now = step % 40 == 20
            session.run_for(100_000)
        assert max(watch.beyond_bound_us) <= 0
        assert watch.bounds_us[0] < 25_000, "from the first report on"
        assert watch.bounds_us[-1] < 4_000, "after twenty seconds"
        statistics = session.engine.statistics
        assert statistics.frames_sent > 500
        assert (statistics.frames_retransmitted, statistics.timeouts) == (0, 0)
