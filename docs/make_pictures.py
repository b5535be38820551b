"""Make the pictures of README and documentation anew: run the exploration, draw it.

    python docs/make_pictures.py [RUN_DIR]

Without a folder it runs the paper's five trials in the simulator, seed 0. With
one it draws the logs in it. The theory's and the protocol's pictures it draws in any case.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import motion_pictures
import protocol_pictures
import theory_pictures

from setae.report import explore, pictures

PICTURES = Path(__file__).resolve().parent / "pictures"


def draw(run: Path) -> None:
    """Draw a run's pictures into docs/pictures."""
    trials = explore.trials(run)
    pictures.write_all(PICTURES, trials)
    pictures.animation(PICTURES / "explore.gif", pictures.telling(trials))


def main(arguments: list[str]) -> None:
    """Draw the given run, or one made for it."""
    theory_pictures.draw(PICTURES)
    motion_pictures.draw(PICTURES)
    protocol_pictures.draw(PICTURES)
    if arguments:
        draw(Path(arguments[0]))
        return
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        command = [sys.executable, "-m", "setae.cli", "explore", "--sim", "--no-report"]
        subprocess.run([*command, "--out", str(run)], check=True)
        draw(run)


if __name__ == "__main__":
    main(sys.argv[1:])
