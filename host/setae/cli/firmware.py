"""`setae flash`: put the firmware of this version on the board."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from setae import rig
from setae.cli.common import app, console
from setae.errors import PortNotFoundError, SetaeError

# Where PlatformIO leaves what it has built, below the folder of platformio.ini.
_HEX = Path(".pio") / "build" / "uno" / "firmware.hex"
# The UNO's bootloader: avrdude's names for programmer and part, and its rate.
_AVRDUDE = ("-q", "-p", "atmega328p", "-c", "arduino", "-b", "115200", "-D")
_TIMEOUT_S = 600


@app.command
def flash(*, port: str | None = None, hex_file: Path | None = None) -> None:
    """Write the firmware to an Arduino UNO, then say which version answers.

    PlatformIO builds and uploads it, where it is installed and the sources are
    here. Otherwise avrdude uploads a hex file that was built before.

    Parameters
    ----------
    port
        Serial port; without it the board is found by its USB ids.
    hex_file
        A built firmware to upload with avrdude, instead of building one.
    """
    tool, folder = _tool(hex_file)
    port = _port(port)
    command = [part.replace("{port}", port) for part in tool]
    console.print(f"Running: {' '.join(command)}", markup=False, soft_wrap=True)
    try:
        done = subprocess.run(command, cwd=folder, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise SetaeError(
            f"{command[0]} didn't end within {_TIMEOUT_S} s.", "Check cable and port, try again."
        ) from error
    if done.returncode != 0:
        raise SetaeError(
            f"{command[0]} failed with exit code {done.returncode}.",
            "Its own output above says why. Where it says `not in sync`, "
            f"no UNO answered on {port}.",
        )
    with rig.connect(port) as robot:
        console.print(f"The board answers: firmware {robot.firmware_version}.")


def _tool(hex_file: Path | None) -> tuple[list[str], Path | None]:
    """What to run, with {port} where the port goes, and in which folder."""
    project = _project()
    pio = _which("pio") or _which("platformio")
    if hex_file is None and pio is not None and project is not None:
        return [pio, "run", "-e", "uno", "-t", "upload", "--upload-port", "{port}"], project
    if hex_file is not None and not hex_file.is_file():
        raise SetaeError(f"There is no hex file {hex_file}.", "Give --hex-file an existing one.")
    if hex_file is None:
        if project is None:
            raise SetaeError(
                "The firmware's sources aren't here: no platformio.ini in this folder or above.",
                "Run it in the project's folder, or give --hex-file.",
            )
        hex_file = project / _HEX
        if not hex_file.is_file():
            raise SetaeError(
                "PlatformIO is missing, and no hex file was built before.",
                "Give `make flash`, which brings it, or install it: pip install platformio.",
            )
    avrdude = _which("avrdude")
    if avrdude is None:
        raise SetaeError(
            "avrdude is missing, which writes a hex file to the board.",
            "Install it (Debian: apt install avrdude), or PlatformIO (pip install platformio).",
        )
    return [avrdude, *_AVRDUDE, "-P", "{port}", "-U", f"flash:w:{hex_file}:i"], None


def _port(port: str | None) -> str:
    """The port, if it is there: building takes a minute, and avrdude's words are long."""
    if port is None:
        try:
            return rig.find_port()
        except PortNotFoundError as error:
            raise PortNotFoundError(
                error.problem, "Plug the board in, or name its port: setae flash --port PORT."
            ) from error
    there = [found.device for found in rig.ports()]
    if port not in there and not Path(port).exists():
        raise PortNotFoundError(
            f"There is no port {port}; ports here: {', '.join(there) or 'none at all'}.",
            "Plug the board in, or name another port.",
        )
    return port


def _which(tool: str) -> str | None:
    """A tool on the path or, in a virtual environment that isn't active, beside its Python."""
    return shutil.which(tool) or shutil.which(tool, path=str(Path(sys.executable).parent))


def _project() -> Path | None:
    """The nearest folder, from here upwards, with this firmware's platformio.ini."""
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / "platformio.ini").is_file() and (folder / "firmware").is_dir():
            return folder
    return None
