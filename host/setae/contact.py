"""From a trip record to where the bristle was when it touched.

The record says what was *commanded* around the touch: the pulses of the last
four servo frames, and the time of the deciding sample. The robot was not there
yet: its servos lag. And the touch was before the sample: the sensor measures
every 13 ms, and the pressure has to build up. So the estimate goes back in the
record by the servos' lag, and its uncertainty covers the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from setae import kinematics, servo
from setae.config import Config
from setae_protocol.messages import PRESSURE_LSB_PER_HPA, SERVO_FRAME_US, Trip, TripCause

Point = tuple[float, float, float]

MODEL_ERROR_MM = 4.32
"""Mean error of the constant curvature model, as the paper measured it."""

# The sensor's slowest rate that counts as healthy: 75 Hz.
_SAMPLE_PERIOD_US = 13_333


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Where and when the bristle touched, as far as the host can tell.

    Attributes
    ----------
    position_mm
        Estimated spring top U in frame D.
    tip_mm
        Estimated undeformed bristle tip E in frame D.
    lengths_mm
        Estimated tendon lengths.
    uncertainty_mm
        Of `position_mm`: what the lag and the sensor's rate leave open, and the
        constant curvature model's mean error (4.32 mm, the paper), as a root
        sum of squares.
    pressure_hpa, baseline_hpa
        The deciding sample, and what it was compared with.
    time_us
        Time of the deciding sample, by the session's clock.
    cause
        ``contact`` in a guarded move, ``coarse_contact`` otherwise.
    """

    position_mm: Point
    tip_mm: Point
    lengths_mm: tuple[float, ...]
    uncertainty_mm: float
    pressure_hpa: float
    baseline_hpa: float
    time_us: int
    cause: str

    @property
    def pressure_change_hpa(self) -> float:
        """Deciding sample against the baseline, with its sign."""
        return self.pressure_hpa - self.baseline_hpa


def estimate(record: Trip, config: Config, *, time_us: int) -> Contact:
    """Estimate the pose at a contact.

    Parameters
    ----------
    record
        The board's trip record.
    config
        Gives the servos' calibration and lag.
    time_us
        Time of the deciding sample on the session's clock.
    """
    history_mm = servo.ServoModel(config).lengths_mm(record.pulse_ticks)
    # In frames, counted back from the frozen ones: those were put out in the
    # frame in which the sample was taken, or in the next.
    phase = record.sample_phase_us / SERVO_FRAME_US
    lag = config.servo.lag_ms * 1000 / SERVO_FRAME_US
    consecutive = config.bristle.consecutive * _SAMPLE_PERIOD_US / SERVO_FRAME_US
    latest = phase - 1.0 - lag
    earliest = phase - 2.0 - lag - consecutive
    best_mm = _at(history_mm, (latest + earliest) / 2)
    ends_mm = [_position(_at(history_mm, when), config) for when in (earliest, latest)]
    position = _position(best_mm, config)
    timing_mm = max(float(np.linalg.norm(end - position)) for end in ends_mm)
    # Whatever model the commands are made with: of the three, offset arcs tell best where
    # the simulated spring is from the lengths, 0.7 mm off on average (`paper` 2.8).
    arc = kinematics.forward(best_mm, config.geometry, model="parallel")
    tip = kinematics.position(arc, tip_offset_mm=config.geometry.tip_offset_mm)
    return Contact(
        position_mm=_point(position),
        tip_mm=_point(tip),
        lengths_mm=tuple(float(length) for length in best_mm),
        uncertainty_mm=float(np.hypot(timing_mm, MODEL_ERROR_MM)),
        pressure_hpa=record.pressure_raw / PRESSURE_LSB_PER_HPA,
        baseline_hpa=record.baseline_raw / PRESSURE_LSB_PER_HPA,
        time_us=time_us,
        cause=TripCause(record.cause).name.lower(),
    )


def _at(history_mm: NDArray[np.float64], frames: float) -> NDArray[np.float64]:
    """Commanded lengths a number of frames (≤ 0) after the last of the history, (n,)."""
    last = len(history_mm) - 1
    when = min(max(last + frames, 0.0), float(last))
    index = min(int(when), last - 1)
    part = when - index
    result: NDArray[np.float64] = (1 - part) * history_mm[index] + part * history_mm[index + 1]
    return result


def _position(lengths_mm: NDArray[np.float64], config: Config) -> NDArray[np.float64]:
    arc = kinematics.forward(lengths_mm, config.geometry, model="parallel")
    return np.asarray(kinematics.position(arc), dtype=float)


def _point(vector: NDArray[np.float64]) -> Point:
    x, y, z = (float(value) for value in vector)
    return (x, y, z)
