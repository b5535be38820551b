"""`setae workspace`: what the robot can reach, in figures and pictures."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from setae import tendons, volume
from setae.cli.common import Flag, app, console, new_folder
from setae.cli.runs import say
from setae.config import load
from setae.volume import Fate, Volumes


@app.command
def workspace(
    *,
    model: str | None = None,
    config: Path | None = None,
    out: Path | None = None,
    force: Flag = False,
) -> None:
    """Measure and draw the workspace: what the robot reaches, holds, and loses.

    Writes workspace.png and workspace.html into the folder --out.

    Parameters
    ----------
    model
        Tendon model: paper, parallel or taut. Without it the configuration's.
    config
        TOML file with what differs from the paper's robot.
    out
        Folder for the pictures; the default is the next free runs/workspace-N.
    force
        Use --out though it holds files; those of the same names are replaced.
    """
    from setae.report import workspace as pictures
    from setae.report.files import writing

    robot = load(config)
    model = tendons.model(model or robot.motion.model).name
    pictures.require()
    folder = new_folder("workspace", out, force=force)
    measured = volume.measure(robot, model)
    _print(measured, model)
    with writing(folder, "The pictures"):
        say(f"Picture: {pictures.picture(folder / 'workspace.png', robot, model, measured)}")
        say(f"Page: {pictures.page(folder / 'workspace.html', robot, model, measured)}")


def _print(measured: Volumes, model: str) -> None:
    table = Table(title=f"Workspace of the spring's top, model {model}", title_justify="left")
    table.add_column("")
    table.add_column("cm³", justify="right", overflow="fold")
    table.add_column("±", justify="right", overflow="fold")
    rows = [("the spring alone", measured.spring)]
    rows += [
        (f"  lost to {name}", measured.lost[kind])
        for kind, name in ((Fate.TRAVEL, "servo travel"), (Fate.LONG, "too long tendons"))
    ]
    rows.append(("reachable", measured.reachable))
    rows += [
        (f"  lost to {name}", measured.lost[kind])
        for kind, name in ((Fate.TENSION, "tension"), (Fate.SLACK, "slack tendons"))
    ]
    rows.append(("reachable and held", measured.held))
    for name, part in rows:
        table.add_row(name, f"{part.cm3:.1f}", f"{part.error_cm3:.2f}")
    console.print(table)
