"""How fast the host notices a dead arm, and how fast a contact stops a living one."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterable

from bench.figure import Figure
from tests.ur.controller import FakeController, boxed, controller

from setae import rig
from setae.config import load
from setae.errors import ArmFrozenError
from setae.link.events import Event, Tripped
from setae.link.session import Session
from setae.robot import Robot
from setae.scene import Obstacle, tube_scene
from setae.sim import Follower, SimTransport, World, add_solid
from setae.ur import UrStage

FREEZES = 10
CONTACTS = 5
_POLL_S = 0.02  # a session's slice
_LOOK_US = 1000


def freeze_detect_ms(fake: FakeController) -> float:
    """From the controller's freeze to the error, in mid-move, polled as a session does."""
    config = load()
    with UrStage(fake.url, dataclasses.replace(config, ur=boxed(config.ur))) as stage:
        stage.move_to((0, 0, -80))
        while stage.position_mm[2] > -5:
            stage.poll(0)
            time.sleep(_POLL_S)
        fake.freeze()
        frozen_s = time.monotonic()
        try:
            while True:
                stage.poll(0)
                time.sleep(_POLL_S)
        except ArmFrozenError:
            return 1000 * (time.monotonic() - frozen_s)


class _TouchedWorld(World):
    """Notes when its bristle first touched something, in real time.

    It runs ahead of real time by a slice, and its line waits for the rest: so its time is real
    time and a constant, which the least of their differences is.
    """

    watched = False
    _behind_s = math.inf
    _touched_us: int | None = None

    def note_time(self, _: Event) -> None:
        """Compare the clocks; where the line has just waited."""
        self._behind_s = min(self._behind_s, time.monotonic() - self.now_us / 1e6)

    @property
    def touched_s(self) -> float:
        """By the monotonic clock."""
        assert self._touched_us is not None
        return self._touched_us / 1e6 + self._behind_s

    def run(self, until_us: int) -> bytes:
        """Step, and look each millisecond."""
        if not self.watched:
            return super().run(until_us)
        while True:
            data = super().run(min(until_us, self.now_us + _LOOK_US))
            if self._touched_us is None and self.truth().contact_depth_mm > 0:
                self._touched_us = self.now_us
            if data or self.now_us >= until_us:
                return data


def arm_stop_ms(fake: FakeController) -> tuple[float, float]:
    """To the arm's rest: from the trip's arrival at the host, and from the true touch."""
    config = load()
    config = dataclasses.replace(
        config,
        tube=dataclasses.replace(config.tube, cube_edge_mm=69.0),
        ur=boxed(config.ur),
    )
    scene = tube_scene(config, Obstacle(below_tip_mm=30, edge_mm=69.0))
    assert scene.box is not None
    below = dataclasses.replace(scene.box, centre_mm=(0.0, 0.0, scene.box.centre_mm[2]))
    tripped_s: list[float] = []

    def note(event: Event) -> None:
        if isinstance(event, Tripped):
            tripped_s.append(time.monotonic())

    world = _TouchedWorld(parameters=rig.simulator_parameters(config, 0))
    for solid in dataclasses.replace(scene, box=below).solids:
        add_solid(world, solid)
    world.start()
    with UrStage(fake.url, config) as stage:
        session = Session(
            SimTransport(world, speed=1.0), session_id=1, pollables=[stage, Follower(world, stage)]
        )
        session.open()
        with Robot(session, config, leave="hold") as robot:  # the bristle still touches
            robot.prepare()
            session.subscribe(note)
            robot.enable()
            robot.compress(config.explore.compressed_length_mm)
            world.watched = True
            session.subscribe(world.note_time)
            robot.hold_guarded(
                begin=lambda: stage.move_to((0, 0, -100)),
                busy=lambda: stage.moving,
                abort=stage.stop,
                timeout_s=10,
            )
            robot.wait(lambda: not stage.moving, timeout_s=10, what="the arm to rest")
            rest_s = time.monotonic()
    return 1000 * (rest_s - tripped_s[0]), 1000 * (rest_s - world.touched_s)


def figures() -> Iterable[Figure]:
    """Against the stand-in for the controller, in real time."""
    worst_ms = 0.0
    for _ in range(FREEZES):
        with controller() as fake:
            worst_ms = max(worst_ms, freeze_detect_ms(fake))
    stops = []
    for _ in range(CONTACTS):
        with controller() as fake:
            stops.append(arm_stop_ms(fake))
    yield Figure(
        "ur_freeze_detect_ms_max",
        round(worst_ms, 1),
        "ms",
        f"the stand-in controller frozen in mid-move, to the error, polled every"
        f" {1000 * _POLL_S:g} ms as by a session; {FREEZES} times",
    )
    from_record_ms, from_touch_ms = (max(column) for column in zip(*stops, strict=True))
    config = load().stage
    how = (
        f"to the arm at rest, from {config.speed_mm_s:g} mm/s at {config.acceleration_mm_s2:g}"
        f" mm/s2 ({1000 * config.speed_mm_s / config.acceleration_mm_s2:g} ms of it are braking);"
        f" {CONTACTS} times"
    )
    yield Figure(
        "contact_to_arm_stop_ms_max",
        round(from_record_ms, 1),
        "ms",
        f"simulated robot on the stand-in controller: from the contact's record at the host {how}",
    )
    yield Figure(
        "touch_to_arm_stop_ms_max",
        round(from_touch_ms, 1),
        "ms",
        "simulated robot on the stand-in controller: from the first true touch of the simulated"
        f" bristle, looked for every {_LOOK_US / 1000:g} ms, {how}",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {"arm": figures}
