"""A Universal Robots arm that carries the robot: a stage over the network."""

from setae.ur.stage import SCHEME, UrStage

__all__ = ["SCHEME", "UrStage"]
