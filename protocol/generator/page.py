"""The reference page: tables of everything in the schema."""

from __future__ import annotations

from generator.layout import (
    BOARD_HEADER,
    BOARD_OVERHEAD_BYTES,
    HOST_HEADER,
    HOST_OVERHEAD_BYTES,
    MESSAGES,
    SCHEMA_HASH,
    Field,
    Nested,
    value_of,
)
from generator.text import PREAMBLE
from setae_protocol import schema


def reference_page() -> str:
    """Return the whole page."""
    introduction = (
        f"Version {value_of('PROTOCOL_VERSION')}, schema hash `0x{SCHEMA_HASH:08X}`. All integers"
        " are little-endian. `u16[4]` is an array of four unsigned 16-bit integers. What it is all"
        " for, and worked bytes, are in the [README](README.md)."
    )
    lines = [
        "# Protocol reference",
        "",
        f"<!-- {PREAMBLE} -->",
        "",
        introduction,
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
        lines += ["", f"### Code {codes.name}", "", codes.doc, ""]
        lines += ["| Value | Name | Meaning |" + (" What to do |" if remedy else "")]
        lines += ["|---|---|---|" + ("---|" if remedy else "")]
        for code in codes.values:
            row = f"| {code.value} | `{code.name}` | {cell(code.doc)} |"
            lines.append(row + (f" {cell(code.remedy)} |" if remedy else ""))
    return "\n".join(lines) + "\n"


def cell(text: str) -> str:
    """Return text fit for a cell of a table."""
    return text.replace("|", "\\|")


def field_table(fields: tuple[Field, ...]) -> list[str]:
    """Return the table of a struct, with offsets."""
    lines = ["| Offset | Field | Type | Meaning |", "|---|---|---|---|"]
    offset = 0
    for field in fields:
        doc = cell(field.doc) + (
            f" ([{field.codes}](#code-{field.codes.lower()}))" if field.codes else ""
        )
        lines.append(f"| {offset} | `{field.name}` | {field.text} | {doc} |")
        offset += field.size
    return lines
