"""Smooth motions, sampled on the board's servo frames.

All tendons follow one phase s(t), so they start, pass each point of the path and
arrive together. `laws` has the phases, `paths` the ways through arcs and where a
tendon model jumps on them, `plan` stretches a path's time until every limit is kept,
and `moves` puts them together: what a caller wants is here.

>>> motion = line([70] * 4, [60] * 4, duration_s=1.0, limits=Limits(speed_mm_s=60))
>>> motion.frames, motion.lengths_mm[-1].tolist()
(50, [60.0, 60.0, 60.0, 60.0])
"""

from __future__ import annotations

from setae.trajectory.laws import PEAK, cruise, quintic
from setae.trajectory.moves import along, bend, circle, duration_for_speed, hold, line
from setae.trajectory.paths import JUMP_MM, Jump, between, jumps, largest_jump_mm
from setae.trajectory.plan import FrameTrajectory, Limits

__all__ = [
    "JUMP_MM",
    "PEAK",
    "FrameTrajectory",
    "Jump",
    "Limits",
    "along",
    "bend",
    "between",
    "circle",
    "cruise",
    "duration_for_speed",
    "hold",
    "jumps",
    "largest_jump_mm",
    "line",
    "quintic",
]
