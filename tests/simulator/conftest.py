"""A driver that puts pulses on the simulated robot through the board's own protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import pytest

from setae.link.events import Event, TelemetryReceived
from setae.link.session import Session
from setae.sim import SimTransport, Truth, World
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    Enable,
    Segment,
    Segments,
    SetLimits,
    State,
)

Array = npt.NDArray[np.float64]

FREE_US = 850.0
US_PER_MM = 2000.0 / 180.0 / (np.pi / 180.0 * 35.0)
FREE_MM = 70.0
TENDON_RADIUS_MM = 8.3
QUIET = {
    "sensor.noise_hpa": 0.0,
    "sensor.drift_hpa_per_sqrt_s": 0.0,
}

# Whatever the servos can take: these tests look at the plant, not at the board's limits.
_WIDE = SetLimits(
    pulse_min_ticks=(1000,) * 4,
    pulse_max_ticks=(5000,) * 4,
    slew_ticks=4000,
    pair_sum_min_ticks=(0, 0),
    pair_sum_max_ticks=(10000, 10000),
    pair_difference_min_ticks=(-4000, -4000),
    pair_difference_max_ticks=(4000, 4000),
    coarse_threshold_raw=0,
    hold_timeout_s=0,
    stop_switch=0,
)
_EMPTY = Segment(duration_frames=0, target_ticks=(0, 0, 0, 0))


def arc_lengths_mm(position_mm: Sequence[float]) -> Array:
    """Offset fibres of the constant-curvature arc to a position of U, (4,)."""
    x, y, z = position_mm
    rho = np.hypot(x, y)
    bend = 2 * np.arctan2(rho, z)
    length = np.hypot(rho, z) * (1.0 if bend < 1e-9 else 0.5 * bend / np.sin(0.5 * bend))
    angles = np.radians([0, 90, 180, 270])
    return np.asarray(length - TENDON_RADIUS_MM * bend * np.cos(angles - np.arctan2(y, x)))


def ticks(lengths_mm: Array) -> tuple[int, int, int, int]:
    """Pulses for tendon lengths."""
    a, b, c, d = (
        round(2 * (FREE_US + US_PER_MM * (FREE_MM - length))) for length in lengths_mm.tolist()
    )
    return (a, b, c, d)


class Driver:
    """A started world with its servos on, at the free length."""

    def __init__(self, world: World, *, enable: bool = True) -> None:
        self.world = world
        self.session = Session(SimTransport(world), session_id=7)
        self.samples: list[tuple[int, float]] = []  # time, pressure in hPa
        self.lengths_mm = np.full(4, FREE_MM)
        self.session.subscribe(self._keep)
        self.session.open()
        self.session.request(_WIDE)
        if enable:
            self.session.request(Enable(pulse_ticks=ticks(self.lengths_mm)))
            self.session.run_until(lambda: self.session.state is State.HOLDING, 2_000_000)

    def _keep(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            message = event.telemetry
            self.samples.extend(
                (self.world.now_us - sample.age_us, sample.pressure_raw / PRESSURE_LSB_PER_HPA)
                for sample in message.samples[: message.sample_count]
            )

    def pressures_hpa(self, start: int = 0) -> Array:
        """All samples that telemetry brought from number `start` on."""
        return np.array([pressure for _, pressure in self.samples[start:]])

    def play(self, targets: Sequence[tuple[int, int, int, int]], frames_each: int = 1) -> None:
        """Play pulses, in ticks, as straight segments; wait for the end."""
        segments = [Segment(duration_frames=frames_each, target_ticks=target) for target in targets]
        tickets = []
        for first in range(0, len(segments), 5):
            part = segments[first : first + 5]
            a, b, c, d, e = part + [_EMPTY] * (5 - len(part))
            tickets.append(
                self.session.send(
                    Segments(epoch=self.session.epoch, count=len(part), segments=(a, b, c, d, e))
                )
            )
        self.session.run_until(
            lambda: all(ticket.done for ticket in tickets),
            len(segments) * frames_each * 20_000 + 2_000_000,
        )
        self.session.run_for(40_000)  # so that telemetry shows the motion it started
        self.session.run_until(
            lambda: self.session.state is State.HOLDING,
            len(segments) * frames_each * 20_000 + 2_000_000,
        )

    def pull(
        self, lengths_mm: npt.ArrayLike, duration_s: float = 0.5, rest_s: float = 0.3
    ) -> Truth:
        """Move smoothly to tendon lengths, let the robot come to rest, and look."""
        start = self.lengths_mm
        self.lengths_mm = np.broadcast_to(np.asarray(lengths_mm, dtype=float), (4,)).copy()
        u = np.linspace(0, 1, max(2, round(duration_s / 0.02)) + 1)[1:]
        blend = u**3 * (10 - 15 * u + 6 * u**2)
        self.play([ticks(start + f * (self.lengths_mm - start)) for f in blend])
        self.wait(rest_s)
        return self.world.truth()

    def reach(self, position_mm: Sequence[float], duration_s: float = 0.5) -> Truth:
        """Like `pull`, to the lengths that the constant-curvature arc to a position has."""
        return self.pull(arc_lengths_mm(position_mm), duration_s)

    def wait(self, duration_s: float) -> None:
        """Let time pass, with the link alive."""
        self.session.run_for(round(1e6 * duration_s))


MakeDriver = Callable[..., Driver]


@pytest.fixture
def make_driver() -> Iterator[MakeDriver]:
    """Make drivers, each with a world of its own; they are closed at the end."""
    worlds: list[World] = []

    def make(
        parameters: Mapping[str, float] | None = None,
        *,
        seed: int = 1,
        setup: Callable[[World], object] | None = None,
        enable: bool = True,
    ) -> Driver:
        world = World(seed=seed, parameters={**QUIET, **(parameters or {})})
        worlds.append(world)
        if setup is not None:
            setup(world)
        world.start()
        return Driver(world, enable=enable)

    yield make
    for world in worlds:
        world.close()


@pytest.fixture
def driver(make_driver: MakeDriver) -> Driver:
    """A driver of the default robot, without noise."""
    return make_driver()
