"""Configurations: the default, differences to it, and what each mistake is answered."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import setae
from setae import config
from setae.config import Config, Geometry
from setae.errors import ConfigError


def test_the_papers_robot_is_the_default_in_code_and_in_the_file() -> None:
    robot = config.load()
    assert robot.geometry == Geometry()
    assert setae.Geometry() == Geometry()
    assert robot.geometry.tendon_angles_rad == (0.0, math.pi / 2, math.pi, 1.5 * math.pi)
    assert robot.geometry.max_bend_rad == math.pi / 2


def test_a_file_gives_only_what_differs(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[geometry]\ntendon_radius_mm = 8\n[motion]\nmodel = 'parallel'\n")
    robot = config.load(path)
    assert robot.geometry == Geometry(tendon_radius_mm=8.0)
    assert robot.motion.model == "parallel"
    assert robot.servo == config.load().servo


def test_what_is_logged_reads_back_as_the_same_robot() -> None:
    robot = config.loads(
        "[geometry]\nmax_bend_deg = 81.7\ntendon_angles_deg = [1.3, 91, 181, 271]\n"
        "[simulator]\nspring.shear_n = 40\n'servo.lag_us' = 2.5e4\n"
    )
    text = robot.to_toml()
    assert "tendon_angles_deg = [1.3, 91.0, 181.0, 271.0]" in text
    back = config.loads(text)
    assert back.simulator == (("servo.lag_us", 25000.0), ("spring.shear_n", 40.0))
    assert back.geometry.tendon_angles_rad == pytest.approx(robot.geometry.tendon_angles_rad)
    assert dataclasses.replace(back, geometry=robot.geometry) == robot
    assert config.loads(config.load().to_toml()) == config.load()


def test_configurations_are_frozen_and_can_be_keys() -> None:
    robot = config.load()
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.geometry.tendon_radius_mm = 9.0  # type: ignore[misc]  # that is the test
    assert hash(robot) == hash(config.load())


MISTAKES = [
    (
        "[geometry]\ntendon_radius = 8",
        "my.toml: [geometry] has no key 'tendon_radius'. Did you mean 'tendon_radius_mm'?",
    ),
    (
        "[stage]\nxyzzy = 8",
        "my.toml: [stage] has no key 'xyzzy'. There are: 'speed_mm_s', 'acceleration_mm_s2'.",
    ),
    ("[geomtry]\n", "my.toml: there is no section [geomtry]. Did you mean [geometry]?"),
    (
        "tendon_radius_mm = 8",
        (
            "my.toml: 'tendon_radius_mm' stands outside of any section. Put it below one of: "
            "[geometry], [spring], [servo], [motion], [bristle], [stage], [ur], [explore], [tube], "
            "[scan], [simulator]."
        ),
    ),
    (
        "[geometry]\ntendon_radius_mm = -8",
        (
            "my.toml: [geometry] tendon_radius_mm = -8: it must be a number of mm from 0.1 to "
            "500, or a list of 1 to 64 of them."
        ),
    ),
    (
        "[geometry]\ntendon_radius_mm = nan",
        (
            "my.toml: [geometry] tendon_radius_mm = NaN: it must be a number of mm from 0.1 to "
            "500, or a list of 1 to 64 of them."
        ),
    ),
    (
        "[geometry]\ntendon_radius_mm = '8'",
        (
            'my.toml: [geometry] tendon_radius_mm = "8": it must be a number of mm from 0.1 to '
            "500, or a list of 1 to 64 of them."
        ),
    ),
    (
        "[geometry]\nmax_bend_deg = true",
        "my.toml: [geometry] max_bend_deg = true: it must be a number of degrees from 1 to 180.",
    ),
    (
        "[geometry]\nmax_bend_deg = 200",
        "my.toml: [geometry] max_bend_deg = 200: it must be a number of degrees from 1 to 180.",
    ),
    (
        "[geometry]\ntendon_angles_deg = 90",
        (
            "my.toml: [geometry] tendon_angles_deg = 90: it must be a list of 1 to 64, each a "
            "number of degrees from -360 to 360."
        ),
    ),
    (
        "[geometry]\ntendon_angles_deg = [0, 120, 240]",
        (
            "my.toml: [geometry] tendon_angles_deg has 3 entries. The board drives 4 servos: give "
            "4. `Geometry` alone takes any number."
        ),
    ),
    (
        "[geometry]\nmin_length_mm = 80",
        "my.toml: [geometry] min_length_mm = 80 must be below free_length_mm = 70.",
    ),
    (
        "[geometry]\ntendon_radius_mm = 9.5",
        (
            "my.toml: [geometry] tendon_radius_mm = 9.5 must not exceed bore_radius_mm = 9: the "
            "tendons run inside the spring."
        ),
    ),
    (
        "[geometry]\nbore_radius_mm = 10.5",
        (
            "my.toml: [geometry] bore_radius_mm = 10.5 must be below half of "
            "spring_outer_diameter_mm = 21."
        ),
    ),
    (
        "[geometry]\nfilament_length_mm = 70",
        (
            "my.toml: [geometry] filament_length_mm = 70 must not exceed tip_offset_mm = 65, which "
            "includes the filament."
        ),
    ),
    (
        "[servo]\npulse_min_us = [830, 830, 830]",
        (
            "my.toml: [servo] pulse_min_us = [830, 830, 830]: it must be a list of 4, each a "
            "number of µs from 500 to 2500."
        ),
    ),
    (
        "[servo]\ndirection = [1, 1, 2, 1]",
        "my.toml: [servo] direction = [1, 1, 2, 1]: it must be a list of 4, each one of 1, -1.",
    ),
    (
        "[servo]\npulse_free_us = [850, 850, 800, 850]",
        (
            "my.toml: [servo] servo 2: pulse_free_us = 800 must lie from pulse_min_us = 830 to "
            "pulse_max_us = 2150."
        ),
    ),
    (
        "[servo]\npulse_max_us = [2150, 820, 2150, 2150]",
        "my.toml: [servo] servo 1: pulse_min_us = 830 must be below pulse_max_us = 820.",
    ),
    (
        "[servo]\nmin_tension_n = 9",
        (
            "my.toml: [servo] min_tension_n = 9 must be below the 7.89 N that a servo holds. "
            "That is stall_torque_n_m times torque_part over pulley_radius_mm."
        ),
    ),
    (
        "[motion]\nmodel = 'papr'",
        'my.toml: [motion] model = "papr": it must be one of "paper", "parallel", "taut".',
    ),
    (
        "[motion]\nretract_speed_mm_s = 200",
        "my.toml: [motion] retract_speed_mm_s = 200 must not exceed slew_mm_s = 160.",
    ),
    (
        "[explore]\nsteps = 2.5",
        "my.toml: [explore] steps = 2.5: it must be an integer from 1 to 1000.",
    ),
    (
        "[explore]\ncompressed_length_mm = 10",
        (
            "my.toml: [explore] compressed_length_mm = 10 must lie from min_length_mm = 20 to "
            "free_length_mm = 70."
        ),
    ),
    (
        "[simulator]\nspring.shear_n = 'soft'",
        'my.toml: [simulator] spring.shear_n = "soft": it must be a number.',
    ),
    (
        "[simulator]\nspring.shear_n = inf",
        "my.toml: [simulator] spring.shear_n = inf: it must be finite.",
    ),
]


@pytest.mark.parametrize(("text", "message"), MISTAKES)
def test_a_mistake_is_answered_with_file_key_and_what_it_may_hold(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as raised:
        config.loads(text, source="my.toml")
    assert str(raised.value) == message
    assert isinstance(raised.value, ValueError)


def test_broken_toml_says_where() -> None:
    with pytest.raises(ConfigError, match=r"^my.toml isn't valid TOML: .*line 2"):
        config.loads("[geometry]\ntendon_radius_mm =\n", source="my.toml")


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    with pytest.raises(ConfigError, match=r"Can't read the configuration .*robot.toml: No such"):
        config.load(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="isn't text in UTF-8"):
        config.load(str(path))
    with pytest.raises(ConfigError, match="Can't read"):
        config.load(tmp_path)


BAD_GEOMETRY: list[tuple[dict[str, Any], str]] = [
    ({"tendon_radius_mm": math.nan}, r"\[geometry\] tendon_radius_mm = nan: it must be a number"),
    ({"tendon_radius_mm": math.inf}, "tendon_radius_mm = inf"),
    ({"max_bend_rad": 90}, "max_bend_rad = 90: it must be a number of radians from 0.0174533"),
    ({"tendon_angles_rad": ()}, "must be a list of 1 to 64"),
    ({"tendon_angles_rad": "0123"}, "must be a list"),
    ({"min_length_mm": 70}, "must be below free_length_mm"),
]


@pytest.mark.parametrize(("values", "message"), BAD_GEOMETRY)
def test_a_geometry_made_in_code_is_checked_too(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Geometry(**values)


def test_numbers_of_other_types_become_plain_ones() -> None:
    values: dict[str, Any] = {
        "tendon_radius_mm": np.float32(8.25),
        "free_length_mm": 80,
        "tendon_angles_rad": np.arange(3.0),
    }
    geometry = Geometry(**values)
    assert type(geometry.tendon_radius_mm) is float
    assert type(geometry.free_length_mm) is float
    assert geometry.tendon_angles_rad == (0.0, 1.0, 2.0)


def test_every_section_has_documented_attributes_only() -> None:
    for field in dataclasses.fields(Config):
        section = getattr(config.load(), field.name)
        if dataclasses.is_dataclass(section):
            for key in dataclasses.fields(section):
                assert key.name in (type(section).__doc__ or ""), (field.name, key.name)
