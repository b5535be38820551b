"""What an experiment tells while it runs: to its log, and to whoever watches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened in an experiment.

    Attributes
    ----------
    time_us
        When, by the session's clock.
    name
        Such as trial_start; each experiment's module says which it has.
    data
        What belongs to it; JSON-ready.
    """

    time_us: int
    name: str
    data: Mapping[str, Any] = field(default_factory=dict)


OnEvent = Callable[[Event], None]
