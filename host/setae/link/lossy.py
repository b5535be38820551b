"""A transport that does to frames what bad cables and full buffers do."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass, field

from setae.link.transport import Transport

__all__ = ["Faults", "LossyTransport"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """How often what happens to a frame, each a probability from 0 to 1.

    Attributes
    ----------
    lose, double, damage
        It is gone, comes twice, has a bit, a byte or its delimiter changed.
    delay, delay_max_us
        It comes late, by up to `delay_max_us`; frames after it overtake it.
    split, merge
        It comes in two pieces, or waits for the next.
    """

    lose: float = 0.0
    double: float = 0.0
    damage: float = 0.0
    delay: float = 0.0
    delay_max_us: int = 30_000
    split: float = 0.0
    merge: float = 0.0


@dataclass(order=True, slots=True)
class _Piece:
    at_us: int
    number: int
    data: bytes = field(compare=False)


class _Mangler:
    """One direction."""

    def __init__(self, faults: Faults, rng: random.Random) -> None:
        self.faults = faults
        self.pending: list[_Piece] = []
        self.counts = dict.fromkeys(("lost", "doubled", "damaged", "delayed"), 0)
        self._rng = rng
        self._number = 0
        self._partial = b""

    def put(self, data: bytes, now_us: int) -> None:
        *frames, self._partial = (self._partial + data).split(b"\0")
        for frame in frames:
            self._put_frame(frame + b"\0", now_us)

    def _put_frame(self, frame: bytes, now_us: int) -> None:
        faults, rng = self.faults, self._rng
        if rng.random() < faults.lose:
            self.counts["lost"] += 1
            return
        copies = 1
        if rng.random() < faults.double:
            self.counts["doubled"] += 1
            copies = 2
        for _ in range(copies):
            data = frame
            at_us = now_us
            if rng.random() < faults.damage:
                self.counts["damaged"] += 1
                data = self._damage(data)
            if rng.random() < faults.delay:
                self.counts["delayed"] += 1
                at_us += rng.randint(1, faults.delay_max_us)
            if rng.random() < faults.merge:
                at_us += 1_000
            if len(data) > 1 and rng.random() < faults.split:
                cut = rng.randrange(1, len(data))
                self._push(data[:cut], at_us)
                data = data[cut:]
            self._push(data, at_us)

    def _damage(self, frame: bytes) -> bytes:
        data = bytearray(frame)
        place = self._rng.randrange(len(data))
        kind = self._rng.randrange(4)
        if kind == 0:
            data[place] ^= 1 << self._rng.randrange(8)
        elif kind == 1:
            del data[place]
        elif kind == 2:
            data.insert(place, self._rng.randrange(256))
        else:
            data[place] = self._rng.randrange(256)
        return bytes(data)

    def _push(self, data: bytes, at_us: int) -> None:
        self._number += 1
        heapq.heappush(self.pending, _Piece(at_us, self._number, data))

    def next_us(self) -> int | None:
        return self.pending[0].at_us if self.pending else None

    def due(self, now_us: int) -> bytes:
        out = b""
        while self.pending and self.pending[0].at_us <= now_us:
            out += heapq.heappop(self.pending).data
        return out


class LossyTransport:
    """Wraps a transport and loses, doubles, reorders, damages, delays, splits and merges frames.

    Parameters
    ----------
    inner
        The transport that works.
    seed
        The same seed and traffic give the same faults.
    down, up
        What happens to frames to the board, and from it.

    Attributes
    ----------
    down_faults, up_faults
        May be replaced at any time.
    """

    def __init__(
        self,
        inner: Transport,
        *,
        seed: int,
        down: Faults = Faults(),
        up: Faults = Faults(),
    ) -> None:
        self.inner = inner
        self._down = _Mangler(down, random.Random(f"down {seed}"))
        self._up = _Mangler(up, random.Random(f"up {seed}"))

    @property
    def name(self) -> str:
        """The wrapped transport's."""
        return self.inner.name

    @property
    def simulated(self) -> bool:
        """The wrapped transport's."""
        return self.inner.simulated

    @property
    def down_faults(self) -> Faults:
        """What happens to frames to the board."""
        return self._down.faults

    @down_faults.setter
    def down_faults(self, faults: Faults) -> None:
        self._down.faults = faults

    @property
    def up_faults(self) -> Faults:
        """What happens to frames from the board."""
        return self._up.faults

    @up_faults.setter
    def up_faults(self, faults: Faults) -> None:
        self._up.faults = faults

    @property
    def counts(self) -> dict[str, int]:
        """Frames lost, doubled, damaged and delayed so far, both ways."""
        return {key: value + self._up.counts[key] for key, value in self._down.counts.items()}

    def now_us(self) -> int:
        """Return the wrapped transport's time."""
        return self.inner.now_us()

    def send(self, data: bytes) -> None:
        """Send what the faults leave of it."""
        now_us = self.now_us()
        self._down.put(data, now_us)
        self._release(now_us)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Wait for bytes until the deadline."""
        while True:
            now_us = self.now_us()
            self._release(now_us)
            data = self._up.due(now_us)
            if data:
                return data, now_us
            times = [deadline_us, self._down.next_us(), self._up.next_us()]
            wake_us = min(time for time in times if time is not None)
            received = self.inner.receive(wake_us)
            if received is not None:
                self._up.put(*received)
            elif self.now_us() >= deadline_us:
                self._release(self.now_us())
                return None

    def close(self) -> None:
        """Close the wrapped transport."""
        self.inner.close()

    def _release(self, now_us: int) -> None:
        data = self._down.due(now_us)
        if data:
            self.inner.send(data)
