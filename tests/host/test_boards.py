"""Boards from plug-ins: what is said where there is none."""

from __future__ import annotations

import pytest

import setae
from setae.errors import InputError


def test_a_scheme_that_nothing_knows_is_told_with_a_way_out() -> None:
    with pytest.raises(InputError, match="xyz://") as failure:
        setae.connect("xyz://board")
    assert "SETAE_BOARDS" in failure.value.remedy


def test_the_simulated_uno_is_said_how_to_get(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SETAE_BOARDS", raising=False)
    with pytest.raises(InputError) as failure:
        setae.connect("avr://firmware.elf")
    assert "make avr" in failure.value.remedy


def test_a_plug_in_that_cannot_be_loaded_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SETAE_BOARDS", "avr=no.such.module:connect")
    with pytest.raises(InputError, match=r"no\.such\.module"):
        setae.connect("avr://")


def test_a_firmware_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SETAE_BOARDS", "avr=tests.avr.robot:connect")
    with pytest.raises(setae.SetaeError, match=r"nowhere\.elf"):
        setae.connect("avr://nowhere.elf")
