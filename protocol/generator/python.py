"""The Python module: constants, enumerations, dataclasses."""

from __future__ import annotations

import json

from generator.layout import (
    BOARD_HEADER,
    BOARD_OVERHEAD_BYTES,
    CRC_BYTES,
    HOST_HEADER,
    HOST_OVERHEAD_BYTES,
    MESSAGES,
    SCHEMA_HASH,
    Field,
    MessageType,
    Nested,
    Scalar,
    size_of,
)
from generator.text import PREAMBLE, wrap
from setae_protocol import schema

_STRUCT_LETTERS = {8: "Bb", 16: "Hh", 32: "Ii"}


def flat_letters(fields: tuple[Field, ...]) -> str:
    """Return struct's letters for fields, one for each number."""
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
    """Return `HHHH` as `4H`."""
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
    """Return a field's annotation."""
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
            out.append(
                "(\n" + "".join(f"                {item},\n" for item in items) + "            )"
            )
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
    """Return the docstring of a struct, its fields as attributes."""
    lines = [*python_summary(doc), "", "    Attributes", "    ----------"]
    for field in fields:
        lines.append(f"    {field.name}")
        lines += wrap(field.doc, "        ", 96)
    return [*lines, '    """', ""]


def python_class(
    name: str, fields: tuple[Field, ...], doc: str, message: MessageType | None
) -> list[str]:
    """Return a dataclass, with pack and unpack where it is a message or header."""
    # The frozen handshake must stay readable for other versions, whose codes we don't know.
    codes = message is not None and not message.source.frozen
    letters = squeeze(flat_letters(fields))
    lines = ["", "", "@dataclass(frozen=True, slots=True)", f"class {name}:"]
    lines += python_docstring(doc, fields)
    if message is not None:
        lines.append(f"    TYPE: ClassVar[MessageType] = MessageType.{message.source.name.upper()}")
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
    """Return the whole module."""
    lines = [
        f'"""{PREAMBLE.split(" from ")[0]}.',
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
