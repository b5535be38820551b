"""What the pressure did while the board watched it."""

from __future__ import annotations

from setae.link.events import Event, TelemetryReceived
from setae_protocol.messages import PRESSURE_LSB_PER_HPA, Guard

__all__ = ["PressureWatch"]


class PressureWatch:
    """Notices pressure that rose and fell back while the board watched: a bristle that slid off."""

    def __init__(self) -> None:
        self._highest_hpa = 0.0
        self._fell_hpa = 0.0

    def begin(self) -> None:
        """Forget what was."""
        self._highest_hpa = self._fell_hpa = 0.0

    def fell_hpa(self) -> float:
        """Largest fall of the pressure's change since `begin`."""
        return self._fell_hpa

    def take(self, event: Event) -> None:
        """Take an event of the link."""
        if not isinstance(event, TelemetryReceived):
            return
        telemetry = event.telemetry
        if telemetry.guard is not Guard.ARMED:
            return
        # The newest comes last.
        for sample in telemetry.samples[: telemetry.sample_count]:
            change_hpa = abs(sample.pressure_raw - telemetry.baseline_raw) / PRESSURE_LSB_PER_HPA
            self._highest_hpa = max(self._highest_hpa, change_hpa)
            self._fell_hpa = max(self._fell_hpa, self._highest_hpa - change_hpa)
