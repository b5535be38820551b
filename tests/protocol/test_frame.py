"""Frames through noise: what is whole arrives, what is damaged never does."""

from __future__ import annotations

import dataclasses
import itertools
import typing
from enum import IntEnum
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from setae_protocol.frame import (
    BoardDecoder,
    BoardFrame,
    Damage,
    HostDecoder,
    HostFrame,
    cobs_decode,
    cobs_encode,
    encode,
    encode_board,
    encode_host,
)
from setae_protocol.messages import (
    BOARD_MESSAGES,
    FRAME_WIRE_BYTES_MAX,
    HOST_MESSAGES,
    Acknowledge,
    Enable,
    Fault,
    Ping,
    Pong,
    Record,
    Refusal,
)

u8 = st.integers(0, 255)


def values(kind: Any, bounds: tuple[int, int]) -> st.SearchStrategy[Any]:
    if typing.get_origin(kind) is tuple:
        return st.tuples(*(values(item, bounds) for item in typing.get_args(kind)))
    if dataclasses.is_dataclass(kind):
        return messages(typing.cast(type, kind))
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return st.sampled_from(kind)
    return st.integers(*bounds)


def messages(kind: type) -> st.SearchStrategy[Any]:
    """Any values that fit every width: each field's range is found by trying."""
    hints = typing.get_type_hints(kind)
    parts = {}
    for field in dataclasses.fields(kind):
        signed = "pressure" in field.name or "baseline" in field.name or field.name == "value"
        signed = signed or field.name == "limit" or field.name.startswith("pair_")
        parts[field.name] = values(hints[field.name], (-128, 127) if signed else (0, 255))
    return st.builds(kind, **parts)


host_messages = st.one_of([messages(kind) for kind in HOST_MESSAGES.values()])
board_messages = st.one_of([messages(kind) for kind in BOARD_MESSAGES.values()])
host_frames = st.builds(
    lambda message, session, sequence: encode_host(message, session=session, sequence=sequence),
    host_messages, u8, u8,
)  # fmt: skip


def cut(data: bytes, places: list[int]) -> list[bytes]:
    edges = sorted({0, len(data), *(place % (len(data) + 1) for place in places)})
    return [data[a:b] for a, b in itertools.pairwise(edges)]


@given(message=host_messages, session=u8, sequence=u8)
def test_host_message_comes_back(message: Any, session: int, sequence: int) -> None:
    [frame] = HostDecoder().feed(encode_host(message, session=session, sequence=sequence))
    assert frame.message == message
    assert (frame.header.session, frame.header.sequence) == (session, sequence)


@given(message=board_messages, numbers=st.tuples(u8, u8, u8, u8, u8), state=st.integers(0, 5))
def test_board_message_comes_back(message: Any, numbers: tuple[int, ...], state: int) -> None:
    session, sequence, expected, credit, epoch = numbers
    wire = encode_board(
        message, session=session, sequence=sequence, expected=expected, credit=credit,
        epoch=epoch, state=state,
    )  # fmt: skip
    [frame] = BoardDecoder().feed(wire)
    assert frame.message == message
    header = frame.header
    assert (header.session, header.sequence, header.expected, header.credit) == numbers[:4]
    assert (header.epoch, header.state) == (epoch, state)


@given(data=st.binary(max_size=600))
def test_cobs_takes_out_every_zero_and_comes_back(data: bytes) -> None:
    encoded = cobs_encode(data)
    assert 0 not in encoded
    assert cobs_decode(encoded) == data
    assert len(encoded) <= len(data) + 1 + len(data) // 254


def by_the_book(data: bytes) -> bytes | None:
    """Decode COBS block by block, as its inventors tell it."""
    out = b""
    while data:
        code, block, data = data[0], data[1 : data[0]], data[data[0] :]
        if code == 0 or len(block) < code - 1 or 0 in block:
            return None
        out += block
        if code < 255 and data:
            out += b"\0"
    return out


@given(data=st.binary(max_size=600), places=st.lists(st.tuples(st.integers(0, 599), u8)))
def test_cobs_takes_and_refuses_what_the_book_does(
    data: bytes, places: list[tuple[int, int]]
) -> None:
    damaged = bytearray(cobs_encode(data))
    for place, value in places:
        damaged[place % len(damaged)] = value
    assert cobs_decode(bytes(damaged)) == by_the_book(bytes(damaged))
    assert cobs_decode(data) == by_the_book(data)


@given(frames=st.lists(host_frames, max_size=8), places=st.lists(st.integers(0, 10**4)))
def test_any_split_gives_the_same_frames(frames: list[bytes], places: list[int]) -> None:
    data = b"".join(frames)
    whole, pieces = HostDecoder(), HostDecoder()
    expected = whole.feed(data)
    assert len(expected) == len(frames)
    assert [f for piece in cut(data, places) for f in pieces.feed(piece)] == expected
    assert pieces.damage == whole.damage


@given(
    noise=st.binary(max_size=200),
    wire=host_frames,
    places=st.lists(st.integers(0, 10**4), max_size=5),
)
def test_after_any_noise_and_a_delimiter_the_next_frame_arrives(
    noise: bytes, wire: bytes, places: list[int]
) -> None:
    decoder = HostDecoder()
    frames = [f for piece in cut(noise + b"\0" + wire, places) for f in decoder.feed(piece)]
    assert frames[-1:] == HostDecoder().feed(wire)


@settings(max_examples=300)
@given(
    wire=host_frames,
    flips=st.lists(st.tuples(st.integers(0, 10**4), st.integers(1, 255)), min_size=1, max_size=4),
)
def test_damage_is_never_taken_for_a_message(wire: bytes, flips: list[tuple[int, int]]) -> None:
    """Whatever comes out of a damaged frame is what went in, or nothing."""
    damaged = bytearray(wire)
    for place, mask in flips:
        damaged[place % len(wire)] ^= mask
    decoder = HostDecoder()
    frames = decoder.feed(bytes(damaged) + b"\0")
    if bytes(damaged) != wire:
        assert frames == []
        assert sum(decoder.damage.values()) >= 1


@given(stream=st.binary(max_size=2_000))
def test_random_bytes_are_not_messages(stream: bytes) -> None:
    assert HostDecoder().feed(stream) == []
    assert BoardDecoder().feed(stream) == []


def test_every_single_and_double_bit_error_inside_is_found() -> None:
    """CRC-32C has a Hamming distance of 6 at this length: all pairs of bits, tried."""
    wire = encode_host(Enable(pulse_ticks=(1700, 1800, 1900, 2000)), session=3, sequence=9)
    inside = cobs_decode(wire[:-1])
    assert inside is not None
    for first in range(8 * len(inside)):
        for second in range(first, 8 * len(inside)):
            bad = bytearray(inside)
            bad[first // 8] ^= 1 << first % 8
            if second != first:
                bad[second // 8] ^= 1 << second % 8
            decoder = HostDecoder()
            assert decoder.feed(cobs_encode(bytes(bad)) + b"\0") == []


def test_endless_garbage_takes_no_memory() -> None:
    decoder = HostDecoder()
    for _ in range(1_000):
        decoder.feed(b"\x01" * 100)
    assert len(decoder._partial) <= FRAME_WIRE_BYTES_MAX
    frames = decoder.feed(b"\0" + encode_host(Ping(token=1), session=0))
    assert [frame.message for frame in frames] == [Ping(token=1)]
    assert decoder.damage[Damage.OVER_LONG] == 1


def test_code_of_another_version_is_damage() -> None:
    """A record that this version can't name must not pass for one that it can."""
    good = encode_host(Acknowledge(record=Record.FAULT, record_id=1), session=1)
    inside = cobs_decode(good[:-1])
    assert inside is not None
    body = bytearray(inside[:-4])
    body[3] = 77
    decoder = HostDecoder()
    assert decoder.feed(encode(bytes(body))) == []
    assert decoder.damage[Damage.BAD_VALUE] == 1


def test_frames_of_the_other_side_are_damage() -> None:
    pong = encode_board(Pong(token=1, frame=2, phase_us=3), session=1)
    ping = encode_host(Ping(token=1), session=1)
    host: list[HostFrame] = HostDecoder().feed(pong)
    board: list[BoardFrame] = BoardDecoder().feed(ping)
    assert (host, board) == ([], [])


@pytest.mark.parametrize("ticks", [(1, 2, 3), (1, 2, 3, 65536), (-1, 0, 0, 0), (0.5, 0, 0, 0)])
def test_value_out_of_range_is_refused_by_name(ticks: Any) -> None:
    with pytest.raises(ValueError, match="Enable"):
        Enable(pulse_ticks=ticks).pack()


@pytest.mark.parametrize("codes", [Fault, Refusal])
def test_every_fault_and_refusal_says_what_to_do(codes: Any) -> None:
    for code in codes:
        assert code.doc.endswith(".")
        assert code.remedy.endswith(".")


@pytest.mark.parametrize("refusal", Refusal)
def test_what_a_program_has_to_call_a_terminal_is_told_too(refusal: Refusal) -> None:
    """The commands passed on "call resume()", and there is no command of that name."""
    if "resume()" in refusal.remedy or "enable()" in refusal.remedy:
        assert "`setae enable`" in refusal.remedy
