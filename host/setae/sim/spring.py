"""The simulated spring alone: between any tendons, and all ways in which it can rest."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from setae.errors import InputError
from setae.sim.library import CRest, SimulationError, load
from setae.sim.truth import SOLVED
from setae.sim.world import World

__all__ = ["Rest", "Rests", "Spring", "Start"]

Array = NDArray[np.float64]

_SAME_MM = 0.1
_SAME_RAD = 0.01
_BENDS_DEG = (-60.0, 0.0, 60.0)
_SHIFTS_MM = (-15.0, 0.0, 15.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """How a spring rests.

    Attributes
    ----------
    top_mm
        The spring's top U in frame D, (3,).
    rotation
        Frame U in frame D, (3, 3).
    tension_n
        Of each tendon, (n,); 0 where it is slack.
    energy_n_mm
        Of spring, tendons and weight, against the free spring in no gravity.
    residual
        Scaled gradient norm of the equilibrium; below 1e-4 it is solved.
    stable
        Whether the energy rises in every direction from here.
    """

    top_mm: Array
    rotation: Array
    tension_n: Array
    energy_n_mm: float
    residual: float
    stable: bool

    def same_as(self, other: Rest) -> bool:
        """Whether two are one: the top within 0.1 mm and 0.01 rad."""
        turn = 0.5 * (np.trace(self.rotation.T @ other.rotation) - 1)
        away_mm = float(np.linalg.norm(self.top_mm - other.top_mm))
        return away_mm < _SAME_MM and math.acos(min(1.0, max(-1.0, float(turn)))) < _SAME_RAD


@dataclass(frozen=True, slots=True)
class Start:
    """How a spring is held before it is let go.

    Attributes
    ----------
    bend_deg
        Bent about x and y.
    shift_mm
        Its top moved along x and y.
    """

    bend_deg: tuple[float, float] = (0.0, 0.0)
    shift_mm: tuple[float, float] = (0.0, 0.0)


class Rests(tuple[Rest, ...]):
    """Stable rests, lowest energy first.

    Attributes
    ----------
    unsettled : tuple of Start
        From where the spring was let go and found no stable equilibrium, or none at all: what lies
        there is unknown.
    """

    unsettled: tuple[Start, ...]

    def __new__(cls, found: Iterable[Rest], unsettled: Iterable[Start]) -> Rests:
        """Sort the rests."""
        rests = super().__new__(cls, sorted(found, key=lambda rest: rest.energy_n_mm))
        rests.unsettled = tuple(unsettled)
        return rests


class Spring:
    """The plant of a simulated robot without its servos, friction and time.

    Parameters
    ----------
    angles_deg
        Where its 3 to 8 tendons are, about the axis.
    parameters
        Values by the simulator's own names, as for `setae.sim.World`; errors of holes, friction and
        servos count for nothing here.

    Raises
    ------
    InputError
        A parameter or the number of tendons is no good.

    Examples
    --------
    >>> spring = Spring([0, 120, 240], {"plant.gravity_m_s2": 0.0})
    >>> rest = spring.rest([50, 50, 50])
    >>> [round(float(value), 2) for value in rest.tension_n], rest.stable
    ([1.46, 1.46, 1.46], True)
    """

    def __init__(
        self,
        angles_deg: Sequence[float] = (0.0, 90.0, 180.0, 270.0),
        parameters: Mapping[str, float] | Iterable[tuple[str, float]] = (),
    ) -> None:
        self._library = load()
        self._handle: int | None = None
        self._tendons = len(angles_deg)
        angles = (ctypes.c_double * self._tendons)(*np.radians(angles_deg))
        with World(parameters=parameters) as world:
            self._handle = world.spring(self._tendons, angles)

    def rest(
        self,
        lengths_mm: Sequence[float] | Array,
        *,
        bend_deg: tuple[float, float] = (0.0, 0.0),
        shift_mm: tuple[float, float] = (0.0, 0.0),
    ) -> Rest:
        """Let go of the spring, and tell where it comes to rest.

        Parameters
        ----------
        lengths_mm
            Free length of each tendon.
        bend_deg, shift_mm
            How it is held before: bent about x and y, its top moved along x and y.

        Raises
        ------
        InputError
            Not one positive length for each tendon.
        SimulationError
            It found no rest.
        """
        rest = self._rest(lengths_mm, Start(bend_deg, shift_mm))
        if not rest.residual < SOLVED:
            raise SimulationError(
                "The spring found no rest at these tendon lengths.",
                "Ask `rests`, which lets it go from elsewhere, too.",
            )
        return rest

    def _rest(self, lengths_mm: Sequence[float] | Array, start: Start) -> Rest:
        """As `rest`, solved or not."""
        if len(lengths_mm) != self._tendons:
            raise InputError(f"{len(lengths_mm)} lengths for {self._tendons} tendons.")
        out = CRest()
        status = self._library.setae_spring_rest(
            self._handle,
            (ctypes.c_double * self._tendons)(*lengths_mm),
            (ctypes.c_double * 2)(*np.radians(start.bend_deg)),
            (ctypes.c_double * 2)(*start.shift_mm),
            ctypes.byref(out),
        )
        if status != 0:
            raise InputError("A tendon's length is not a positive number, or a start not finite.")
        return Rest(
            top_mm=np.array(out.position_mm),
            rotation=np.array(out.rotation).reshape(3, 3),
            tension_n=np.array(out.tension_n[: self._tendons]),
            energy_n_mm=out.energy_n_mm,
            residual=out.residual,
            stable=bool(out.stable),
        )

    def rests(self, lengths_mm: Sequence[float] | Array) -> Rests:
        """Search all stable rests at some tendon lengths, lowest energy first.

        From 21 starts: straight, bent to all sides, with the top moved to all sides, and both.
        A search is no proof: what none of them leads to is not found.

        Returns
        -------
        Rests
            A tuple of them, and in ``unsettled`` the starts from which it found no stable one.

        Raises
        ------
        InputError
            As by `rest`.
        """
        found: list[Rest] = []
        unsettled: list[Start] = []
        starts = [Start(bend_deg=(x, y)) for x, y in product(_BENDS_DEG, _BENDS_DEG)]
        starts += [Start(shift_mm=(x, y)) for x, y in product(_SHIFTS_MM, _SHIFTS_MM)]
        starts += [Start((x, y), (y / 4, -x / 4)) for x, y in product((-60.0, 60.0), (-60.0, 60.0))]
        for start in dict.fromkeys(starts):
            rest = self._rest(lengths_mm, start)
            if not (rest.residual < SOLVED and rest.stable):
                unsettled.append(start)
            elif not any(rest.same_as(other) for other in found):
                found.append(rest)
        return Rests(found, unsettled)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.setae_spring_destroy(self._handle)
            self._handle = None
