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
    if 0 in data:
        return None
    size = len(data)
    # Each code tells where the next one is, and but for the first it stands where a zero was;
    # one behind a full block stands for nothing.
    out = bytearray(data)
    full = []
    index = 0
    while index < size:
        code = data[index]
        out[index] = 0
        index += code
        if code == 255 and index < size:
            full.append(index)
    if index > size:
        return None
    for place in reversed(full):
        del out[place]
    return bytes(out[1:])
