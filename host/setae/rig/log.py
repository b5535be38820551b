"""What link, arm and simulator tell, written into a recorder."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from setae.errors import LogError
from setae.link.events import (
    Event,
    FaultReported,
    Refused,
    StatusReceived,
    TelemetryReceived,
    Tripped,
)
from setae.record import Recorder
from setae.robot import Robot
from setae.sim import World
from setae.stage import Stage
from setae_protocol.messages import (
    PRESSURE_LSB_PER_HPA,
    PULSE_TICKS_PER_US,
    Guard,
    MessageType,
    TripCause,
)

__all__ = ["RigLog"]

_STAGE_PERIOD_US = 40_000
_TRUTH_FRAMES = 2


class RigLog:
    """Writes what the link, the arm and the simulator tell into a recorder."""

    def __init__(self, robot: Robot, stage: Stage, world: World | None, recorder: Recorder) -> None:
        self.recorder = recorder
        self._robot = robot
        self._arm = stage
        self._world = world
        self._stage_due_us = 0
        self._stage_moving: bool | None = None
        self._frames = 0
        self._robot.on_command = self._on_command
        self._unsubscribe = self._robot.session.subscribe(self._on_event)

    def close(self) -> None:
        """Stop listening, and close the recorder."""
        self._detach()
        self.recorder.close()

    def _detach(self) -> None:
        self._unsubscribe()
        self._robot.on_command = None

    def _on_command(self, name: str, args: Mapping[str, Any]) -> None:
        with self._told_once():
            self.recorder.command(self._robot.now_us, name, args)

    def _on_event(self, event: Event) -> None:
        with self._told_once():
            self._write(event)

    @contextmanager
    def _told_once(self) -> Iterator[None]:
        """A full disk is told once. The robot still has to be stopped, and that comes by here."""
        try:
            yield
        except LogError:
            self._detach()
            raise

    def _write(self, event: Event) -> None:
        if isinstance(event, TelemetryReceived):
            self._telemetry(event)
        elif isinstance(event, Tripped):
            self._trip(event)
        elif isinstance(event, FaultReported):
            fault = event.record
            self.recorder.fault(
                event.time_us,
                record_id=fault.record_id,
                fault=fault.fault.name.lower(),
                detail=fault.detail,
                pulse_us=np.array(fault.pulse_ticks) / PULSE_TICKS_PER_US,
            )
        elif isinstance(event, StatusReceived):
            status = event.status
            self.recorder.status(
                event.time_us,
                supply_mv=status.supply_mv,
                storing=bool(status.storing),
                stop_switch_open=bool(status.stop_switch_open),
                rx_framing_errors=status.rx_framing_errors,
                rx_overruns=status.rx_overruns,
                rx_overflows=status.rx_overflows,
                late_pulses=status.late_pulses,
            )
        elif isinstance(event, Refused):
            refusal = event.record
            self.recorder.refusal(
                event.time_us,
                record_id=refusal.record_id,
                command=MessageType(refusal.command_type).name.lower(),
                reason=refusal.reason.name.lower(),
                index=refusal.index,
                value=refusal.value,
                limit=refusal.limit,
            )

    def _telemetry(self, event: TelemetryReceived) -> None:
        telemetry = event.telemetry
        baseline_hpa = telemetry.baseline_raw / PRESSURE_LSB_PER_HPA
        pulses_us = [
            ticks / PULSE_TICKS_PER_US if telemetry.attached >> index & 1 else 0.0
            for index, ticks in enumerate(telemetry.pulse_ticks)
        ]
        # By the board's own time: the line's delays don't belong into the log.
        time_us = self._robot.host_time_us(telemetry.frame, telemetry.phase_us)
        self.recorder.telemetry(
            time_us,
            frame=telemetry.frame,
            state=event.state.name.lower(),
            epoch=event.epoch,
            pulse_us=pulses_us,
            guard=telemetry.guard.name.lower(),
            reflex_running=bool(telemetry.reflex_running),
            queued=telemetry.queued,
            baseline_hpa=baseline_hpa,
        )
        for sample in telemetry.samples[: telemetry.sample_count]:
            self.recorder.pressure(
                time_us - sample.age_us,
                pressure_hpa=sample.pressure_raw / PRESSURE_LSB_PER_HPA,
                baseline_hpa=baseline_hpa,
                armed=telemetry.guard is Guard.ARMED,
            )
        self._stage(event.time_us)
        self._frames += 1
        if self._world is not None and self._frames % _TRUTH_FRAMES == 0:
            self._truth(self._world)

    def _trip(self, event: Tripped) -> None:
        record = event.record
        self.recorder.trip(
            event.time_us,
            record_id=record.record_id,
            cause=record.cause.name.lower(),
            sample_time_us=self._robot.host_time_us(record.sample_frame, record.sample_phase_us),
            pressure_hpa=record.pressure_raw / PRESSURE_LSB_PER_HPA,
            baseline_hpa=record.baseline_raw / PRESSURE_LSB_PER_HPA,
            pulse_us=np.array(record.pulse_ticks) / PULSE_TICKS_PER_US,
            contact=None if record.cause is TripCause.DEADLINE else self._robot.contact_of(event),
        )

    def _stage(self, time_us: int) -> None:
        if time_us < self._stage_due_us:
            return
        self._stage_due_us = time_us + _STAGE_PERIOD_US
        moving = self._arm.moving
        if moving or self._stage_moving is not False:
            self.recorder.stage(time_us, position_mm=self._arm.position_mm, moving=moving)
        self._stage_moving = moving

    def _truth(self, world: World) -> None:
        truth = world.truth()
        self.recorder.truth(
            truth.time_us,
            backbone_mm=truth.backbone_mm,
            filament_mm=truth.filament_mm,
            arm_mm=truth.arm_mm,
            contact_depth_mm=truth.contact_depth_mm,
            contact_point_mm=np.full(3, np.nan)
            if truth.contact_point_mm is None
            else truth.contact_point_mm,
            tension_n=truth.tension_n,
            pressure_hpa=truth.pressure_hpa,
            plant_residual=truth.plant_residual,
            largest_residual=truth.largest_residual,
            unsolved_samples=math.nan if truth.unsolved_samples is None else truth.unsolved_samples,
        )
