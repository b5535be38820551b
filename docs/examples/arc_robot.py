"""A plant of one's own: a robot that always is an arc.

In this file's folder: `setae explore --sim python:arc_robot:make`.
"""

import numpy as np

from setae import kinematics
from setae.config import Config
from setae.sim.plugin import Answer, Drive


class ArcRobot:
    """Takes what the servos have wound up, and bends as offset arcs of that length do."""

    def __init__(self, config: Config) -> None:
        self.geometry = config.geometry

    def step(self, drive: Drive) -> Answer:
        """The arc at the drive's time."""
        lengths_mm = self.geometry.free_length_mm - drive.pull_mm
        arc = kinematics.forward(lengths_mm, self.geometry, model="parallel")
        pose = kinematics.transform(arc)
        return Answer(position_mm=pose[:3, 3], rotation=pose[:3, :3], tension_n=np.zeros(4))


def make(config: Config, seed: int) -> ArcRobot:
    """What `python:arc_robot:make` names. This robot has no chance in it to be seeded."""
    del seed
    return ArcRobot(config)
