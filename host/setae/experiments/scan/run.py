"""One scan, from where the arm stands."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from setae import rig
from setae.config import Config, Scan
from setae.errors import InputError, SetaeError
from setae.experiments.events import OnEvent
from setae.experiments.reach import require_reachable
from setae.experiments.scan import adaptive, cycles
from setae.experiments.scan.steps import Feeling, Steps, contact_data
from setae.experiments.scan.survey import Cell, Place, Survey
from setae.experiments.scan.window import require_free_start, require_window
from setae.heightmap import HeightMap
from setae.objects import TableScene
from setae.record import Recorder
from setae.robot import Robot
from setae.stage import Stage

Mode: TypeAlias = Literal["paper", "safe", "adaptive"]
MODES: Final[tuple[Mode, ...]] = ("paper", "safe", "adaptive")
EXPERIMENT: Final = "scan"

# The true surface of a simulated scene is kept this many times finer than the scan.
_FINER: Final = 4
# Below the scene's table there is nothing to look for.
_BELOW_TABLE_MM: Final = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanResult:
    """Outcome of a scan.

    Attributes
    ----------
    height_map
        What was felt.
    places
        The same, in the order in which it became known.
    mode
        One of `MODES`.
    duration_s
        By the session's clock, earlier parts of a resumed scan included.
    complete
        Whether something is known of every place.
    scene
        What a log says of the scene; empty where nothing is known.
    """

    height_map: HeightMap
    places: tuple[Place, ...]
    mode: Mode
    duration_s: float
    complete: bool
    scene: Mapping[str, Any] = field(default_factory=dict)


def arm_targets_mm(settings: Scan) -> tuple[tuple[float, float, float], ...]:
    """Corners of the scanned square, from its first place: where the arm goes at most.

    Examples
    --------
    >>> from setae.config import load
    >>> arm_targets_mm(load().scan)[2]
    (200.0, 200.0, 0.0)
    """
    survey = Survey(settings)
    x_mm, y_mm = survey.x_mm(survey.columns - 1), survey.y_mm(survey.rows - 1)
    return ((0.0, 0.0, 0.0), (x_mm, 0.0, 0.0), (x_mm, y_mm, 0.0), (0.0, y_mm, 0.0))


def scan(
    robot: Robot,
    stage: Stage,
    *,
    mode: Mode = "paper",
    settings: Scan | None = None,
    known: Iterable[Place] = (),
    earlier_s: float = 0.0,
    on_event: OnEvent | None = None,
    arm_timeout_s: float | None = None,
    scene: Mapping[str, Any] | None = None,
) -> ScanResult:
    """Scan a square from where the arm stands, which is above its first place.

    The robot must be enabled. Whatever goes wrong, Ctrl-C included, arm and robot are stopped
    before the exception leaves.

    Parameters
    ----------
    robot
        Enabled robot.
    stage
        Arm that carries it.
    mode
        One of `MODES`.
    settings
        Of the scan; None: the robot's configured ones.
    known
        Places that an earlier run found out about; they are left out.
    earlier_s
        How long that took.
    on_event
        Called with each `setae.experiments.events.Event` as it happens: scan_start, step,
        step_contact, place, arm_return, scan_end, scan_aborted.
    arm_timeout_s
        Longest time for a move of the arm; None: what its configured speed asks for, and some
        seconds.
    scene
        What is scanned, for the result only.

    Raises
    ------
    InputError
        There is no such mode, or an earlier run's places don't fit; nothing has moved.
    HeightWindowError
        What is scanned is too tall, by `tallest_mm` in the settings: nothing has moved. Or the
        retracted robot has touched something.
    ArmBoxError
        A corner of the square lies outside of the arm's box; nothing has moved.
    SetaeError
        Whatever ended the scan; the arm stays where it stopped.
    """
    if mode not in MODES:
        raise InputError(f"There is no mode {mode!r}.", f"Give one of {', '.join(MODES)}.")
    config = dataclasses.replace(robot.config, scan=settings or robot.config.scan)
    require_window(config, config.scan.tallest_mm)
    survey = Survey(config.scan)
    survey.resume(known)
    require_reachable(stage, arm_targets_mm(config.scan))
    steps = Steps(robot, stage, config, on_event=on_event, arm_timeout_s=arm_timeout_s)
    try:
        return _run(steps, survey, config.scan, mode, earlier_s, scene or {})
    finally:
        steps.close()


def _run(
    steps: Steps,
    survey: Survey,
    settings: Scan,
    mode: Mode,
    earlier_s: float,
    scene: Mapping[str, Any],
) -> ScanResult:
    start_us = steps.now_us
    places: list[Place] = list(survey.places)

    def found(cell: Cell, feeling: Feeling) -> None:
        contact = feeling.contact
        place = survey.make(
            cell,
            feeling.mark,
            height_mm=feeling.height_mm,
            uncertainty_mm=contact.uncertainty_mm if contact else np.nan,
            time_us=steps.now_us,
        )
        places.append(place)
        steps.emit("place", **place.data(), known=survey.known, total=len(survey),
                   contact=contact and contact_data(contact))  # fmt: skip

    steps.emit(
        "scan_start",
        mode=mode,
        order=settings.order,
        step_mm=settings.step_mm,
        columns=survey.columns,
        rows=survey.rows,
        lengths_mm=[steps.short_mm, steps.long_mm],
        known=survey.known,
        earlier_s=earlier_s,
    )
    try:
        if mode == "paper":
            cycles.paper(steps, survey, settings.order, found)
        elif mode == "safe":
            cycles.safe(steps, survey, settings.order, found)
        else:
            adaptive.adaptive(steps, survey, settings, found)
        steps.retract()
        steps.emit("arm_return")
        steps.go(0.0, 0.0)
    except BaseException as error:
        steps.stop(error)
        # If the log is what failed, it can't be told there.
        with contextlib.suppress(SetaeError):
            steps.emit("scan_aborted", reason=f"{type(error).__name__}: {error}".strip(": "))
        raise
    duration_s = earlier_s + (steps.now_us - start_us) / 1e6
    steps.emit("scan_end", duration_s=duration_s)
    return ScanResult(
        height_map=survey.height_map(),
        places=tuple(places),
        mode=mode,
        duration_s=duration_s,
        complete=survey.known == len(survey),
        scene=scene,
    )


# ------------------------------------------------------------------------- simulated


class HasSurface(Protocol):
    """A simulated world that can be asked for its true surface."""

    def surface_mm(self, x_mm: float, y_mm: float, *, bottom_mm: float, top_mm: float) -> float:
        """Height of the topmost solid."""
        ...


def true_surface(
    world: HasSurface, x_mm: ArrayLike, y_mm: ArrayLike, scene: TableScene
) -> NDArray[np.float64]:
    """Heights of the simulated scene, (R, C), at rows y and columns x of the world."""
    return np.array(
        [
            [
                world.surface_mm(
                    float(x), float(y), bottom_mm=scene.table_z_mm - _BELOW_TABLE_MM, top_mm=0.0
                )
                for x in np.asarray(x_mm, dtype=float)
            ]
            for y in np.asarray(y_mm, dtype=float)
        ]
    )


def record_true_surface(
    recorder: Recorder, world: HasSurface, scene: TableScene, settings: Scan
) -> None:
    """Write the simulated scene's true surface into a log, for reports only."""
    survey = Survey(settings)
    step_mm = settings.step_mm / _FINER
    x_mm, y_mm = (
        np.arange((count - 1) * _FINER + 1) * step_mm for count in (survey.columns, survey.rows)
    )
    heights_mm = true_surface(world, x_mm, y_mm, scene)
    recorder.experiment(
        0,
        "true_surface",
        {"step_mm": step_mm, "height_mm": np.round(heights_mm, 3), "table_mm": scene.table_z_mm},
    )


def in_scene(config: Config, scene: TableScene) -> Config:
    """The configuration with how tall the simulated scene is, as a person would tell it.

    Examples
    --------
    >>> from setae.config import load
    >>> from setae.objects import ScanObject, table_scene
    >>> config = load()
    >>> in_scene(config, table_scene(config, ScanObject(shape="eraser"))).scan.tallest_mm
    29.0
    """
    top_mm = scene.table_z_mm + (scene.object.height_mm if scene.object else 0.0)
    tallest_mm = max(0.0, round(top_mm - config.scan_reach_mm, 6))
    return dataclasses.replace(config, scan=dataclasses.replace(config.scan, tallest_mm=tallest_mm))


def simulate(
    config: Config,
    scene: TableScene,
    *,
    mode: Mode = "paper",
    seed: int = 0,
    plant: str | None = None,
    log: Path | None = None,
    on_event: OnEvent | None = None,
) -> ScanResult:
    """Scan a simulated scene, in this process.

    Parameters
    ----------
    config
        Robot and settings; `tallest_mm` follows from the scene.
    scene
        Table and object, see `setae.objects.table_scene`.
    mode, on_event
        As in `scan`.
    seed
        Of the simulator.
    plant
        The simulated robot; None: the configured one.
    log
        Where to write a log, if at all; it must not exist.

    Raises
    ------
    HeightWindowError
        The robot at rest would press into the scene, or as in `scan`.
    SetaeError
        As in `scan`.
    """
    if plant is not None:
        config = dataclasses.replace(config, plant=plant)
    config = in_scene(config, scene)
    require_window(config, config.scan.tallest_mm)
    require_free_start(config, scene)
    with rig.open("sim://", config=config, seed=seed, scene=scene) as opened:
        told = on_event
        if log is not None:
            recorder = opened.record(log, metadata={"experiment": EXPERIMENT, "mode": mode})
            assert opened.world is not None, "a simulated rig has a world"
            record_true_surface(recorder, opened.world, scene, config.scan)
            told = recorded(recorder, on_event)
        opened.robot.enable()
        return scan(
            opened.robot, opened.stage, mode=mode, on_event=told, scene=scene.describe()["scene"]
        )


def recorded(recorder: Recorder, on_event: OnEvent | None = None) -> OnEvent:
    """Write events into a log, then pass them on."""

    def told(event: Any) -> None:
        recorder.experiment(event.time_us, event.name, event.data)
        if on_event is not None:
            on_event(event)

    return told
