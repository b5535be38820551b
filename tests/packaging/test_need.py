"""A machine that lacks something is told in one line: what, and the command that helps."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# What a minimal Debian has anyway, of what the script runs.
BASE = ("sh", "grep", "dpkg-query")


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """Return a folder of tools that lacks everything that the set-up needs."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in BASE:
        found = shutil.which(name)
        assert found, f"{name} belongs to every Debian"
        (folder / name).symlink_to(found)
    user(folder, 1000)
    return folder


def tool(folder: Path, name: str, script: str = "exit 0") -> None:
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def user(folder: Path, number: int) -> None:
    tool(folder, "id", f"echo {number}")


def need(folder: Path, *words: str) -> tuple[int, str]:
    env = {name: value for name, value in os.environ.items() if name not in ("CXX", "PYTHON")}
    done = subprocess.run(
        ["/bin/sh", str(ROOT / ".ci" / "need"), *words],
        env=env | {"PATH": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def test_everything_missing_is_one_line_with_the_command(bare: Path) -> None:
    tool(bare, "sudo")
    status, said = need(bare, "make", "python", "compiler")
    assert status == 1
    assert said.count("\n") == 1
    for word in ("make", "python3", "3.11", "C++ compiler"):
        assert word in said
    assert "sudo apt-get install -y make python3-venv g++" in said


def test_without_sudo_the_line_says_so_and_names_root(bare: Path) -> None:
    status, said = need(bare, "compiler")
    assert status == 1
    assert said.count("\n") == 1
    assert "no sudo" in said
    assert "as root: apt-get install -y g++" in said


def test_root_is_not_told_to_use_sudo(bare: Path) -> None:
    user(bare, 0)
    _, said = need(bare, "compiler")
    assert "sudo" not in said
    assert "apt-get install -y g++" in said


def test_only_what_is_missing_is_named(bare: Path) -> None:
    tool(bare, "python3")
    tool(bare, "make")
    _, said = need(bare, "make", "python", "compiler")
    assert "python3" not in said
    assert "make" not in said
    assert "C++ compiler" in said


def test_an_old_python_is_named_with_its_version(bare: Path) -> None:
    tool(bare, "python3", 'case "$2" in *exit*) exit 1;; *) echo 3.9.2;; esac')
    status, said = need(bare, "python")
    assert status == 1
    assert said.count("\n") == 1
    assert "Python 3.11 or later (python3 is 3.9.2" in said


def test_a_python_without_venv_is_told_from_no_python(bare: Path) -> None:
    tool(bare, "python3", 'case "$2" in *ensurepip*) exit 1;; esac')
    _, said = need(bare, "python")
    assert "missing: Python's venv." in said
    assert "python3-venv" in said


def test_a_debian_package_is_looked_up(bare: Path) -> None:
    assert need(bare, "dpkg") == (0, "")
    status, said = need(bare, "no-such-package-here")
    assert status == 1
    assert said.count("\n") == 1
    assert "missing: no-such-package-here." in said


def test_root_installs_what_is_missing_when_asked(bare: Path, tmp_path: Path) -> None:
    user(bare, 0)
    for name in ("mktemp", "rm", "cat"):
        (bare / name).symlink_to(str(shutil.which(name)))
    asked = tmp_path / "asked"
    tool(bare, "apt-get", f'echo "$*" >> {asked}')
    status, said = need(bare, "--install", "compiler")
    assert status == 0
    assert "C++ compiler" in said
    assert asked.read_text().split()[-1] == "g++"


def test_an_apt_that_fails_is_a_failure(bare: Path) -> None:
    user(bare, 0)
    for name in ("mktemp", "rm", "cat"):
        (bare / name).symlink_to(str(shutil.which(name)))
    tool(bare, "apt-get", "echo no network; exit 100")
    status, said = need(bare, "--install", "compiler")
    assert status == 1
    assert "no network" in said
    assert "apt could not install g++" in said


def test_anyone_else_is_told_instead(bare: Path, tmp_path: Path) -> None:
    asked = tmp_path / "asked"
    tool(bare, "apt-get", f'echo "$*" >> {asked}')
    status, said = need(bare, "--install", "compiler")
    assert status == 1
    assert "as root: apt-get install -y g++" in said
    assert not asked.exists()


@pytest.mark.parametrize("target", ["demo", "test", "flash", "firmware", "firmware-test", "lint"])
def test_make_names_what_is_missing_before_it_does_anything(target: str, bare: Path) -> None:
    """The firmware's targets ended with `exec: python3: not found`."""
    make = shutil.which("make")
    assert make
    for name in ("find", "sort", "cmp", "xargs", "sed"):
        found = shutil.which(name)
        assert found
        (bare / name).symlink_to(found)
    missing = bare / "no-python"
    done = subprocess.run(
        # The stamps are taken for older than all, as in a fresh clone.
        [make, "--no-print-directory", "--always-make", target, f"PYTHON={missing}"],
        cwd=ROOT,
        env={"PATH": str(bare)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("setae: missing: ")
    assert "no-python (3.11 or later, with venv)" in done.stderr.splitlines()[0]
