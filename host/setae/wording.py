"""How many there are, in words."""

from __future__ import annotations

__all__ = ["counted"]


def counted(count: int, noun: str) -> str:
    """A number and what it counts, in the plural unless it is 1.

    Parameters
    ----------
    count
        How many.
    noun
        In the singular, of the kind that an s makes plural; what follows it comes after.

    Examples
    --------
    >>> counted(1, "contact"), counted(0, "contact")
    ('1 contact', '0 contacts')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
