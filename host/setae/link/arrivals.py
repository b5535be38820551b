"""The order of the board's frames: which are new, late, or were lost."""

from __future__ import annotations

from typing import Final

from setae.link.counts import Statistics

__all__ = ["Arrivals"]

# Board frames are numbered modulo 256; after this much silence an old number means nothing.
_RESYNCHRONISE_US: Final = 500_000


class Arrivals:
    """Follows the number in each board frame's header.

    Attributes
    ----------
    heard_at_us
        When the newest frame came.
    """

    def __init__(self, statistics: Statistics) -> None:
        self.heard_at_us = 0
        self._statistics = statistics
        self._last_sequence: int | None = None

    def start(self, sequence: int, now_us: int) -> None:
        """Count from this frame on."""
        self._last_sequence = sequence
        self.heard_at_us = now_us

    def note(self, sequence: int, now_us: int) -> bool:
        """Count lost frames; return whether this one is newer than all before it."""
        silent = now_us - self.heard_at_us >= _RESYNCHRONISE_US
        step = 1 if self._last_sequence is None else (sequence - self._last_sequence) & 0xFF
        if not silent and (step == 0 or step >= 128):
            self._statistics.frames_late += 1
            return False
        self._statistics.frames_lost += (step - 1) & 0xFF
        self._last_sequence = sequence
        self.heard_at_us = now_us
        return True
