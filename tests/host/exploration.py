"""A small stand-in for the robot, which writes the logs of an exploration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from setae.record import Recorder

ALPHAS_DEG = tuple(range(0, 360, 45))
TIP_MM = 65.0
POSES_PER_S = 10
AXIS_OFFSET_MM = 104.0


def arc(position_mm: tuple[float, float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Backbone (21, 3) and filament (2, 3) of a constant-curvature arc to U, frame D."""
    x, y, z = position_mm
    rho = float(np.hypot(x, y))
    theta = 2 * np.arctan2(rho, z)
    towards = np.array([x, y, 0.0]) / rho if rho > 0 else np.zeros(3)
    length = np.sqrt(rho**2 + z**2) * (theta / 2) / np.sin(theta / 2) if rho > 0 else z
    angle = np.linspace(0, theta, 21)[:, None]
    if rho > 0:
        radius = length / theta
        backbone = radius * ((1 - np.cos(angle)) * towards + np.sin(angle) * [0, 0, 1])
    else:
        backbone = np.linspace(0, 1, 21)[:, None] * [0, 0, z]
    along = np.sin(theta) * towards + np.cos(theta) * np.array([0, 0, 1])
    top = backbone[-1]
    return backbone, np.stack([top + 12 * along, top + TIP_MM * along])


class Walk:
    """Writes the log of one trial: moves along straight lines."""

    def __init__(self, recorder: Recorder, obstacle_mm: float | None, *, seed: int) -> None:
        self.recorder = recorder
        self.noise = np.random.default_rng(seed)
        self.time_us = 2_000_000
        self.arm_z_mm = 0.0
        self.pose_mm = np.array([0.0, 0.0, 45.0])
        self.cube_top_mm = None if obstacle_mm is None else -(45 + TIP_MM + obstacle_mm)
        self.armed = False

    def hits(self) -> bool:
        if self.cube_top_mm is None:
            return False
        _, filament = arc(tuple(self.pose_mm))
        x, y, z = (float(value) for value in filament[1] * (1, -1, -1) + (0, 0, self.arm_z_mm))
        return x > 30.0 and abs(y) < 20 and self.cube_top_mm - 40 < z < self.cube_top_mm

    def step(self) -> None:
        backbone, filament = arc(tuple(self.pose_mm))
        hit = self.hits()
        pressure = 1013.0 + 0.4 * self.noise.standard_normal() + (22.0 if hit else 0.0)
        record = self.recorder
        for part in range(3):
            record.pressure(
                self.time_us + part * 33_333,
                pressure_hpa=pressure,
                baseline_hpa=1013.0,
                armed=self.armed,
            )
        record.truth(
            self.time_us,
            backbone_mm=backbone,
            filament_mm=filament,
            arm_mm=(0, 0, self.arm_z_mm),
            contact_depth_mm=2.0 if hit else 0.0,
            contact_point_mm=filament[1] * (1, -1, -1) + (0, 0, self.arm_z_mm),
            tension_n=np.ones(4),
            pressure_hpa=pressure,
        )
        record.stage(self.time_us, position_mm=(0, 0, self.arm_z_mm), moving=False)
        self.time_us += 1_000_000 // POSES_PER_S

    def move(self, target_mm: tuple[float, float, float], seconds: float) -> bool:
        """Move there; True where the bristle touches on the way."""
        start = self.pose_mm.copy()
        steps = int(seconds * POSES_PER_S)
        for index in range(steps):
            self.pose_mm = start + (np.array(target_mm) - start) * (index + 1) / steps
            self.step()
            if self.armed and self.hits():
                return True
        return False

    def descend(self, to_mm: float) -> None:
        start = self.arm_z_mm
        for index in range(POSES_PER_S):
            self.arm_z_mm = start + (-to_mm - start) * (index + 1) / POSES_PER_S
            self.step()

    def direction(self, alpha_deg: float) -> bool:
        alpha = np.radians(alpha_deg)
        target = (15 * np.cos(alpha), 15 * np.sin(alpha), 60.0)
        record = self.recorder
        record.experiment(
            self.time_us, "direction_start", {"alpha_deg": alpha_deg, "target_mm": target}
        )
        self.armed = True
        touched = self.move(target, 1.0)
        contact = None
        if touched:
            _, filament = arc(tuple(self.pose_mm))
            contact = {
                "time_us": self.time_us,
                "tip_mm": filament[1],
                "pressure_hpa": 1035.0,
                "baseline_hpa": 1013.0,
            }
            record.trip(
                self.time_us,
                record_id=1,
                cause="contact",
                sample_time_us=self.time_us - 8_000,
                pressure_hpa=1035.0,
                baseline_hpa=1013.0,
                pulse_us=np.full((4, 4), 1200.0),
                contact=contact,
            )
        self.armed = False
        self.move((0.0, 0.0, 45.0), 0.6)
        data = {"alpha_deg": alpha_deg, "touched": touched, "contact": contact}
        record.experiment(self.time_us, "direction_end", data)
        return touched

    def run(self, *, levels: int, to_the_end: bool = True) -> None:
        record = self.recorder
        record.experiment(self.time_us, "trial_start", {})
        contacts = 0
        descent_mm = 0.0
        for level in range(1, levels + 1):
            descent_mm = 20.0 * level
            self.descend(descent_mm)
            record.experiment(self.time_us, "level_start", {"descent_mm": descent_mm})
            contacts = sum(self.direction(alpha) for alpha in ALPHAS_DEG)
            record.experiment(self.time_us, "level_end", {"contacts": contacts})
            if contacts:
                break
        if not to_the_end:
            return
        record.experiment(self.time_us, "arm_return", {})
        self.descend(0.0)
        record.experiment(
            self.time_us, "trial_end", {"descent_mm": descent_mm, "contacts": contacts}
        )


def write_log(
    path: Path, number: int, obstacle_mm: float | None, *, levels: int = 5, to_the_end: bool = True
) -> Path:
    cube = None
    if obstacle_mm is not None:
        top = -(45 + TIP_MM + obstacle_mm)
        cube = {"centre_mm": [50.0, 0.0, top - 20], "edge_mm": 40.0, "yaw_rad": 0.0}
    metadata = {
        "simulated": True,
        "seed": 7,
        "experiment": "explore",
        "config": "[bristle]\nthreshold_hpa = 15.0\n",
        "versions": {"setae": "0.1.0"},
        "trial": number,
        "obstacle_below_tip_mm": obstacle_mm,
        "scene": {
            "tube": {"axis_mm": [-AXIS_OFFSET_MM, 0.0], "inner_radius_mm": 174.0},
            "cube": cube,
            "arm_start_mm": [0.0, 0.0, 0.0],
        },
    }
    with Recorder(path, metadata=metadata) as recorder:
        Walk(recorder, obstacle_mm, seed=number).run(levels=levels, to_the_end=to_the_end)
    return path


def write_run(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number, obstacle_mm in enumerate((35.0, 55.0, 75.0, 95.0, None), start=1):
        write_log(folder / f"trial_{number}.mcap", number, obstacle_mm)
    return folder
