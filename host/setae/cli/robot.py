"""Commands for one robot: move it, stop it, switch it on and off."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from cyclopts import Parameter

from setae.cli.common import Flag, Where, app, connected, console

# Negative coordinates are numbers, not options.
Number = Annotated[float, Parameter(allow_leading_hyphen=True)]


@app.command
def move(
    x: Number,
    y: Number,
    z: Number,
    /,
    *,
    duration: float | None = None,
    speed: float | None = None,
    relax: Flag = False,
    accept_jump: Flag = False,
    where: Where | None = None,
) -> None:
    """Move the spring's top to X Y Z (mm, frame D), then hold there.

    Parameters
    ----------
    x, y, z
        Target in mm.
    duration
        Time for the move in s.
    speed
        Speed of the fastest tendon in mm/s, instead of a duration.
    relax
        Relax afterwards instead of holding.
    accept_jump
        Enable the servos though nobody knows where they are, or they were left where the
        configuration doesn't allow them: the first pulse may move them at full speed.
    where
        Which robot.
    """
    with connected(where, leave="relax" if relax else "hold") as robot:
        robot.enable(accept_jump=accept_jump)
        robot.move_to((x, y, z), duration_s=duration, speed_mm_s=speed)
        console.print(f"At {_mm(robot.position_mm)}, tendons {_mm(robot.lengths_mm)}.")


@app.command
def probe(
    x: Number,
    y: Number,
    z: Number,
    /,
    *,
    speed: float | None = None,
    relax: Flag = False,
    accept_jump: Flag = False,
    where: Where | None = None,
) -> None:
    """Move towards X Y Z (mm, frame D) until the bristle touches something.

    On a contact the robot retracts to where it was.

    Parameters
    ----------
    x, y, z
        Target in mm.
    speed
        Highest speed of the bristle's tip in mm/s.
    relax
        Relax afterwards instead of holding.
    accept_jump
        Enable the servos though nobody knows where they are, or they were left where the
        configuration doesn't allow them: the first pulse may move them at full speed.
    where
        Which robot.
    """
    with connected(where, leave="relax" if relax else "hold") as robot:
        robot.enable(accept_jump=accept_jump)
        contact = robot.probe((x, y, z), speed_mm_s=speed)
        if contact is None:
            console.print(f"No contact up to {_mm(robot.position_mm)}.")
            return
        console.print(
            f"Contact: {contact.pressure_change_hpa:+.1f} hPa, spring's top at about"
            f" {_mm(contact.position_mm)}, tip at about {_mm(contact.tip_mm)}"
            f" (± {contact.uncertainty_mm:.1f} mm).",
            soft_wrap=True,
        )


@app.command
def stop(*, where: Where | None = None) -> None:
    """Stop the robot: freeze its servos where they are.

    Opening a UNO's port resets the board, which stops it too; this makes sure.

    Parameters
    ----------
    where
        Which robot.
    """
    with connected(where, leave="hold") as robot:
        robot.stop()
        console.print(f"Stopped: the board is {robot.state.name.lower()}.")


@app.command
def enable(*, accept_jump: Flag = False, where: Where | None = None) -> None:
    """Switch the servos on where they are, and hold; also after a stop, contact or fault.

    Parameters
    ----------
    accept_jump
        Enable the servos though nobody knows where they are, or they were left where the
        configuration doesn't allow them: the first pulse may move them at full speed.
    where
        Which robot.
    """
    with connected(where, leave="hold") as robot:
        robot.resume()
        robot.enable(accept_jump=accept_jump)
        console.print(f"Holding at {_mm(robot.position_mm)}, tendons {_mm(robot.lengths_mm)}.")


@app.command
def relax(*, accept_jump: Flag = False, where: Where | None = None) -> None:
    """Unwind the tendons slowly to the free length, then switch the servos off.

    Parameters
    ----------
    accept_jump
        Enable the servos though nobody knows where they are, or they were left where the
        configuration doesn't allow them: the first pulse may move them at full speed.
    where
        Which robot.
    """
    with connected(where, leave="hold") as robot:
        robot.resume()
        # A board that was reset holds the tendons by the servos' gears alone, so
        # they have to be switched on before they can unwind slowly.
        robot.enable(accept_jump=accept_jump)
        robot.relax()
        console.print("Relaxed: the servos are off.")


@app.command
def store(*, where: Where | None = None) -> None:
    """Store the configuration's limits in the board, so that it starts with them.

    Ranges, speed, pairs, coarse threshold, hold timeout and stop switch then hold before
    any host has set its own. The robot must be relaxed.

    Parameters
    ----------
    where
        Which robot.
    """
    with connected(where, leave="hold") as robot:
        robot.store_limits()
        console.print("Stored: the board starts with these limits from now on.")


def _mm(values: npt.ArrayLike) -> str:
    # + 0.0: no minus before a zero.
    rounded = np.round(np.asarray(values), 1) + 0.0
    return "(" + ", ".join(f"{value:.1f}" for value in rounded) + ") mm"
