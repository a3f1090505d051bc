"""Parcel, a fictitious middleware: the example of docs/how-to/add-a-middleware.md.

A definition is a file `<Message>.parcel` in the folder of its package, a line for each field:

    id: u16                 # a number, flag or stamp
    place: lab/Place        # another message; without a package, of the same
    values: 3 f32           # three of them
    samples: any i16        # a variable number of them

On the wire a payload begins with the bytes CA FE. Numbers are aligned to two bytes, counted from behind these.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    ElementType,
    Field,
    FieldType,
    InterfaceKind,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.piece import Piece, read_lines
from fusesoc_firm.message.wire import INTEGER_AND_FLOAT, WireRules
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail, nearest

RULES = WireRules(
    scalars=MappingProxyType(
        {
            "flag": INTEGER_AND_FLOAT["bool"],
            "u8": INTEGER_AND_FLOAT["uint8"],
            "u16": INTEGER_AND_FLOAT["uint16"],
            "i16": INTEGER_AND_FLOAT["int16"],
            "f32": INTEGER_AND_FLOAT["float32"],
            "f64": INTEGER_AND_FLOAT["float64"],
        }
    ),
    compounds=MappingProxyType(
        {"stamp": (("seconds", INTEGER_AND_FLOAT["uint32"]), ("ticks", INTEGER_AND_FLOAT["uint16"]))}
    ),
    max_alignment=2,
    prefix=b"\xca\xfe",
    checked_prefix=2,
    empty_bytes=0,
    string_terminator=0,
    trailing_bytes=0,
)
TYPES = frozenset(RULES.scalars) | frozenset(RULES.compounds) | {"text"}


def parse(text: str, name: MessageName, ros: Middleware, file: str, diagnostics: Diagnostics) -> MessageDefinition:
    """Parse a definition; a fault in one line does not hide faults in later lines."""
    lines = [line.partition("#")[0] for line in read_lines(text, file)]
    fields = [_field(line, name.package, diagnostics) for line in lines if line.text]
    found = tuple(field for field in fields if field)
    return MessageDefinition(name, ros, found, (), SourceRef(file, 1, 1))


def _field(line: Piece, package: str, diagnostics: Diagnostics) -> Field | None:
    name, kind = line.partition(":")
    count, word = kind.split_word() if " " in kind.text else (None, kind)
    if not name.text.isidentifier() or not word.text:
        diagnostics.error("this is no field", line.source, "a field is 'name: type'")
        return None
    if count and count.text != "any" and not count.text.isdecimal():
        diagnostics.error(f"'{count.text}' is no count", count.source, "a number, or 'any'")
        return None
    element = _element(word, package, diagnostics)
    return Field(name.text, _array(element, count.text if count else ""), word.source) if element else None


def _element(word: Piece, package: str, diagnostics: Diagnostics) -> ElementType | None:
    if word.text == "text":
        return StringType()
    if word.text in TYPES:
        return PrimitiveType(word.text)
    *packages, message = word.text.split("/")
    if message[:1].isupper():
        return MessageType(MessageName(packages[0] if packages else package, message))
    diagnostics.error(f"unknown type '{word.text}'", word.source, nearest(word.text, TYPES))
    return None


def _array(element: ElementType, count: str) -> FieldType:
    if not count:
        return element
    return SequenceType(element) if count == "any" else ArrayType(element, int(count))


def checksum(
    name: MessageName,
    definitions: Mapping[MessageName, MessageDefinition],
    kind: InterfaceKind = InterfaceKind.MESSAGE,
) -> str:
    """The signature: a CRC of the fields of a message and all within it; `kind` says nothing, there are no services."""
    fields = [f"{known} {field.name} {field.type}" for known in definitions for field in definitions[known].fields]
    return f"{zlib.crc32('; '.join([str(name), *fields]).encode()):08x}"


class NoStore:
    """No definitions are shipped; all come from files of the user."""

    title = "no store"
    names: frozenset[MessageName] = frozenset()

    def __init__(self, distribution: str | None) -> None:
        if distribution is not None:
            fail(f"Parcel has no distribution '{distribution}'")

    def text(self, name: MessageName) -> str:
        raise KeyError(name)

    def file(self, name: MessageName) -> str:
        raise KeyError(name)


def _folders(environment: Mapping[str, str]) -> list[Path]:
    return [Path(environment["PARCEL_HOME"])] if "PARCEL_HOME" in environment else []


MIDDLEWARE = Middleware(
    number=3,
    title="Parcel",
    words=("PARCEL",),
    rules=RULES,
    parse=parse,
    signature=checksum,
    builtin_types=TYPES,
    suffixes={"parcel": InterfaceKind.MESSAGE},
    folders=_folders,
    distributions=list,
    store=NoStore,
)
