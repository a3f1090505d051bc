"""Message -> configuration of its VHDL package: the signature and the constants, in the types of converters' ports.

ROS messages have constants instead of enumerations. The package also contains the constants of nested messages,
prefixed with the nested message's name: `PointField.INT8` is `POINTFIELD_INT8` in the package of PointCloud2.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from fusesoc_firm.converter.vhdl import vhdl_type, wrapped
from fusesoc_firm.frame.model import COUNT_BYTES
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.model import Constant, MessageName, StringType, nested_message
from fusesoc_firm.message.signature import signature
from fusesoc_firm.message.wire import CHARACTER, WIDE_CHARACTER
from fusesoc_firm.text.naming import distinct_constants, entity_name, prefixed

CONSTANTS_TEMPLATE = "vhdl/constants.vhd"
SIGNATURE = "SIGNATURE"

_LONGEST_LINE = 120
_LONGEST_EXPRESSION = 110
_CHARACTERS_A_PIECE = 100
_BYTES_A_PIECE = 50
_QUOTE = '"'


@dataclass(frozen=True)
class _Placed:
    """A constant with the nested message that defines it, or None if the package's own message does."""

    message: MessageName | None
    constant: Constant

    @property
    def words(self) -> tuple[str, ...]:
        """The words of the constant's name in VHDL."""
        return (self.constant.name,) if self.message is None else (self.message.name, self.constant.name)

    @property
    def comment(self) -> str:
        """The constant's type and ROS name, with the value of a number: `uint8 sensor_msgs/PointField.INT8=1`."""
        owner = "" if self.message is None else f"{self.message}."
        named = f"{self.constant.type} {owner}{self.constant.name}"
        return named if isinstance(self.constant.value, str) else f"{named}={_decimal(self.constant.value)}"


def constants_package(name: MessageName, ros: Middleware | None = None, prefix: str = "") -> str:
    """Return `<prefix>_<pkg>_<type>_pkg` or, where packages of both ROS versions coexist, `..._ros<N>_pkg`."""
    version = [] if ros is None else [f"ros{ros.number}"]
    return prefixed(prefix, "_".join([entity_name(name.package, name.name), *version, "pkg"]))


def constants_configuration(name: MessageName, definitions: Definitions, package: str) -> dict[str, Any]:
    """Return the configuration of a message's package; `definitions` contains the message and all nested messages."""
    placed = list(_placed(name, definitions))
    texts = [item for item in placed if isinstance(item.constant.type, StringType)]
    numbers = [item for item in placed if not isinstance(item.constant.type, StringType)]
    parts = [(*item.words, part) for item in texts for part in ("length", "bytes")]
    # Names from the definition take precedence over added names for texts.
    names = distinct_constants([*(item.words for item in (*numbers, *texts)), *parts], [SIGNATURE])
    values, heads = names[: len(numbers)], names[len(numbers) : len(placed)]
    lengths, contents = names[len(placed) :: 2], names[len(placed) + 1 :: 2]
    ros, sum_ = definitions[name].ros, signature(name, definitions)
    return {
        "package": package,
        "message": str(name),
        "middleware": ros.title,
        "signature": _declaration(SIGNATURE, f"string(1 to {len(sum_)})", _characters(sum_)),
        **_numbers([_value(item, own, ros) for item, own in zip(numbers, values, strict=True)]),
        "texts": [
            {"comment": item.comment, "declarations": _text(item, own)}
            for item, *own in zip(texts, heads, lengths, contents, strict=True)
        ],
    }


def _placed(name: MessageName, definitions: Definitions) -> Iterator[_Placed]:
    """Yield the constants of a message, then of each nested message once, in the order of the fields."""
    messages: list[MessageName] = []
    _collect(name, definitions, messages)
    for message in messages:
        for constant in definitions[message].constants:
            yield _Placed(None if message == name else message, constant)


def _collect(name: MessageName, definitions: Definitions, found: list[MessageName]) -> None:
    """Add a message and all messages nested in it to `found`, unless they are already there."""
    if name in found:
        return
    found.append(name)
    for field in definitions[name].fields:
        if nested := nested_message(field.type):
            _collect(nested, definitions, found)


def _value(item: _Placed, name: str, ros: Middleware) -> dict[str, Any]:
    """Return the configuration of a number or bool, with its value as the bits at a port."""
    wire = ros.rules.scalars[str(item.constant.type)]
    digits = struct.pack(f">{wire.code}", item.constant.value).hex()
    is_bit = wire.bits == 1
    return {
        "name": name,
        "type": vhdl_type(None if is_bit else wire.bits),
        "value": f"'{digits[-1]}'" if is_bit else f'x"{digits}"',
        "comment": item.comment,
    }


def _numbers(values: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the configuration of constants in columns.

    If a line would be too long, comments are above the constants.
    """
    columns = {key: max((len(item[key]) for item in values), default=0) for key in ("name", "type", "value", "comment")}
    aligned = [{**item, **{key: item[key].ljust(columns[key]) for key in ("name", "type")}} for item in values]
    return {"values": aligned, "is_above": sum(columns.values()) + len("  constant  :  := ; -- ") > _LONGEST_LINE}


def _text(item: _Placed, names: Sequence[str]) -> list[dict[str, Any]]:
    """Return a text's three constants: the string, the length, and the bytes as in a converter's stream."""
    characters = str(item.constant.value).encode()
    data = _wire_bytes(item)
    count = len(data) // (WIDE_CHARACTER.size if _is_wide(item) else CHARACTER.size)
    head, length, content = (name.ljust(max(map(len, names))) for name in names)
    declarations = [
        _declaration(head, f"string(1 to {len(characters)})", _characters(characters.decode("latin-1"))),
        _declaration(length, vhdl_type(8 * COUNT_BYTES), _bytes(count.to_bytes(COUNT_BYTES, "little"))),
    ]
    if data:  # Some tools reject a vector without bits.
        declarations.append(_declaration(content, vhdl_type(8 * len(data)), _bytes(data)))
    return declarations


def _is_wide(item: _Placed) -> bool:
    return isinstance(item.constant.type, StringType) and item.constant.type.is_wide


def _wire_bytes(item: _Placed) -> bytes:
    """Return the bytes of the text on the wire, without length and terminator."""
    text = str(item.constant.value)
    if not _is_wide(item):
        return text.encode()
    units = text.encode("utf-16-le")
    return b"".join(units[first : first + 2].ljust(WIDE_CHARACTER.size, b"\0") for first in range(0, len(units), 2))


def _declaration(name: str, type_: str, pieces: list[str]) -> dict[str, Any]:
    """Return a constant whose value is `pieces` joined with `&`, on one line or several."""
    lines = wrapped(pieces, "&", _LONGEST_EXPRESSION)
    length = len("  constant  :  := ;") + len(name) + len(type_) + len(lines[0])
    return {
        "name": name,
        "type": type_,
        "is_one_line": len(lines) == 1 and length <= _LONGEST_LINE,
        "lines": lines,
    }


def _characters(text: str) -> list[str]:
    """Return the pieces of a Latin-1 string: `"printable"`, and `character'val(10)` for any other character."""
    runs = groupby(text, key=lambda character: character.isascii() and character.isprintable())
    pieces = [piece for is_printable, run in runs for piece in (_quoted("".join(run)) if is_printable else _codes(run))]
    # Characters joined with `&` form a string only if an operand is a string, so the first operand is an empty string.
    return pieces if pieces and pieces[0].startswith(_QUOTE) else ['""', *pieces]


def _quoted(text: str) -> Iterator[str]:
    for first in range(0, len(text), _CHARACTERS_A_PIECE):
        yield f'"{text[first : first + _CHARACTERS_A_PIECE].replace(_QUOTE, 2 * _QUOTE)}"'


def _codes(characters: Iterable[str]) -> Iterator[str]:
    return (f"character'val({ord(character)})" for character in characters)


def _bytes(data: bytes) -> list[str]:
    """Return the pieces of a vector, with the first byte lowest."""
    digits, size = data[::-1].hex(), 2 * _BYTES_A_PIECE
    return [f'x"{digits[first : first + size]}"' for first in range(0, len(digits), size)]


def _decimal(value: bool | float) -> str:
    """Return a number as ROS writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
