"""A Universal Robots arm that carries the robot: a stage over the network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from setae.ur.stage import SCHEME, UrStage

__all__ = ["SCHEME", "UrStage"]


def __getattr__(name: str) -> Any:
    # The process that holds the UR library starts in half the time without the stage.
    if name in __all__:
        from setae.ur import stage

        return getattr(stage, name)
    raise AttributeError(f"module 'setae.ur' has no attribute {name!r}")
