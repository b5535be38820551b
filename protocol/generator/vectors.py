"""The test vectors that both languages share."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from typing import Any

from generator.layout import (
    BOARD_HEADER,
    HOST_HEADER,
    MESSAGES,
    SCHEMA_HASH,
    Field,
    MessageType,
    Nested,
    Scalar,
    camel,
    header_of,
    size_of,
    value_of,
)
from generator.text import PREAMBLE, cpp_comment, wrap
from setae_protocol import schema
from setae_protocol.cobs import cobs_encode
from setae_protocol.crc import crc32c


def example(fields: tuple[Field, ...], pick: Callable[[Field, Scalar], int]) -> dict[str, Any]:
    """Values for a struct, each scalar chosen by `pick`."""

    def build(field: Field, shape: tuple[int, ...]) -> Any:
        if shape:
            return [build(field, shape[1:]) for _ in range(shape[0])]
        if isinstance(field.kind, Nested):
            return example(field.kind.fields, pick)
        return pick(field, field.kind)

    return {field.name: build(field, field.shape) for field in fields}


def frame_examples() -> Iterator[tuple[str, MessageType, dict[str, Any], dict[str, Any]]]:
    """Each message at its lowest, at its highest and at two pseudo-random values."""
    counts = {codes.name: len(codes.values) for codes in schema.CODES}
    for message in MESSAGES:
        for label in ("lowest", "highest", "random_1", "random_2"):
            rng = random.Random(f"{message.source.name} {label}")

            def pick(
                field: Field, kind: Scalar, rng: random.Random = rng, label: str = label
            ) -> int:
                top = counts[field.codes] - 1 if field.codes else kind.maximum
                if label == "lowest":
                    return kind.minimum
                return top if label == "highest" else rng.randint(kind.minimum, top)

            header = example(header_of(message), pick)
            header["type"] = message.source.number
            if "state" in header:
                header["state"] %= counts["State"]
            yield (
                f"{message.source.name}_{label}",
                message,
                header,
                example(message.fields, pick),
            )


def stuffed(inside: bytes) -> bytes:
    """Return bytes as they go on the wire."""
    return cobs_encode(inside) + b"\0"


def with_crc(inside: bytes) -> bytes:
    """Return bytes with their CRC appended."""
    return inside + crc32c(inside).to_bytes(4, "little")


def frame_vectors() -> list[dict[str, Any]]:
    """Return every example frame with its fields and bytes."""
    vectors = []
    for name, message, header, values in frame_examples():
        header_struct = schema.HOST_HEADER if message.from_host else schema.BOARD_HEADER
        head: bytes = header_struct.build(header)
        payload: bytes = message.source.payload.build(values)
        vectors.append(
            {
                "name": name,
                "message": message.source.name,
                "from": "host" if message.from_host else "board",
                "header": header,
                "fields": values,
                "header_hex": head.hex(),
                "payload_hex": payload.hex(),
                "wire_hex": stuffed(with_crc(head + payload)).hex(),
            }
        )
    return vectors


DAMAGES = {
    "bad_cobs": "The COBS code bytes don't add up.",
    "short": "Too short for a header and a CRC.",
    "bad_crc": "The CRC is wrong.",
    "unknown_type": "The CRC is right, but no message from this side has this type.",
    "wrong_length": "The CRC and the type are right, but the length is another type's.",
    "over_long": "More bytes than a frame may have before the delimiter.",
}


def damaged_vectors() -> list[dict[str, Any]]:
    """Broken frames, each with the one cause that a receiver must count."""
    vectors = []

    def add(side: str, name: str, wire: bytes, verdict: str) -> None:
        vectors.append({"name": f"{side}_{name}", "from": side, "wire_hex": wire.hex(),
                        "verdict": verdict})  # fmt: skip

    for side, header_size in (("host", size_of(HOST_HEADER)), ("board", size_of(BOARD_HEADER))):
        base = next(m for m in MESSAGES if m.source.name == ("ping" if side == "host" else "pong"))
        other = "pong" if side == "host" else "ping"
        header = bytes([base.source.number, *range(1, header_size)])
        payload = bytes(range(0x11, 0x11 + base.size))
        good = with_crc(header + payload)
        limit = value_of("FRAME_WIRE_BYTES_MAX")
        add(side, "code_past_end", b"\x05\x01\x02\0", "bad_cobs")
        add(side, "cut_before_delimiter", stuffed(good)[:-3] + b"\0", "bad_cobs")
        add(side, "one_byte", b"\x02\x01\0", "short")
        add(side, "lone_code", b"\x01\0", "short")
        add(side, "header_only", stuffed(header), "short")
        add(side, "crc_short_by_one", stuffed(with_crc(header[:-1])), "short")
        for bit in (0, 7, 8 * header_size, 8 * (len(good) - 1) + 7):
            flipped = bytearray(good)
            flipped[bit // 8] ^= 1 << bit % 8
            add(side, f"bit_{bit}_flipped", stuffed(bytes(flipped)), "bad_crc")
        add(side, "crc_big_endian", stuffed(good[:-4] + good[:-5:-1]), "bad_crc")
        add(side, "payload_without_crc", stuffed(header + payload), "bad_crc")
        no_xor = (crc32c(header + payload) ^ 0xFFFFFFFF).to_bytes(4, "little")
        add(side, "crc_without_final_xor", stuffed(header + payload + no_xor), "bad_crc")
        for number in (0x00, 0x7F, 0xFF):
            head = bytes([number]) + header[1:]
            add(side, f"type_{number:02x}", stuffed(with_crc(head + payload)), "unknown_type")
        reply = next(m for m in MESSAGES if m.source.name == other)
        head = bytes([reply.source.number]) + header[1:]
        add(side, "other_side_type", stuffed(with_crc(head + bytes(reply.size))), "unknown_type")
        add(side, "one_byte_less", stuffed(with_crc(header + payload[:-1])), "wrong_length")
        add(side, "one_byte_more", stuffed(with_crc(header + payload + b"\x01")), "wrong_length")
        add(side, "no_payload", stuffed(with_crc(header)), "wrong_length")
        add(side, "one_byte_over", b"\x01" * limit + b"\0", "over_long")
        add(side, "far_over", b"\x01" * 300 + b"\0", "over_long")
        longest = stuffed(with_crc(header + bytes(limit - 2 - 4 - header_size)))
        assert len(longest) == limit
        add(side, "longest_allowed_of_wrong_length", longest, "wrong_length")
    return vectors


def coding_vectors() -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return bytes with their COBS encoding, and with their CRC."""
    rng = random.Random("coding")
    blobs = [
        b"", b"\0", b"\0\0", b"\x11\x22\0\x33", b"\x11\x22\x33\x44", b"\x11\0\0\0", b"\xff",
        b"123456789", bytes(32), b"\xff" * 32, bytes(range(32)), bytes(range(31, -1, -1)),
        bytes(range(1, 60)), rng.randbytes(58),
    ]  # fmt: skip
    cobs = [{"data_hex": blob.hex(), "encoded_hex": cobs_encode(blob).hex()} for blob in blobs]
    crc = [{"data_hex": blob.hex(), "crc32c": f"{crc32c(blob):08x}"} for blob in blobs]
    return cobs, crc


def vectors_json() -> str:
    """Return the vectors for Python and for other readers."""
    cobs, crc = coding_vectors()
    data = {
        "note": PREAMBLE,
        "schema_hash": f"{SCHEMA_HASH:08x}",
        "damages": DAMAGES,
        "cobs": cobs,
        "crc": crc,
        "frames": frame_vectors(),
        "damaged": damaged_vectors(),
    }
    return json.dumps(data, indent=1) + "\n"


def cpp_bytes(name: str, data: bytes) -> list[str]:
    """Return bytes as a C++ array."""
    # C++ has no empty arrays; the size beside the pointer tells.
    items = [f"0x{byte:02x}" for byte in data] or ["0"]
    return [f"const uint8_t {name}[] = {{", *wrap(", ".join(items), "    "), "};"]


def cpp_checks(value: Any, path: str) -> Iterator[str]:
    """Yield comparisons of every field below `path` with its value."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from cpp_checks(item, f"{path}.{key}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from cpp_checks(item, f"{path}[{index}]")
    else:
        # The lowest int32 has no literal of its own in C++.
        literal = "INT32_MIN" if value == -(1 << 31) else str(value)
        yield f"{path} == {literal}" + ("u" if isinstance(value, int) and value > 32767 else "")


def vectors_header() -> str:
    """Return the vectors for C++."""
    classes = {message.source.name: message.name for message in MESSAGES}
    cobs, crc = coding_vectors()
    lines = [
        f"// {PREAMBLE}",
        "#pragma once",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        '#include "protocol/messages.h"',
        "",
        "namespace setae {",
        "namespace vectors {",
        "",
        "struct Frame {",
        "  const char* name;",
        "  bool from_host;",
        "  protocol::MessageType type;",
        "  const uint8_t* header;",
        "  uint8_t header_size;",
        "  const uint8_t* payload;",
        "  uint8_t payload_size;",
        "  const uint8_t* wire;",
        "  uint8_t wire_size;",
        "  // Decodes header and payload, and compares every field with its value.",
        "  bool (*fields_match)(const uint8_t* header, const uint8_t* payload);",
        "  // Decodes the payload and encodes it again.",
        "  void (*reencode)(const uint8_t* in, uint8_t* out);",
        "};",
        "",
        "enum class Damage : uint8_t {",
    ]
    for name, doc in DAMAGES.items():
        lines += [*cpp_comment(doc, "  "), f"  k{camel(name)},"]
    lines += [
        "};",
        "",
        "struct Damaged {",
        "  const char* name;",
        "  bool from_host;",
        "  Damage verdict;",
        "  const uint8_t* wire;",
        "  size_t wire_size;",
        "};",
        "",
        "struct Coding {",
        "  const uint8_t* data;",
        "  uint8_t size;",
        "  const uint8_t* encoded;",
        "  uint8_t encoded_size;",
        "  uint32_t crc32c;",
        "};",
        "",
        "namespace detail {",
        "template <typename Message>",
        "void reencode(const uint8_t* in, uint8_t* out) {",
        "  Message message{};",
        "  decode(in, message);",
        "  encode(message, out);",
        "}",
        "",
    ]
    table = []
    for index, vector in enumerate(frame_vectors()):
        host = vector["from"] == "host"
        name = f"frame_{index}"
        lines.append(f"// {vector['name']}")
        for part in ("header", "payload", "wire"):
            lines += cpp_bytes(f"{name}_{part}", bytes.fromhex(vector[f"{part}_hex"]))
        checks = [
            *cpp_checks(vector["header"], "head"),
            *cpp_checks(vector["fields"], "message"),
        ]
        kind = classes[vector["message"]]
        lines += [
            f"inline bool {name}_fields_match(const uint8_t* header, const uint8_t* payload) {{",
            f"  protocol::{'HostHeader' if host else 'BoardHeader'} head{{}};",
            f"  protocol::{kind} message{{}};",
            "  decode(header, head);",
            "  decode(payload, message);",
            *wrap("return " + " && ".join(checks) + ";", "  "),
            "}",
        ]
        table.append(
            f'{{"{vector["name"]}", {str(host).lower()},'
            f" protocol::MessageType::k{camel(vector['message'])},"
            f" detail::{name}_header, sizeof(detail::{name}_header), detail::{name}_payload,"
            f" sizeof(detail::{name}_payload), detail::{name}_wire, sizeof(detail::{name}_wire),"
            f" detail::{name}_fields_match, detail::reencode<protocol::{kind}>}},"
        )
    damaged = []
    for index, vector in enumerate(damaged_vectors()):
        lines += cpp_bytes(f"damaged_{index}", bytes.fromhex(vector["wire_hex"]))
        damaged.append(
            f'{{"{vector["name"]}", {str(vector["from"] == "host").lower()},'
            f" Damage::k{camel(vector['verdict'])}, detail::damaged_{index},"
            f" sizeof(detail::damaged_{index})}},"
        )
    coding = []
    for index, (cobs_item, crc_item) in enumerate(zip(cobs, crc, strict=True)):
        data = bytes.fromhex(cobs_item["data_hex"])
        encoded = bytes.fromhex(cobs_item["encoded_hex"])
        lines += cpp_bytes(f"coding_{index}", data)
        lines += cpp_bytes(f"coding_{index}_encoded", encoded)
        coding.append(
            f"{{detail::coding_{index}, {len(data)}, detail::coding_{index}_encoded,"
            f" {len(encoded)}, 0x{crc_item['crc32c']}u}},"
        )
    lines += ["}  // namespace detail", ""]
    for title, name, rows in (
        ("Frame", "kFrames", table),
        ("Damaged", "kDamaged", damaged),
        ("Coding", "kCodings", coding),
    ):
        lines.append(f"const {title} {name}[] = {{")
        for row in rows:
            first, *rest = wrap(row, "        ")
            lines += ["    " + first.lstrip(), *rest]
        lines += ["};", ""]
    lines += ["}  // namespace vectors", "}  // namespace setae"]
    return "\n".join(lines) + "\n"
