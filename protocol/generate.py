"""Write everything that follows from `setae_protocol/schema.py` and the default robot.

    python protocol/generate.py            write the generated files
    python protocol/generate.py --check    fail where one of them differs

The generated files are committed, so that flashing a board needs no Python.
"""

from __future__ import annotations

import argparse
import difflib
import json
import random
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from construct import Array, Construct, FormatField, Renamed, Struct

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "protocol"))

from setae_protocol import schema  # noqa: E402  (the script runs without an installed package)
from setae_protocol.cobs import cobs_encode  # noqa: E402
from setae_protocol.crc import crc32c  # noqa: E402

CRC_BYTES = 4
# One COBS code byte (frames stay below 254 bytes) and the delimiter.
STUFFING_BYTES = 2

# ------------------------------------------------------------- the schema, as plain data


@dataclass(frozen=True, slots=True)
class Scalar:
    """An integer on the wire."""

    bits: int
    signed: bool

    @property
    def minimum(self) -> int:
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def maximum(self) -> int:
        return (1 << (self.bits - 1)) - 1 if self.signed else (1 << self.bits) - 1

    @property
    def text(self) -> str:
        return f"{'i' if self.signed else 'u'}{self.bits}"

    @property
    def cpp(self) -> str:
        return f"{'' if self.signed else 'u'}int{self.bits}_t"


@dataclass(frozen=True, slots=True)
class Nested:
    """A struct inside a message."""

    name: str
    fields: tuple[Field, ...]


@dataclass(frozen=True, slots=True)
class Field:
    """One field: its scalar or nested struct, and the array shape around it."""

    name: str
    doc: str
    shape: tuple[int, ...]
    kind: Scalar | Nested
    codes: str | None = None

    @property
    def size(self) -> int:
        unit = self.kind.bits // 8 if isinstance(self.kind, Scalar) else size_of(self.kind.fields)
        for count in self.shape:
            unit *= count
        return unit

    @property
    def text(self) -> str:
        base = self.kind.text if isinstance(self.kind, Scalar) else self.kind.name
        return base + "".join(f"[{count}]" for count in self.shape)


@dataclass(frozen=True, slots=True)
class MessageType:
    """A message of the schema with its layout resolved."""

    source: schema.Message
    name: str
    from_host: bool
    fields: tuple[Field, ...]
    base: str | None

    @property
    def size(self) -> int:
        return size_of(self.fields)


def size_of(fields: tuple[Field, ...]) -> int:
    return sum(field.size for field in fields)


def camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


_NESTED_NAMES = {id(schema.SEGMENT): "Segment", id(schema.SAMPLE): "Sample"}
_SCALARS = {
    "<B": Scalar(8, False), ">B": Scalar(8, False), "<H": Scalar(16, False),
    "<h": Scalar(16, True), "<L": Scalar(32, False), "<l": Scalar(32, True),
}  # fmt: skip


def read_fields(struct: Construct, codes: dict[str, str]) -> tuple[Field, ...]:
    """Resolve a construct Struct; anything but integers, arrays and structs is refused."""
    fields = []
    for part in struct.subcons:
        assert isinstance(part, Renamed)
        doc = part.docs
        shape: list[int] = []
        inner: Any = part.subcon
        while isinstance(inner, (Array, Renamed)):
            if isinstance(inner, Array):
                shape.append(inner.count)
            inner = inner.subcon
        kind: Scalar | Nested
        if isinstance(inner, Struct):
            kind = Nested(_NESTED_NAMES[id(inner)], read_fields(inner, {}))
        elif isinstance(inner, FormatField):
            kind = _SCALARS[inner.fmtstr]
        else:
            raise TypeError(f"{part.name}: {inner!r} has no layout in the generator")
        fields.append(Field(part.name, doc, tuple(shape), kind, codes.get(part.name)))
    return tuple(fields)


def read_messages() -> tuple[MessageType, ...]:
    taken = {codes.name for codes in schema.CODES}
    payloads: dict[int, str] = {}
    messages = []
    for message in schema.MESSAGES:
        name = camel(message.name)
        if name in taken:
            name += "Message"
        base = payloads.setdefault(id(message.payload), name)
        messages.append(
            MessageType(
                message,
                name,
                message in schema.HOST_MESSAGES,
                read_fields(message.payload, dict(message.codes)),
                None if base == name else base,
            )
        )
    return tuple(messages)


MESSAGES = read_messages()
HOST_HEADER = read_fields(schema.HOST_HEADER, {})
BOARD_HEADER = read_fields(schema.BOARD_HEADER, {})
HOST_OVERHEAD_BYTES = size_of(HOST_HEADER) + CRC_BYTES + STUFFING_BYTES
BOARD_OVERHEAD_BYTES = size_of(BOARD_HEADER) + CRC_BYTES + STUFFING_BYTES


def header_of(message: MessageType) -> tuple[Field, ...]:
    return HOST_HEADER if message.from_host else BOARD_HEADER


def canonical_text() -> str:
    """Everything that host and board must agree on, and nothing else: no prose."""
    lines = [f"constant {c.name} {c.value}" for c in schema.CONSTANTS]
    for codes in schema.CODES:
        lines += [f"code {codes.name} {code.name} {code.value}" for code in codes.values]

    def layout(fields: tuple[Field, ...]) -> str:
        parts = []
        for field in fields:
            kind = field.text
            if isinstance(field.kind, Nested):
                kind = kind.replace(field.kind.name, "{" + layout(field.kind.fields) + "}", 1)
            parts.append(f"{field.name}:{kind}" + (f"={field.codes}" if field.codes else ""))
        return ",".join(parts)

    lines.append(f"header host {layout(HOST_HEADER)}")
    lines.append(f"header board {layout(BOARD_HEADER)}")
    for message in MESSAGES:
        kind = "reliable" if message.source.reliable else "plain"
        lines.append(
            f"message {message.source.name} {message.source.number} {kind} {layout(message.fields)}"
        )
    return "\n".join(lines) + "\n"


SCHEMA_HASH = crc32c(canonical_text().encode())


def check_schema() -> None:
    """Refuse a schema that can't be right."""
    numbers = [message.source.number for message in MESSAGES]
    assert len(set(numbers)) == len(numbers), "a message number is used twice"
    limit = next(c.value for c in schema.CONSTANTS if c.name == "FRAME_WIRE_BYTES_MAX")
    for message in MESSAGES:
        overhead = HOST_OVERHEAD_BYTES if message.from_host else BOARD_OVERHEAD_BYTES
        wire = overhead + message.size
        assert wire <= limit, f"{message.source.name} takes {wire} bytes on the wire, over {limit}"
        assert (message.source.number < 0x80) == message.from_host, message.source.name
        names = {codes.name for codes in schema.CODES}
        assert all(codes in names for _, codes in message.source.codes), message.source.name
    for codes in schema.CODES:
        assert [code.value for code in codes.values] == list(range(len(codes.values))), codes.name


# ----------------------------------------------------------------------------- C++ header

_PREAMBLE = "Generated by protocol/generate.py from protocol/setae_protocol/schema.py; do not edit."


def constant_name(name: str) -> str:
    return "k" + camel(name.lower())


def smallest_uint(value: int) -> str:
    return next(f"uint{bits}_t" for bits in (8, 16, 32) if value < 1 << bits)


def wrap(text: str, indent: str, width: int = 100) -> list[str]:
    lines, line = [], indent
    for word in text.split():
        if len(line) + len(word) + 1 > width and line != indent:
            lines.append(line.rstrip())
            line = indent
        line += word + " "
    lines.append(line.rstrip())
    return lines


def cpp_comment(text: str, indent: str = "") -> list[str]:
    return wrap(text, f"{indent}// ")


def cpp_struct(
    name: str, fields: tuple[Field, ...], doc: str, kind: str | None, size: int
) -> list[str]:
    lines = [*cpp_comment(doc), f"struct {name} {{"]
    if kind:
        lines.append(f"  static constexpr MessageType kType = MessageType::{kind};")
    lines += [f"  static constexpr uint8_t kSize = {size};", ""]
    for field in fields:
        base = field.kind.cpp if isinstance(field.kind, Scalar) else field.kind.name
        shape = "".join(f"[{count}]" for count in field.shape)
        note = field.doc + (f" ({field.codes})" if field.codes else "")
        lines += cpp_comment(note, "  ")
        lines.append(f"  {base} {field.name}{shape};")
    return [*lines, "};", ""]


def cpp_codec(name: str, fields: tuple[Field, ...]) -> list[str]:
    """encode and decode, byte by byte: no casts, so the machine's order does not matter."""

    def body(verb: str) -> list[str]:
        lines = []
        offset = 0
        for field in fields:
            indent = "  "
            index = ""
            position = str(offset)
            unit = field.size
            for depth, count in enumerate(field.shape):
                letter = "ijk"[depth]
                unit //= count
                lines.append(
                    f"{indent}for (uint8_t {letter} = 0; {letter} < {count}; ++{letter}) {{"
                )
                indent += "  "
                index += f"[{letter}]"
                position += f" + {letter} * {unit}" if unit > 1 else f" + {letter}"
            value = f"message.{field.name}{index}"
            if isinstance(field.kind, Nested):
                arguments = (
                    f"{value}, out + {position}" if verb == "put" else f"in + {position}, {value}"
                )
                lines.append(f"{indent}{'encode' if verb == 'put' else 'decode'}({arguments});")
            elif verb == "put":
                unsigned = f"uint{field.kind.bits}_t"
                cast = f"static_cast<{unsigned}>({value})" if field.kind.signed else value
                lines.append(f"{indent}detail::put{field.kind.bits}({cast}, out + {position});")
            else:
                source = f"detail::get{field.kind.bits}(in + {position})"
                if field.kind.signed:
                    source = f"static_cast<{field.kind.cpp}>({source})"
                lines.append(f"{indent}{value} = {source};")
            while len(indent) > 2:
                indent = indent[2:]
                lines.append(f"{indent}}}")
            offset += field.size
        return [line.replace("out + 0 + ", "out + ").replace("in + 0 + ", "in + ")
                .replace("out + 0)", "out)").replace("in + 0)", "in)")
                .replace("in + 0,", "in,") for line in lines]  # fmt: skip

    return [
        f"inline void encode(const {name}& message, uint8_t* out) {{",
        *body("put"),
        "}",
        f"inline void decode(const uint8_t* in, {name}& message) {{",
        *body("get"),
        "}",
        "",
    ]


def cpp_header() -> str:
    lines = [
        f"// {_PREAMBLE}",
        "//",
        *cpp_comment(
            "Field values are plain integers; where a field holds a code, the enumeration stands in"
            " brackets. encode() writes and decode() reads exactly kSize bytes, little-endian. A"
            " message whose name an enumeration has already is called ...Message."
        ),
        "#pragma once",
        "",
        "#include <stdint.h>",
        "",
        "namespace setae {",
        "namespace protocol {",
        "",
    ]
    for constant in schema.CONSTANTS:
        lines += cpp_comment(constant.doc)
        lines.append(
            f"constexpr {smallest_uint(constant.value)} {constant_name(constant.name)} ="
            f" {constant.value};"
        )
    host_max = max(m.size for m in MESSAGES if m.from_host)
    board_max = max(m.size for m in MESSAGES if not m.from_host)
    lines += [
        "// CRC-32C of what host and board must agree on; they compare it in the handshake.",
        f"constexpr uint32_t kSchemaHash = 0x{SCHEMA_HASH:08X};",
        "// CRC, COBS code byte and delimiter: what a frame has besides header and payload.",
        f"constexpr uint8_t kCrcBytes = {CRC_BYTES};",
        f"constexpr uint8_t kStuffingBytes = {STUFFING_BYTES};",
        f"constexpr uint8_t kHostPayloadMax = {host_max};",
        f"constexpr uint8_t kBoardPayloadMax = {board_max};",
        "",
    ]
    for codes in schema.CODES:
        lines += cpp_comment(codes.doc)
        lines.append(f"enum class {codes.name} : uint8_t {{")
        for code in codes.values:
            lines += cpp_comment(code.doc, "  ")
            lines.append(f"  k{camel(code.name)} = {code.value},")
        lines += ["};", f"constexpr uint8_t k{codes.name}Count = {len(codes.values)};", ""]
    lines.append("enum class MessageType : uint8_t {")
    for message in MESSAGES:
        lines.append(f"  k{camel(message.source.name)} = 0x{message.source.number:02X},")
    lines += ["};", ""]
    lines += [
        "namespace detail {",
        "inline void put8(uint8_t value, uint8_t* out) { out[0] = value; }",
        "inline void put16(uint16_t value, uint8_t* out) {",
        "  out[0] = static_cast<uint8_t>(value);",
        "  out[1] = static_cast<uint8_t>(value >> 8);",
        "}",
        "inline void put32(uint32_t value, uint8_t* out) {",
        "  put16(static_cast<uint16_t>(value), out);",
        "  put16(static_cast<uint16_t>(value >> 16), out + 2);",
        "}",
        "inline uint8_t get8(const uint8_t* in) { return in[0]; }",
        "inline uint16_t get16(const uint8_t* in) {",
        "  return static_cast<uint16_t>(in[0] | (static_cast<uint16_t>(in[1]) << 8));",
        "}",
        "inline uint32_t get32(const uint8_t* in) {",
        "  return get16(in) | (static_cast<uint32_t>(get16(in + 2)) << 16);",
        "}",
        "}  // namespace detail",
        "",
    ]
    lines += cpp_struct(
        "HostHeader", HOST_HEADER, "Starts every frame from the host.", None, size_of(HOST_HEADER)
    )
    lines += cpp_codec("HostHeader", HOST_HEADER)
    lines += cpp_struct(
        "BoardHeader", BOARD_HEADER, "Starts every frame from the board.", None,
        size_of(BOARD_HEADER),
    )  # fmt: skip
    lines += cpp_codec("BoardHeader", BOARD_HEADER)
    done: set[str] = set()
    for message in MESSAGES:
        for field in message.fields:
            if isinstance(field.kind, Nested) and field.kind.name not in done:
                done.add(field.kind.name)
                nested = field.kind
                lines += cpp_struct(
                    nested.name, nested.fields, f"One of `{message.source.name}.{field.name}`.",
                    None, size_of(nested.fields),
                )  # fmt: skip
                lines += cpp_codec(nested.name, nested.fields)
        kind = f"k{camel(message.source.name)}"
        if message.base:
            lines += [
                *cpp_comment(message.source.doc),
                f"struct {message.name} : {message.base} {{",
                f"  static constexpr MessageType kType = MessageType::{kind};",
                "",
                f"  {message.name}() = default;",
                f"  explicit {message.name}(const {message.base}& other)"
                f" : {message.base}(other) {{}}",
                "};",
                "",
            ]
            continue
        lines += cpp_struct(message.name, message.fields, message.source.doc, kind, message.size)
        lines += cpp_codec(message.name, message.fields)
    for side, from_host in (("host", True), ("board", False)):
        lines += [
            f"// Payload bytes of a message from the {side}; 0xFF for a type that is none of them.",
            f"constexpr uint8_t {side}_payload_size(MessageType type) {{",
            "  switch (type) {",
        ]
        for message in MESSAGES:
            if message.from_host == from_host:
                lines += [
                    f"    case MessageType::k{camel(message.source.name)}:",
                    f"      return {message.name}::kSize;",
                ]
        lines += ["    default:", "      return 0xFF;", "  }", "}", ""]
    lines += [
        "// Reliable messages are sequenced, acknowledged and carried out exactly once.",
        "constexpr bool is_reliable(MessageType type) {",
        "  switch (type) {",
    ]
    lines += [
        f"    case MessageType::k{camel(m.source.name)}:" for m in MESSAGES if m.source.reliable
    ]
    lines += ["      return true;", "    default:", "      return false;", "  }", "}", ""]
    lines += [
        "static_assert(HostHeader::kSize + kHostPayloadMax + kCrcBytes + kStuffingBytes <=",
        "                  kFrameWireBytesMax,",
        '              "a host frame is too long");',
        "static_assert(BoardHeader::kSize + kBoardPayloadMax + kCrcBytes + kStuffingBytes <=",
        "                  kFrameWireBytesMax,",
        '              "a board frame is too long");',
        "",
        "}  // namespace protocol",
        "}  // namespace setae",
    ]
    return "\n".join(lines) + "\n"


# -------------------------------------------------------------------------- Python module

_STRUCT_LETTERS = {8: "Bb", 16: "Hh", 32: "Ii"}


def flat_letters(fields: tuple[Field, ...]) -> str:
    letters = ""
    for field in fields:
        if isinstance(field.kind, Scalar):
            unit = _STRUCT_LETTERS[field.kind.bits][field.kind.signed]
        else:
            unit = flat_letters(field.kind.fields)
        count = 1
        for extent in field.shape:
            count *= extent
        letters += unit * count
    return letters


def squeeze(letters: str) -> str:
    out = ""
    index = 0
    while index < len(letters):
        end = index
        while end < len(letters) and letters[end] == letters[index]:
            end += 1
        out += (str(end - index) if end - index > 1 else "") + letters[index]
        index = end
    return out


def python_type(field: Field, *, codes: bool) -> str:
    base = "int" if isinstance(field.kind, Scalar) else field.kind.name
    if field.codes and codes:
        base = field.codes
    for count in reversed(field.shape):
        base = "tuple[" + ", ".join([base] * count) + "]"
        # Four numbers are always one for each servo.
        base = "Ticks" if base == "tuple[int, int, int, int]" else base
    return base


def python_flatten(fields: tuple[Field, ...], prefix: str) -> list[str]:
    """Expressions, one for each item that struct packs."""
    out = []
    for field in fields:
        name = f"{prefix}{field.name}"
        if isinstance(field.kind, Nested):
            for i in range(field.shape[0]):
                out += python_flatten(field.kind.fields, f"{name}[{i}].")
        elif len(field.shape) == 2:
            out += [f"*{name}[{i}]" for i in range(field.shape[0])]
        else:
            out.append(f"*{name}" if field.shape else name)
    return out


def python_rebuild(fields: tuple[Field, ...], start: int, *, codes: bool) -> tuple[list[str], int]:
    """Expressions that build the fields from struct's flat tuple `v`."""
    out = []
    for field in fields:
        if isinstance(field.kind, Nested):
            items = []
            for _ in range(field.shape[0]):
                parts, start = python_rebuild(field.kind.fields, start, codes=False)
                items.append(f"{field.kind.name}({', '.join(parts)})")
            out.append("(\n" + "".join(f"                {item},\n" for item in items) + "            )")
            continue

        def group(shape: tuple[int, ...], field: Field = field) -> str:
            nonlocal start
            if not shape:
                start += 1
                text = f"v[{start - 1}]"
                return f"{field.codes}({text})" if field.codes and codes else text
            if len(shape) == 1:
                start += shape[0]
                return f"v[{start - shape[0]}:{start}]"
            return "(" + ", ".join(group(shape[1:]) for _ in range(shape[0])) + ")"

        out.append(group(field.shape))
    return out, start


def python_summary(doc: str) -> list[str]:
    """Open a docstring; a second sentence goes into a paragraph of its own."""
    first, stop, rest = doc.partition(". ")
    lines = [f'    """{first}{stop.strip()}']
    return [*lines, "", *wrap(rest, "    ", 96)] if rest else lines


def python_docstring(doc: str, fields: tuple[Field, ...]) -> list[str]:
    lines = [*python_summary(doc), "", "    Attributes", "    ----------"]
    for field in fields:
        lines.append(f"    {field.name}")
        lines += wrap(field.doc, "        ", 96)
    return [*lines, '    """', ""]


def python_class(
    name: str, fields: tuple[Field, ...], doc: str, message: MessageType | None
) -> list[str]:
    # The frozen handshake must stay readable for other versions, whose codes we don't know.
    codes = message is not None and not message.source.frozen
    letters = squeeze(flat_letters(fields))
    lines = ["", "", "@dataclass(frozen=True, slots=True)", f"class {name}:"]
    lines += python_docstring(doc, fields)
    if message is not None:
        lines.append(
            f"    TYPE: ClassVar[MessageType] = MessageType.{message.source.name.upper()}"
        )
        lines.append(f"    RELIABLE: ClassVar[bool] = {message.source.reliable}")
    if message is not None or name.endswith("Header"):
        lines.append(f"    SIZE: ClassVar[int] = {size_of(fields)}")
        lines.append("")
    for field in fields:
        lines.append(f"    {field.name}: {python_type(field, codes=codes)}")
    if message is None and not name.endswith("Header"):
        return lines
    struct = f"_{name.upper()}"
    flat = python_flatten(fields, "self.")
    rebuilt, _ = python_rebuild(fields, 0, codes=codes)
    lines += [
        "",
        "    def pack(self) -> bytes:",
        '        """Return the bytes on the wire; ValueError where a field is out of range."""',
        "        try:",
        f"            return {struct}.pack(",
        *[f"                {item}," for item in flat],
        "            )",
        "        except (struct.error, IndexError, TypeError) as error:",
        f'            raise ValueError(f"{name}: {{error}}") from None',
        "",
        "    @classmethod",
        "    def unpack(cls, data: bytes) -> Self:",
        f'        """Read exactly {size_of(fields)} bytes; ValueError for anything else."""',
        "        try:",
        f"            v = {struct}.unpack(data)",
        "        except struct.error as error:",
        f'            raise ValueError(f"{name}: {{error}}") from None',
        "        return cls(",
        *[f"            {item}," for item in rebuilt],
        "        )",
    ]
    lines_before = ["", "", f'{struct} = struct.Struct("<{letters}")']
    return lines_before + lines


def python_module() -> str:
    lines = [
        f'"""{_PREAMBLE.split(" from ")[0]}.',
        "",
        "Made from `schema.py`; do not edit. A message whose name an enumeration has",
        "already is called ...Message.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "import struct",
        "from collections.abc import Mapping",
        "from dataclasses import dataclass",
        "from enum import IntEnum",
        "from types import MappingProxyType",
        "from typing import ClassVar, Final, Self, TypeAlias",
        "",
        "Ticks: TypeAlias = tuple[int, int, int, int]",
        '"""One number for each servo."""',
        "",
    ]
    for constant in schema.CONSTANTS:
        lines.append(f"{constant.name}: Final = {constant.value}")
        lines += wrap(f'"""{constant.doc}"""', "", 96)
    lines += [
        f"SCHEMA_HASH: Final = 0x{SCHEMA_HASH:08X}",
        '"""CRC-32C of what host and board must agree on; compared in the handshake."""',
        f"CRC_BYTES: Final = {CRC_BYTES}",
        f"HOST_OVERHEAD_BYTES: Final = {HOST_OVERHEAD_BYTES}",
        '"""What a frame from the host has on the wire besides its payload."""',
        f"BOARD_OVERHEAD_BYTES: Final = {BOARD_OVERHEAD_BYTES}",
        '"""What a frame from the board has on the wire besides its payload."""',
    ]
    for codes in schema.CODES:
        table = f"_{codes.name.upper()}"
        has_remedy = any(code.remedy for code in codes.values)
        summary = python_summary(codes.doc)
        if len(summary) == 1:
            summary[0] += '"""'
        else:
            summary.append('    """')
        lines += ["", "", f"class {codes.name}(IntEnum):", *summary, ""]
        for code in codes.values:
            lines.append(f"    {code.name.upper()} = {code.value}")
        lines += [
            "",
            "    @property",
            "    def doc(self) -> str:",
            '        """What it means."""',
            f"        return {table}_DOC[self]",
        ]
        if has_remedy:
            lines += [
                "",
                "    @property",
                "    def remedy(self) -> str:",
                '        """What to do about it."""',
                f"        return {table}_REMEDY[self]",
            ]
        for suffix, attribute in (("DOC", "doc"), ("REMEDY", "remedy"))[: 1 + has_remedy]:
            lines += [
                "", "",
                f"{table}_{suffix}: Mapping[{codes.name}, str] = MappingProxyType(",
                "    {",
            ]  # fmt: skip
            for code in codes.values:
                text = json.dumps(getattr(code, attribute), ensure_ascii=False)
                entry = f"        {codes.name}.{code.name.upper()}: {text},"
                if len(entry) > 100:
                    lines += [f"        {codes.name}.{code.name.upper()}: ("]
                    whole = "            " + text
                    lines += (
                        [whole]
                        if len(whole) <= 100
                        else python_string(getattr(code, attribute), "            ")
                    )
                    lines += ["        ),"]
                else:
                    lines.append(entry)
            lines += ["    }", ")"]
    lines += ["", "", "class MessageType(IntEnum):", '    """Message numbers."""', ""]
    for message in MESSAGES:
        lines.append(f"    {message.source.name.upper()} = 0x{message.source.number:02X}")
    lines += python_class("HostHeader", HOST_HEADER, "Starts every frame from the host.", None)
    lines += python_class("BoardHeader", BOARD_HEADER, "Starts every frame from the board.", None)
    done: set[str] = set()
    for message in MESSAGES:
        for field in message.fields:
            if isinstance(field.kind, Nested) and field.kind.name not in done:
                done.add(field.kind.name)
                lines += python_class(
                    field.kind.name,
                    field.kind.fields,
                    f"One of `{message.source.name}.{field.name}`.",
                    None,
                )
        lines += python_class(message.name, message.fields, message.source.doc, message)
    for side, from_host in (("Host", True), ("Board", False)):
        names = [m.name for m in MESSAGES if m.from_host == from_host]
        lines += ["", "", f"{side}Message: TypeAlias = ("]
        whole = "    " + " | ".join(names)
        if len(whole) <= 100:
            lines.append(whole)
        else:
            lines += [f"    {'| ' if i else ''}{name}" for i, name in enumerate(names)]
        lines += [")", f'"""Any message from the {side.lower()}."""']
    for side, from_host in (("Host", True), ("Board", False)):
        lines += [
            "",
            f"{side.upper()}_MESSAGES: Mapping[int, type[{side}Message]] = MappingProxyType(",
            "    {",
            *[
                f"        MessageType.{m.source.name.upper()}: {m.name},"
                for m in MESSAGES
                if m.from_host == from_host
            ],
            "    }",
            ")",
            f'"""Message number to class, {side.lower()} side."""',
        ]
    return "\n".join(lines) + "\n"


def python_string(text: str, indent: str) -> list[str]:
    """A long string as adjacent literals."""
    chunks = wrap(text, "", 96 - len(indent) - 3)
    quoted = [json.dumps(c + " ", ensure_ascii=False) for c in chunks[:-1]]
    quoted.append(json.dumps(chunks[-1], ensure_ascii=False))
    return [indent + q for q in quoted]


# ------------------------------------------------------------------------- reference page


def reference_page() -> str:
    lines = [
        "# Protocol reference",
        "",
        f"<!-- {_PREAMBLE} -->",
        "",
        f"Version {value_of('PROTOCOL_VERSION')}, schema hash `0x{SCHEMA_HASH:08X}`. All integers"
        " are little-endian. `u16[4]` is an array of four unsigned 16-bit integers. What it is all"
        " for, and worked bytes, are in the [README](README.md).",
        "",
        "## Constants",
        "",
        "| Name | Value | Meaning |",
        "|---|---|---|",
    ]
    lines += [f"| `{c.name}` | {c.value} | {cell(c.doc)} |" for c in schema.CONSTANTS]
    lines += ["", "## Headers"]
    for title, fields in (("From the host", HOST_HEADER), ("From the board", BOARD_HEADER)):
        lines += ["", f"### {title}", "", *field_table(fields)]
    lines += [
        "",
        "## Messages",
        "",
        "*On the wire* counts the whole frame: header, payload, CRC, COBS and delimiter.",
        "",
        "| Number | Name | Direction | Reliable | Payload, bytes | On the wire, bytes |",
        "|---|---|---|---|---|---|",
    ]
    for message in MESSAGES:
        overhead = HOST_OVERHEAD_BYTES if message.from_host else BOARD_OVERHEAD_BYTES
        lines.append(
            f"| 0x{message.source.number:02X} | [`{message.source.name}`](#{message.source.name})"
            f" | {'host → board' if message.from_host else 'board → host'}"
            f" | {'yes' if message.source.reliable else ''} | {message.size}"
            f" | {overhead + message.size} |"
        )
    for message in MESSAGES:
        lines += ["", f"### {message.source.name}", "", message.source.doc]
        if message.source.frozen:
            lines += ["", "Its layout and meaning never change, in no version of the protocol."]
        lines += ["", *field_table(message.fields)]
        for field in message.fields:
            if isinstance(field.kind, Nested):
                lines += ["", f"Each `{field.kind.name}`:", "", *field_table(field.kind.fields)]
    lines += ["", "## Codes"]
    for codes in schema.CODES:
        remedy = any(code.remedy for code in codes.values)
        lines += ["", f"### {codes.name}", "", codes.doc, ""]
        lines += ["| Value | Name | Meaning |" + (" What to do |" if remedy else "")]
        lines += ["|---|---|---|" + ("---|" if remedy else "")]
        for code in codes.values:
            row = f"| {code.value} | `{code.name}` | {cell(code.doc)} |"
            lines.append(row + (f" {cell(code.remedy)} |" if remedy else ""))
    return "\n".join(lines) + "\n"


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def value_of(name: str) -> int:
    return next(c.value for c in schema.CONSTANTS if c.name == name)


def field_table(fields: tuple[Field, ...]) -> list[str]:
    lines = ["| Offset | Field | Type | Meaning |", "|---|---|---|---|"]
    offset = 0
    for field in fields:
        doc = cell(field.doc) + (f" ([{field.codes}](#{field.codes.lower()}))" if field.codes else "")
        lines.append(f"| {offset} | `{field.name}` | {field.text} | {doc} |")
        offset += field.size
    return lines


# --------------------------------------------------------------------------------- vectors


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

            def pick(field: Field, kind: Scalar, rng: random.Random = rng, label: str = label) -> int:
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
    return cobs_encode(inside) + b"\0"


def with_crc(inside: bytes) -> bytes:
    return inside + crc32c(inside).to_bytes(4, "little")


def frame_vectors() -> list[dict[str, Any]]:
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
    cobs, crc = coding_vectors()
    data = {
        "note": _PREAMBLE,
        "schema_hash": f"{SCHEMA_HASH:08x}",
        "damages": DAMAGES,
        "cobs": cobs,
        "crc": crc,
        "frames": frame_vectors(),
        "damaged": damaged_vectors(),
    }
    return json.dumps(data, indent=1) + "\n"


def cpp_bytes(name: str, data: bytes) -> list[str]:
    # C++ has no empty arrays; the size beside the pointer tells.
    items = [f"0x{byte:02x}" for byte in data] or ["0"]
    return [f"const uint8_t {name}[] = {{", *wrap(", ".join(items), "    "), "};"]


def cpp_checks(value: Any, path: str) -> Iterator[str]:
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
    classes = {message.source.name: message.name for message in MESSAGES}
    cobs, crc = coding_vectors()
    lines = [
        f"// {_PREAMBLE}",
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


# -------------------------------------------------------------------------- default limits


def default_limits_header() -> str:
    """The limits that a board starts with, from the default robot's configuration."""
    sys.path.insert(0, str(ROOT / "host"))
    from setae import config, servo

    limits = servo.board_limits(config.load())
    message = next(m for m in MESSAGES if m.source.name == "set_limits")
    rows = []
    for field in message.fields:
        value = getattr(limits, field.name)
        text = "{" + ", ".join(map(str, value)) + "}" if field.shape else str(value)
        rows.append((f"    {text},", field.name))
    width = max(len(text) for text, _ in rows) + 2
    lines = [
        "// Generated by protocol/generate.py from host/setae/robots/paper.toml; do not edit.",
        "//",
        "// The limits in force until the host sets others.",
        "#pragma once",
        "",
        '#include "protocol/messages.h"',
        "",
        "namespace setae {",
        "",
        f"constexpr protocol::{message.name} kDefaultLimits = {{",
        *[f"{text:<{width}}// {name}" for text, name in rows],
        "};",
        "",
        "}  // namespace setae",
    ]
    return "\n".join(lines) + "\n"


# ------------------------------------------------------------------------------------ main

OUTPUTS: dict[str, Callable[[], str]] = {
    "firmware/lib/protocol/src/protocol/messages.h": cpp_header,
    "protocol/setae_protocol/messages.py": python_module,
    "protocol/REFERENCE.md": reference_page,
    "protocol/vectors.json": vectors_json,
    "tests/firmware/test_protocol/vectors.h": vectors_header,
    # Last: it needs the host package, which needs the messages.
    "firmware/lib/board/src/board/default_limits.h": default_limits_header,
}


def drift(root: Path) -> list[str]:
    """One line for each generated file that differs from what the schema gives."""
    lines = []
    for name, make in OUTPUTS.items():
        path = root / name
        if not path.exists():
            lines.append(f"{name} is missing; run: python protocol/generate.py")
            continue
        old, new = path.read_text(encoding="utf-8"), make()
        if old != new:
            changed = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=0)
            first = next(line for line in list(changed)[3:])
            lines.append(
                f"{name} is not what the schema gives; run: python protocol/generate.py"
                f" (first difference: {first})"
            )
    return lines


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, fail on a difference")
    options = parser.parse_args(arguments)
    check_schema()
    if options.check:
        differences = drift(ROOT)
        for line in differences:
            print(line, file=sys.stderr)
        return 1 if differences else 0
    for name, make in OUTPUTS.items():
        path = ROOT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text = make()
        # An unchanged file keeps its date, so that nothing is built for nothing.
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
