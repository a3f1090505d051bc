"""Message values as nested dictionaries and lists: access by the paths of a Frame, and conversion of texts to units.

A text is a `str`. Bytes that are not UTF-8, and unpaired UTF-16 units, are kept as lone surrogates.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from reprlib import Repr
from typing import Any

from fusesoc_firm.frame.model import Data, DataKind, Frame, FrameField, Loop, NameTree, Path
from fusesoc_firm.message.wire import WireType
from fusesoc_firm.text.diagnostics import closest

MessageValue = Mapping[str, Any]
BytesLike = bytes | bytearray | memoryview
_MISSING = object()

_repr = Repr()
_repr.maxstring = _repr.maxother = _repr.maxlong = 60


_LEGAL = {
    "bool": "legal here: True, False",
    **dict.fromkeys(("float32", "float64"), "legal here: numbers"),
    **dict.fromkeys(("string", "wstring"), "legal here: texts (str)"),
}


class CodecError(ValueError):
    """A value that does not fit its message, or bytes that do not fit their frame."""

    @property
    def field(self) -> str:
        """The last name of the field in the text, or "" if the text names none."""
        found = re.search(r"'(?:[^' ]+\.)?(\w+)'", str(self))
        return found[1] if found else ""

    @property
    def hint(self) -> str:
        """The legal values, if the text names a field and its type, or an empty text."""
        if " must be a mapping of fields" in str(self):
            return "legal here: a mapping, such as {'x': 1.0, 'y': 2.0}"
        found = re.search(r"must be of type (\w+),", str(self))
        name = found[1] if found else ""
        if bits := re.fullmatch(r"(u?)int(\d+)", name):
            is_signed, size = not bits[1], int(bits[2])
            least, most = (-(2 ** (size - 1)), 2 ** (size - 1) - 1) if is_signed else (0, 2**size - 1)
            return f"legal here: integers from {least} to {most}"
        return _LEGAL.get(name, "")


class SignallingNan(float):
    """A signalling NaN of a float32; conversion to a double, Python's float, would make it a quiet NaN.

    The value prints and calculates like any other NaN; `bits` are the bits on the wire.
    """

    bits: int

    def __new__(cls, bits: int) -> SignallingNan:
        """Create the NaN with these 32 bits."""
        made = super().__new__(cls, "nan")
        made.bits = bits
        return made

    def __getnewargs__(self) -> tuple[int]:
        """Return the arguments of `__new__` for a copy."""
        return (self.bits,)


def packed(code: str, values: Sequence[Any]) -> bytes:
    """Pack numbers into bytes, in sequence; `code` is a `struct` format code. May raise the errors of `struct`."""
    data = struct.pack(f"<{len(values)}{code}", *values)
    if code != "f" or SignallingNan not in {*map(type, values)}:
        return data
    words = struct.unpack(f"<{len(values)}I", data)
    kept = (value.bits if isinstance(value, SignallingNan) else word for value, word in zip(values, words, strict=True))
    return struct.pack(f"<{len(values)}I", *kept)


def unpacked(code: str, data: bytes) -> Sequence[Any]:
    """Unpack the numbers in `data`; `packed` converts them back to the same bytes."""
    numbers = struct.unpack(f"<{len(data) // struct.calcsize(code)}{code}", data)
    if code != "f" or struct.pack(f"<{len(numbers)}f", *numbers) == data:
        return numbers
    words = struct.unpack(f"<{len(numbers)}I", data)
    return [SignallingNan(word) if _is_signalling(word) else n for n, word in zip(numbers, words, strict=True)]


def _is_signalling(word: int) -> bool:
    """Return whether the bits of a float32 are those of a signalling NaN."""
    return word & 0x7FC00000 == 0x7F800000 and word & 0x003FFFFF != 0


def shown(value: object) -> str:
    """Return the text of a value in error messages; long values are shortened."""
    return _repr.repr(value)


def dotted(names: tuple[str, ...]) -> str:
    """Return the names as a dotted path."""
    return ".".join(names)


def part_of(value: Any, part: Data | Loop, depth: int) -> Any:
    """Return the value or default of `part` within `value`; `depth` is the number of names above `value`."""
    for step in part.path[depth:]:
        value = _member(value, step.name)
        if value is _MISSING:
            return _default(part)
    return value


def leaf_of(value: Any, leaf: FrameField, depth: int) -> list[Any]:
    """Return every element of `leaf` in `value`, in wire order."""
    return list(_elements(value, leaf.path[depth:], leaf))


def put(message: dict[str, Any], path: Path, value: Any) -> None:
    """Store a value at `path`, which contains no arrays."""
    for step in path[:-1]:
        message = message.setdefault(step.name, {})
    message[path[-1].name] = value


def put_leaf(message: dict[str, Any], path: Path, elements: Iterator[Any]) -> None:
    """Store all elements of a leaf, given in wire order, at `path`."""
    step, rest = path[0], path[1:]
    if not rest:
        message[step.name] = next(elements) if step.count is None else [next(elements) for _ in range(step.count)]
    elif step.count is None:
        put_leaf(message.setdefault(step.name, {}), rest, elements)
    else:
        for element in message.setdefault(step.name, [{} for _ in range(step.count)]):
            put_leaf(element, rest, elements)


def reject_unknown(frame: Frame, message: MessageValue) -> None:
    """Raise `CodecError` for an unknown name that contains values."""
    for names in _unknown(message, frame.names, ()):
        near = closest(*_first_unknown(names, frame.names))
        meant = f"; did you mean '{near}'?" if near else ""
        raise CodecError(f"{frame.message} has no field '{dotted(names)}'{meant}")


def _first_unknown(names: tuple[str, ...], known: NameTree) -> tuple[str, NameTree]:
    """Return the first name that is unknown, and the names that are known in its place."""
    for name in names:
        if name not in known:
            return name, known
        known = known[name]
    return names[-1], {}


def without_arrays(value: Any) -> Any:
    """Return a message in which arrays and numbers of NumPy are lists and numbers of Python."""
    if isinstance(value, Mapping):
        return {name: without_arrays(inner) for name, inner in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    # Lists of numbers, such as an image's, may be long.
    has_more = (
        isinstance(value, list | tuple) and value and (isinstance(value[0], Mapping) or hasattr(value[0], "tolist"))
    )
    return [without_arrays(item) for item in value] if has_more else value


def listed(value: Any, type_: WireType | None) -> Any:
    """Return an array, such as one of NumPy, as a list; the numbers of an array of `type_` keep their bits."""
    if not hasattr(value, "tolist"):
        return value
    if type_ and getattr(value, "dtype", None) == f"<{type_.code}" and value.ndim == 1:
        return [*unpacked(type_.code, value.tobytes())]
    return value.tolist()


def units_of(data: Data, text: object) -> BytesLike:
    """Return the bytes of a text on the wire, without count and terminator. Raise `CodecError` for any other value."""
    if not isinstance(text, str):
        raise CodecError(f"'{dotted(data.names)}' must be of type {data.kind.value}, not {shown(text)}")
    try:
        if data.kind is DataKind.STRING:
            return text.encode("utf-8", "surrogateescape")
        units = text.encode("utf-16-le", "surrogatepass")
    except UnicodeEncodeError as error:
        raise CodecError(f"'{dotted(data.names)}' cannot contain a lone surrogate: {shown(text)}") from error
    count = len(units) // 2
    return struct.pack(f"<{count}I", *struct.unpack(f"<{count}H", units))


def text_of(data: Data, units: bytes) -> str:
    """Return the text that was sent as `units`."""
    if data.kind is DataKind.STRING:
        return units.decode("utf-8", "surrogateescape")
    count = len(units) // data.element.size
    numbers = struct.unpack(f"<{count}{data.element.code}", units)
    try:
        return struct.pack(f"<{count}H", *numbers).decode("utf-16-le", "surrogatepass")
    except struct.error:
        raise CodecError(f"'{dotted(data.names)}' contains a unit that is not UTF-16: {max(numbers):#x}") from None


def check_bound(part: Data | Loop, count: int) -> None:
    """Raise `CodecError` if `count` exceeds the bound in the definition."""
    if part.bound is not None and count > part.bound:
        raise CodecError(f"the length of '{dotted(part.names)}' must be at most {part.bound}, not {count}")


def _member(value: Any, name: str) -> Any:
    """Return the member `name`, or `_MISSING`; a missing message has no members, but its fields may have defaults."""
    if value is _MISSING:
        return _MISSING
    if not isinstance(value, Mapping):
        raise CodecError(f"the message with the field '{name}' must be a mapping of fields, not {shown(value)}")
    return value.get(name, _MISSING)


def _default(part: FrameField | Data | Loop) -> Any:
    if part.default is None:
        raise _no_value(part)
    return part.default


def _no_value(part: FrameField | Data | Loop) -> CodecError:
    return CodecError(f"no value for '{dotted(part.names)}'")


def _elements(value: Any, path: Path, leaf: FrameField) -> Iterator[Any]:
    if not path:
        yield value
        return
    step, rest = path[0], path[1:]
    inner = _member(value, step.name)
    if inner is _MISSING and not rest:
        inner = _default(leaf)
    elif inner is _MISSING and step.count is not None:
        # An array of messages has no default, even if its elements consist of defaults.
        raise _no_value(leaf)
    if step.count is None:
        yield from _elements(inner, rest, leaf)
        return
    inner = inner if rest else listed(inner, leaf.type)
    is_array = isinstance(inner, list | tuple) or (not rest and leaf.type.code == "B" and isinstance(inner, BytesLike))
    if not is_array or len(inner) != step.count:
        raise CodecError(f"'{step.name}' must be a list of {step.count}, not {shown(inner)}")
    if not rest:
        yield from inner
        return
    for element in inner:
        yield from _elements(element, rest, leaf)


def _unknown(value: Any, known: NameTree, names: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield the names that are not in `known`; the values of leaves are not examined."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            here = (*names, str(name))
            if name not in known:
                yield from _leaves(inner, here)
            elif known[name]:
                yield from _unknown(inner, known[name], here)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _unknown(inner, known, names)


def _leaves(value: Any, names: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield the names on the path to each value; empty messages and arrays without elements contain no values."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(inner, (*names, str(name)))
    elif isinstance(value, list | tuple) and (not value or isinstance(value[0], Mapping)):
        for inner in value:
            yield from _leaves(inner, names)
    else:
        yield names
