"""One simulated world: board, line, plant, sensor, arm and solids in one time."""

from __future__ import annotations

import ctypes
import difflib
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from setae.errors import InputError, SetaeError
from setae.sim.library import CPlantInput, CPlantOutput, CTruth, PlantStep, SimulationError, load
from setae.sim.plugin import Drive, Plant, PluginError, checked
from setae.sim.truth import SensorFault, Truth

__all__ = ["World", "parameter_names", "parameter_ranges"]

_BAD_ARGUMENT = -1
_PLANT_FAILED = -5
_READ_ROOM = 4096

Array = NDArray[np.float64]


@cache
def parameter_names() -> tuple[str, ...]:
    """Return the names of all parameters, such as ``spring.axial_rate_n_per_mm``."""
    library = load()
    count = library.setae_world_parameter_count()
    return tuple(library.setae_world_parameter_name(i).decode() for i in range(count))


def parameter_ranges() -> dict[str, tuple[float, float]]:
    """Return what each parameter may be, least and most, by its name."""
    library = load()
    ranges = {}
    for index, name in enumerate(parameter_names()):
        least, most = ctypes.c_double(), ctypes.c_double()
        library.setae_world_parameter_range(index, ctypes.byref(least), ctypes.byref(most))
        ranges[name] = (least.value, most.value)
    return ranges


def _known(count: int) -> int | None:
    """A plug-in's counts are -1."""
    return None if count < 0 else count


def _vector(name: str, values: Sequence[float] | Array) -> ctypes.Array[ctypes.c_double]:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (3,):
        raise InputError(f"{name} has shape {array.shape}.", "Give three numbers, in mm.")
    return (ctypes.c_double * 3)(*array)


class World:
    """A simulated world. Set it up, start it, then run it; nothing runs by itself.

    Parameters
    ----------
    seed
        Of all noise: same seed, same calls, same bytes.
    parameters
        Values by the simulator's own names (see `parameter_names`); the others
        keep their defaults.
    plant
        Another plant in the place of the built-in spring, see `setae.sim.plugin`.

    Raises
    ------
    SimulatorMissingError
        The simulator was not compiled.
    InputError
        No parameter has that name, or its value is no good.

    Examples
    --------
    >>> from setae.sim import World
    >>> with World(seed=1) as world:
    ...     world.start()
    ...     _ = world.run(100_000)
    ...     round(float(world.truth().backbone_mm[-1, 2]), 1)
    70.0
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        parameters: Mapping[str, float] | Iterable[tuple[str, float]] = (),
        plant: Plant | None = None,
    ) -> None:
        self._library = load()
        self._handle: int | None = None
        if not 0 <= seed < 2**64:
            raise InputError(f"seed is {seed}.", "Give a whole number from 0 to 2**64 - 1.")
        self._handle = self._library.setae_world_create(seed)
        if not self._handle:
            raise MemoryError
        # The same memory twice: C writes it, numpy reads it.
        self._truth_fields = np.zeros((), dtype=np.dtype(CTruth))
        self._truth = CTruth.from_buffer(self._truth_fields.data)
        self._truth_holds = False
        self._asked_now_us: int | None = None
        self._room = ctypes.create_string_buffer(_READ_ROOM)
        self._size = ctypes.c_size_t()
        for name, value in dict(parameters).items():
            self.set(name, value)
        self._plant_error: Exception | None = None
        if plant is not None:
            self._step = PlantStep(self._stepper(plant))  # C holds no reference to it
            self._change(self._library.setae_world_use_plant(self._handle, self._step, None))

    def _stepper(self, plant: Plant) -> Callable[..., int]:
        """A plant's step as C calls it: no exception may cross."""

        def step(user: None, given: Any, wanted: Any) -> int:
            del user
            raw: CPlantInput = given.contents
            bits = raw.attached
            drive = Drive(
                time_s=1e-6 * raw.time_us,
                attached=(bool(bits & 1), bool(bits & 2), bool(bits & 4), bool(bits & 8)),
                pulse_us=np.array(raw.pulse_us),
                pull_mm=np.array(raw.pull_mm),
            )
            try:
                position, rotation, tension, pressure = checked(plant.step(drive))
            except Exception as error:  # told by whoever called into the world
                self._plant_error = error
                return 1
            answer: CPlantOutput = wanted.contents
            answer.position_mm[:] = position.tolist()
            answer.rotation[:] = rotation.ravel().tolist()
            answer.tension_n[:] = tension.tolist()
            answer.pressure_hpa = pressure
            return 0

        return step

    def set(self, name: str, value: float) -> None:
        """Set a parameter, before the start.

        Raises
        ------
        InputError
            No parameter has that name, or the value is no good for it.
        """
        if name not in (names := parameter_names()):
            close = difflib.get_close_matches(name, names, n=1)
            raise InputError(
                f"The simulator has no parameter {name!r}.",
                f"Did you mean {close[0]!r}?" if close else "setae.sim.parameter_names() has all.",
            )
        self._change(self._library.setae_world_set(self._live, name.encode(), value))

    def get(self, name: str) -> float:
        """Return a parameter's value. Raises InputError where there is none of that name."""
        value = ctypes.c_double()
        self._check(self._library.setae_world_get(self._live, name.encode(), ctypes.byref(value)))
        return value.value

    def add_tube(self, axis_point_mm: Sequence[float], inner_radius_mm: float) -> None:
        """Add a vertical tube, before the start; its wall is all beyond the inner radius."""
        point = _vector("axis_point_mm", axis_point_mm)
        self._change(self._library.setae_world_add_tube(self._live, point, inner_radius_mm))

    def add_box(
        self, centre_mm: Sequence[float], edges_mm: Sequence[float], yaw_rad: float = 0.0
    ) -> None:
        """Add an upright box, turned by yaw about z, before the start."""
        centre = _vector("centre_mm", centre_mm)
        edges = _vector("edges_mm", edges_mm)
        self._change(self._library.setae_world_add_box(self._live, centre, edges, yaw_rad))

    def add_prism(
        self,
        centre_mm: Sequence[float],
        edges_mm: Sequence[float],
        *,
        corner_mm: float = 0.0,
        wall_mm: float = 0.0,
        yaw_rad: float = 0.0,
    ) -> None:
        """Add an upright prism, before the start.

        Parameters
        ----------
        corner_mm
            Radius of its four upright edges.
        wall_mm
            Above 0: hollow and open at the top, its walls and bottom this thick.
        """
        centre, edges = _vector("centre_mm", centre_mm), _vector("edges_mm", edges_mm)
        self._change(
            self._library.setae_world_add_prism(
                self._live, centre, edges, corner_mm, wall_mm, yaw_rad
            )
        )

    def add_ring(
        self, centre_mm: Sequence[float], ring_radius_mm: float, section_radius_mm: float
    ) -> None:
        """Add a lying ring of round section, before the start."""
        centre = _vector("centre_mm", centre_mm)
        self._change(
            self._library.setae_world_add_ring(
                self._live, centre, ring_radius_mm, section_radius_mm
            )
        )

    def add_ellipsoid(
        self, centre_mm: Sequence[float], semi_axes_mm: Sequence[float], yaw_rad: float = 0.0
    ) -> None:
        """Add an upright ellipsoid, turned by yaw about z, before the start."""
        centre, axes = _vector("centre_mm", centre_mm), _vector("semi_axes_mm", semi_axes_mm)
        self._change(self._library.setae_world_add_ellipsoid(self._live, centre, axes, yaw_rad))

    def surface_mm(self, x_mm: float, y_mm: float, *, bottom_mm: float, top_mm: float) -> float:
        """Height of the topmost solid at a place of the world, true.

        Returns
        -------
        float
            Between the two heights; -inf where there is nothing between them.
        """
        z_mm = ctypes.c_double()
        self._check(
            self._library.setae_world_surface(
                self._live, x_mm, y_mm, bottom_mm, top_mm, ctypes.byref(z_mm)
            )
        )
        return z_mm.value

    def spring(self, tendons: int, angles_rad: ctypes.Array[ctypes.c_double]) -> int:
        """Handle of this world's spring between other tendons, for `setae.sim.Spring`."""
        handle = self._library.setae_world_spring(self._live, tendons, angles_rad)
        if not handle:
            text = self._library.setae_world_error(self._live).decode()
            raise InputError(f"Simulator: {text}.")
        return int(handle)

    def start(self, arm_mm: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        """Switch the power on, with the origin of frame D at `arm_mm` in the world.

        Raises
        ------
        InputError
            Two parameters contradict each other; the message names them.
        SimulationError
            The spring has no equilibrium with these parameters.
        """
        self._change(self._library.setae_world_start(self._live, _vector("arm_mm", arm_mm)))

    @property
    def now_us(self) -> int:
        """Virtual time since power-on."""
        now_us = self._asked_now_us
        if now_us is None:
            now_us = self._asked_now_us = int(self._library.setae_world_now_us(self._live))
        return now_us

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the board now."""
        self._change(self._library.setae_world_send(self._live, data, len(data)))

    def run(self, until_us: int) -> bytes:
        """Step until bytes for the host are there, or the time has come.

        How a wait is cut into calls changes nothing in the world.

        Returns
        -------
        bytes
            Empty when the time has come first.

        Raises
        ------
        SimulationError
            The spring's equilibrium could not be found.
        """
        self._size.value = _READ_ROOM
        self._change(
            self._library.setae_world_run(
                self._live, until_us, self._room, ctypes.byref(self._size)
            )
        )
        return self._room.raw[: self._size.value] if self._size.value else b""

    def arm_move(
        self, target_mm: Sequence[float], speed_mm_s: float, acceleration_mm_s2: float
    ) -> None:
        """Start a straight move of the arm, with a trapezoidal speed profile.

        Raises
        ------
        InputError
            A value is no good.
        SimulationError
            The arm is moving.
        """
        target = _vector("target_mm", target_mm)
        self._change(
            self._library.setae_world_arm_move(self._live, target, speed_mm_s, acceleration_mm_s2)
        )

    def arm_follow(self, position_mm: Sequence[float]) -> None:
        """Say where something outside the world has the arm now; it comes after it smoothly."""
        position = _vector("position_mm", position_mm)
        self._change(self._library.setae_world_arm_follow(self._live, position))

    def arm_stop(self, acceleration_mm_s2: float) -> None:
        """Brake the arm on its present line."""
        self._change(self._library.setae_world_arm_stop(self._live, acceleration_mm_s2))

    @property
    def arm_mm(self) -> tuple[float, float, float]:
        """Origin of frame D in the world now."""
        x_mm, y_mm, z_mm = self._look().arm_mm
        return (x_mm, y_mm, z_mm)

    @property
    def arm_moving(self) -> bool:
        """Whether the arm moves now."""
        return bool(self._look().arm_moving)

    def truth(self) -> Truth:
        """Look at the world as it is now; changes nothing in it."""
        raw = self._look()
        # One copy of all: the fields below are views of it, in which nobody writes.
        now = self._truth_fields.copy()
        bits = raw.board_attached
        depth_mm = raw.contact_depth_mm
        return Truth(
            time_us=raw.time_us,
            arm_mm=now["arm_mm"],
            arm_target_mm=now["arm_target_mm"],
            arm_moving=bool(raw.arm_moving),
            attached=(bool(bits & 1), bool(bits & 2), bool(bits & 4), bool(bits & 8)),
            pulse_us=now["pulse_us"],
            servo_length_mm=now["servo_length_mm"],
            tension_n=now["tension_n"],
            backbone_mm=now["backbone_mm"],
            rotation=now["rotation"].reshape(3, 3),
            filament_mm=now["filament_mm"],
            contact_depth_mm=depth_mm,
            contact_point_mm=now["contact_point_mm"] if depth_mm > 0 else None,
            bent_tip_mm=now["bent_tip_mm"],
            pressure_hpa=raw.pressure_hpa,
            plant_residual=raw.plant_residual,
            plant_iterations=_known(raw.plant_iterations),
            largest_residual=raw.largest_residual,
            unsolved_samples=_known(raw.unsolved_samples),
        )

    def _look(self) -> CTruth:
        """The truth, asked for once between two changes of the world."""
        if not self._truth_holds:
            self._check(self._library.setae_world_truth(self._live, ctypes.byref(self._truth)))
            self._truth_holds = True
        return self._truth

    def sensor_fault(self, fault: SensorFault) -> None:
        """Break the pressure sensor, or mend it."""
        self._change(self._library.setae_world_sensor_fault(self._live, int(fault)))

    def supply(self, supply_mv: int) -> None:
        """Set the board's supply, 5000 mV at the start."""
        self._change(self._library.setae_world_supply(self._live, supply_mv))

    def stop_switch(self, *, is_open: bool) -> None:
        """Open or close the stop switch on D4; at the start there is none, which is open."""
        self._change(self._library.setae_world_stop_switch(self._live, int(is_open)))

    def reset_board(self) -> None:
        """Press the reset button: the board starts anew; retained memory and EEPROM survive."""
        self._change(self._library.setae_world_reset_board(self._live))

    def remove_board(self) -> None:
        """Take the board out, for one outside that is in step with this world.

        From now on its pulses come by `pulse`, its sensor asks by `sense`, and no bytes pass.
        """
        self._change(self._library.setae_world_remove_board(self._live))

    def pulse(self, servo: int, width_us: float) -> None:
        """Tell of a pulse that has just ended; a width of 0: there are no pulses any more."""
        self._change(self._library.setae_world_pulse(self._live, servo, width_us))

    def sense(self) -> float:
        """Move the plant up to now, and return the pressure of a sample that is taken now, in hPa.

        Raises
        ------
        SimulationError
            The plant has no solution.
        """
        pressure_hpa = ctypes.c_double()
        self._change(self._library.setae_world_sense(self._live, ctypes.byref(pressure_hpa)))
        return pressure_hpa.value

    def close(self) -> None:
        """Let go of the world. Closing twice is fine."""
        if self._handle:
            self._library.setae_world_destroy(self._handle)
            self._handle = None
            self._truth_holds = False
            self._asked_now_us = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self.close()

    @property
    def _live(self) -> int:
        if self._handle is None:
            raise SimulationError("The simulated world was closed.", "Make a new one.")
        return self._handle

    def _change(self, status: int) -> None:
        """After each call that may have changed the world."""
        self._truth_holds = False
        self._asked_now_us = None
        self._check(status)

    def _check(self, status: int) -> None:
        if status == 0:
            return
        if status == _PLANT_FAILED and (error := self._plant_error) is not None:
            self._plant_error = None
            if isinstance(error, SetaeError):
                raise error
            what = f"{type(error).__name__}: {error}".rstrip(".: ")
            raise PluginError(f"The plant's step failed: {what}.") from error
        text = self._library.setae_world_error(self._live).decode()
        problem = f"Simulator: {text}."
        if status == _BAD_ARGUMENT:
            raise InputError(problem)
        raise SimulationError(problem)
