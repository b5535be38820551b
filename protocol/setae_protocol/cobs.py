"""Consistent Overhead Byte Stuffing: takes every zero out of a frame.

Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999.
"""

from __future__ import annotations


def cobs_encode(data: bytes) -> bytes:
    """Return `data` without zeros, one byte longer for each 254 begun.

    >>> cobs_encode(bytes([0x11, 0x22, 0x00, 0x33])).hex(" ")
    '03 11 22 02 33'
    """
    out = bytearray()
    runs = data.split(b"\0")
    for index, run in enumerate(runs):
        start = 0
        while len(run) - start >= 254:
            out.append(255)
            out += run[start : start + 254]
            start += 254
        # A full block implies no zero, so nothing follows one at the very end.
        if start and start == len(run) and index == len(runs) - 1:
            break
        out.append(len(run) - start + 1)
        out += run[start:]
    return bytes(out)


def cobs_decode(data: bytes) -> bytes | None:
    """Return what `data` encodes, or None where no data encodes to it.

    >>> cobs_decode(bytes([0x03, 0x11, 0x22, 0x02, 0x33])).hex(" ")
    '11 22 00 33'
    >>> cobs_decode(bytes([0x05, 0x11])) is None
    True
    """
    size = len(data)
    out = bytearray()
    index = 0
    while index < size:
        code = data[index]
        end = index + code
        if code == 0 or end > size:
            return None
        out += data[index + 1 : end]
        index = end
        if code != 255 and index < size:
            out.append(0)
    if 0 in data:
        return None
    return bytes(out)
