"""What the command line says when something is wrong: one line, what to do, no traceback."""

from __future__ import annotations

import errno
import os
import select
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NoReturn

import pytest
import serial
from serial.tools import list_ports_common

from setae import volume
from setae.cli import main
from setae.experiments import bristle as study
from setae.link import session as sessions
from setae_protocol.frame import HostDecoder, encode_board
from setae_protocol.messages import PROTOCOL_VERSION, SCHEMA_HASH, Hello, HelloReply


@contextmanager
def pseudo_port(answer: Callable[[bytes], bytes] = lambda _: b"") -> Iterator[str]:
    """A serial port at whose other end `answer` decides what comes back."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    over_read, over_write = os.pipe()

    def serve() -> None:
        while True:
            ready, _, _ = select.select([ours, over_read], [], [])
            if over_read in ready:
                return
            reply = answer(os.read(ours, 4096))
            if reply:
                os.write(ours, reply)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        os.write(over_write, b"x")
        thread.join()
        for number in (ours, theirs, over_read, over_write):
            os.close(number)


class OtherVersion:
    """A board with the firmware of another protocol version."""

    def __init__(self) -> None:
        self._decoder = HostDecoder()

    def __call__(self, data: bytes) -> bytes:
        out = b""
        for frame in self._decoder.feed(data):
            if isinstance(frame.message, Hello):
                out += encode_board(
                    HelloReply(
                        protocol_version=PROTOCOL_VERSION + 1,
                        schema_hash=SCHEMA_HASH ^ 0xFFFF,
                        token=frame.message.token,
                        firmware_major=9,
                        firmware_minor=8,
                        firmware_patch=7,
                        previous_session=0,
                        reset_cause=0,
                        limits_crc=0,
                        pose_known=0,
                        pulse_ticks=(0, 0, 0, 0),
                        sensor=0,
                    ),
                    session=0,
                )
        return out


def error_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run `setae` and return its one line of error."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code not in (0, None)
    captured = capsys.readouterr()
    assert "Traceback" not in captured.out + captured.err
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    return lines[0]


def test_a_port_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    error = error_of(capsys, "info", "--port", "/dev/nothing-here")
    assert "/dev/nothing-here" in error
    assert "setae ports" in error


@pytest.mark.parametrize("port", ["/dev/null", "/tmp"])
def test_something_else_than_a_port(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It was said to be busy: close the other program, join the group."""
    error = error_of(capsys, "info", "--port", port)
    assert f"{port} is no serial port" in error
    assert "setae ports" in error


def test_a_port_that_another_program_holds(capsys: pytest.CaptureFixture[str]) -> None:
    with pseudo_port() as port, serial.Serial(port, exclusive=True):
        error = error_of(capsys, "info", "--port", port)
    assert port in error
    assert "Another program" in error


def test_no_board_on_any_port_lists_the_ports(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    port = list_ports_common.ListPortInfo("/dev/ttyS7")
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [port])
    error = error_of(capsys, "info")
    assert "/dev/ttyS7" in error
    assert "--sim" in error


def test_two_boards_ask_for_a_choice(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for name in ("/dev/ttyACM0", "/dev/ttyACM1"):
        port = list_ports_common.ListPortInfo(name)
        port.vid, port.pid = 0x2341, 0x0043
        found.append(port)
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    error = error_of(capsys, "info")
    assert "/dev/ttyACM0, /dev/ttyACM1" in error
    assert "--port" in error


def test_a_board_that_does_not_answer(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The real wait covers a bootloader; nothing answers here however long it is.
    monkeypatch.setattr(sessions.Session.open, "__defaults__", (300_000,))
    with pseudo_port() as port:
        error = error_of(capsys, "info", "--port", port)
    assert port in error
    assert "setae flash" in error


def test_firmware_of_another_version_names_both_and_the_remedy(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pseudo_port(OtherVersion()) as port:
        error = error_of(capsys, "info", "--port", port)
    assert "9.8.7" in error
    assert f"protocol {PROTOCOL_VERSION + 1}" in error
    assert f"protocol {PROTOCOL_VERSION} " in error
    assert "setae flash" in error
    assert "make build" in error  # a simulator that is older was to be flashed


@pytest.mark.parametrize(
    ("target", "words"),
    [
        (("0", "0", "600"), "600.00 mm"),
        (("0", "0", "-5"), "z = -5"),
        (("nan", "0", "60"), "nan"),
        (("inf", "0", "60"), "inf"),
    ],
)
def test_an_unreachable_target(
    target: tuple[str, str, str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in error_of(capsys, "move", *target, "--sim")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[geometry]\ntendon_radius = 8.0\n", "tendon_radius_mm"),
        ("[geometry\n", "TOML"),
        ("[explore]\nsteps = -1\n", "steps"),
        ("[simulator]\nno_such_thing = 1.0\n", "parameter_names() has all"),
        ('[simulator]\n"tendon.frictoin" = 0.1\n', "Did you mean 'tendon.friction'?"),
    ],
)
def test_a_broken_configuration(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    assert words in error_of(capsys, "info", "--sim", "--config", str(path))


def test_doctor_goes_on_after_what_is_wrong_and_exits_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[motion]\nslew_mm_s = -1\n")
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--sim", "--config", str(path)])
    assert ended.value.code == 1
    printed = capsys.readouterr().out
    assert "[motion] slew_mm_s" in printed
    assert "ok  simulator" in printed


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[object]\nshape = "ball"\n', "There is no object 'ball'. Give one of"),
        ('[object]\nshape = "orange"\nscale = 5\n', "scale is 5. Give a number from 0.8 to 1.2."),
        ('[object]\nshape = "orange"\ncolour = 5\n', "object: there is no 'colour'. It has shape"),
    ],
)
def test_a_broken_scene(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two errors came in one line, and neither named the file."""
    path = tmp_path / "table.toml"
    path.write_text(text)
    error = error_of(capsys, "scan", "--sim", "--scene", str(path), "--out", str(tmp_path / "out"))
    assert f"setae: {path}: " in error
    assert words in error
    assert ".." not in error
    assert "__init__" not in error


def test_a_configuration_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert "no-such.toml" in error_of(capsys, "info", "--sim", "--config", "no-such.toml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--obstacle", "deep"), "deep"),
        (("--obstacle", "-5"), "above 0 mm"),
        (("--obstacle", "nan"), "finite"),
        (("--obstacle", "0.055"), "in mm"),  # metres were meant, and it ran
        (("--obstacle", "550"), "107 mm"),  # it ran, and touched nothing
        (("--obstacle", "35", "--azimuth", "1e300"), "-360 to 360"),
        (("--obstacle", "35", "--trials", "paper"), "--trials"),
        (("--port", "/dev/ttyACM0"), "--port"),
        (("--seed", "-1"), "--seed"),
    ],
)
def test_what_explore_can_not_do(
    arguments: tuple[str, ...],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    assert words in error_of(capsys, "explore", "--sim", "--out", str(out), *arguments)
    assert not out.exists()


def test_a_folder_with_files_is_not_written_into_without_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "precious.txt").write_text("mine")
    error = error_of(capsys, "explore", "--sim", "--out", str(tmp_path))
    assert "--force" in error
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_a_file_that_is_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "some.mcap"
    path.write_bytes(b"not a log")
    for command in ("replay", "report"):
        assert "some.mcap" in error_of(capsys, command, str(path))


def test_flashing_without_sources_or_tools_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "platformio.ini" in error_of(capsys, "flash")
    (tmp_path / "some.hex").write_text(":00000001FF\n")
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    assert "avrdude" in error_of(capsys, "flash", "--hex-file", "some.hex")
    assert "other.hex" in error_of(capsys, "flash", "--hex-file", "other.hex")
    (tmp_path / "platformio.ini").touch()
    (tmp_path / "firmware").mkdir()
    assert "make flash" in error_of(capsys, "flash")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("explore", "--no-such-option"), "no-such-option"),
        (("explor",), "explore"),
        (("info", "--seed", "seven"), "seven"),
        (("info", "--sim", "--seed", "1.5"), "1.5"),  # was taken for 2
        (("report",), "log"),
        (("move", "1", "2", "three", "--sim"), "three"),
    ],
)
def test_what_no_command_takes_is_told_in_one_line_too(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """These came as boxes of several lines."""
    assert words in error_of(capsys, *arguments)


def test_exploring_without_a_board_asks_nobody_for_anything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The obstacle used to be asked for first, and the board looked for only then."""
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.chdir(tmp_path)
    assert "--sim" in error_of(capsys, "explore")
    assert list(tmp_path.iterdir()) == []


def test_a_scan_that_the_robot_can_not_reach_is_told_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The arm used to go down first."""
    config = tmp_path / "wide.toml"
    config.write_text("[explore]\ntarget_radius_mm = 500.0\n")
    out = tmp_path / "out"
    error = error_of(capsys, "explore", "--sim", "--config", str(config), "--out", str(out))
    assert "bent by" in error
    assert not out.exists()


@pytest.mark.parametrize("arguments", [("info", "--sim"), ("validate", "--list", "--targets", "5")])
def test_an_output_that_takes_nothing_is_no_bug_of_setae(arguments: tuple[str, ...]) -> None:
    """A full disk behind `>` gave a traceback; buffered, as is usual, Python's own code."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "setae.cli", *arguments],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=env,
        )  # fmt: skip
    assert ended.returncode == 1
    assert ended.stderr.splitlines() == [
        "setae: The output can't be written: No space left on device. Give it another place."
    ]


def test_a_report_of_a_folder_without_logs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "holds no log" in error_of(capsys, "report", str(tmp_path))


@pytest.mark.parametrize(
    ("taken", "arguments"),
    [
        ("trial-1.mcap", ("explore", "--sim", "--obstacle", "none")),
        ("paper.mcap", ("validate", "--sim", "--targets", "5")),
        ("bristle.mcap", ("calibrate", "bristle", "--sim")),
    ],
)
def test_a_file_that_can_not_be_replaced(
    taken: str, arguments: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each gave a traceback, and so did the next."""
    (tmp_path / taken).mkdir()
    error = error_of(capsys, *arguments, "--out", str(tmp_path), "--force")
    assert str(tmp_path) in error


def test_pictures_of_the_workspace_that_can_not_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("setae.volume.measure", partial(volume.measure, cells=(4, 4, 4)))
    monkeypatch.setattr("setae.report.workspace.picture", full)
    error = error_of(capsys, "workspace", "--out", str(tmp_path))
    assert f"{tmp_path}: No space left" in error


def test_what_ended_early_advises_nothing_that_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It named `setae report`, which refuses a measurement without touches."""
    monkeypatch.setattr(study.Bristle, "touches", _interrupted)
    error = error_of(capsys, "calibrate", "bristle", "--sim", "--moves", "1",
                     "--out", str(tmp_path))  # fmt: skip
    assert "the robot is stopped" in error
    assert f"{tmp_path / 'bristle.mcap'}" in error
    assert "setae report" not in error


def test_a_study_of_causes_that_ends_early_says_what_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It only said that it was interrupted, as if the targets were lost."""
    monkeypatch.setattr("setae.experiments.causes.cases", _interrupted)
    error = error_of(capsys, "validate", "--sim", "--targets", "5", "--causes",
                     "--out", str(tmp_path))  # fmt: skip
    assert "targets are done" in error
    assert f"setae report {tmp_path}" in error


def _interrupted(*_: object) -> NoReturn:
    raise KeyboardInterrupt
