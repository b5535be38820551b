"""Reports of the tube exploration, from logs that a small stand-in for the robot writes."""

from __future__ import annotations

import base64
import csv
import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.host.exploration import write_log, write_run

from setae import report
from setae.config import load
from setae.errors import ExtraMissingError, LogError
from setae.record import Recorder, read
from setae.report import animation, explore, html, palette
from setae.report.reading import load as load_trial
from setae.servo import ServoModel


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of five trials like the paper's, and their report in the same folder."""
    folder = write_run(tmp_path_factory.mktemp("runs") / "explore-1")
    report.write(folder, folder / "report.html")
    return folder


class Page(HTMLParser):
    """What a browser would load, and the cells of the table."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.rows: list[list[str]] = []
        self.text: list[str] = []
        self._cell = False
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self._inside = tag
        if tag != "a":
            self.loads += [value for key in ("src", "href") if (value := found.get(key))]
        if tag == "tr":
            self.rows.append([])
        self._cell = self._cell or tag == "td"
        if tag == "td":
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""
        if tag == "td":
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.rows[-1][-1] += data
        if self._inside not in ("script", "style"):
            self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())

    @property
    def table(self) -> list[list[str]]:
        return [row for row in self.rows if row]


def data_of(text: str) -> Any:
    found = re.search(r'<script type="application/json" id="run">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_page_puts_the_run_beside_the_paper(run: Path) -> None:
    page = Page((run / "report.html").read_text())
    assert [row[:3] + row[6:] for row in page.table] == [
        ["1", "35", "40", "40", "yes", "✓ same"],
        ["2", "55", "60", "60", "yes", "✓ same"],
        ["3", "75", "80", "80", "yes", "✓ same"],
        ["4", "95", "100", "100", "yes", "✓ same"],
        ["5", "none", "100", "100", "no", "✓ same"],
    ]
    assert [row[3] for row in page.table] == ["yes", "yes", "yes", "yes", "no"]
    assert "found the obstacle in 4 of 4 trials" in page.words
    assert "Simulated, seed 7" in page.words


def test_other_results_give_another_table(tmp_path: Path) -> None:
    """A robot that gives up after two levels, and an obstacle the paper doesn't have."""
    write_log(tmp_path / "a.mcap", 1, 95.0, levels=2)
    write_log(tmp_path / "b.mcap", 2, 42.0)
    write_log(tmp_path / "c.mcap", 3, None, levels=3, to_the_end=False)
    text = html.page(explore.trials(tmp_path))
    page = Page(text)
    assert page.table[0][2:] == ["40", "no", "0", "16", "100", "yes", "✗ differs"]
    assert page.table[1][1:3] == ["42", "40"]
    assert page.table[1][6:] == ["–", "–", ""]
    # A trial without its end is shown, but neither judged nor counted.
    assert page.table[2][0] == "3 (not complete)"
    assert page.table[2][6:] == ["100", "no", ""]
    assert "found the obstacle in 1 of 2 trials. It did otherwise" in page.words
    assert "Trial 3 ended early and does not count." in page.words
    assert page.table[2][3] == "not yet"


def test_what_a_reader_is_told_of_few_and_of_interrupted_trials(tmp_path: Path) -> None:
    """It said "in all 1 trials that the paper reports", and "KeyboardInterrupt"."""
    write_log(tmp_path / "a.mcap", 1, None)
    with Recorder(tmp_path / "b.mcap", metadata={"simulated": True, "trial": 2}) as recorder:
        recorder.experiment(0, "trial_start", {"obstacle": {"below_tip_mm": 35.0}})
        recorder.experiment(1_000_000, "trial_aborted", {"reason": "KeyboardInterrupt"})
    page = Page(html.page(explore.trials(tmp_path)))
    assert "touched nothing. It stopped at the same depth as the paper’s robot." in page.words
    assert "Trial 2 ended early and does not count." in page.words
    assert "not complete: somebody ended it with Ctrl-C" in page.words
    assert "KeyboardInterrupt" not in page.words


def test_the_cubes_direction_is_said_where_it_is_not_the_usual_one(tmp_path: Path) -> None:
    """Trials at 0 and at 135 degrees looked the same in table, tabs and pictures."""
    labels: list[str] = []
    for centre_mm in ([50.0, 0.0, -165.0], [-35.355, -35.355, -165.0]):  # y of frame D is -y
        path = tmp_path / f"{len(labels)}.mcap"
        cube = {"centre_mm": centre_mm, "edge_mm": 40.0, "yaw_rad": 0.0}
        with Recorder(path, metadata={"scene": {"cube": cube}}) as recorder:
            recorder.experiment(0, "trial_start", {"obstacle": {"below_tip_mm": 35.0}})
        labels.append(load_trial(read(path)).label)
    assert labels == ["obstacle 35 mm below", "obstacle 35 mm below at α = 135°"]


def test_the_page_loads_nothing(run: Path) -> None:
    text = (run / "report.html").read_text()
    page = Page(text)
    assert page.loads == ["data:,"]
    outside_scripts = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert "http" not in outside_scripts
    assert "@import" not in outside_scripts
    own_script = resources.files("setae.report.page").joinpath("page.js").read_text()
    for call in ("fetch(", "XMLHttpRequest", "import(", "http:", "https:"):
        assert call not in own_script


def test_the_page_is_of_a_size_that_can_be_sent(run: Path) -> None:
    assert (run / "report.html").stat().st_size < 15e6


def test_the_page_holds_the_robots_motion(run: Path) -> None:
    trial = data_of((run / "report.html").read_text())["trials"][0]
    motion = trial["motion"]
    seconds = np.frombuffer(base64.b64decode(motion["time_s"]), "<f4")
    points = np.frombuffer(base64.b64decode(motion["points"]), "<i2").astype(float)
    points = points.reshape(len(seconds), motion["per_frame"], 3) * motion["step_mm"]
    assert 5 <= len(seconds) / trial["duration_s"] <= 10
    arm, tip = points[:, 0], points[:, 2]
    assert arm[:, 2].min() == pytest.approx(-40.0, abs=0.1)
    touch = trial["contacts"][0]
    near = int(np.argmin(np.abs(seconds - touch["time_s"])))
    np.testing.assert_allclose(tip[near], touch["point_mm"], atol=5.0)


def test_a_page_says_when_it_was_measured(tmp_path: Path) -> None:
    """Without the simulator's truth, shapes come from the pulses and nothing says simulated."""
    path = tmp_path / "real.mcap"
    model = ServoModel(load())
    lengths_mm = (50.0, 45.0, 40.0, 45.0)
    with Recorder(path, metadata={"simulated": False}) as recorder:
        recorder.experiment(0, "trial_start", {"obstacle": {"below_tip_mm": 35.0}})
        for frame in range(50):
            recorder.telemetry(
                frame * 20_000,
                frame=frame,
                state="holding",
                epoch=1,
                pulse_us=model.pulses_us(lengths_mm) if frame > 5 else np.zeros(4),
                guard="off",
                reflex_running=False,
                queued=0,
                baseline_hpa=1013.0,
            )
            recorder.stage(frame * 20_000, position_mm=(0, 0, -frame), moving=True)
    trial = explore.trials(path)[0]
    assert trial.obstacle_below_tip_mm == 35.0
    assert trial.motion is not None
    assert not trial.motion.measured
    # The tendon at α = 180° is the shortest: the tip goes to -x. z of the world is up.
    tip = trial.motion.filament_mm[-1, 1]
    assert tip[0] < -10
    assert tip[2] == pytest.approx(-49 - 105, abs=10)
    np.testing.assert_allclose(trial.motion.backbone_mm[:, 0], trial.motion.arm_mm, atol=1e-3)
    words = Page(html.page([trial])).words
    assert "Measured on the robot" in words
    assert "imulated" not in words


def test_tables_have_units_and_the_logs_own_numbers(run: Path) -> None:
    trials = rows_of(run / "trials.csv")
    assert [row["descent_mm"] for row in trials] == ["40.0", "60.0", "80.0", "100.0", "100.0"]
    assert [row["obstacle_below_tip_mm"] for row in trials] == ["35.0", "55.0", "75.0", "95.0", ""]
    assert [row["touched"] for row in trials] == ["yes", "yes", "yes", "yes", "no"]
    contacts = rows_of(run / "contacts.csv")
    assert [(row["trial"], row["alpha_deg"]) for row in contacts] == [
        (str(number), "0.0") for number in (1, 2, 3, 4)
    ]
    assert float(contacts[0]["change_hpa"]) == 22.0
    assert float(contacts[0]["tip_z_mm"]) == pytest.approx(-155.5, abs=2.0)
    pressure = rows_of(run / "pressure.csv")
    assert {row["trial"] for row in pressure} == {"1", "2", "3", "4", "5"}
    for row in (trials[0], contacts[0], pressure[0]):
        plain = {
            "trial", "contact", "touched", "paper_touched", "contacts", "levels", "directions",
            "complete", "simulated", "watched",
        }  # fmt: skip
        for name in row.keys() - plain:
            assert name.rsplit("_", 1)[1] in ("mm", "s", "hpa", "deg")
    watched = [row for row in pressure if row["watched"] == "yes"]
    assert all(row["baseline_hpa"] for row in watched)
    assert not any(row["baseline_hpa"] for row in pressure if row["watched"] == "no")


def test_pictures_are_drawn(run: Path) -> None:
    names = {path.name for path in (run / "pictures").iterdir()}
    assert names == {"robot.png", "explore.png", "pressure.png", "directions.png", "trials.png"}
    for path in (run / "pictures").iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")


def test_the_robot_hangs_below_its_arm(run: Path) -> None:
    """Frame D's z points down; nothing of the robot may be drawn above its base."""
    trial = explore.trials(run)[0]
    assert trial.motion is not None
    below = trial.motion.backbone_mm[:, 1:, 2] < trial.motion.arm_mm[:, None, 2]
    assert below.all()
    assert (trial.motion.filament_mm[:, 1, 2] < trial.motion.backbone_mm[:, -1, 2]).all()
    assert trial.cube is not None
    # The tip reaches the cube's inner face, 30 mm from the robot's axis.
    assert trial.contacts[0].point_mm[0] == pytest.approx(30.0, abs=4.0)


def test_the_same_logs_give_the_same_report(run: Path, tmp_path: Path) -> None:
    once, again = (explore.write(run / "trial_1.mcap", tmp_path / name) for name in "ab")
    for first, second in zip(
        (once.page, *once.tables, *once.pictures),
        (again.page, *again.tables, *again.pictures),
        strict=True,
    ):
        assert first.read_bytes() == second.read_bytes()


def test_a_cut_log_is_reported_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = write_log(tmp_path / "whole.mcap", 1, 75.0).read_bytes()
    cut = tmp_path / "run" / "cut.mcap"
    cut.parent.mkdir()
    cut.write_bytes(whole[: len(whole) // 2])
    trial = explore.trials(cut)[0]
    assert not trial.complete
    assert 0 < trial.descent_mm < 80
    words = Page(report.write(cut, cut.parent / "report.html").read_text()).words
    assert "Not all logs are complete" in words
    assert "The log is cut" in words


def test_an_aborted_trial_says_why(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with Recorder(path, metadata={"simulated": True}) as recorder:
        recorder.experiment(0, "trial_start", {})
        recorder.experiment(10, "trial_aborted", {"reason": "StoppedError: stopped by hand"})
    assert "stopped by hand" in Page(html.page(explore.trials(path))).words


def test_a_touch_on_the_way_down_counts(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with Recorder(path, metadata={"simulated": True, "obstacle_below_tip_mm": 35.0}) as recorder:
        recorder.experiment(0, "trial_start", {})
        recorder.experiment(5, "arm_lowering", {"level": 1})
        touch = {
            "descent_mm": 12.5,
            "alpha_deg": None,
            "tip_world_mm": [1, 2, -120],
            "pressure_hpa": 1040.0,
            "baseline_hpa": 1013.0,
            "time_us": 9,
        }
        recorder.experiment(10, "lowering_contact", {"contact": touch})
        recorder.experiment(20, "trial_end", {"descent_mm": 12.5})
    trial = explore.trials(path)[0]
    assert trial.touched
    assert trial.contacts[0].alpha_deg is None
    assert trial.contacts[0].point_mm.tolist() == [1, 2, -120]
    assert Page(html.page([trial])).table[0][2:4] == ["12.5", "yes"]
    files = explore.write(path, tmp_path / "out")
    assert rows_of(files.tables[1])[0]["alpha_deg"] == ""


def test_what_cannot_be_reported_is_said(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No log"):
        report.write(tmp_path, tmp_path / "report.html")
    path = tmp_path / "other.mcap"
    with Recorder(path) as recorder:
        recorder.command(0, "enable")
    with pytest.raises(LogError, match="no exploration"):
        report.write(path, tmp_path / "report.html")


def test_missing_packages_name_their_extra(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("plotly.offline", "matplotlib.figure"):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, module, None)
            with pytest.raises(ExtraMissingError, match=r"setae\[report\]"):
                explore.write(run / "trial_1.mcap", tmp_path / "out")


def test_commands_import_no_report_and_the_report_no_plotting() -> None:
    # The scan's live map took all reports in with every command.
    code = (
        "import sys, setae.cli.commands;"
        " early = [m for m in sys.modules if m.startswith('setae.report')];"
        " import setae.report;"
        " print(early + [m for m in ('matplotlib', 'plotly') if m in sys.modules])"
    )
    found = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("scale", [palette.HEIGHTS[::-1], palette.AMOUNTS])
def test_scales_of_colours_are_in_order_for_who_sees_no_colours(scale: tuple[str, ...]) -> None:
    # From blue over yellow to red the middle was the lightest, so both ends looked alike.
    light = [
        sum(
            weight * int(colour[at : at + 2], 16) ** 2.2
            for weight, at in ((0.2126, 1), (0.7152, 3), (0.0722, 5))
        )
        for colour in scale
    ]
    assert all(darker < 0.8 * lighter for lighter, darker in pairwise(light))


def test_an_animation_is_drawn(tmp_path: Path) -> None:
    trial = load_trial(read(write_log(tmp_path / "log.mcap", 1, 35.0, levels=2)))
    path = tmp_path / "explore.gif"
    animation.write(path, trial, frames=8, width_px=160)
    data = path.read_bytes()
    assert data.startswith(b"GIF89a")
    assert data.count(b"\x21\xf9\x04") >= 6  # graphic control blocks: one a frame
