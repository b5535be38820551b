"""Named plants: what they set, and where their name ends up."""

from __future__ import annotations

from pathlib import Path

import pytest

from setae import config, rig
from setae.cli import main
from setae.errors import ConfigError, InputError
from setae.record import read
from setae.sim import World, plants


def test_every_name_gives_parameters_that_the_simulator_takes() -> None:
    for name in ("ideal", "paper_like", "random:0", "random:7"):
        with World(parameters=plants.parameters(name)) as world:
            world.start()


def test_a_random_plant_is_its_seed_s() -> None:
    assert plants.parameters("random:7") == plants.parameters("random", 7)
    assert plants.parameters("random:7") == plants.parameters("random:7", 3)
    assert plants.parameters("random:7") != plants.parameters("random:8")


@pytest.mark.parametrize("name", ["", "perfect", "random", "random:", "random:-1", "ideal:3"])
def test_a_plant_that_does_not_exist_is_an_error(name: str) -> None:
    with pytest.raises(InputError, match=r"random|ideal"):
        plants.parameters(name)


def test_every_parameter_of_a_plant_has_one_cause() -> None:
    values = plants.parameters("random:7")
    parts = plants.by_cause(values)
    assert sorted(key for part in parts.values() for key in part) == sorted(values)


def test_the_configuration_names_a_plant_and_stands_above_it(tmp_path: Path) -> None:
    made = config.loads('[simulator]\nplant_name = "random:7"\ntendon.backlash_mm = 2.5')
    assert made.plant == "random:7"
    assert config.loads(made.to_toml()) == made
    with rig.open("sim://", config=made) as opened:
        opened.record(tmp_path / "log.mcap")
        assert opened.world is not None
        assert opened.world.get("tendon.backlash_mm") == 2.5
        expected = plants.parameters("random:7")["tendon.offset_mm_2"]
        assert opened.world.get("tendon.offset_mm_2") == expected
    metadata = read(tmp_path / "log.mcap").metadata
    assert metadata["plant"] == "random:7"
    assert metadata["plant_parameters"]["tendon.offset_mm_2"] == expected
    with pytest.raises(ConfigError, match="plant_name"):
        config.loads("[simulator]\nplant_name = 7")


def test_random_without_a_number_takes_the_simulator_s_seed() -> None:
    made = config.loads('[simulator]\nplant_name = "random"')
    with rig.open("sim://", config=made, seed=5) as opened:
        assert opened.plant == "random:5"


def test_the_command_line_names_a_plant(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, code, says in (
        (["--sim", "--plant", "random:7"], 0, ""),
        (["--sim", "--plant", "perfect"], 1, "perfect"),
        (["--plant", "ideal", "--port", "/dev/null"], 1, "--sim"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["move", "0", "0", "60", *arguments])
        assert ended.value.code == code
        assert says in capsys.readouterr().err
