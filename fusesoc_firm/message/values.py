"""The values of constants and defaults: text to Python, checked against the range of their type."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

from fusesoc_firm.diagnostics import Diagnostics
from fusesoc_firm.message.dialect import Dialect
from fusesoc_firm.message.model import (
    ArrayType,
    DefaultValue,
    FieldType,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.piece import Piece

_QUOTES = ('"', "'")
# An element is quoted, with `\"` for the quote itself, or takes all up to the comma. Possessive, or `\"` could also close.
_ELEMENT = re.compile(r"""\s*("(?:\\"|[^"])*+"|'(?:\\'|[^'])*+'|[^,]*?)\s*(?:,|$)""")


def read_value(
    piece: Piece, kind: PrimitiveType | StringType, dialect: Dialect, diagnostics: Diagnostics
) -> Scalar | None:
    """The value of a constant, of a default or of one of its elements; None if a fault was noted."""
    try:
        return _scalar(piece.text, kind, dialect)
    except ValueError as fault:
        diagnostics.error(f"'{piece.text}' is no value of {kind}", piece.source, str(fault))
        return None


def read_default(piece: Piece, kind: FieldType, dialect: Dialect, diagnostics: Diagnostics) -> DefaultValue | None:
    """A field's default value; None if a fault was noted."""
    element = kind.element if isinstance(kind, ArrayType | SequenceType) else kind
    if isinstance(element, MessageType):
        diagnostics.error(f"a field of type {kind} has no default value", piece.source, "only primitive types have one")
        return None
    if isinstance(kind, ArrayType | SequenceType):
        return _array(piece, kind, element, dialect, diagnostics)
    return read_value(piece, element, dialect, diagnostics)


def _array(
    piece: Piece,
    kind: ArrayType | SequenceType,
    element: PrimitiveType | StringType,
    dialect: Dialect,
    diagnostics: Diagnostics,
) -> tuple[Scalar, ...] | None:
    if len(piece.text) < 2 or piece.text[0] != "[" or piece.text[-1] != "]":
        diagnostics.error(f"'{piece.text}' is no value of {kind}", piece.source, "an array is written '[a, b, c]'")
        return None
    values = [
        read_value(part, element, dialect, diagnostics) for part in _elements(piece.part(1, -1 + len(piece.text)))
    ]
    if hint := _count_fault(kind, len(values)):
        diagnostics.error(f"a default of {len(values)} elements does not fit {kind}", piece.source, hint)
        return None
    known = tuple(value for value in values if value is not None)
    return known if len(known) == len(values) else None


def _elements(inner: Piece) -> Iterator[Piece]:
    if not inner.text.strip():
        return
    position = 0
    # The text is met with a comma behind it, so that the last element ends like all others and `[1,]` has an empty one.
    while position <= len(inner.text):
        match = _ELEMENT.match(inner.text, position)
        if match is None:  # an unclosed quote, or text behind a closing one
            yield inner.part(position).strip()
            return
        yield inner.part(*match.span(1))
        position = match.end() + (not match.group().endswith(","))


def _count_fault(kind: ArrayType | SequenceType, count: int) -> str:
    if isinstance(kind, ArrayType):
        return "" if count == kind.length else f"it takes exactly {kind.length}"
    return "" if kind.bound is None or count <= kind.bound else f"it takes at most {kind.bound}"


def _scalar(text: str, kind: PrimitiveType | StringType, dialect: Dialect) -> Scalar:
    """The value of `text`, or a ValueError that says what is legal."""
    if isinstance(kind, StringType):
        return _string(text, kind, dialect)
    if kind.name == "bool":
        return _boolean(text, dialect)
    if kind.name in dialect.integer_ranges:
        return _integer(text, kind, dialect)
    return _float(text, kind)


def _boolean(text: str, dialect: Dialect) -> bool:
    key = text.lower() if "true" in dialect.booleans else text
    if key not in dialect.booleans:
        raise ValueError(f"bool takes {', '.join(dialect.booleans)}")
    return dialect.booleans[key]


def _integer(text: str, kind: PrimitiveType, dialect: Dialect) -> int:
    smallest, largest = dialect.integer_ranges[kind.name]
    try:
        value = _whole_number(text, dialect)
    except ValueError:
        radix = "decimal, 0x, 0o or 0b" if dialect.has_integer_prefixes else "decimal"
        raise ValueError(f"{kind} takes a whole number ({radix}) from {smallest} to {largest}") from None
    if not smallest <= value <= largest:
        raise ValueError(f"{kind} takes {smallest} to {largest}")
    return value


def _whole_number(text: str, dialect: Dialect) -> int:
    try:
        return int(text)  # first, since `010` is ten to both references
    except ValueError:
        if not dialect.has_integer_prefixes:
            raise
        return int(text, 0)


def _float(text: str, kind: PrimitiveType) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{kind} takes a number with '.' as the separator, inf or nan") from None
    try:
        struct.pack("<f" if kind.name == "float32" else "<d", value)
    except OverflowError:
        raise ValueError("the largest float32 is 3.4028235e+38") from None
    return value


def _string(text: str, kind: StringType, dialect: Dialect) -> str:
    value = _unquoted(text) if dialect.has_quoted_strings else text
    if kind.bound is not None and len(value) > kind.bound:
        raise ValueError(f"{kind} takes at most {kind.bound} characters, not {len(value)}")
    return value


def _unquoted(text: str) -> str:
    """Without the quotes round it; a text that is not in quotes on both sides stays, quotes and all."""
    for quote in _QUOTES:
        if text.startswith(quote) and text.endswith(quote):
            inner = text[1:-1]
            if re.search(rf"(?<!\\){quote}", inner):
                raise ValueError(f"a {quote} within the quotes is written \\{quote}")
            return inner.replace(f"\\{quote}", quote)
    return text
