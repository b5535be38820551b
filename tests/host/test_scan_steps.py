"""What a step of a scan makes of what robot and arm answer: no board, no time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from setae.config import load, replaced
from setae.contact import Contact
from setae.errors import RefusedError, TrippedError
from setae.experiments.events import Event
from setae.experiments.scan.steps import Steps
from setae.link.events import TelemetryReceived
from setae.robot import Approach, Robot
from setae.stage import Stage
from setae_protocol.messages import PRESSURE_LSB_PER_HPA, Guard

CONFIG = load()
SHORT_MM, LONG_MM = CONFIG.scan_lengths_mm
TIP_MM = 110.0  # below the arm, where it touches


def contact(length_mm: float = TIP_MM - CONFIG.geometry.tip_offset_mm) -> Contact:
    return Contact(
        position_mm=(0.0, 0.0, length_mm),
        tip_mm=(0.0, 0.0, TIP_MM),
        lengths_mm=(length_mm,) * 4,
        uncertainty_mm=4.0,
        pressure_hpa=20.0,
        baseline_hpa=0.0,
        time_us=0,
        cause="contact",
    )


class Answering:
    """Robot and arm in one: each extension or guarded step answers as it was told to.

    An answer is the pressures that the board tells meanwhile, and what comes out.
    """

    def __init__(self, *answers: tuple[Sequence[float], Contact | Exception | None]) -> None:
        self.config = CONFIG
        self.session = self
        self.now_us = 0
        self.position_mm = (0.0, 0.0, 0.0)
        self.moving = False
        self.answers = list(answers)
        self.on_the_way_hpa: Sequence[float] = ()
        self.in_the_way: Exception | None = None
        self.resumed = 0
        self.pose = SimpleNamespace(length_mm=SHORT_MM)
        self._listener: Callable[[Any], object] = print

    def subscribe(self, listener: Callable[[Any], object]) -> Callable[[], None]:
        self._listener = listener
        return lambda: None

    def probe(
        self, to_mm: Sequence[float], *, speed_mm_s: float, retract_mm: Sequence[float],
        approach: Approach | None,
    ) -> Contact | None:  # fmt: skip
        del speed_mm_s
        if approach is not None:
            approach.begin()
            self._tell(self.on_the_way_hpa)
            assert approach.busy()
            self.moving = False
            assert not approach.busy()
        pressures_hpa, outcome = self.answers.pop(0)
        self._tell(pressures_hpa)
        if isinstance(outcome, Exception):
            raise outcome
        self.pose.length_mm = (to_mm if outcome is None else retract_mm)[2]
        return outcome

    def compress(self, length_mm: float, *, speed_mm_s: float) -> None:
        del speed_mm_s
        if self.in_the_way is not None:
            error, self.in_the_way = self.in_the_way, None
            raise error
        self.pose.length_mm = length_mm

    def resume(self) -> None:
        self.resumed += 1

    def move_to(self, position_mm: tuple[float, float, float]) -> None:
        self.position_mm, self.moving = position_mm, True

    def stop(self) -> None:
        raise AssertionError("nothing is wrong")

    def _tell(self, pressures_hpa: Sequence[float]) -> None:
        for hpa in pressures_hpa:
            sample = SimpleNamespace(pressure_raw=round(hpa * PRESSURE_LSB_PER_HPA))
            telemetry = SimpleNamespace(
                guard=Guard.ARMED, baseline_raw=0, sample_count=1, samples=[sample]
            )
            self._listener(TelemetryReceived(cast(Any, telemetry), *(cast(Any, None),) * 4))


def steps_of(answering: Answering, events: list[Event] | None = None, **settings: float) -> Steps:
    return Steps(
        cast(Robot, answering),
        cast(Stage, answering),
        replaced(CONFIG, {f"scan.{name}": value for name, value in settings.items()}),
        on_event=None if events is None else events.append,
    )


@pytest.mark.parametrize("depth_mm", [0.0, 2.5])
def test_the_depth_of_a_contact_is_added_to_every_height(depth_mm: float) -> None:
    # Left out it was within what scans of the simulator are held to.
    feeling = steps_of(Answering(((), contact())), contact_depth_mm=depth_mm).feel()
    assert feeling is not None
    assert feeling.height_mm == pytest.approx(-TIP_MM + depth_mm)


@pytest.mark.parametrize(("rise_hpa", "mark"), [(5.0, "empty"), (12.0, "lost")])
def test_what_is_touched_and_slid_off_without_a_contact_is_lost(rise_hpa: float, mark: str) -> None:
    feeling = steps_of(Answering(((0.0, rise_hpa, 0.0), None))).feel()
    assert feeling is not None
    assert feeling.mark == mark


def test_what_is_grazed_on_the_way_is_no_slip_of_the_place() -> None:
    answering = Answering(((0.0, 16.0), contact()))
    answering.on_the_way_hpa = (0.0, 12.0, 0.0)
    feeling = steps_of(answering).go_and_feel(10.0, 0.0)
    assert feeling is not None
    assert feeling.mark == "felt"


def test_a_robot_in_touch_retracts_and_says_so_and_a_short_one_gives_up() -> None:
    refusal = RefusedError("tare_far")
    answering, events = Answering(((), refusal)), list[Event]()
    steps = steps_of(answering, events)
    answering.pose.length_mm = SHORT_MM + 20
    assert steps.feel() is None
    assert steps.short
    assert [event.name for event in events] == ["in_touch"]
    for length_mm, error in ((SHORT_MM, refusal), (SHORT_MM + 20, RefusedError("tare_noisy"))):
        answering.answers.append(((), error))
        answering.pose.length_mm = length_mm
        with pytest.raises(RefusedError, match=error.reason):
            steps.feel()


def test_a_surface_that_is_higher_than_it_was_said_to_be_only_shortens_the_robot() -> None:
    answering = Answering()
    answering.in_the_way = TrippedError("The bristle touched something.")
    steps = steps_of(answering)
    answering.pose.length_mm = SHORT_MM + 5
    steps.lower(SHORT_MM + 20)
    assert answering.resumed == 1
    assert steps.short
