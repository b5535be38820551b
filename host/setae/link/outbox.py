"""Frames that wait to be put on the line, and the session that they carry."""

from __future__ import annotations

from setae.link.counts import Statistics
from setae_protocol.frame import encode_host
from setae_protocol.messages import HostMessage

__all__ = ["Outbox"]


class Outbox:
    """Encodes messages and keeps them until somebody takes the bytes.

    Attributes
    ----------
    session
        The number that every frame carries; 0 before there is a session.
    """

    def __init__(self, statistics: Statistics) -> None:
        self.session = 0
        self._statistics = statistics
        self._frames: list[bytes] = []
        self._token = 0

    def start(self, session: int) -> None:
        """Draw tokens that an earlier session did not use; end what the board half received."""
        self._token = session << 16
        self._frames.append(b"\0")

    def put(self, message: HostMessage, *, sequence: int = 0) -> None:
        """Send a message after those that wait."""
        self._frames.append(encode_host(message, session=self.session, sequence=sequence))
        self._statistics.frames_sent += 1

    def put_first(self, message: HostMessage) -> None:
        """Send a message ahead of all that wait."""
        self._frames.insert(0, encode_host(message, session=self.session))
        self._statistics.frames_sent += 1

    def new_token(self) -> int:
        """Return a number by which an answer finds its question."""
        self._token = (self._token + 1) & 0xFFFFFFFF
        return self._token

    def take(self) -> bytes:
        """Return all that waits, and forget it."""
        data = b"".join(self._frames)
        self._frames.clear()
        return data

    def clear(self) -> None:
        """Forget all that waits."""
        self._frames.clear()
