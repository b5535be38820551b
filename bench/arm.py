"""How fast the host notices a dead arm, and how fast a contact stops a living one."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable

from bench.figure import Figure
from tests.ur.controller import FakeController, controller

from setae import rig
from setae.config import load
from setae.errors import ArmFrozenError
from setae.link.events import Event, Tripped
from setae.scene import Obstacle, tube_scene
from setae.ur import UrStage

FREEZES = 10
CONTACTS = 5
_POLL_S = 0.005


def freeze_detect_ms(fake: FakeController) -> float:
    """From the controller's freeze to the error, in mid-move, polled as a session does."""
    with UrStage(fake.url, load()) as stage:
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


def contact_to_arm_stop_ms(fake: FakeController) -> float:
    """From the trip's arrival at the host to the arm's rest."""
    config = load()
    config = dataclasses.replace(config, tube=dataclasses.replace(config.tube, cube_edge_mm=69.0))
    scene = tube_scene(config, Obstacle(below_tip_mm=30, edge_mm=69.0))
    assert scene.box is not None
    below = dataclasses.replace(scene.box, centre_mm=(0.0, 0.0, scene.box.centre_mm[2]))
    tripped_s: list[float] = []

    def note(event: Event) -> None:
        if isinstance(event, Tripped):
            tripped_s.append(time.monotonic())

    with rig.open(
        "sim://",
        config=config,
        scene=dataclasses.replace(scene, box=below),
        stage=fake.url,
        leave="hold",  # the bristle still touches
    ) as opened:
        robot, stage = opened.robot, opened.stage
        robot.session.subscribe(note)
        robot.enable()
        robot.compress(config.explore.compressed_length_mm)
        robot.hold_guarded(
            begin=lambda: stage.move_to((0, 0, -100)),
            busy=lambda: stage.moving,
            abort=stage.stop,
            timeout_s=10,
        )
        robot.wait(lambda: not stage.moving, timeout_s=10, what="the arm to rest")
        return 1000 * (time.monotonic() - tripped_s[0])


def figures() -> Iterable[Figure]:
    """Against the stand-in for the controller, in real time."""
    worst_ms = 0.0
    for _ in range(FREEZES):
        with controller() as fake:
            worst_ms = max(worst_ms, freeze_detect_ms(fake))
    yield Figure(
        "ur_freeze_detect_ms_max",
        round(worst_ms, 1),
        "ms",
        f"the stand-in controller frozen in mid-move, to the error; {FREEZES} times",
    )
    rests = []
    for _ in range(CONTACTS):
        with controller() as fake:
            rests.append(contact_to_arm_stop_ms(fake))
    config = load().stage
    yield Figure(
        "contact_to_arm_stop_ms_max",
        round(max(rests), 1),
        "ms",
        "simulated robot on the stand-in controller: from the contact's record at the host to"
        f" the arm at rest, from {config.speed_mm_s:g} mm/s at {config.acceleration_mm_s2:g}"
        f" mm/s2 ({1000 * config.speed_mm_s / config.acceleration_mm_s2:g} ms of it are braking);"
        f" {CONTACTS} times",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {"arm": figures}
