"""What the link asks of whatever carries its bytes."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Transport"]


class Transport(Protocol):
    """A byte stream to a board, with a clock of its own.

    Attributes
    ----------
    name
        How a user would name it, such as ``/dev/ttyACM0`` or ``sim://``.
    simulated
        Its time is virtual: it passes only inside `receive`.
    """

    @property
    def name(self) -> str:
        """How a user would name it."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether time is virtual."""
        ...

    def now_us(self) -> int:
        """Return the transport's time. It never goes back."""
        ...

    def send(self, data: bytes) -> None:
        """Put bytes on the line.

        Raises
        ------
        LinkLostError
            The line is gone.
        """
        ...

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Wait for bytes until the deadline.

        Returns
        -------
        The bytes and when they came, or None at the deadline.

        Raises
        ------
        LinkLostError
            The line is gone.
        """
        ...

    def close(self) -> None:
        """Let go of the line. Closing twice is fine."""
        ...
