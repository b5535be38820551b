"""Board time and host time: which is which, and how surely.

Every board frame carries the board's time when it was made and gets the host's
when it arrives. Between the two lie the line, which is known, and a delay,
which is not (the UNO's USB chip holds bytes back for up to 4 ms) but is never
negative. So the true relation is the highest line that stays below all points:
the lower envelope of the delay.

The line is the edge of the points' lower convex hull below their mean, which is
the one with the least sum of distances (Moon, Skelly and Towsley, "Estimation
and removal of clock skew from network delay measurements", INFOCOM 1999).

How surely: a board's answer was made after the question was sent, so each ping
gives a point that the true line can't be below. With the resonator's tolerance,
the lines between the two kinds of points are all that are possible.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias

__all__ = ["Clock", "ClockEstimate"]

_BUCKET_US: Final = 500_000
_BUCKETS: Final = 120
# The UNO's ceramic resonator is within 0.5 %; the host's crystal adds little.
_RATE_ERROR_MAX: Final = 0.006
# Below this span a few ms of delay look like more rate error than a resonator has.
_SPAN_FOR_RATE_US: Final = 2_000_000
# What the resonator makes of a frame's time on the line, and whole microseconds.
_LINE_ERROR_US: Final = 25


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """A straight line between the two times.

    Attributes
    ----------
    board_us, host_us
        A pair of times that belong together, the newest.
    rate
        Host microseconds that pass in one microsecond of the board.
    uncertainty_us
        How wrong `host_us` may be at most, either way; infinite until a ping came back.
        It holds where both clocks ran evenly for the last minute.
    rate_uncertainty
        How wrong `rate` may be at most, either way.
    """

    board_us: float
    host_us: float
    rate: float
    uncertainty_us: float
    rate_uncertainty: float

    def to_host_us(self, board_us: float) -> float:
        """Return the host time of a board time."""
        return self.host_us + (board_us - self.board_us) * self.rate

    def to_board_us(self, host_us: float) -> float:
        """Return the board time of a host time."""
        return self.board_us + (host_us - self.host_us) / self.rate

    def uncertainty_at_us(self, board_us: float) -> float:
        """Return how wrong the host time of a board time may be at most, either way."""
        return self.uncertainty_us + abs(board_us - self.board_us) * self.rate_uncertainty


class Clock:
    """Collects pairs of times and estimates how they belong together.

    Examples
    --------
    >>> clock = Clock()
    >>> clock.add(board_us=1_000, received_us=51_000)
    >>> clock.estimate().to_host_us(2_000)
    52000.0
    """

    def __init__(self) -> None:
        # The quickest pair of each half second: (board time, received - board time).
        self._buckets: deque[tuple[int, int, int]] = deque(maxlen=_BUCKETS)
        # The latest possible board time of a host time, from the downlink.
        self._sent: deque[tuple[int, int]] = deque(maxlen=_BUCKETS)
        self._estimate: ClockEstimate | None = None

    @property
    def known(self) -> bool:
        """Whether there is anything to estimate from."""
        return bool(self._buckets)

    def add(self, *, board_us: int, received_us: int) -> None:
        """Add a board time and when it arrived, less its bytes' time on the line."""
        key = board_us // _BUCKET_US
        delay = received_us - board_us
        if self._buckets and self._buckets[-1][0] == key:
            if delay >= self._buckets[-1][2]:
                return
            self._buckets[-1] = (key, board_us, delay)
        else:
            self._buckets.append((key, board_us, delay))
        self._estimate = None

    def add_sent(self, *, sent_us: int, board_us: int) -> None:
        """Add when a question was sent, plus its bytes' time, and the board's time of answering."""
        self._sent.append((board_us, sent_us - board_us))
        self._estimate = None

    def estimate(self) -> ClockEstimate:
        """Return the best line so far.

        Raises
        ------
        ValueError
            Nothing was added yet.
        """
        if self._estimate is None:
            self._estimate = self._fit()
        return self._estimate

    def _fit(self) -> ClockEstimate:
        if not self._buckets:
            raise ValueError("no frame with a board time has arrived yet")
        points = sorted((board, delay) for _, board, delay in self._buckets)
        upper = _lower_hull(points)
        # No line through the lower points leaves out one below another's hull.
        lower = [(x, -y) for x, y in _lower_hull(sorted((x, -y) for x, y in self._sent))]
        slowest, fastest = _slopes_between(upper, lower)
        slope = (slowest + fastest) / 2
        if points[-1][0] - points[0][0] >= _SPAN_FOR_RATE_US:
            mean = sum(board for board, _ in points) / len(points)
            for (x0, y0), (x1, y1) in pairwise(upper):
                if x0 <= mean <= x1:
                    slope = (y1 - y0) / (x1 - x0)
            slope = max(slowest, min(fastest, slope))
        # Behind all points: so the steepest line is the highest there, and the flattest the lowest.
        at = max(points[-1][0], lower[-1][0] if lower else 0)
        height = _lowest(upper, slope, at)
        highest = _lowest(upper, fastest, at)
        lowest = -_lowest([(x, -y) for x, y in lower], -slowest, at)
        return ClockEstimate(
            board_us=float(at),
            host_us=at + height,
            rate=1.0 + slope,
            uncertainty_us=max(highest - height, height - lowest, 0.0) + _LINE_ERROR_US,
            rate_uncertainty=max(fastest - slope, slope - slowest),
        )


_Points: TypeAlias = list[tuple[int, int]]


def _slopes_between(upper: _Points, lower: _Points) -> tuple[float, float]:
    """Slopes of the lines below all `upper` and above all `lower` points: least, greatest."""
    slowest, fastest = -_RATE_ERROR_MAX, _RATE_ERROR_MAX
    for x, y in upper:
        for x_low, y_low in lower:
            if x > x_low:
                fastest = min(fastest, (y - y_low) / (x - x_low))
            elif x < x_low:
                slowest = max(slowest, (y_low - y) / (x_low - x))
    # Crossed where a clock did not run evenly: then nothing better is known.
    return (slowest, fastest) if slowest <= fastest else (-_RATE_ERROR_MAX, _RATE_ERROR_MAX)


def _lowest(points: _Points, slope: float, at: int) -> float:
    """Height at `at` of the highest line with this slope that is below all points."""
    return min((y + slope * (at - x) for x, y in points), default=float("inf"))


def _lower_hull(points: _Points) -> _Points:
    hull: _Points = []
    for x, y in points:
        while len(hull) >= 2:
            (x0, y0), (x1, y1) = hull[-2:]
            if (y1 - y0) * (x - x0) >= (y - y0) * (x1 - x0):
                hull.pop()
            else:
                break
        hull.append((x, y))
    return hull
