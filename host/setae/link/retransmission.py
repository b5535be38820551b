"""How long to wait for a receipt before sending again: RFC 6298."""

from __future__ import annotations

from typing import Final

__all__ = ["RetransmissionTimer"]

# A floor far above a frame's time on the line and the 4 ms that a USB chip may hold back an
# answer.
_TIMEOUT_FLOOR_US: Final = 25_000
_TIMEOUT_INITIAL_US: Final = 200_000
_TIMEOUT_MAX_US: Final = 400_000


class RetransmissionTimer:
    """Estimates the round trip, and from it the timeout.

    Attributes
    ----------
    smoothed_us
        Smoothed round trip; None before the first.
    timeout_us
        How long to wait now.
    """

    def __init__(self) -> None:
        self.smoothed_us: float | None = None
        self.timeout_us = _TIMEOUT_INITIAL_US
        self._variation_us = 0.0

    @property
    def round_trip_us(self) -> float:
        """Smoothed round trip, or a guess where none was measured."""
        return self.smoothed_us or _TIMEOUT_FLOOR_US

    def measure(self, round_trip_us: int) -> None:
        """Take one round trip (section 2)."""
        if self.smoothed_us is None:
            self.smoothed_us = float(round_trip_us)
            self._variation_us = round_trip_us / 2
        else:
            error = abs(self.smoothed_us - round_trip_us)
            self._variation_us += (error - self._variation_us) / 4
            self.smoothed_us += (round_trip_us - self.smoothed_us) / 8

    @property
    def estimate_us(self) -> int:
        """How long an answer takes at most, as far as is known (section 2)."""
        if self.smoothed_us is None:
            return _TIMEOUT_INITIAL_US
        estimate_us = int(self.smoothed_us + 4 * self._variation_us)
        return max(_TIMEOUT_FLOOR_US, min(_TIMEOUT_MAX_US, estimate_us))

    def recover(self) -> None:
        """The board was heard: wait as long as the estimate says."""
        self.timeout_us = self.estimate_us

    def back_off(self) -> None:
        """Nothing was heard: wait twice as long (section 5.5)."""
        self.timeout_us = min(2 * self.timeout_us, _TIMEOUT_MAX_US)
