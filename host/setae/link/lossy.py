"""A transport that does to frames what bad cables and full buffers do."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass, field
from typing import Final

from setae.link.transport import Transport

__all__ = ["Faults", "LossyTransport"]


_SPLIT_PAUSE_MAX_US: Final = 2_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """How often what happens to a frame, each a probability from 0 to 1.

    Attributes
    ----------
    lose, double, damage
        It is gone, comes twice, has a bit, a byte or its delimiter changed.
    delay, delay_max_us, delay_max_frames
        It comes late: by up to `delay_max_us`, and at the latest after that many
        frames more. Below 127 of them the protocol's numbers tell old from new.
    reorder
        It changes places with the next one.
    split
        It comes in two pieces with a pause between.
    merge
        It waits for the next and comes joined with it, every other time without the
        delimiter between: then the two are one damaged frame.
    """

    lose: float = 0.0
    double: float = 0.0
    damage: float = 0.0
    delay: float = 0.0
    delay_max_us: int = 30_000
    delay_max_frames: int = 100
    reorder: float = 0.0
    split: float = 0.0
    merge: float = 0.0

    @classmethod
    def each(cls, rate: float) -> Faults:
        """Each kind at the same rate."""
        return cls(
            lose=rate, double=rate, damage=rate, delay=rate, reorder=rate, split=rate, merge=rate
        )


@dataclass(order=True, slots=True)
class _Piece:
    at_us: int
    number: int
    frame: int = field(compare=False)
    data: bytes = field(compare=False)


@dataclass(slots=True)
class _Held:
    """Waits for the next frame: to let it pass, or to be joined with it."""

    data: bytes
    until_us: int
    merge: bool


_KINDS: Final = ("lost", "doubled", "damaged", "delayed", "reordered", "split", "merged")


class _Mangler:
    """One direction."""

    def __init__(self, faults: Faults, rng: random.Random) -> None:
        self.faults = faults
        self.pending: list[_Piece] = []
        self.counts = dict.fromkeys(_KINDS, 0)
        self._rng = rng
        self._number = 0
        self._frames = 0
        self._partial = b""
        self._held: _Held | None = None
        # The rest of a frame that was split, and what comes after it, is not there before.
        self._not_before_us = 0

    def put(self, data: bytes, now_us: int) -> None:
        *frames, self._partial = (self._partial + data).split(b"\0")
        for frame in frames:
            self._frames += 1
            self._put_frame(frame + b"\0", now_us)
        self._hurry(now_us)

    def _put_frame(self, frame: bytes, now_us: int) -> None:
        faults, rng = self.faults, self._rng
        if self._happens(faults.lose, "lost"):
            return
        for _ in range(1 + self._happens(faults.double, "doubled")):
            data = frame
            if self._happens(faults.damage, "damaged"):
                data = self._damage(data)
            if self._happens(faults.delay, "delayed"):
                self._push(data, now_us + rng.randint(1, faults.delay_max_us))
            elif self._held is not None:
                held, self._held = self._held, None
                self._send(held.data + data if held.merge else data + held.data, now_us)
            elif self._happens(faults.reorder, "reordered"):
                self._held = _Held(data, now_us + faults.delay_max_us, merge=False)
            elif self._happens(faults.merge, "merged"):
                kept = data[: len(data) - rng.randrange(2)]
                self._held = _Held(kept, now_us + faults.delay_max_us, merge=True)
            else:
                self._send(data, now_us)

    def _happens(self, rate: float, kind: str) -> bool:
        if self._rng.random() >= rate:
            return False
        self.counts[kind] += 1
        return True

    def _send(self, data: bytes, now_us: int) -> None:
        """In order, whole or in two pieces."""
        at_us = max(now_us, self._not_before_us)
        if len(data) > 1 and self._happens(self.faults.split, "split"):
            cut = self._rng.randrange(1, len(data))
            self._push(data[:cut], at_us)
            data = data[cut:]
            at_us += self._rng.randint(1, _SPLIT_PAUSE_MAX_US)
            self._not_before_us = at_us
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
        heapq.heappush(self.pending, _Piece(at_us, self._number, self._frames, data))

    def _hurry(self, now_us: int) -> None:
        """Nothing waits for more frames than allowed."""
        newest = self._frames - self.faults.delay_max_frames
        if any(piece.frame < newest for piece in self.pending):
            for piece in self.pending:
                if piece.frame < newest:
                    piece.at_us = min(piece.at_us, now_us)
            heapq.heapify(self.pending)

    def next_us(self) -> int | None:
        times = [self.pending[0].at_us] if self.pending else []
        if self._held is not None:
            times.append(self._held.until_us)
        return min(times, default=None)

    def due(self, now_us: int) -> bytes:
        if self._held is not None and self._held.until_us <= now_us:
            held, self._held = self._held, None
            self._send(held.data, now_us)
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
        """How many frames of each kind of harm so far, both ways."""
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
