"""How much tendon a servo winds up, and how far it turns for it.

A line that winds onto itself makes its pulley grow. As a spiral whose radius
grows evenly with the angle φ from where the tendon has the free length::

    r(φ) = R + g φ / 2π        wound(φ) = R φ + g φ² / 4π

With no growth, g = 0, that is the plain pulley: wound = R φ. All functions work
on arrays whose last axis is the servo, and on a configuration's `Servo` and
`Geometry`.
"""

from __future__ import annotations

import math

import numpy as np

from setae.arc import FloatArray
from setae.config import Config

__all__ = [
    "angle_rad",
    "pulses_us",
    "radius_mm",
    "travel_mm",
    "us_per_mm",
    "wound_by_us",
    "wound_mm",
]


def angle_rad(wound_mm: FloatArray, config: Config) -> FloatArray:
    """Find how far servos turn to wind up some tendon, shape (..., 4).

    Examples
    --------
    >>> from setae import config
    >>> angle_rad(np.array([0, 35, 0, -1.0]), config.load()).round(4)
    array([ 0.    ,  1.    ,  0.    , -0.0286])
    """
    radius = config.geometry.pulley_radius_mm
    growth = np.array(config.servo.growth_mm_per_turn)
    # The root of the quadratic in the form that g = 0 doesn't spoil.
    square = np.maximum(radius**2 + growth * wound_mm / math.pi, 0.0)
    return np.asarray(2 * wound_mm / (radius + np.sqrt(square)))


def wound_mm(angle_rad: FloatArray, config: Config) -> FloatArray:
    """Find how much tendon servos wind up with an angle, shape (..., 4)."""
    growth = np.array(config.servo.growth_mm_per_turn)
    radius = config.geometry.pulley_radius_mm
    return np.asarray(angle_rad * (radius + growth * angle_rad / (4 * math.pi)))


def radius_mm(wound_mm: FloatArray, config: Config) -> FloatArray:
    r"""Find the radius at which the tendon leaves the pulley, shape (..., 4).

    Examples
    --------
    >>> from setae import config
    >>> robot = config.loads("[servo]\ngrowth_mm_per_turn = [1.0, 1.0, 0.0, 0.0]")
    >>> radius_mm(np.array([0.0, 50, 0, 50]), robot).round(2)
    array([35.  , 35.23, 35.  , 35.  ])
    """
    growth = np.array(config.servo.growth_mm_per_turn)
    turned = angle_rad(wound_mm, config)
    return np.asarray(config.geometry.pulley_radius_mm + growth * turned / (2 * math.pi))


def pulses_us(wound_mm: FloatArray, config: Config) -> FloatArray:
    """Find the pulses that wind up some tendon, end stops disregarded, shape (..., 4)."""
    return np.asarray(
        np.array(config.servo.pulse_free_us) + _us_per_rad(config) * angle_rad(wound_mm, config)
    )


def wound_by_us(pulses_us: FloatArray, config: Config) -> FloatArray:
    """Invert `pulses_us`, shape (..., 4)."""
    turned = (pulses_us - np.array(config.servo.pulse_free_us)) / _us_per_rad(config)
    return wound_mm(turned, config)


def us_per_mm(config: Config) -> FloatArray:
    """Find the change of each servo's pulse for a millimetre of tendon, shape (4,).

    At the free length; where the pulley has grown, it is less.

    Examples
    --------
    >>> from setae import config
    >>> us_per_mm(config.load()).round(2)
    array([18.19, 18.19, 18.19, 18.19])
    """
    return np.abs(_us_per_rad(config)) / config.geometry.pulley_radius_mm


def travel_mm(config: Config) -> tuple[FloatArray, FloatArray]:
    """Find the least and the most tendon that each servo can wind up, shapes (4,).

    Less than nothing: it can give tendon beyond the free length.
    """
    ends = np.stack(
        [
            wound_by_us(np.array(end), config)
            for end in (config.servo.pulse_min_us, config.servo.pulse_max_us)
        ]
    )
    return ends.min(axis=0), ends.max(axis=0)


def _us_per_rad(config: Config) -> FloatArray:
    servo = config.servo
    per_degree = np.array(servo.us_per_degree) * np.array(servo.direction)
    return np.asarray(per_degree * 180 / math.pi)
