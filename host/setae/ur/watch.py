"""For how long the controller has told nothing, whatever the host does meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final

__all__ = ["Watch"]

_PERIOD_S: Final = 0.005
_END_TIMEOUT_S: Final = 1.0
# The host's computer itself may stall, and then it hears nothing either: what counts is for
# how long somebody looked.
_GAP_MAX_S: Final = 0.05


class Watch:
    """Looks at the controller's own time in a thread of its own.

    So the age of what it told is known also to a host that plans for seconds, or polls rarely.

    Parameters
    ----------
    timestamp_s
        The controller's time when it last told, or None; never waits.
    clock
        Seconds, of the host.
    """

    def __init__(self, timestamp_s: Callable[[], float | None], clock: Callable[[], float]) -> None:
        self._timestamp_s = timestamp_s
        self._clock = clock
        self._last_s: float | None = None
        self._looked_s = 0.0
        self._unseen_s = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="setae-arm-watch", daemon=True)

    @property
    def unseen_s(self) -> float:
        """For how long nothing new was seen."""
        return self._unseen_s

    def start(self) -> None:
        """Begin; what the controller has told so far is new."""
        self._last_s, self._looked_s = self._timestamp_s(), self._clock()
        self._thread.start()

    def close(self) -> None:
        """End; closing twice is fine, and so is closing what was never started."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(_END_TIMEOUT_S)

    def look(self) -> None:
        """Look once; the thread does."""
        told_s, now_s = self._timestamp_s(), self._clock()
        gap_s, self._looked_s = now_s - self._looked_s, now_s
        if told_s is not None and told_s != self._last_s:
            self._last_s, self._unseen_s = told_s, 0.0
        else:
            self._unseen_s += min(gap_s, _GAP_MAX_S)

    def _run(self) -> None:
        while not self._ended.wait(_PERIOD_S):
            self.look()
