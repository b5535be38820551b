"""The simulated robot: the board's own code and a physical plant, in virtual time.

Everything here drives one compiled library through a C interface,
`simulator/setae_sim.h`. A `World` holds board, line, plant, sensor, arm and
solids; `SimTransport` and `SimulatedStage` are the two ways into it that look
like hardware to the rest of setae.
"""

from setae.sim import plants, plugin
from setae.sim.library import SimulationError
from setae.sim.plugin import PluginError
from setae.sim.solids import add_solid
from setae.sim.spring import Rest, Spring
from setae.sim.stage import Follower, SimulatedStage
from setae.sim.transport import SimTransport
from setae.sim.truth import SOLVED, SensorFault, Truth
from setae.sim.world import World, parameter_names, parameter_ranges

__all__ = [
    "SOLVED",
    "Follower",
    "PluginError",
    "Rest",
    "SensorFault",
    "SimTransport",
    "SimulatedStage",
    "SimulationError",
    "Spring",
    "Truth",
    "World",
    "add_solid",
    "parameter_names",
    "parameter_ranges",
    "plants",
    "plugin",
]
