"""From which change of pressure on the bristle touches something: moves without, then with.

A move makes pressure of its own: the bristle's mass swings, the sensor drifts and is
noisy. A touch presses the filament into its silicone. Here both are measured the same
way: the largest change against the mean pressure at rest before the move, which is what
the board compares. Between the two lies the threshold.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from setae.arc import Arc, FloatArray
from setae.config import Config
from setae.errors import InputError, SetaeError, TrippedError
from setae.experiments.events import Event, OnEvent
from setae.link.events import Event as LinkEvent
from setae.link.events import TelemetryReceived
from setae.record import Log
from setae.robot import Robot
from setae_protocol.messages import PRESSURE_LSB_PER_HPA

__all__ = [
    "EXPERIMENT",
    "Bristle",
    "Move",
    "Threshold",
    "moves_in",
    "rates",
    "surface_mm",
    "threshold",
]

EXPERIMENT: Final = "bristle"
"""What the metadata of such a log names."""

DEPTH_MM: Final = (2.0, 6.0)
"""How far beyond the surface a touch ends."""

_SPREAD = (0.6, 1.3)  # of durations, about that of an extension
_REST_S = 0.15
_AFTER_S = 0.1  # the servos lag, and so does the pressure
_CLEAR_MM = 2.0  # between the lowest free move and the surface
_TURN_RAD = math.radians(4.0)
_TRIES = 5  # to get away from what it presses on


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """One measured move.

    Attributes
    ----------
    touched
        Whether there was something in its way.
    duration_s
        Of the move.
    depth_mm
        How far beyond the surface it was sent; NaN for one without contact.
    peak_hpa
        Largest change of pressure, without its sign.
    """

    touched: bool
    duration_s: float
    depth_mm: float
    peak_hpa: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """A threshold, and how it judges some moves.

    Attributes
    ----------
    hpa
        The change that counts as a touch.
    free, false
        Moves without contact, and how many of them reach it.
    touches, missed
        Touches, and how many of them don't.
    """

    hpa: float
    free: int
    false: int
    touches: int
    missed: int

    @property
    def false_rate(self) -> float:
        """Part of the moves without contact that count as touches."""
        return self.false / self.free if self.free else math.nan

    @property
    def missed_rate(self) -> float:
        """Part of the touches that don't count as such."""
        return self.missed / self.touches if self.touches else math.nan

    @classmethod
    def of(cls, hpa: float, moves: Sequence[Move]) -> Threshold:
        """Judge some moves by a threshold."""
        free = [move.peak_hpa for move in moves if not move.touched]
        touches = [move.peak_hpa for move in moves if move.touched]
        return cls(
            hpa=hpa,
            free=len(free),
            false=sum(peak >= hpa for peak in free),
            touches=len(touches),
            missed=sum(peak < hpa for peak in touches),
        )


def threshold(moves: Sequence[Move]) -> Threshold:
    """Recommend a threshold: as far from both kinds where they part, else the fewest errors.

    As far means as many times the loudest move as the lightest touch is times it: both come
    louder or lighter by a part of themselves, by speed, depth and the filament's stiffness.

    Raises
    ------
    InputError
        One of the two kinds is missing.

    Examples
    --------
    >>> free = [Move(touched=False, duration_s=1, depth_mm=math.nan, peak_hpa=p) for p in (3, 5)]
    >>> touch = [Move(touched=True, duration_s=1, depth_mm=3, peak_hpa=p) for p in (20, 30)]
    >>> found = threshold(free + touch)
    >>> found.hpa, found.false, found.missed
    (10.0, 0, 0)
    """
    free = np.sort([move.peak_hpa for move in moves if not move.touched])
    touches = np.sort([move.peak_hpa for move in moves if move.touched])
    if not len(free) or not len(touches):
        raise InputError("A threshold needs moves without contact and touches.", "Measure both.")
    if free[-1] < touches[0]:
        loudest = max(free[-1], 1 / PRESSURE_LSB_PER_HPA)
        return Threshold.of(round(math.sqrt(loudest * touches[0]), 1), moves)
    places = np.unique(np.round(np.concatenate([free, touches, [free[-1] + 0.1]]), 2))
    false = 1 - np.searchsorted(free, places) / len(free)
    missed = np.searchsorted(touches, places) / len(touches)
    return Threshold.of(float(places[np.argmin(false + missed)]), moves)


def surface_mm(config: Config) -> float:
    """How far below the origin of frame D the surface for the touches has to be.

    Examples
    --------
    >>> from setae.config import load
    >>> surface_mm(load())
    125.0
    """
    return config.explore.target_height_mm - 2.0 + config.geometry.tip_offset_mm + _CLEAR_MM


class Bristle:
    """Measures moves with a robot.

    Parameters
    ----------
    robot
        Enabled robot.
    seed
        Of the moves: where to, and how fast.
    on_event
        Called with each event: move.
    """

    def __init__(self, robot: Robot, *, seed: int = 0, on_event: OnEvent | None = None) -> None:
        self._robot = robot
        self._settings = robot.config.explore
        self._rng = np.random.default_rng(seed)
        self._on_event = on_event
        self._samples_hpa: list[float] = []
        self._surface_mm = surface_mm(robot.config)

    def free(self, count: int) -> list[Move]:
        """Move around without contact, out and back; each way counts. Ends compressed."""
        home = self._arc(self._settings.compressed_length_mm, 0.0, 0.0)
        found: list[Move] = []
        with self._watching():
            self._return(0.5)
            while len(found) < count:
                height = self._rng.uniform(
                    self._settings.compressed_length_mm + 4, self._settings.target_height_mm - 2
                )
                radius = self._rng.uniform(0, self._settings.target_radius_mm)
                turn = self._rng.uniform(0, 2 * math.pi)
                away = (radius * math.cos(turn), radius * math.sin(turn), height)
                for place in (away, home):
                    if len(found) < count:
                        found.append(self._measured(place, math.nan))
            self._return(0.5)
        return found

    def touches(self, count: int) -> list[Move]:
        """Reach down to the surface and beyond, somewhere below."""
        found: list[Move] = []
        with self._watching():
            self._return(0.5)
            while len(found) < count:
                depth = self._rng.uniform(*DEPTH_MM)
                bend = self._rng.uniform(0, _TURN_RAD)
                turn = self._rng.uniform(0, 2 * math.pi)
                found.append(self._measured(self._reaching(depth, bend, turn), depth))
                self._return(0.4)
        return found

    def _reaching(self, depth_mm: float, bend_rad: float, turn_rad: float) -> tuple[float, ...]:
        """Where the spring's top is when the tip is that far beyond the surface."""
        tip_mm = self._robot.config.geometry.tip_offset_mm * math.cos(bend_rad)
        height = self._surface_mm + depth_mm - tip_mm
        length = height * bend_rad / math.sin(bend_rad) if bend_rad else height
        return self._arc(length, bend_rad, turn_rad)

    @staticmethod
    def _arc(length_mm: float, bend_rad: float, turn_rad: float) -> tuple[float, ...]:
        arc = Arc.from_angles(length_mm=length_mm, theta_rad=bend_rad, alpha_rad=turn_rad)
        return tuple(float(value) for value in arc.top_mm)

    def _measured(self, place: Sequence[float], depth_mm: float) -> Move:
        self._samples_hpa.clear()
        self._robot.session.run_for(round(_REST_S * 1e6))
        if not self._samples_hpa:
            raise SetaeError(
                "The board reports no pressure.",
                "`setae doctor` says what is wrong with the sensor.",
            )
        baseline = float(np.mean(self._samples_hpa))
        self._samples_hpa.clear()
        duration = self._settings.extend_duration_s * self._rng.uniform(*_SPREAD)
        self._go(place, duration)
        self._robot.session.run_for(round(_AFTER_S * 1e6))
        move = Move(
            touched=not math.isnan(depth_mm),
            duration_s=duration,
            depth_mm=depth_mm,
            peak_hpa=float(np.abs(np.array(self._samples_hpa) - baseline).max()),
        )
        if self._on_event is not None:
            data: dict[str, Any] = {
                "touched": move.touched,
                "duration_s": duration,
                "depth_mm": depth_mm,
                "peak_hpa": move.peak_hpa,
            }
            self._on_event(Event(time_us=self._robot.now_us, name="move", data=data))
        return move

    def _go(self, place: Sequence[float], duration_s: float) -> bool:
        """Move; False where it froze on the way: pressed harder than any move may."""
        try:
            self._robot.move_to(place, duration_s=duration_s)
        except TrippedError:
            self._robot.resume()
            return False
        return True

    def _return(self, duration_s: float) -> None:
        """Get short, all the way: a bent bristle that springs back may freeze it again."""
        home = self._arc(self._settings.compressed_length_mm, 0.0, 0.0)
        for _ in range(_TRIES):
            if self._go(home, duration_s):
                return
        raise SetaeError(
            f"The bristle presses on something, and {_TRIES} moves away from it were stopped.",
            "Make room for the bristle, and start anew.",
        )

    @contextlib.contextmanager
    def _watching(self) -> Iterator[None]:
        unsubscribe = self._robot.session.subscribe(self._note)
        try:
            yield
        finally:
            unsubscribe()

    def _note(self, event: LinkEvent) -> None:
        if isinstance(event, TelemetryReceived):
            telemetry = event.telemetry
            for sample in telemetry.samples[: telemetry.sample_count]:
                self._samples_hpa.append(sample.pressure_raw / PRESSURE_LSB_PER_HPA)


def moves_in(log: Log) -> tuple[Move, ...]:
    """Read the measured moves from a log."""
    return tuple(
        Move(
            touched=bool(event.data["touched"]),
            duration_s=float(event.data["duration_s"]),
            depth_mm=math.nan if event.data["depth_mm"] is None else float(event.data["depth_mm"]),
            peak_hpa=float(event.data["peak_hpa"]),
        )
        for event in log.events("move")
    )


def rates(moves: Sequence[Move], places_hpa: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute false and missed rates over thresholds, both of shape (n,)."""
    free = np.sort([move.peak_hpa for move in moves if not move.touched])
    touches = np.sort([move.peak_hpa for move in moves if move.touched])
    false = 1 - np.searchsorted(free, places_hpa) / max(len(free), 1)
    missed = np.searchsorted(touches, places_hpa) / max(len(touches), 1)
    return np.asarray(false), np.asarray(missed)
