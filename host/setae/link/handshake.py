"""How a session opens, and how the host notices that it is over.

Ask which board this is, open a session of a new number, read what was latched
before, go. Later, where the board is silent or speaks in another session's name,
ask again.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from setae.errors import BoardResetError, LinkLostError, ProtocolMismatchError
from setae.link.outbox import Outbox
from setae.link.timing import Timing
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    BoardHeader,
    Hello,
    HelloReply,
    Recall,
    Record,
    ResetCause,
)

__all__ = ["Handshake", "Phase"]

_HELLO_REPEAT_US: Final = 200_000
_SETTLE_REPEAT_US: Final = 50_000
# Telemetry comes every 20 ms. Without it, ask whether the board is still in the session.
_SILENCE_US: Final = 150_000
# Longer than a bootloader takes: a board that was reset then says so itself.
_LOST_US: Final = 4_000_000


class Phase(Enum):
    """Where the handshake stands."""

    CLOSED = "closed"
    ASKING = "asking"  # for version and running session
    OPENING = "opening"  # our session
    SETTLING = "settling"  # reading what was latched before
    OPEN = "open"
    FAILED = "failed"


class Handshake:
    """Asks until it has what it needs.

    Attributes
    ----------
    phase
        Where it stands.
    reply
        What the board said when it opened our session.
    """

    def __init__(self, outbox: Outbox, timing: Timing) -> None:
        self.phase = Phase.CLOSED
        self.reply: HelloReply | None = None
        self._outbox = outbox
        self._timing = timing
        self._wanted_session = 0
        self._hello_token: int | None = None
        self._settle_tokens: set[int] = set()
        self._settle_answered = False
        self._repeat_at_us = 0
        self._probe_at_us = 0

    @property
    def in_session(self) -> bool:
        """Whether the board is in our session, as far as we know."""
        return self.phase in (Phase.SETTLING, Phase.OPEN)

    @property
    def settled(self) -> bool:
        """Whether all that was asked is answered, so that commands may go out."""
        return self.phase is Phase.SETTLING and self._settle_answered

    def next_deadline_us(self, heard_at_us: int) -> int | None:
        """When `poll` has something to do, or None."""
        if self.in_session:
            silent_us = max(heard_at_us + _SILENCE_US, self._probe_at_us)
            due_us = min(silent_us, heard_at_us + _LOST_US)
            return due_us if self.phase is Phase.OPEN else min(due_us, self._repeat_at_us)
        return self._repeat_at_us if self.phase in (Phase.ASKING, Phase.OPENING) else None

    def open(self, session: int, now_us: int) -> None:
        """Start."""
        if self.phase is not Phase.CLOSED:
            raise ValueError("an engine opens one session only")
        if not 1 <= session <= 255:
            raise ValueError(f"session must be 1 to 255, not {session}")
        self._wanted_session = session
        self._outbox.start(session)
        self.phase = Phase.ASKING
        self._say_hello(0, now_us)

    def poll(self, now_us: int, *, heard_at_us: int) -> None:
        """Ask again what was not answered.

        Raises
        ------
        LinkLostError
            The board has been silent for too long.
        """
        if self.phase in (Phase.ASKING, Phase.OPENING) and now_us >= self._repeat_at_us:
            asking = self.phase is Phase.ASKING
            self._say_hello(0 if asking else self._outbox.session, now_us)
        elif self.phase is Phase.SETTLING and now_us >= self._repeat_at_us:
            self._settle(now_us)
        if not self.in_session:
            return
        silent_us = now_us - heard_at_us
        if silent_us >= _LOST_US:
            raise LinkLostError(f"The board has been silent for {_LOST_US / 1e6:.0f} s.")
        if silent_us >= _SILENCE_US:
            self.probe(now_us)

    def probe(self, now_us: int) -> None:
        """Ask, now and then, which session the board is in. A reset board says 0."""
        if now_us < self._probe_at_us:
            return
        self._say_hello(0, now_us)
        self._probe_at_us = now_us + _SILENCE_US

    def on_hello(self, header: BoardHeader, reply: HelloReply, now_us: int) -> bool:
        """Take an answer that does not say that our session lives.

        Returns
        -------
        Whether it opened our session.

        Raises
        ------
        ProtocolMismatchError
            The board speaks another version.
        BoardResetError
            Our session is over.
        """
        if reply.token != self._hello_token:
            return False
        if (reply.protocol_version, reply.schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH):
            raise _mismatch(reply)
        if self.phase is Phase.ASKING:
            session = self._wanted_session
            if session == header.session:
                session = session % 255 + 1
            self._outbox.session = session
            self.phase = Phase.OPENING
            self._hello_token = None
            self._say_hello(session, now_us)
        elif self.phase is Phase.OPENING and header.session == self._outbox.session:
            self.reply = reply
            self.phase = Phase.SETTLING
            self._hello_token = None
            self._settle(now_us)
            return True
        elif self.in_session:
            raise _session_over(header, reply)
        return False

    def on_pong(self, token: int) -> None:
        """Take a pong: the board has got what was asked before it, whichever repeat that was."""
        if token in self._settle_tokens:
            self._settle_answered = True

    def finish(self) -> None:
        """From here on commands go out."""
        self.phase = Phase.OPEN

    def fail(self) -> None:
        """The session is over."""
        self.phase = Phase.FAILED

    def _say_hello(self, new_session: int, now_us: int) -> None:
        # One token for all repeats: a late answer to an earlier repeat is as good.
        if self._hello_token is None:
            self._hello_token = self._outbox.new_token()
        self._outbox.put(
            Hello(
                protocol_version=PROTOCOL_VERSION,
                schema_hash=SCHEMA_HASH,
                new_session=new_session,
                token=self._hello_token,
            )
        )
        if not self.in_session:
            self._repeat_at_us = now_us + _HELLO_REPEAT_US

    def _settle(self, now_us: int) -> None:
        """Ask for what was latched before, so that it isn't taken for this session's."""
        for record in Record:
            self._outbox.put(Recall(record=record))
        self._settle_tokens.add(self._timing.ping(now_us))
        self._repeat_at_us = now_us + _SETTLE_REPEAT_US


def _mismatch(reply: HelloReply) -> ProtocolMismatchError:
    firmware = f"{reply.firmware_major}.{reply.firmware_minor}.{reply.firmware_patch}"
    return ProtocolMismatchError(
        f"The board's firmware {firmware} speaks protocol {reply.protocol_version}"
        f" (schema {reply.schema_hash:08x}); this host speaks protocol"
        f" {PROTOCOL_VERSION} (schema {SCHEMA_HASH:08x})."
    )


def _session_over(header: BoardHeader, reply: HelloReply) -> BoardResetError:
    if header.session != 0:
        return BoardResetError(
            f"Another host opened session {header.session} on this board.",
            "Close the other program, then connect again.",
        )
    known = reply.reset_cause in ResetCause._value2member_map_
    cause = ResetCause(reply.reset_cause).doc if known else ""
    return BoardResetError(f"The board started anew in the middle of the session. {cause}")
