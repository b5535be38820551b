"""`setae plant`: every number of a simulated robot."""

from __future__ import annotations

from pathlib import Path

from setae import rig
from setae.cli.common import app
from setae.config import load

# Behind its last underscores a name has its unit; these are several words of one.
_HEADER = "parameter,value,default,least,most"


@app.command(name="plant")
def plant_command(name: str | None = None, *, config: Path | None = None) -> None:
    """Print all parameters of a simulated robot as CSV: value, default and range.

    A name ends with its unit (those of one tendon with the tendon's number behind it); without
    one it is a ratio, a count, a direction (1 or -1) or a switch (0 or 1). Any of them can be set
    in the configuration, below [simulator].

    Parameters
    ----------
    name
        The simulated robot: ideal, paper_like or random:SEED. Without it the configuration's.
    config
        TOML file with what differs from the paper's robot.
    """
    print(_HEADER)
    for row in rig.simulator_table(load(config), name):
        print(f"{row.name},{row.value!r},{row.default!r},{row.least!r},{row.most!r}")
