"""Driving the stage on a stand-in: both live in real time, so a test waits for what happens."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from tests.ur.controller import FakeController, patient

from setae import rig
from setae.config import Config, load
from setae.errors import ArmStoppedError
from setae.ur import UrStage
from setae_protocol.messages import State

TIMEOUT_S = 60.0
NEAR_MM = 0.3
_LOOK_S = 0.005


def with_ur(**changes: Any) -> Config:
    config = load()
    return dataclasses.replace(config, ur=dataclasses.replace(patient(config.ur), **changes))


@contextmanager
def connected(fake: FakeController, **changes: Any) -> Iterator[UrStage]:
    with UrStage(fake.url, with_ur(**changes)) as stage:
        yield stage


def wait_until(done: Callable[[], bool], *, between: Callable[[], object] = bool) -> None:
    """Wait for what another process or thread does; nobody else could tell."""
    end_s = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end_s, "did not happen"
        between()
        time.sleep(_LOOK_S)


def poll_until(stage: UrStage, done: Callable[[], bool]) -> None:
    """Poll as a session does, every few milliseconds of the controller's real time."""
    wait_until(done, between=lambda: stage.poll(0))


def far_on_its_way(stage: UrStage) -> bool:
    return stage.position_mm[2] < -5


def ends_by_a_pressed_stop(
    fake: FakeController, opened: rig.Rig, when: Callable[[], bool], run: Callable[[], object]
) -> None:
    """Press Stop once `when` is so, and see that `run` ends and nothing moves by itself."""
    told = fake.told()

    def look(_: object) -> None:
        if when():
            fake.tell("stop_program")
            told.update(fake.told())

    opened.robot.session.subscribe(look)
    with pytest.raises(ArmStoppedError, match="stopped or paused at the controller"):
        run()
    assert opened.robot.state is State.STOPPED
    assert told["move"]
    assert fake.told() == told, "it moved, or its program runs again"
