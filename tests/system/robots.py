"""Robots for tests: the simulated one, with hands on its line and its world."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from tests.avr.robot import WorldTransport
from tests.avr.simavr import Uno

from setae.config import Config, load
from setae.link.events import Event, TelemetryReceived
from setae.link.lossy import Faults, LossyTransport
from setae.link.session import Session
from setae.robot import Robot
from setae.scene import Obstacle, TubeScene, tube_scene
from setae.sim import SensorFault, SimTransport, SimulatedStage, World, add_solid

# The board of those tests that name none: "avr" for the one of `bench`, `compressed`.
BACK_END_VARIABLE = "SETAE_TEST_BACK_END"
# Deep enough, in every direction that matters here, for a probe to find it.
WALL_AHEAD = Obstacle(below_tip_mm=1.0)


def run_world(world: World, duration_s: float) -> None:
    """Let time pass with no host listening."""
    end_us = world.now_us + round(duration_s * 1e6)
    while world.now_us < end_us:
        world.run(end_us)


@dataclass
class Bench:
    """A robot and all that a test may look at or meddle with."""

    robot: Robot
    stage: SimulatedStage
    line: LossyTransport
    world: World
    uno: Uno | None = None
    reports: list[TelemetryReceived] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    _hooks: list[Callable[[int], None]] = field(default_factory=list)

    def poll(self, now_us: int) -> None:
        for hook in tuple(self._hooks):
            hook(now_us)

    def at(self, time_us: int, act: Callable[[], object]) -> None:
        """Do something once, at a time, from within the session's loop."""

        def hook(now_us: int) -> None:
            if now_us >= time_us:
                self._hooks.remove(hook)
                act()

        self._hooks.append(hook)

    def pulses_us(self) -> npt.NDArray[np.float64]:
        """What the board puts out now."""
        return self.world.truth().pulse_us

    def reset_board(self) -> None:
        """Press the board's reset button."""
        if self.uno is None:
            self.world.reset_board()
        else:
            self.uno.press_reset()

    def silence_sensor(self, silent: bool = True) -> None:
        """Let the sensor answer, but measure nothing."""
        if self.uno is None:
            self.world.sensor_fault(SensorFault.SILENT if silent else SensorFault.NONE)
        else:
            self.uno.set_sensor_silent(silent)

    def open_stop_switch(self, is_open: bool = True) -> None:
        """Open or close the switch on D4."""
        if self.uno is None:
            self.world.stop_switch(is_open=is_open)
        else:
            self.uno.close_stop_switch(not is_open)

    def run_without_host(self, duration_s: float) -> None:
        """Let time pass with nobody listening, the line closed or not."""
        if not isinstance(self.line.inner, WorldTransport):
            run_world(self.world, duration_s)
            return
        end_us = self.line.now_us() + round(duration_s * 1e6)
        while self.line.now_us() < end_us:
            self.line.inner.advance(end_us)

    def run(self, duration_s: float) -> None:
        self.robot.session.run_for(round(duration_s * 1e6))


@contextmanager
def bench(
    *,
    seed: int = 1,
    obstacle: Obstacle | None = None,
    scene: TubeScene | None = None,
    down: Faults | None = None,
    up: Faults | None = None,
    parameters: Mapping[str, float] | None = None,
    config: Config | None = None,
    back_end: str | None = None,
) -> Iterator[Bench]:
    """A connected robot, relaxed, in a world of its own: the tube, or another scene.

    `back_end` "avr": its board is the built firmware in the simulated UNO.
    """
    config = config or load()
    back_end = back_end or os.environ.get(BACK_END_VARIABLE, "sim")
    scene = scene or tube_scene(config, obstacle)
    with World(seed=seed, parameters={**dict(config.simulator), **(parameters or {})}) as world:
        for solid in scene.solids:
            add_solid(world, solid)
        world.start()
        uno = Uno() if back_end == "avr" else None
        line = LossyTransport(
            WorldTransport(uno, world) if uno else SimTransport(world),
            seed=seed, down=down or Faults(), up=up or Faults(),
        )  # fmt: skip
        session = Session(line, session_id=7)
        robot = Robot(session, config)
        made = Bench(robot, SimulatedStage(world, config.stage), line, world, uno)
        session.pollables.append(made)

        def note(event: Event) -> None:
            made.events.append(event)
            if isinstance(event, TelemetryReceived):
                made.reports.append(event)

        session.subscribe(note)
        session.open()
        robot.prepare()
        try:
            yield made
        finally:
            if uno is not None:
                uno.close()


@contextmanager
def compressed(
    *,
    seed: int = 1,
    obstacle: Obstacle | None = None,
    down: Faults | None = None,
    up: Faults | None = None,
    config: Config | None = None,
    back_end: str | None = None,
) -> Iterator[Bench]:
    """The same, enabled and compressed to 45 mm."""
    with bench(
        seed=seed, obstacle=obstacle, down=down, up=up, config=config, back_end=back_end
    ) as made:
        # An UNO that was just switched on does not know its pose.
        made.robot.enable(accept_jump=True)
        made.robot.compress(45.0)
        yield made
