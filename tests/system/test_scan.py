"""Scans of small squares, end to end: host, link, the board's own code, plant and arm."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from setae import record, rig
from setae.cli import main
from setae.config import Config, load
from setae.errors import HeightWindowError, InputError, LogError, RefusedError
from setae.experiments.events import Event
from setae.experiments.scan import (
    MODES,
    Mode,
    ScanResult,
    read,
    recorded,
    scan,
    simulate,
    true_surface,
)
from setae.experiments.scan.steps import Steps
from setae.heightmap import TOUCHED
from setae.objects import ScanObject, TableScene, table_scene
from setae.solids import Box, Ellipsoid, Solid
from setae_protocol.messages import State

STEP_MM = 20.0
HEIGHT_ERROR_MM = 2.0


def coarse(places: int, **settings: Any) -> Config:
    """The paper's robot, for a scan of so many places square."""
    config = load()
    side_mm = (places - 1) * STEP_MM
    fields: dict[str, Any] = {"area_mm": (side_mm, side_mm), "step_mm": STEP_MM, **settings}
    return dataclasses.replace(config, scan=dataclasses.replace(config.scan, **fields))


def eraser_at(middle_mm: float) -> ScanObject:
    """A board eraser along y."""
    return ScanObject(shape="eraser", x_mm=middle_mm, y_mm=middle_mm, yaw_deg=90.0)


@dataclass(frozen=True)
class Blocks:
    """A scene of boxes."""

    solids: tuple[Solid, ...]

    def describe(self) -> dict[str, Any]:
        return {"scene": {}}


def wall(x_mm: float, *, top_mm: float, thick_mm: float = 4.0) -> Blocks:
    """A wall across the rows; `top_mm` is the height of its top in the world."""
    high_mm = 60.0
    box = Box(
        centre_mm=(x_mm, 0.0, top_mm - high_mm / 2),
        edges_mm=(thick_mm, 400.0, high_mm),
        yaw_rad=0.0,
    )
    return Blocks((box,))


@pytest.mark.parametrize("mode", MODES)
def test_each_mode_finds_the_object_and_its_height(mode: Mode) -> None:
    config = coarse(4)
    scene = table_scene(config, eraser_at(40.0))
    events: list[Event] = []
    result = simulate(config, scene, mode=mode, on_event=events.append)
    grid = result.height_map
    with rig.open("sim://", config=config, scene=scene) as opened:
        assert opened.world is not None
        true_mm = true_surface(opened.world, grid.x_mm, grid.y_mm, scene)
    # The handle, 15 mm to both sides of its middle; the felt ends 26 mm from it.
    assert np.isfinite(grid.height_mm[:, 2]).all()
    assert not np.isfinite(grid.height_mm[:, 0]).any()
    error_mm = np.abs(grid.height_mm - true_mm)[:, 2]
    assert error_mm.max() < HEIGHT_ERROR_MM
    assert result.complete
    assert result.mode == mode
    assert result.duration_s == pytest.approx(events[-1].data["duration_s"])
    assert events[-1].name == "scan_end"
    short_mm, long_mm = config.scan_lengths_mm
    lengths = {round(event.data["length_mm"]) for event in events if event.name == "step"}
    if mode == "safe":
        assert lengths == {round(short_mm)}, "retracted in every step"
    else:
        assert round(long_mm) in lengths, "extended where nothing is"


def test_the_paper_cycle_measures_after_a_contact_with_the_robot_short_in_between() -> None:
    config = coarse(4)
    events: list[Event] = []
    simulate(config, table_scene(config, eraser_at(40.0)), on_event=events.append)
    names = [event.name for event in events]
    first = names.index("step_contact")
    place = names.index("place", first)
    # The step ends short, if it has not ended yet; then comes the measurement.
    assert names[first + 1 : place] in ([], ["step"])
    assert all(
        event.data["length_mm"] == pytest.approx(20, abs=0.1) for event in events[first + 1 : place]
    )
    assert events[place].data["mark"] in TOUCHED
    # After it, short steps until a full extension feels nothing, then extended ones.
    rest = [event for event in events[place + 1 :] if event.name in ("step", "place")]
    length_mm = 20.0
    for event in rest[:-1]:
        if event.name == "step":
            assert event.data["length_mm"] == pytest.approx(length_mm, abs=0.1)
        else:
            length_mm = 20.0 if event.data["mark"] in TOUCHED else 70.0


def test_the_adaptive_scan_finds_the_same_in_less_time() -> None:
    config = coarse(6, coarse_mm=40.0)
    scene = table_scene(config, eraser_at(50.0))
    paper, adaptive = (simulate(config, scene, mode=mode) for mode in ("paper", "adaptive"))
    same = np.isfinite(paper.height_map.height_mm) == np.isfinite(adaptive.height_map.height_mm)
    assert same.mean() > 0.9
    assert adaptive.duration_s < 0.6 * paper.duration_s
    assert "inferred" in adaptive.height_map.mark
    both = np.isfinite(paper.height_map.height_mm + adaptive.height_map.height_mm)
    difference_mm = (paper.height_map.height_mm - adaptive.height_map.height_mm)[both]
    assert np.median(np.abs(difference_mm)) < 0.5


def test_the_adaptive_scan_finds_where_an_object_ends_between_its_rows() -> None:
    # A ring's end between two rows that were traced was taken for nothing: both rows had nothing
    # there, one of them beyond the ring and the other in its hole. So were other round ends.
    config = coarse(7, coarse_mm=60.0)
    top_mm, high_mm = -100.0, 30.0
    parts = [(20.0, 55.0, 14.0, 50.0), (60.0, 55.0, 14.0, 50.0), (40.0, 80.0, 54.0, 16.0)]
    scene = Blocks(
        tuple(
            Box(
                centre_mm=(x_mm, y_mm, top_mm - high_mm / 2),
                edges_mm=(wide_mm, deep_mm, high_mm),
                yaw_rad=0.0,
            )
            for x_mm, y_mm, wide_mm, deep_mm in parts
        )
    )
    with rig.open("sim://", config=config, scene=scene) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage, mode="adaptive")
    heights_mm = result.height_map.height_mm
    assert np.isfinite(heights_mm[3, (1, 3)]).all()
    assert np.isnan(heights_mm[3, 2])
    assert np.isnan(heights_mm[6]).all()
    assert heights_mm[4, 2] == pytest.approx(top_mm, abs=HEIGHT_ERROR_MM)


def test_the_adaptive_scan_finds_where_a_narrow_object_ends_between_its_rows() -> None:
    # Seen in one row only, and at one place there, its end in the next row was taken for nothing.
    config = coarse(7, coarse_mm=60.0)
    top_mm = -100.0
    strip = Box(centre_mm=(60.0, 70.0, top_mm - 15.0), edges_mm=(14.0, 34.0, 30.0), yaw_rad=0.0)
    with rig.open("sim://", config=config, scene=Blocks((strip,))) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage, mode="adaptive")
    heights_mm = result.height_map.height_mm
    assert heights_mm[3:5, 3] == pytest.approx(top_mm, abs=HEIGHT_ERROR_MM)
    assert np.isfinite(heights_mm).sum() == 2


def test_nothing_is_found_on_an_empty_table() -> None:
    for mode in MODES:
        config = coarse(3)
        events: list[Event] = []
        result = simulate(config, table_scene(config), mode=mode, on_event=events.append)
        assert not len(result.height_map.points_mm())
        assert set(result.height_map.mark.ravel()) <= {"empty", "inferred"}
        assert not any(event.name == "step_contact" for event in events)


def test_a_contact_in_a_step_stops_the_arm_and_the_board_retracts() -> None:
    config = coarse(2, step_mm=60.0, area_mm=(60.0, 0.0))
    with rig.open("sim://", config=config, scene=wall(15.0, top_mm=-100.0)) as opened:
        opened.robot.enable()
        where: list[tuple[float, float]] = []

        def on_event(event: Event) -> None:
            if event.name == "step_contact":
                assert not opened.stage.moving
                where.append((opened.stage.position_mm[0], opened.robot.position_mm[2]))

        scan(opened.robot, opened.stage, on_event=on_event)
    x_mm, length_mm = where[0]
    assert 13.0 < x_mm < 45.0, "before the place it was sent to"
    assert length_mm == pytest.approx(20, abs=0.1)


def test_the_arm_goes_to_a_place_though_the_robot_can_not_extend_further() -> None:
    # An extended robot has no extension left to take the arm along: the place that was asked
    # for was found empty without a move of the arm.
    config = coarse(2)
    with rig.open("sim://", config=config, scene=table_scene(config)) as opened:
        opened.robot.enable()
        steps = Steps(opened.robot, opened.stage, config)
        assert steps.extended
        feeling = steps.go_and_feel(STEP_MM, 0.0)
        assert feeling is not None
        assert feeling.mark == "empty"
        assert steps.position_mm[0] == pytest.approx(STEP_MM, abs=0.1)
        steps.close()


def test_a_bent_bristle_comes_free_though_it_presses_hard() -> None:
    # Retracting from a contact in a step pressed harder than an unguarded motion may, and the
    # scan ended there.
    config = coarse(4)
    bristle = dataclasses.replace(config.bristle, coarse_threshold_hpa=17.0)
    config = dataclasses.replace(config, bristle=bristle)
    scene = wall(45.0, top_mm=-105.0, thick_mm=30.0)
    with rig.open("sim://", config=config, scene=scene) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage, mode="adaptive")
    assert result.complete
    assert np.isfinite(result.height_map.height_mm[:, 2]).all()


@pytest.mark.parametrize("coarse_threshold_hpa", [17.0, 30.0])
def test_a_retraction_that_the_bristle_stopped_is_ended_before_anything_else(
    coarse_threshold_hpa: float,
) -> None:
    # The board's own retraction ended early, because the bent bristle pressed harder than an
    # unguarded motion may. The paper's scan took the robot for short, found itself in touch
    # where it wanted to extend, and ended in an AssertionError.
    config = coarse(4)
    bristle = dataclasses.replace(config.bristle, coarse_threshold_hpa=coarse_threshold_hpa)
    config = dataclasses.replace(config, bristle=bristle)
    scene = wall(45.0, top_mm=-105.0, thick_mm=30.0)
    events: list[Event] = []
    with rig.open("sim://", config=config, scene=scene) as opened:
        opened.robot.enable()

        def on_event(event: Event) -> None:
            events.append(event)
            if event.name == "place" and event.data["mark"] in TOUCHED:
                assert opened.robot.position_mm[2] == pytest.approx(20, abs=0.1)

        result = scan(opened.robot, opened.stage, on_event=on_event)
    assert result.complete
    assert np.isfinite(result.height_map.height_mm[:, 2]).all()
    names = [event.name for event in events]
    assert "step_contact" in names
    assert "in_touch" not in names


def test_what_is_touched_beside_a_place_and_not_at_it_is_lost() -> None:
    # A thin wall between two columns: the steps run into it, the extensions miss it.
    config = coarse(2)
    with rig.open("sim://", config=config, scene=wall(10.0, top_mm=-110.0)) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage)
    assert "lost" in result.height_map.mark[:, 1]
    assert not np.isfinite(result.height_map.height_mm).any()


def test_what_is_higher_than_the_short_robot_ends_the_scan() -> None:
    config = coarse(2)
    with rig.open("sim://", config=config, scene=wall(12.0, top_mm=-60.0)) as opened:
        opened.robot.enable()
        events: list[Event] = []
        with pytest.raises(HeightWindowError, match="can't be stepped over"):
            scan(opened.robot, opened.stage, mode="safe", on_event=events.append)
        assert events[-1].name == "scan_aborted"
        assert opened.robot.state is State.STOPPED
        assert opened.stage.position_mm[0] < 20.0


def test_a_window_that_is_too_small_is_told_before_anything_moves() -> None:
    config = coarse(2)
    scene = TableScene(table_z_mm=-138.0, object=ScanObject(shape="orange", x_mm=20, y_mm=20))
    events: list[Event] = []
    with pytest.raises(HeightWindowError, match="Raise the arm's start by 20 mm"):
        simulate(config, scene, on_event=events.append)
    assert not events


def test_a_robot_that_was_in_touch_before_the_scan_is_told_to_start_higher() -> None:
    # Its rest pressure was taken in touch. "Begin where it touches nothing" was no help: the
    # retracted robot touched nothing.
    config = coarse(2)
    with rig.open("sim://", config=config, scene=TableScene(table_z_mm=-120.0)) as opened:
        opened.robot.enable()
        with pytest.raises(RefusedError) as refused:
            scan(opened.robot, opened.stage)
    assert "Raise the arm's start until the robot at its free length" in refused.value.__notes__[0]


def test_a_contact_at_the_very_start_of_an_extension_is_flagged() -> None:
    config = coarse(2)
    # Its top is just below the short robot's tip.
    block = wall(20.0, top_mm=-(20.0 + 65.0) - 0.5, thick_mm=20.0)
    with rig.open("sim://", config=config, scene=block) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage)
    assert result.height_map.mark.tolist() == [["empty", "double"]] * 2


@pytest.mark.parametrize(("slip_hpa", "mark"), [(8.0, "felt"), (2.0, "slipped")])
def test_pressure_that_falls_back_before_the_contact_is_a_slip(slip_hpa: float, mark: str) -> None:
    # The bristle slides down a ball's flank, by 3 hPa, before it rests on what the ball lies in.
    config = coarse(2, area_mm=(12.0, 0.0), step_mm=12.0, slip_hpa=slip_hpa)
    ball = Ellipsoid(centre_mm=(35.0, 0.0, -135.0), semi_axes_mm=(25.0, 25.0, 25.0), yaw_rad=0.0)
    floor = Box(centre_mm=(35.0, 0.0, -145.0), edges_mm=(60.0, 400.0, 30.0), yaw_rad=0.0)
    with rig.open("sim://", config=config, scene=Blocks((ball, floor))) as opened:
        opened.robot.enable()
        result = scan(opened.robot, opened.stage, mode="safe")
    assert result.height_map.mark.tolist() == [["empty", mark]]
    assert result.height_map.height_mm[0, 1] == pytest.approx(-130.0, abs=HEIGHT_ERROR_MM)


def test_rows_go_to_and_fro_or_all_the_same_way() -> None:
    ways = {"zigzag": [0, 1, 1, 0], "raster": [0, 1, 0, 1]}
    for order, columns in ways.items():
        config = coarse(2, order=order)
        result = simulate(config, table_scene(config), mode="safe")
        assert [place.cell[0] for place in result.places] == columns


def test_an_aborted_scan_goes_on_from_its_own_log_to_the_same_map(tmp_path: Path) -> None:
    config = coarse(3)
    scene = table_scene(config, eraser_at(40.0))
    whole = simulate(config, scene)
    for mode in ("paper", "adaptive"):
        folder = tmp_path / mode
        folder.mkdir()
        _abort_after(4, config, scene, folder / f"{mode}.mcap", mode)
        begun = read(folder)
        assert not begun.complete
        assert 4 <= len(begun.places) < 9
        with pytest.raises(SystemExit) as ended:
            main(["scan", "--resume", str(folder), "--no-report"])
        assert ended.value.code == 0
        result = read(folder)
        assert result.complete
        assert len(result.places) == 9, "no place twice"
        # Whether the time of the earlier part counted was never looked at.
        (end,) = record.read(folder / f"{mode}-2.mcap").events("scan_end")
        assert result.duration_s == pytest.approx(end.data["duration_s"])
        assert result.duration_s - begun.duration_s > 5.0
        ours, theirs = result.height_map, whole.height_map
        assert (np.isfinite(ours.height_mm) == np.isfinite(theirs.height_mm)).all()
        assert np.nanmax(np.abs(ours.height_mm - theirs.height_mm)) < HEIGHT_ERROR_MM


def _abort_after(places: int, config: Config, scene: TableScene, log: Path, mode: Mode) -> None:
    """Scan until so many places are known, then press Ctrl-C."""

    def on_event(event: Event) -> None:
        if event.name == "place" and event.data["known"] >= places:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(config, scene, mode=mode, log=log, on_event=on_event)


def test_a_log_of_another_grid_is_not_resumed() -> None:
    config = coarse(2)
    known = simulate(config, table_scene(config)).places
    other = coarse(2, step_mm=10.0)
    with rig.open("sim://", config=other, scene=table_scene(other)) as opened:
        opened.robot.enable()
        with pytest.raises(InputError, match="none of this scan"):
            scan(opened.robot, opened.stage, known=known)


def test_reading_a_log_gives_what_the_scan_gave(tmp_path: Path) -> None:
    config = coarse(3)
    scene = table_scene(config, eraser_at(40.0))
    result = simulate(config, scene, log=tmp_path / "paper.mcap", seed=3)
    again = read(tmp_path)
    assert_same(again, result)
    assert again.scene["object"]["shape"] == "eraser"
    for place in again.places:
        assert np.isfinite(place.uncertainty_mm) == (place.mark in TOUCHED)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(LogError, match="holds no log"):
        read(empty)


def assert_same(one: ScanResult, other: ScanResult) -> None:
    assert (one.height_map.mark == other.height_map.mark).all()
    np.testing.assert_allclose(
        one.height_map.height_mm, other.height_map.height_mm, atol=1e-5, equal_nan=True
    )
    assert one.duration_s == pytest.approx(other.duration_s)
    assert one.complete == other.complete


def test_events_reach_the_log_before_the_listener(tmp_path: Path) -> None:
    with record.Recorder(tmp_path / "log.mcap") as recorder:

        def interrupted(event: Event) -> None:
            raise KeyboardInterrupt(event.name)

        with pytest.raises(KeyboardInterrupt, match="place"):
            recorded(recorder, interrupted)(Event(time_us=1, name="place", data={}))
    assert record.read(tmp_path / "log.mcap").events("place")
