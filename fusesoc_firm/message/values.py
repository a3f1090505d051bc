"""Parse the values of constants and defaults, and check them against the ranges of their types."""

from __future__ import annotations

import re
import struct

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
from fusesoc_firm.text.diagnostics import Diagnostics

_QUOTES = ('"', "'")
# An array element is either quoted, with `\"` for a quote, or extends to the comma. The match is possessive; otherwise,
# the quote of `\"` could also close the string.
_ELEMENT = re.compile(r"""\s*("(?:\\"|[^"])*+"|'(?:\\'|[^'])*+'|[^\s,"'](?:[^,]*[^\s,])?)\s*(?:,|$)""")


def read_value(
    piece: Piece, kind: PrimitiveType | StringType, dialect: Dialect, diagnostics: Diagnostics
) -> Scalar | None:
    """Return the value of a constant, a default or an element of a default.

    After a fault, report it and return None.
    """
    try:
        return scalar_of(piece.text, kind, dialect, dialect.has_quoted_strings)
    except ValueError as fault:
        shown = f"'{piece.text}' is not a value of {kind}" if piece.text else f"a value of {kind} is missing"
        diagnostics.error(shown, piece.source, str(fault))
        return None


def read_default(piece: Piece, kind: FieldType, dialect: Dialect, diagnostics: Diagnostics) -> DefaultValue | None:
    """Return the default value of a field; after a fault, report it and return None."""
    element = kind.element if isinstance(kind, ArrayType | SequenceType) else kind
    if isinstance(element, MessageType):
        diagnostics.error(
            f"a field of type {kind} cannot have a default value",
            piece.source,
            "only fields of primitive types can have default values",
        )
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
        diagnostics.error(f"'{piece.text}' is not a value of {kind}", piece.source, "write an array as '[a, b, c]'")
        return None
    elements = _elements(piece.part(1, len(piece.text) - 1), diagnostics)
    if elements is None:
        return None
    values = [read_value(part, element, dialect, diagnostics) for part in elements]
    if hint := count_fault(kind, len(values)):
        diagnostics.error(f"a default value with {len(values)} elements does not fit {kind}", piece.source, hint)
        return None
    known = tuple(value for value in values if value is not None)
    return known if len(known) == len(values) else None


def _elements(inner: Piece, diagnostics: Diagnostics) -> list[Piece] | None:
    """Return the elements between the brackets; after a fault, report it and return None."""
    elements: list[Piece] = []
    position = 0
    while inner.text.strip():
        match = _ELEMENT.match(inner.text, position)
        if match is None:
            rest = inner.part(position).strip()
            hint = "separate elements by ','; a string must end with the quote that starts it"
            diagnostics.error(
                f"element {len(elements) + 1} of the array is empty or has no closing quote", rest.source, hint
            )
            return None
        elements.append(inner.part(*match.span(1)))
        position = match.end()
        if not match.group().endswith(","):
            break
    return elements


def count_fault(kind: ArrayType | SequenceType, count: int) -> str:
    """Return the legal numbers of elements if an array cannot have `count` of them, or an empty text."""
    if isinstance(kind, ArrayType):
        return "" if count == kind.length else f"legal here: exactly {kind.length} elements"
    return "" if kind.bound is None or count <= kind.bound else f"legal here: at most {kind.bound} elements"


def scalar_of(text: str, kind: PrimitiveType | StringType, dialect: Dialect, has_quotes: bool) -> Scalar:
    """Return the value of `text`. Raise `ValueError`, with the legal values, if it is illegal.

    If `has_quotes`, quotes around a string are not part of its value.
    """
    if isinstance(kind, StringType):
        return _string(text, kind, has_quotes)
    if kind.name == "bool":
        return _boolean(text, dialect)
    if kind.name in dialect.integer_ranges:
        return _integer(text, kind, dialect)
    return _float(text, kind)


def _boolean(text: str, dialect: Dialect) -> bool:
    key = text.lower() if "true" in dialect.booleans else text
    if key not in dialect.booleans:
        raise ValueError(f"legal here: {', '.join(dialect.booleans)}")
    return dialect.booleans[key]


def _integer(text: str, kind: PrimitiveType, dialect: Dialect) -> int:
    smallest, largest = dialect.integer_ranges[kind.name]
    try:
        value = _whole_number(text, dialect)
    except ValueError:
        radix = "decimal, 0x, 0o or 0b" if dialect.has_integer_prefixes else "decimal"
        raise ValueError(f"legal here: whole numbers ({radix}) from {smallest} to {largest}") from None
    if not smallest <= value <= largest:
        raise ValueError(f"legal here: {smallest} to {largest}")
    return value


def _whole_number(text: str, dialect: Dialect) -> int:
    try:
        return int(text)  # decimal first: both reference parsers read `010` as ten
    except ValueError:
        if not dialect.has_integer_prefixes:
            raise
        return int(text, 0)


def _float(text: str, kind: PrimitiveType) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError("legal here: inf, nan, and numbers with '.' as the decimal separator") from None
    try:
        struct.pack("<f" if kind.name == "float32" else "<d", value)
    except OverflowError:
        raise ValueError("the largest float32 is 3.4028235e+38") from None
    return value


def _string(text: str, kind: StringType, has_quotes: bool) -> str:
    value = _unquoted(text) if has_quotes else text
    if kind.bound is not None and len(value) > kind.bound:
        raise ValueError(f"legal here: at most {kind.bound} characters, not {len(value)}")
    return value


def _unquoted(text: str) -> str:
    """Return a text without surrounding quotes; a text without quotes at both ends is unchanged."""
    for quote in _QUOTES:
        if text.startswith(quote) and text.endswith(quote):
            inner = text[1:-1]
            if re.search(rf"(?<!\\){quote}", inner):
                raise ValueError(f"write a {quote} within the quotes as \\{quote}")
            return inner.replace(f"\\{quote}", quote)
    return text
