"""Frames of measured positions that can't be right, though each position alone could be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from setae.config import load
from setae.errors import InputError
from setae.experiments import frames, positions, view
from setae.experiments.accuracy import Pose
from setae.experiments.targets import Target, choose, paper_targets

TARGETS = paper_targets(load())


def poses(targets: tuple[Target, ...], by: tuple[float, float, float], sd_mm: float) -> list[Pose]:
    """What a robot with errors of its own shows where the frame multiplies by something."""
    errs = np.random.default_rng(1)
    scale = np.array(by)
    return [Pose(t, scale * (np.array(t.position_mm) + errs.normal(0, sd_mm, 3))) for t in targets]


def test_a_good_frame_is_not_doubted() -> None:
    for sd_mm in (0.0, 1.0, 4.0):
        assert frames.doubts(poses(TARGETS, (1, 1, 1), sd_mm)) == ()
    assert frames.doubts([]) == ()


def test_mirrored_pictures_are_told_by_group() -> None:
    """A frame with right = "-X" counted as 50 mm of error."""
    plus_x = tuple(target for target in choose(TARGETS, 60) if target.group == "+X")
    others = tuple(target for target in choose(TARGETS, 60) if target.group != "+X")
    told = frames.doubts([*poses(plus_x, (-1, 1, 1), 2.0), *poses(others, (1, 1, 1), 2.0)])
    assert len(told) == 1
    assert f"The {len(plus_x)} positions of +X lie on the other side" in told[0]


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_wrong_scale_is_told_with_its_factor(factor: float) -> None:
    """A scale that is off by a tenth counted as 5 mm of error."""
    told = frames.doubts(poses(TARGETS, (factor, factor, factor), 0.5))
    assert len(told) == 1
    assert f"The positions are {factor:.2f} times as far" in told[0]


def test_a_wrong_scale_of_one_group_is_told() -> None:
    part = tuple(target for target in TARGETS if target.group == "+Y")
    others = tuple(target for target in TARGETS if target.group != "+Y")
    told = frames.doubts([*poses(part, (0.9, 0.9, 0.9), 0.5), *poses(others, (1, 1, 1), 0.5)])
    assert len(told) == 1
    assert "The positions of +Y are 0.90 times as far" in told[0]


@pytest.mark.parametrize("low_mm", [4.0, -6.0])
def test_positions_that_are_all_too_low_are_laid_at_the_origin(low_mm: float) -> None:
    """The scale was blamed, which would have explained less."""
    for targets in (TARGETS, choose(TARGETS, 20)):
        good = poses(targets, (1, 1, 1), 0.5)
        (told,) = frames.doubts([Pose(p.target, p.position_mm - [0, 0, low_mm]) for p in good])
        assert "check the origin" in told
        assert "sideways" in told
        z_mm = float(told.split(" mm in z")[0].split()[-1])
        assert z_mm == pytest.approx(-low_mm, abs=0.2)


def test_few_positions_prove_nothing() -> None:
    assert frames.doubts(poses(TARGETS[9:11], (-1, 1, 1), 0.0)) == ()


def scale(tmp_path: Path, text: str, group: str = "+Y") -> float:
    path = tmp_path / "frame.toml"
    path.write_text(f"origin_px = [1, 2]\n{text}")
    return view.load(path).view(group).px_per_mm


def test_a_group_with_a_scale_of_its_own_takes_nothing_from_the_common_one(tmp_path: Path) -> None:
    marker = "marker_mm = 10\nmarker_px = 80\n"
    own = '[view."+Y"]\nright = "+Y"\n'
    assert scale(tmp_path, f"px_per_mm = 5\n{own}{marker}") == 8
    assert scale(tmp_path, f"{marker}{own}px_per_mm = 5") == 5
    assert scale(tmp_path, f"{marker}{own}marker_px = 60") == 6


def test_a_table_without_a_pose_is_called_empty(tmp_path: Path) -> None:
    """It was said to have 0 rows without names."""
    path = tmp_path / "none.csv"
    path.write_text("target,x_mm,y_mm,z_mm\n")
    with pytest.raises(InputError, match="is empty below its line of names"):
        positions.read(path, TARGETS)
