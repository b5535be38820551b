"""The compiled simulator: where it is, and its C functions with their types."""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import os
from ctypes import (
    POINTER,
    c_char_p,
    c_double,
    c_int,
    c_int32,
    c_int64,
    c_size_t,
    c_uint64,
    c_void_p,
)
from pathlib import Path

from setae.errors import SetaeError, SimulatorMissingError

__all__ = [
    "BACKBONE_POINTS",
    "TENDONS",
    "CPlantInput",
    "CPlantOutput",
    "CRest",
    "CTruth",
    "PlantStep",
    "SimulationError",
    "load",
]

BACKBONE_POINTS = 21
TENDONS = 4
TENDONS_MOST = 8

#: A library to use instead of the installed one, for work on the simulator.
LIBRARY_VARIABLE = "SETAE_SIM_LIBRARY"


class SimulationError(SetaeError):
    """The simulated world can't go on.

    Examples of when it happens: the spring has no equilibrium with the given
    parameters.
    """

    default_remedy = "Go back to the simulator's default parameters, or nearer to them."


class CTruth(ctypes.Structure):
    """`setae_truth` of setae_sim.h."""

    _fields_ = (
        ("time_us", c_int64),
        ("arm_mm", c_double * 3),
        ("arm_target_mm", c_double * 3),
        ("arm_moving", c_int32),
        ("board_attached", c_int32),
        ("pulse_us", c_double * TENDONS),
        ("servo_length_mm", c_double * TENDONS),
        ("tension_n", c_double * TENDONS),
        ("backbone_mm", c_double * 3 * BACKBONE_POINTS),
        ("rotation", c_double * 9),
        ("filament_mm", c_double * 3 * 2),
        ("contact_depth_mm", c_double),
        ("contact_point_mm", c_double * 3),
        ("bent_tip_mm", c_double * 3),
        ("pressure_hpa", c_double),
        ("plant_residual", c_double),
        ("largest_residual", c_double),
        ("unsolved_samples", c_int64),
        ("plant_iterations", c_int64),
    )


class CPlantInput(ctypes.Structure):
    """`setae_plant_input` of setae_sim.h."""

    _fields_ = (
        ("time_us", c_int64),
        ("attached", c_int32),
        ("pulse_us", c_double * TENDONS),
        ("pull_mm", c_double * TENDONS),
    )


class CPlantOutput(ctypes.Structure):
    """`setae_plant_output` of setae_sim.h."""

    _fields_ = (
        ("position_mm", c_double * 3),
        ("rotation", c_double * 9),
        ("tension_n", c_double * TENDONS),
        ("pressure_hpa", c_double),
    )


class CRest(ctypes.Structure):
    """`setae_rest` of setae_sim.h."""

    _fields_ = (
        ("position_mm", c_double * 3),
        ("rotation", c_double * 9),
        ("tension_n", c_double * TENDONS_MOST),
        ("energy_n_mm", c_double),
        ("residual", c_double),
        ("stable", c_int32),
    )


#: `setae_plant_step` of setae_sim.h.
PlantStep = ctypes.CFUNCTYPE(c_int, c_void_p, POINTER(CPlantInput), POINTER(CPlantOutput))


def library_path() -> Path:
    """Return where the compiled simulator is.

    Raises
    ------
    SimulatorMissingError
        It was not compiled when setae was installed.
    """
    if chosen := os.environ.get(LIBRARY_VARIABLE):
        path = Path(chosen)
        if not path.is_file():
            raise SimulatorMissingError(
                f"{LIBRARY_VARIABLE} names {path}, which is no file.",
                "Build it with cmake, or unset the variable.",
            )
        return path
    # Not Path(__file__): in an editable installation the library lies elsewhere.
    spec = importlib.util.find_spec("setae.sim.setae_sim")
    if spec is None or spec.origin is None:
        raise SimulatorMissingError(
            "The simulator was not compiled: there was no C++ compiler when setae was installed."
        )
    return Path(spec.origin)


@functools.cache
def load() -> ctypes.CDLL:
    """Load the compiled simulator and declare its functions.

    Raises
    ------
    SimulatorMissingError
        It isn't there, or doesn't load.
    """
    path = library_path()
    try:
        library = ctypes.CDLL(os.fspath(path))
    except OSError as error:
        raise SimulatorMissingError(
            f"The compiled simulator {path} does not load: {error}.",
            "Install setae again on this machine.",
        ) from error
    world = ctypes.c_void_p
    vector = POINTER(c_double)
    status = c_int
    signatures: dict[str, tuple[type | None, tuple[type, ...]]] = {
        "world_create": (world, (c_uint64,)),
        "world_destroy": (None, (world,)),
        "world_error": (c_char_p, (world,)),
        "world_parameter_count": (c_int, ()),
        "world_parameter_name": (c_char_p, (c_int,)),
        "world_parameter_range": (status, (c_int, vector, vector)),
        "world_set": (status, (world, c_char_p, c_double)),
        "world_get": (status, (world, c_char_p, vector)),
        "world_add_tube": (status, (world, vector, c_double)),
        "world_add_box": (status, (world, vector, vector, c_double)),
        "world_add_prism": (status, (world, vector, vector, c_double, c_double, c_double)),
        "world_add_ring": (status, (world, vector, c_double, c_double)),
        "world_add_ellipsoid": (status, (world, vector, vector, c_double)),
        "world_surface": (status, (world, c_double, c_double, c_double, c_double, vector)),
        "world_use_plant": (status, (world, PlantStep, c_void_p)),
        "world_start": (status, (world, vector)),
        "world_now_us": (c_int64, (world,)),
        "world_send": (status, (world, c_char_p, c_size_t)),
        "world_run": (status, (world, c_int64, c_char_p, POINTER(c_size_t))),
        "world_arm_move": (status, (world, vector, c_double, c_double)),
        "world_arm_follow": (status, (world, vector)),
        "world_arm_stop": (status, (world, c_double)),
        "world_truth": (status, (world, POINTER(CTruth))),
        "world_sensor_fault": (status, (world, c_int)),
        "world_supply": (status, (world, c_int)),
        "world_stop_switch": (status, (world, c_int)),
        "world_reset_board": (status, (world,)),
        "world_remove_board": (status, (world,)),
        "world_pulse": (status, (world, c_int, c_double)),
        "world_sense": (status, (world, vector)),
        "world_spring": (c_void_p, (world, c_int, vector)),
        "spring_destroy": (None, (c_void_p,)),
        "spring_rest": (status, (c_void_p, vector, vector, vector, POINTER(CRest))),
    }
    for name, (result, arguments) in signatures.items():
        try:
            function = getattr(library, f"setae_{name}")
        except AttributeError as error:
            raise SimulatorMissingError(
                f"The compiled simulator {path} is of another version: it has no setae_{name}.",
                "Install setae again.",
            ) from error
        function.restype = result
        function.argtypes = arguments
    return library
