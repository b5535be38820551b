"""`setae cloud`, `cluster` and `classify`, from files to answers."""

from __future__ import annotations

import csv
import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from tests.perception.synthetic import CONFIG, REACH_MM, felt

from setae.cli import main
from setae.config import Config, replaced
from setae.errors import InputError
from setae.experiments import samples, scan, study
from setae.experiments.shapes import compare
from setae.heightmap import HeightMap
from setae.objects import SHAPES, ScanObject, random_object, table_scene
from setae.perception import cloud, maps
from setae.report import cluster as pages

SEEDS = range(110, 113)


def told(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    captured = capsys.readouterr()
    assert ended.value.code == code, captured.err
    return captured.out if code == 0 else captured.err


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Maps of real scans, as it were: only whoever scanned knows what they are."""
    folder = tmp_path_factory.mktemp("maps")
    words = []
    for shape in SHAPES:
        for seed in SEEDS:
            path = folder / f"{shape}-{seed}.npz"
            maps.write(path, felt(random_object(shape, seed), seed=seed))
            words.append(f"{shape}={path}")
    return words


def test_what_was_compared_is_known_later_and_what_was_not_is_unknown(
    given: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "shapes.json"
    known = [word for word in given if not word.startswith("coil=")]
    out = tmp_path / "out"
    printed = told(capsys, "cluster", *known, "--out", str(out), "--model", str(model))
    assert "Named right 100%" in printed
    page = (out / "report.html").read_text()
    assert "12 of 12 scans are named right" in page
    trials = list(csv.DictReader((out / "trials.csv").read_text().splitlines()))
    assert len(trials) == 12
    for name, answer in (("orange", "orange"), ("coil", "unknown")):
        path = tmp_path / f"new-{name}.npz"
        maps.write(path, felt(random_object(name, 150), seed=150))
        line = told(capsys, "classify", str(path), "--model", str(model)).splitlines()[1]
        assert line.split()[1] == answer


def test_unknown_has_no_confidence(given: list[str], tmp_path: Path) -> None:
    # "unknown, 100 %": the confidence in the nearest shape stood beside it.
    one_coil = [word for word in given if not word.startswith("coil=")]
    one_coil.append(next(word for word in given if word.startswith("coil=")))
    pages.write(compare(samples.read_all(one_coil)), tmp_path)
    trials = list(csv.DictReader((tmp_path / "trials.csv").read_text().splitlines()))
    assert [row["confidence"] for row in trials if row["named"] == "unknown"] == [""]
    assert all(0.5 < float(row["confidence"]) < 1 for row in trials if row["named"] != "unknown")
    assert ">unknown</span></td><td>–</td>" in (tmp_path / "report.html").read_text()


def test_a_scan_given_twice_counts_once(given: list[str]) -> None:
    # It vouched for itself: the folder of a study, given twice, made every scan known.
    found = compare(samples.read_all([*given, given[0]]))
    assert len(found.labels) == len(given)
    assert "It is the same as lidded_container-110." in found.left_out[0]


def test_scans_without_a_shape_are_left_out_by_name(
    given: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # One scan that felt too little, or a study's bare table, ended the command for all others.
    few = felt(random_object("orange", 1))
    nothing = np.full_like(few.height_mm, np.nan)
    nothing[10, 8:12] = -100.0
    mark = np.where(np.isnan(nothing), "empty", "felt")
    maps.write(tmp_path / "few.npz", dataclasses.replace(few, height_mm=nothing, mark=mark))
    study.conduct(
        study.of_options(
            objects=["none"], seeds=1, vary=["scan.area_mm=[20,20]", "scan.step_mm=20"]
        ).runs(),
        tmp_path / "study",
        workers=1,
    )
    model = tmp_path / "shapes.json"
    odd = (f"orange={tmp_path / 'few.npz'}", str(tmp_path / "study"))
    command = ("cluster", *given, *odd, "--model", str(model), "--out", str(tmp_path / "out"))
    with pytest.raises(SystemExit) as ended:
        main(command)
    printed = capsys.readouterr()
    assert ended.value.code == 0
    assert "few is left out: The scan has 4 heights, and a shape needs 6." in printed.err
    assert "none-0-adaptive" in printed.err
    assert "bare table" in printed.err
    assert re.search(rf"orange +{len(SEEDS)} +{len(SEEDS)} ", printed.out)
    assert "few is left out" in (tmp_path / "out" / "report.html").read_text()
    whole = given[0].partition("=")[2]
    with pytest.raises(SystemExit) as ended:
        main(["classify", str(tmp_path / "few.npz"), whole, "--model", str(model)])
    printed = capsys.readouterr()
    assert ended.value.code == 0
    assert "few is left out" in printed.err
    assert len(printed.out.splitlines()) == 2
    error = told(capsys, "classify", str(tmp_path / "few.npz"), "--model", str(model), code=1)
    assert "nothing to name" in error


def test_scans_of_the_simulator_know_what_they_are_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small: Config = replaced(CONFIG, {"scan.area_mm": [100, 100], "scan.step_mm": 25})
    what = ScanObject(shape="lidded_container", x_mm=90, y_mm=90)
    log = tmp_path / "run" / "scan.mcap"
    log.parent.mkdir()
    scene = table_scene(small, what)
    result = scan.simulate(small, scene, mode="adaptive", log=log)
    (sample,) = samples.read(log.parent)
    assert sample.label == "lidded_container"
    assert sample.reach_mm == REACH_MM
    assert sample.scene == scene
    told(capsys, "cloud", str(log), "--format", "ply", "--format", "map",
         "--out", str(tmp_path / "cloud"))  # fmt: skip
    points = cloud.read(tmp_path / "cloud" / "scan.ply").points_mm
    assert points == pytest.approx(result.height_map.points_mm(), abs=1e-4)
    assert (maps.read(tmp_path / "cloud" / "scan-map.npz").mark == result.height_map.mark).all()


def test_what_is_missing_is_told(given: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    path = given[0].partition("=")[2]
    assert "NAME=PATH" in told(capsys, "cluster", path, given[5], given[9], code=1)
    assert "nothing to compare" in told(capsys, "cluster", given[0], code=1)
    assert "There is no" in told(capsys, "cloud", "nowhere", code=1)
    assert "setae cluster --model" in told(capsys, "classify", path, "--model", path, code=1)


def test_a_report_without_truth_has_no_measures_against_it(
    given: list[str], tmp_path: Path
) -> None:
    found = compare(samples.read_all(given))
    assert found.nearness == (None,) * len(given)
    page = pages.write(found, tmp_path).page.read_text()
    assert "Chamfer distance" not in page
    # That unknown counts as wrong was said beside the figure, and by no test.
    assert found.accuracy == 1.0
    unknown = dataclasses.replace(found.answers[0], known=False)
    doubted = dataclasses.replace(found, answers=(unknown, *found.answers[1:]))
    assert doubted.accuracy == pytest.approx(1 - 1 / len(given))
    with pytest.raises(InputError, match="nothing to compare"):
        compare(found.samples[:2])


def test_a_coarse_scan_has_no_height_error_and_finer_ones_count_by_their_places(
    tmp_path: Path,
) -> None:
    # Of an object without a place away from edges the report told "nan", and the terminal NumPy's
    # "Mean of empty slice". And a scan with a single such place counted as much as one with fifty.
    trials = {
        "orange": (felt(orange := random_object("orange", 1), seed=1, step_mm=20.0), orange),
        "lid": (felt(lid := ScanObject(shape="lidded_container"), noise_mm=0, ragged=0), lid),
        "high": (felt(lid, noise_mm=0, ragged=0, step_mm=25.0), lid),
    }
    high = trials["high"][0]
    raised = dataclasses.replace(high, height_mm=high.height_mm + 3.0)
    found = compare(
        [
            samples.Sample(
                name=name,
                label=what.shape,
                heights=raised if name == "high" else heights,
                reach_mm=REACH_MM,
                scene=table_scene(CONFIG, what),
                origin="made up",
            )
            for name, (heights, what) in trials.items()
        ]
    )
    near = {one.name: by for one, by in zip(found.samples, found.nearness, strict=True) if by}
    assert near["orange"].places == 0
    few, many = near["high"].places, near["lid"].places
    assert 0 < few < many / 3
    page = pages.write(found, tmp_path).page.read_text()
    told = f"<td>{3 * np.sqrt(few / (few + many)):.2f} mm</td>"
    assert told in page
    assert "nan" not in (tmp_path / "trials.csv").read_text()
    assert ">nan" not in page


def test_a_scan_that_ended_early_is_taken_as_far_as_it_goes_and_told(
    given: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A cut log gave four points of a whole scan, and nothing said so."""
    whole = maps.read(Path(given[0].partition("=")[2]))
    mark = whole.mark.astype("U9")
    mark[:3] = "unvisited"
    height_mm = np.where(mark == "unvisited", np.nan, whole.height_mm)
    half = maps.write(
        tmp_path / "half.npz",
        HeightMap(x_mm=whole.x_mm, y_mm=whole.y_mm, height_mm=height_mm, mark=mark),
    )
    with pytest.raises(SystemExit) as ended:
        main(["cloud", str(half), "--out", str(tmp_path / "out")])
    assert ended.value.code == 0
    expected = f"setae: half is not whole: {3 * mark.shape[1]} of {mark.size} places"
    assert capsys.readouterr().err.startswith(expected)
