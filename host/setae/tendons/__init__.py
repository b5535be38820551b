"""How long the tendons are for a given arc.

Three models behind one interface, chosen by name:

``paper``
    Equation 12 to the letter: an arc on the inner half, a chord on the outer
    half. A tendon that crosses from one half to the other *jumps*, by 8 mm
    at θ = 90° and full length.
``parallel``
    Each tendon keeps its distance from the spring's axis: the textbook's offset
    arcs, q = L − d (Δ·u). Linear, and smooth everywhere.
``taut``
    The shortest path from hole to hole inside the spring's bore, as a tendon
    under tension takes it: straight where it can, along the wall where it must.
    It has no jump, and lies between chord and offset arc.

Here u is the unit vector from the axis to the tendon and Δ the bending vector.
A further model is one more entry in `MODELS`, and its name in
`setae.config.TENDON_MODELS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from setae.arc import Arc, FloatArray, first_place
from setae.config import Geometry
from setae.errors import InputError
from setae.tendons import paper, parallel, taut
from setae.tendons.paper import BOUNDARY_TOLERANCE
from setae.tendons.parallel import require_determined
from setae.tendons.rule import Hint, TendonModel

__all__ = [
    "BOUNDARY_TOLERANCE",
    "MODELS",
    "Hint",
    "TendonModel",
    "jacobian",
    "lengths",
    "model",
    "require_determined",
]

MODELS: Mapping[str, TendonModel] = MappingProxyType(
    {model.name: model for model in (paper.MODEL, parallel.MODEL, taut.MODEL)}
)
"""The models by their names."""


def lengths(arc: Arc, geometry: Geometry, model: str = "paper") -> FloatArray:
    """Compute the tendons' lengths.

    Parameters
    ----------
    arc
        Of shape (...).
    geometry
        With n tendons, at any angles and distances from the axis.
    model
        ``paper``, ``parallel`` or ``taut``.

    Returns
    -------
    ndarray, shape (..., n)
        Lengths in mm.

    Raises
    ------
    InputError
        An unknown model, or an arc so short and bent that a tendon's length
        would not be above 0.

    Examples
    --------
    >>> arc = Arc(length_mm=60, bend_rad=(0.5, 0))
    >>> lengths(arc, Geometry(), model="parallel").round(3)
    array([55.85, 60.  , 64.15, 60.  ])
    >>> lengths(arc, Geometry(), model="paper").round(3)
    array([55.85 , 59.377, 63.484, 59.377])
    >>> lengths(arc, Geometry(), model="taut").round(3)
    array([55.605, 59.377, 63.484, 59.377])
    """
    result = _find(model).lengths(arc, geometry)
    # For a single pose numpy's own minimum would take longer than the lengths.
    least = min(result.tolist()) if result.ndim == 1 else result.min(initial=1.0)
    if not least > 0:
        bad = ~(result > 0)
        raise InputError(
            f"The {model} length of tendon{first_place(bad)} would be {result[bad][0]:.3g} mm.",
            "Choose a longer or less bent arc.",
        )
    return result


def jacobian(arc: Arc, geometry: Geometry, model: str = "paper") -> FloatArray:
    """Compute the derivatives of the tendons' lengths by the arc's parameters.

    Parameters
    ----------
    arc, geometry, model
        As in `lengths`.

    Returns
    -------
    ndarray, shape (..., n, 3)
        By L in mm/mm, by Δx and Δy in mm/rad. Where ``paper`` jumps, those of the
        outer side.

    Raises
    ------
    InputError
        An unknown model.

    Examples
    --------
    >>> jacobian(Arc(length_mm=60, bend_rad=(0.5, 0)), Geometry(), model="parallel")[0]
    array([ 1. , -8.3, -0. ])
    """
    return _find(model).derivative(arc, geometry)


def model(name: str) -> TendonModel:
    """Look a model up by its name.

    Raises
    ------
    InputError
        There is no such model.

    Examples
    --------
    >>> model("parallel").name
    'parallel'
    """
    return _find(name)


def _find(name: str) -> TendonModel:
    try:
        return MODELS[name]
    except KeyError:
        raise InputError(
            f"There is no tendon model {name!r}.", f"There are: {', '.join(MODELS)}."
        ) from None
