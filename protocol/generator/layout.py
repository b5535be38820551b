"""The schema as plain data: every field with its type, shape and size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from construct import Array, Construct, FormatField, Renamed, Struct

from setae_protocol import schema
from setae_protocol.crc import crc32c

CRC_BYTES = 4
# One COBS code byte (frames stay below 254 bytes) and the delimiter.
STUFFING_BYTES = 2


@dataclass(frozen=True, slots=True)
class Scalar:
    """An integer on the wire."""

    bits: int
    signed: bool

    @property
    def minimum(self) -> int:
        """Lowest value."""
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def maximum(self) -> int:
        """Highest value."""
        return (1 << (self.bits - 1)) - 1 if self.signed else (1 << self.bits) - 1

    @property
    def text(self) -> str:
        """The type as the reference page and the schema hash have it."""
        return f"{'i' if self.signed else 'u'}{self.bits}"

    @property
    def cpp(self) -> str:
        """The type in C++."""
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
        """Bytes on the wire."""
        unit = self.kind.bits // 8 if isinstance(self.kind, Scalar) else size_of(self.kind.fields)
        for count in self.shape:
            unit *= count
        return unit

    @property
    def text(self) -> str:
        """The type as the reference page and the schema hash have it."""
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
        """Bytes on the wire."""
        return size_of(self.fields)


def size_of(fields: tuple[Field, ...]) -> int:
    """Return the bytes that fields take on the wire."""
    return sum(field.size for field in fields)


def camel(name: str) -> str:
    """Return `hello_reply` as `HelloReply`."""
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
    """Resolve all messages. One whose name an enumeration has gets a suffix."""
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
    """Return the header that a message's frames have."""
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


def value_of(name: str) -> int:
    """Return the value of a constant."""
    return next(c.value for c in schema.CONSTANTS if c.name == name)
