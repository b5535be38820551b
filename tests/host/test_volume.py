"""The workspace's volume, what is lost to what, and the pictures of it."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from setae import config, volume, workspace
from setae.cli import main
from setae.kinematics import inverse
from setae.volume import Fate

CONFIG = config.load()


def changed(section: str, **values: Any) -> config.Config:
    part = dataclasses.replace(getattr(CONFIG, section), **values)
    return dataclasses.replace(CONFIG, **{section: part})


def spring_cm3() -> float:
    """All shapes of the spring: 2π (L₁³ − L₀³)/3 · ∫ (1 − cos θ)²/θ³ dθ."""
    theta = np.linspace(1e-6, math.pi / 2, 20_001)
    integral = np.trapezoid((1 - np.cos(theta)) ** 2 / theta**3, theta)
    return float(2 * math.pi * (70**3 - 20**3) / 3 * integral / 1e3)


def test_the_springs_own_volume_is_the_integral() -> None:
    measured = volume.measure(CONFIG, "paper")
    assert measured.spring.cm3 == pytest.approx(spring_cm3(), abs=4 * measured.spring.error_cm3)
    assert measured.spring.error_cm3 < 0.05


@pytest.mark.parametrize("model", ["paper", "parallel"])
def test_random_positions_in_a_box_give_the_same_volumes(model: str) -> None:
    measured = volume.measure(CONFIG, model)
    low, high = np.array([-45.0, -45, 12]), np.array([45.0, 45, 70])
    position = np.random.default_rng(1).uniform(low, high, (60_000, 3))
    reach = workspace.check(inverse(position), CONFIG, model)
    box_cm3 = float(np.prod(high - low)) / 1e3
    for inside, found in (
        (reach.reachable, measured.reachable),
        (reach.reachable & reach.holdable, measured.held),
    ):
        part = inside.mean()
        error = box_cm3 * math.sqrt(part * (1 - part) / len(position))
        assert found.cm3 == pytest.approx(box_cm3 * part, abs=4 * (error + found.error_cm3))


def test_the_stated_error_is_that_of_other_samples() -> None:
    cells = (12, 10, 16)
    several = [volume.measure(CONFIG, "parallel", cells=cells, seed=s) for s in range(24)]
    spread = np.std([found.held.cm3 for found in several], ddof=1)
    stated = np.mean([found.held.error_cm3 for found in several])
    assert 0.5 < spread / stated < 2.0


def test_what_is_lost_and_what_is_kept_make_up_the_whole() -> None:
    found = volume.measure(CONFIG, "paper", cells=(12, 10, 16))
    parts = found.held.cm3 + sum(lost.cm3 for lost in found.lost.values())
    assert parts == pytest.approx(found.spring.cm3, abs=1e-9)
    kept = found.held.cm3 + found.lost[Fate.SLACK].cm3 + found.lost[Fate.TENSION].cm3
    assert kept == pytest.approx(found.reachable.cm3, abs=1e-9)


def test_less_travel_and_weaker_servos_cost_volume_under_their_own_name() -> None:
    few = (12, 10, 16)
    short = volume.measure(changed("servo", pulse_max_us=(1500.0,) * 4), "paper", cells=few)
    weak = volume.measure(changed("servo", stall_torque_n_m=0.25), "paper", cells=few)
    whole = volume.measure(CONFIG, "paper", cells=few)
    assert whole.lost[Fate.TRAVEL].cm3 == whole.lost[Fate.TENSION].cm3 == 0
    assert short.lost[Fate.TRAVEL].cm3 > 1
    assert weak.lost[Fate.TENSION].cm3 > 1
    assert max(short.held.cm3, weak.held.cm3) < whole.held.cm3


def test_a_section_has_the_fates_of_its_poses() -> None:
    corners, fate = volume.section(CONFIG, 0.6, "paper", lengths=20, bends=15)
    middle = (corners[1:, 1:] + corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:]) / 4
    out, up = middle[..., 0], middle[..., 1]
    position = np.stack([out * math.cos(0.6), out * math.sin(0.6), up], axis=-1)
    again = volume.fates(workspace.check(inverse(position), CONFIG, "paper"))
    assert (again == fate).mean() > 0.98  # but for cells on a border


# ------------------------------------------------------------------------- pictures


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("workspace") / "out"
    with pytest.raises(SystemExit) as ended:
        main(["workspace", "--model", "parallel", "--out", str(folder)])
    assert ended.value.code == 0
    return folder


def test_the_command_writes_a_picture_and_a_page(written: Path) -> None:
    assert sorted(path.name for path in written.iterdir()) == ["workspace.html", "workspace.png"]
    assert (written / "workspace.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_needs_no_network_and_holds_what_was_measured(written: Path) -> None:
    page = (written / "workspace.html").read_text(encoding="utf-8")
    assert "{{" not in re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=.?https?:", page)
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    data = json.loads(found[1])
    for body in data["bodies"]:
        assert len(body["quads"]) == len(body["kinds"]) > 1000
        assert np.isfinite(body["quads"]).all()
    whole, _, held = data["bodies"]
    assert set(held["kinds"]) == {"0"}
    assert set(whole["kinds"]) == {"0", "1", "3"}
    assert len(data["sections"]) * data["step_deg"] == 360
    assert "80.1 ± 0.06 cm³" in page


def test_a_mistake_is_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    for arguments, text in (
        (["--model", "papr", "--out", str(tmp_path / "new")], "There is no tendon model 'papr'"),
        (["--out", str(tmp_path)], "holds files already"),
        (["--config", str(tmp_path / "none.toml")], "Can't read the configuration"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["workspace", *arguments])
        assert ended.value.code == 1
        said = capsys.readouterr().err
        assert text in said
        assert said.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
