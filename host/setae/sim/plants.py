"""Named plants: sets of the simulator's parameters that stand for one robot.

``ideal`` has no imperfection. ``paper_like`` errs about as much as the paper's robot:
one plausible set of imperfections, not an identification of it. ``random:SEED`` draws
all of them, within what cheap servos, printed pulleys and wound line have. Simulated
robots, all of them.
"""

from __future__ import annotations

import numpy as np

from setae.errors import InputError

__all__ = ["CAUSES", "NAMES", "by_cause", "parameters", "resolve"]

NAMES = ("ideal", "paper_like", "random:SEED")
"""What `parameters` knows; SEED is any whole number from 0."""

CAUSES: dict[str, tuple[str, ...]] = {
    "bending stiffness": ("spring.bending_", "spring.stiffness_gradient", "spring.shear_scale"),
    "zero offsets": ("tendon.offset_mm_",),
    "winding gain": ("tendon.winding_error_",),
    "backlash": ("tendon.backlash_mm",),
    "winding slip": ("tendon.winding_slip",),
    "friction": ("tendon.friction", "tendon.presliding_mm"),
    "hole positions": ("tendon.base_", "tendon.top_", "tendon.radius_mm"),
    "weight and load": ("plant.", "spring.mass_g"),
    "compliance": ("tendon.stiffness_n_per_mm", "servo.stiffness_n_per_mm"),
}
"""What a lab can mend, and the beginnings of the parameters' names that belong to it."""


# Fitted so that the errors on the paper's 145 targets, commanded by its tendon model, have
# about the paper's mean and spread in each of its five groups. Twenty-five numbers
# against ten: many other sets would do as well.
_PAPER_LIKE = {
    "servo.stiffness_n_per_mm": 22.68,
    "spring.bending_scale_x": 0.5,
    "spring.bending_scale_y": 0.57,
    "spring.shear_scale": 1.064,
    "spring.stiffness_gradient": 0.4,
    "tendon.backlash_mm": 0.69,
    "tendon.friction": 0.147,
    "tendon.offset_mm_0": 2.02,
    "tendon.offset_mm_1": 0.4,
    "tendon.offset_mm_2": 1.46,
    "tendon.offset_mm_3": 0.5,
    "tendon.radius_mm": 8.208,
    "tendon.top_radial_mm_0": -0.14,
    "tendon.top_radial_mm_1": -0.01,
    "tendon.top_radial_mm_2": -0.06,
    "tendon.top_radial_mm_3": -0.05,
    "tendon.top_tangential_mm_0": -0.11,
    "tendon.top_tangential_mm_1": 0.1,
    "tendon.top_tangential_mm_2": 0.09,
    "tendon.top_tangential_mm_3": 0.2,
    "tendon.winding_error_0": -0.012,
    "tendon.winding_error_1": -0.031,
    "tendon.winding_error_2": -0.005,
    "tendon.winding_error_3": -0.086,
    "tendon.winding_slip": 0.02,
}


def resolve(name: str, seed: int | None = None) -> str:
    """Write a plant's name in full: ``random`` gets the seed.

    Raises
    ------
    InputError
        There is no such plant; the message names those that are.

    Examples
    --------
    >>> resolve("random", 7)
    'random:7'
    """
    kind, separator, number = name.partition(":")
    if kind == "random":
        if not separator and seed is not None:
            number = str(seed)
        if number.isdecimal() and number.isascii():
            return f"random:{int(number)}"
        raise InputError(
            f"The plant {name!r} needs a seed.", "Give a whole number, such as random:7."
        )
    if name not in NAMES:
        raise InputError(f"There is no plant {name!r}.", f"There are: {', '.join(NAMES)}.")
    return name


def parameters(name: str, seed: int | None = None) -> dict[str, float]:
    """Return what a plant sets, by the simulator's own names.

    Parameters
    ----------
    name
        One of `NAMES`.
    seed
        Of ``random`` where the name gives none.

    Returns
    -------
    dict
        For `setae.sim.World` or the configuration's ``[simulator]``; what isn't in
        it keeps the simulator's default. Empty for ``ideal``.

    Raises
    ------
    InputError
        There is no such plant.

    Examples
    --------
    >>> parameters("ideal")
    {}
    >>> parameters("random:7") == parameters("random", 7)
    True
    """
    name = resolve(name, seed)
    if name.startswith("random:"):
        return _random(int(name.removeprefix("random:")))
    return dict(_PAPER_LIKE) if name == "paper_like" else {}


def by_cause(values: dict[str, float]) -> dict[str, dict[str, float]]:
    """Part a plant's parameters into imperfections that can be switched on alone.

    Returns
    -------
    dict
        The parameters of each cause in `CAUSES` that has any, in that order.
    """
    parts = {
        cause: {key: value for key, value in values.items() if key.startswith(beginnings)}
        for cause, beginnings in CAUSES.items()
    }
    return {cause: part for cause, part in parts.items() if part}


def _random(seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    values = {f"spring.bending_scale_{axis}": rng.uniform(0.5, 1) for axis in "xy"}
    for i in range(4):
        values[f"tendon.offset_mm_{i}"] = rng.uniform(-0.5, 3)
        values[f"tendon.winding_error_{i}"] = np.clip(rng.normal(0, 0.07), -0.2, 0.2)
        for plate in ("base", "top"):
            # In the plates' bore still, which is 0.7 mm wider than where the holes belong.
            for way, most in (("radial", 0.6), ("tangential", 0.9)):
                error_mm = np.clip(rng.normal(0, 0.3), -most, most)
                values[f"tendon.{plate}_{way}_mm_{i}"] = error_mm
    values["tendon.backlash_mm"] = rng.uniform(0.3, 1)
    values["tendon.friction"] = rng.uniform(0.05, 0.2)
    values["tendon.winding_slip"] = rng.uniform(0, 0.05)
    # Rounded, so that a log holds the very numbers.
    return {key: round(float(value), 4) for key, value in values.items()}
