"""The command line, where nothing is wrong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from setae import record
from setae.cli import main


def output_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run `setae` and return what it prints."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    captured = capsys.readouterr()
    assert ended.value.code == 0, captured.err
    return captured.out


def test_explore_prints_the_table_and_leaves_logs_and_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    out = tmp_path / "run"
    printed = output_of(
        capsys, "explore", "--sim", "--obstacle", "5", "--azimuth", "90", "--out", str(out)
    )
    # "1 contacts", it said.
    assert "descent 20 mm, 1 contact," in printed
    assert "90°" in printed
    log = record.read(out / "trial-1.mcap")
    assert log.damage is None
    assert log.metadata["trial"] == 1
    assert log.metadata["scene"]["cube"]["edge_mm"] == 40.0
    assert (out / "report.html").stat().st_size > 10_000
    # Again, into the same folder, because told so.
    output_of(
        capsys, "explore", "--sim", "--obstacle", "5", "--out", str(out), "--force", "--no-report"
    )
    replayed = output_of(capsys, "replay", str(out / "trial-1.mcap"))
    assert "trial_start" in replayed
    assert "trial_end" in replayed
    assert "/trip" in replayed


def test_ctrl_c_while_the_commands_are_imported_ends_in_one_line_too() -> None:
    # In its first second it ended in a traceback.
    code = (
        "import signal, sys, types\n"
        "def stop(name, *_):\n"
        "    if name == 'cyclopts': signal.raise_signal(signal.SIGINT)\n"
        "from setae.cli import main\n"
        "sys.meta_path.insert(0, types.SimpleNamespace(find_spec=stop))\n"
        "main(['--version'])\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert (ended.returncode, ended.stderr) == (130, "setae: interrupted\n")


def test_without_out_the_next_free_folder_is_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "explore-1").mkdir(parents=True)
    short = tmp_path / "short.toml"
    short.write_text("[explore]\nsteps = 1\ndirections = 1\n")
    arguments = ("explore", "--sim", "--obstacle", "none", "--no-report", "--config", str(short))
    output_of(capsys, *arguments)
    assert (tmp_path / "runs" / "explore-2" / "trial-1.mcap").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("info",), "firmware"),
        (("doctor",), "hPa peak to peak at rest"),
        (("move", "15", "0", "60"), "At (15.0, 0.0, 60.0) mm"),
        (("move", "-12", "0", "60", "--relax"), "At (-12.0"),
        (("probe", "15", "0", "60"), "No contact"),
        (("stop",), "stopped"),
        (("enable",), "Holding at (0.0, 0.0, 70.0) mm"),
        (("relax",), "Relaxed"),
    ],
)
def test_commands_for_one_robot(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in output_of(capsys, *arguments, "--sim")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run, without a report."""
    folder = tmp_path_factory.mktemp("run")
    config = folder / "short.toml"
    config.write_text("[explore]\nsteps = 1\ndirections = 1\n")
    with pytest.raises(SystemExit) as ended:
        main(["explore", "--sim", "--obstacle", "none", "--obstacle", "5", "--no-report",
              "--config", str(config), "--out", str(folder / "logs")])  # fmt: skip
    assert ended.value.code == 0
    return folder / "logs"


def test_a_folder_is_reported_as_a_run(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only single logs were taken, and a folder for --out was told to be a wrong file."""
    printed = output_of(capsys, "report", str(run), "--out", str(tmp_path))
    assert str(tmp_path / "report.html") in printed.replace("\n", "")
    rows = (tmp_path / "trials.csv").read_text().splitlines()
    assert len(rows) == 3


def test_what_a_damaged_log_lacks_is_told_beside_the_report(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`report` used to say nothing of it in the terminal."""
    data = (run / "trial-1.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) * 3 // 4])
    for command in ("report", "replay"):
        with pytest.raises(SystemExit) as ended:
            main([command, str(cut)])
        assert ended.value.code == 0
        error = capsys.readouterr().err.splitlines()
        assert len(error) == 1
        assert "cut.mcap is not whole" in error[0]
        assert "could not be read" in error[0]


def test_a_log_of_a_folder_that_holds_nothing_is_left_out(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One trial that was killed at once made the others' report impossible."""
    shutil.copy(run / "trial-1.mcap", tmp_path)
    killed = record.Recorder(tmp_path / "trial-2.mcap", metadata={"experiment": "explore"})
    (tmp_path / "trial-3.mcap").write_bytes(b"")
    with pytest.raises(SystemExit) as ended:
        main(["report", str(tmp_path)])
    assert ended.value.code == 0
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert "trial-3.mcap is no log" in told[0]
    assert "trial-2.mcap is not whole" in told[1]
    assert len((tmp_path / "trials.csv").read_text().splitlines()) == 2
    with pytest.raises(SystemExit):
        main(["report", str(tmp_path / "trial-2.mcap")])
    assert "before its experiment began" in capsys.readouterr().err
    killed.close()


def test_ctrl_c_while_the_report_is_written_says_how_to_get_it_later(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("setae.report.write", interrupted)
    config = tmp_path / "short.toml"
    config.write_text("[explore]\nsteps = 1\ndirections = 1\n")
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        main(["explore", "--sim", "--obstacle", "none", "--config", str(config),
              "--out", str(out)])  # fmt: skip
    assert ended.value.code == 130
    error = capsys.readouterr().err
    assert "the experiment is done" in error
    assert f"setae report {out}" in error
    assert record.read(out / "trial-1.mcap").damage is None
