"""Flashing: `setae flash` and avrdude against the bootloader of the simulated UNO."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from serial.tools import list_ports_common
from tests.avr.built import require_built
from tests.avr.programs import boot
from tests.avr.simavr import BOOT_START, BOOTLOADER, FIRMWARE
from tests.avr.usb_port import UsbPort
from tests.system.test_cli import output_of
from tests.system.test_cli_errors import error_of

from setae import __version__

HEX_FILE = FIRMWARE.with_suffix(".hex")


def content(hex_file: Path) -> bytes:
    """What an Intel hex file puts into a memory, from address 0 on and without gaps."""
    records = [bytes.fromhex(line[1:]) for line in hex_file.read_text().split()]
    return b"".join(record[4:-1] for record in records if record[3] == 0)


def test_flash_writes_verifies_and_shows_the_version(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Another program is on the chip, the bootloader takes the new one, and that answers."""
    require_built()
    with boot(tmp_path, []) as uno:
        uno.install_bootloader()
        with UsbPort(uno) as usb:
            printed = output_of(capfd, "flash", "--port", usb.port, "--hex-file", str(HEX_FILE))
        program = content(HEX_FILE)
        assert uno.flash(0, len(program)) == program
        assert uno.flash(BOOT_START, 512) == BOOTLOADER.read_bytes()
        assert usb.openings == 2, "avrdude's and the handshake's, each with its reset"
    assert printed.endswith(f"The board answers: firmware {__version__}.\n")


def test_no_board_to_flash_is_told_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It advised the simulator, which can't be flashed; a wrong port was told after a build."""
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    hex_file = tmp_path / "some.hex"
    hex_file.write_text(":00000001FF\n")
    error = error_of(capsys, "flash", "--hex-file", str(hex_file))
    assert "Plug the board in" in error
    assert "--sim" not in error
    there = [list_ports_common.ListPortInfo("/dev/ttyS7")]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: there)
    error = error_of(capsys, "flash", "--hex-file", str(hex_file), "--port", "/dev/ttyACM9")
    assert "/dev/ttyACM9" in error
    assert "/dev/ttyS7" in error


def test_a_port_without_a_bootloader_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = tmp_path / "avrdude"
    tool.write_text("#!/bin/sh\nexit 1\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    hex_file = tmp_path / "some.hex"
    hex_file.write_text(":00000001FF\n")
    error = error_of(capsys, "flash", "--hex-file", str(hex_file), "--port", "/dev/null")
    assert "exit code 1" in error
    assert "no UNO answered on /dev/null" in error
