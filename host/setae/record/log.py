"""A log in memory, and what may be wrong with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from setae.config import Config, loads
from setae.errors import ConfigError, InputError, LogError
from setae.record.topics import TOPICS
from setae.wording import counted


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """What is wrong with a log that could be read in part.

    Attributes
    ----------
    reason
        In words.
    bytes_lost
        Bytes of the file that gave no message: a cut or broken part. 0 where
        the run ended between two writes.
    chunks_lost
        Broken blocks in the middle, each up to a second of messages.
    last_time_us
        Time of the last message that could be read; what came later is gone,
        up to a second that was never written included.
    """

    reason: str
    bytes_lost: int
    chunks_lost: int
    last_time_us: int

    def __str__(self) -> str:
        lost = [f"{counted(self.bytes_lost, 'byte')} could not be read"] if self.bytes_lost else []
        if self.chunks_lost:
            lost.append(f"{counted(self.chunks_lost, 'broken block')} of up to 1 s each left out")
        lost.append(f"the last message is from {self.last_time_us / 1e6:.3f} s")
        return f"{self.reason}: {', '.join(lost)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A message of ``/experiment``."""

    time_us: int
    name: str
    data: Mapping[str, Any]


class Log:
    """A log in memory.

    Attributes
    ----------
    path : Path
        Where it was read from.
    metadata : dict
        As given to `Recorder`.
    damage : Damage or None
        What is wrong with the file; None where it is whole.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Any],
        messages: Mapping[str, Sequence[Mapping[str, Any]]],
        damage: Damage | None,
    ) -> None:
        self.path = path
        self.metadata = dict(metadata)
        self.damage = damage
        self._messages = {topic: list(items) for topic, items in messages.items()}

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics that hold messages."""
        return tuple(self._messages)

    @property
    def simulated(self) -> bool:
        """Whether the robot was simulated, as far as the log says."""
        return bool(self.metadata.get("simulated", "/truth" in self._messages))

    @property
    def config(self) -> Config:
        """The run's configuration; the paper's robot where the log has none.

        Raises
        ------
        LogError
            This version can't read it.
        """
        try:
            return loads(str(self.metadata.get("config", "")), source=str(self.path))
        except ConfigError as error:
            raise LogError(
                f"The configuration in {self.path} can't be used. {error.problem}",
                "Read the log with the version of setae that wrote it.",
            ) from error

    @property
    def span_us(self) -> tuple[int, int]:
        """Time of the first and the last message; (0, 0) where there is none."""
        times = [m["time_us"] for messages in self._messages.values() for m in messages]
        return (min(times), max(times)) if times else (0, 0)

    def messages(self, topic: str) -> list[Mapping[str, Any]]:
        """Messages of a topic, in the order written; none: an empty list."""
        return list(self._messages.get(topic, ()))

    def times_us(self, topic: str) -> NDArray[np.int64]:
        """Times of a topic's messages, (n,)."""
        return np.array([m["time_us"] for m in self._messages.get(topic, ())], dtype=np.int64)

    def array(self, topic: str, field: str) -> NDArray[Any]:
        """One field of all messages of a topic, (n, ...).

        Numbers come as float64 with NaN for null, flags as bool, text as str.

        Raises
        ------
        InputError
            The topic has no such field, or it holds objects, not values.
        """
        if field not in TOPICS.get(topic, {}):
            known = ", ".join(TOPICS[topic]) if topic in TOPICS else "no such topic"
            raise InputError(f"{topic} has no field {field!r}.", f"It has: {known}.")
        if "object" in TOPICS[topic][field]["type"]:
            raise InputError(f"{field!r} of {topic} is no array.", f"Use messages({topic!r}).")
        values = [m.get(field) for m in self._messages.get(topic, ())]
        kind = TOPICS[topic][field]["type"]
        if kind == "boolean":
            return np.array(values, dtype=bool)
        if kind == "string":
            return np.array(values, dtype=str)
        return np.array(values, dtype=float)

    def events(self, *names: str) -> list[Event]:
        """Messages of ``/experiment``, all or those with one of the names."""
        return [
            Event(time_us=m["time_us"], name=m["event"], data=m["data"] or {})
            for m in self._messages.get("/experiment", ())
            if not names or m["event"] in names
        ]
