"""Build sdist and wheel, and run what they install outside the source tree.

First the way of a machine without a C++ compiler, from the sdist: everything but the
simulator must work, and the missing part must be named. Then the wheel.

Run by `make wheel`, with the Python of .venv.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "build" / "dist"

KINEMATICS = """
import numpy as np
import setae
from setae import kinematics, tendons

arc = kinematics.inverse((15.0, 0.0, 60.0))
lengths_mm = tendons.lengths(arc, setae.Geometry())
assert lengths_mm.shape == (4,), lengths_mm
assert np.allclose(kinematics.position(arc), (15.0, 0.0, 60.0))
"""

WITHOUT_SIMULATOR = """
import setae
from setae.errors import SimulatorMissingError

try:
    setae.connect("sim://")
except SimulatorMissingError as error:
    assert "compiler" in str(error), error
else:
    raise SystemExit("sim:// opened without a simulator")
"""

WITH_SIMULATOR = """
import setae

with setae.connect("sim://") as robot:
    robot.enable()
    robot.move_to((15, 0, 60), duration_s=1.0)
    contact = robot.probe((0, 0, 70), speed_mm_s=20)
assert contact is None, contact
"""

# What pip and the build back end run besides compilers.
PLAIN_TOOLS = ("cat", "chmod", "cp", "env", "ls", "mkdir", "mv", "rm", "sh", "uname")


def run(*command: str | Path, cwd: Path, env: dict[str, str] | None = None) -> str:
    """Run a command and return what it printed; leave with its output where it fails."""
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        print(done.stdout)
        sys.exit(f"wheel: failed with {done.returncode}: {' '.join(map(str, command))}")
    return done.stdout


def require(condition: bool, words: str) -> None:
    if not condition:
        sys.exit(f"wheel: {words}")


def build() -> tuple[Path, Path]:
    """Build the sdist, and the wheel from the sdist; return both files."""
    shutil.rmtree(DIST, ignore_errors=True)
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", DIST, cwd=ROOT)
    (sdist,) = DIST.glob("*.tar.gz")
    (wheel,) = DIST.glob("*.whl")
    return sdist, wheel


def check_contents(sdist: Path, wheel: Path) -> None:
    with tarfile.open(sdist) as archive:
        in_sdist = {name.partition("/")[2] for name in archive.getnames()}
    for name in ("LICENSE", "README.md", "CMakeLists.txt", "simulator/setae_sim.h"):
        require(name in in_sdist, f"{name} is not in {sdist.name}")
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = set(archive.namelist())
    for name in ("setae/py.typed", "setae/robots/paper.toml", "setae_protocol/messages.py"):
        require(name in in_wheel, f"{name} is not in {wheel.name}")
    require(
        any(name.startswith("setae/sim/setae_sim.") for name in in_wheel),
        f"the compiled simulator is not in {wheel.name}",
    )
    require("-py3-none-" in wheel.name, f"{wheel.name} does not serve every Python 3")
    require(
        all(name.startswith(("setae/", "setae_protocol/", "setae-")) for name in in_wheel),
        f"{wheel.name} installs something besides setae",
    )


def try_without_compiler(sdist: Path, python: Path, outside: Path) -> None:
    tools = outside / "tools"
    tools.mkdir()
    for name in PLAIN_TOOLS:
        where = shutil.which(name)
        require(where is not None, f"{name} is not on this machine")
        (tools / name).symlink_to(str(where))
    env = {
        name: value
        for name, value in os.environ.items()
        if name not in ("CC", "CXX", "SETAE_REQUIRE_SIM", "CMAKE_GENERATOR")
    }
    env["PATH"] = f"{python.parent}:{tools}"
    said = run(
        *(python, "-m", "pip", "install", "--verbose", "--constraint", ROOT / "constraints.txt"),
        f"{sdist}[report]",
        cwd=outside,
        env=env,
    )
    require("no working C++ compiler" in said, "pip did not say that the simulator is missing")
    require("without_simulator" in said, "the wheel's name does not say what is missing")
    run(python, "-c", KINEMATICS + WITHOUT_SIMULATOR, cwd=outside)


def try_wheel(wheel: Path, python: Path, outside: Path) -> None:
    run(python, "-m", "pip", "install", "--force-reinstall", "--no-deps", wheel, cwd=outside)
    run(python, "-c", KINEMATICS + WITH_SIMULATOR, cwd=outside)
    command = python.parent / "setae"
    run(command, "--version", cwd=outside)
    run(command, "info", "--sim", cwd=outside)
    run(python, "-m", "pip", "check", cwd=outside)


def main() -> None:
    sdist, wheel = build()
    check_contents(sdist, wheel)
    print(f"wheel: built {sdist.name} and {wheel.name}")
    with tempfile.TemporaryDirectory(prefix="setae-wheel-") as folder:
        outside = Path(folder)
        venv.create(outside / "venv", with_pip=True)
        python = outside / "venv" / "bin" / "python"
        try_without_compiler(sdist, python, outside)
        print("wheel: the sdist installs without a compiler, without sim://, and says so")
        try_wheel(wheel, python, outside)
        print("wheel: the wheel runs outside the source tree")


if __name__ == "__main__":
    main()
