"""Puts a robot together: board or simulator, arm, log.

`connect` gives a `setae.robot.Robot`. `open` gives a `Rig`: robot and arm, and
what is simulated of them shares one world with one clock. Nothing else in the
package knows whether anything is simulated.
"""

from setae.rig.assembly import (
    Leave,
    Rig,
    connect,
    open,  # noqa: A004  # rig.open() is what it does
    simulator_parameters,
    simulator_version,
    try_simulator,
)
from setae.rig.parameters import simulator_table
from setae.rig.ports import PortInfo, find_port, ports
from setae.sim import plants

__all__ = [
    "Leave",
    "PortInfo",
    "Rig",
    "connect",
    "find_port",
    "open",
    "plants",
    "ports",
    "simulator_parameters",
    "simulator_table",
    "simulator_version",
    "try_simulator",
]
