"""What the link went through, as numbers."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Statistics"]


@dataclass(slots=True)
class Statistics:
    """What the link went through, since it was opened."""

    frames_received: int = 0
    frames_lost: int = 0
    frames_late: int = 0
    frames_foreign: int = 0
    frames_sent: int = 0
    frames_retransmitted: int = 0
    timeouts: int = 0
    stops_sent: int = 0
