"""How few segments a motion takes, and how large the workspace is."""

from __future__ import annotations

import numpy as np

from setae import kinematics, packing, servo, tendons, trajectory, volume
from setae.config import load
from setae.volume import Volumes

CONFIG = load()
TUBE_TARGET_MM = (15.0, 0.0, 60.0)
TOLERANCE_UM = 10.0


def segments_per_move() -> tuple[int, int, float]:
    """Pack the exploration's extension, a quintic of 1 s at 10 µm.

    Returns
    -------
    segments, frames : int
        What the board gets, and one for each servo frame.
    error_um : float
        Farthest that what it plays is from what was planned, rounding included.
    """
    servos = servo.ServoModel(CONFIG)
    start = np.full(4, CONFIG.explore.compressed_length_mm)
    end = tendons.lengths(kinematics.inverse(TUBE_TARGET_MM), CONFIG.geometry, "paper")
    limits = trajectory.Limits(speed_mm_s=servos.max_speed_mm_s)
    motion = trajectory.line(start, end, duration_s=1.0, limits=limits)
    begin = servos.ticks(start)
    segments = servos.segments(motion.lengths_mm, start_ticks=begin, tolerance_um=TOLERANCE_UM)
    ends = np.cumsum([segment.duration_frames for segment in segments])
    played = packing.played(begin, ends, [segment.target_ticks for segment in segments])
    error_um = float(np.abs(servos.lengths_mm(played) - motion.lengths_mm).max()) * 1e3
    return len(segments), motion.frames, error_um


def volumes() -> Volumes:
    """Measure the workspace with the paper's tendon rule."""
    return volume.measure(CONFIG, "paper")
