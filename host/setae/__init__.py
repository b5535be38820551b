"""setae: a tendon-driven continuum robot that feels with a bristle.

>>> import setae
>>> setae.Geometry().free_length_mm
70.0
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from setae import errors
from setae.config import Config, Geometry
from setae.errors import SetaeError

if TYPE_CHECKING:
    from setae.rig import connect as connect

__version__ = "0.1.0"

__all__ = ["Config", "Geometry", "SetaeError", "__version__", "connect", "errors"]


def __getattr__(name: str) -> Any:
    # `connect` pulls in the link and the simulator; kinematics alone needs neither.
    if name == "connect":
        from setae.rig import connect

        return connect
    raise AttributeError(f"module 'setae' has no attribute {name!r}")
