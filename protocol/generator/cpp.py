"""The C++ header: constants, enumerations, structs and their codec."""

from __future__ import annotations

from generator.layout import (
    BOARD_HEADER,
    CRC_BYTES,
    HOST_HEADER,
    MESSAGES,
    SCHEMA_HASH,
    STUFFING_BYTES,
    Field,
    Nested,
    Scalar,
    camel,
    size_of,
)
from generator.text import PREAMBLE, cpp_comment
from setae_protocol import schema


def constant_name(name: str) -> str:
    """Return `FRAME_BYTES` as `kFrameBytes`."""
    return "k" + camel(name.lower())


def smallest_uint(value: int) -> str:
    """Return the narrowest unsigned type that holds a value."""
    return next(f"uint{bits}_t" for bits in (8, 16, 32) if value < 1 << bits)


def cpp_struct(
    name: str, fields: tuple[Field, ...], doc: str, kind: str | None, size: int
) -> list[str]:
    """Return a plain struct with its size and, for a message, its type."""
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
    """Return encode and decode, byte by byte: no casts, so the machine's order does not matter."""

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
        "#ifndef __AVR__",
        f"inline void encode(const {name}& message, uint8_t* out) {{",
        *body("put"),
        "}",
        f"inline void decode(const uint8_t* in, {name}& message) {{",
        *body("get"),
        "}",
        "#endif",
        "",
    ]


def cpp_header() -> str:
    """Return the whole header."""
    lines = [
        f"// {PREAMBLE}",
        "//",
        *cpp_comment(
            "Field values are plain integers; where a field holds a code, the enumeration stands in"
            " brackets. encode() writes and decode() reads exactly kSize bytes, little-endian; Wire"
            " gives those bytes, without a copy where there need be none. A message whose name an"
            " enumeration has already is called ...Message."
        ),
        "#pragma once",
        "",
        "#include <stdint.h>",
        "#include <string.h>",
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
        "#ifdef __AVR__",
        "",
        "// The board has a struct in memory as it is on the wire: no padding, low byte first.",
        'static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "");',
        "template <typename Message>",
        "inline void encode(const Message& message, uint8_t* out) {",
        '  static_assert(sizeof(Message) == Message::kSize, "");',
        "  memcpy(out, &message, sizeof(Message));",
        "}",
        "template <typename Message>",
        "inline void decode(const uint8_t* in, Message& message) {",
        '  static_assert(sizeof(Message) == Message::kSize, "");',
        "  memcpy(&message, in, sizeof(Message));",
        "}",
        "template <typename Message>",
        "class Wire {",
        " public:",
        "  explicit Wire(const Message& message) : message_(message) {}",
        "  const uint8_t* bytes() const {",
        '    static_assert(sizeof(Message) == Message::kSize, "");',
        "    return reinterpret_cast<const uint8_t*>(&message_);",
        "  }",
        "",
        " private:",
        "  const Message& message_;",
        "};",
        "",
        "#else",
        "",
        "template <typename Message>",
        "class Wire {",
        " public:",
        "  explicit Wire(const Message& message) { encode(message, bytes_); }",
        "  const uint8_t* bytes() const { return bytes_; }",
        "",
        " private:",
        "  uint8_t bytes_[Message::kSize];",
        "};",
        "",
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
        "#endif",
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
                f"  explicit {message.name}(const {message.base}& all) : {message.base}(all) {{}}",
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
