"""Encode a message, given as nested dictionaries and lists, as payload bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from fusesoc_firm.frame.model import MOST_EMPTY_ELEMENTS, Data, DataKind, Fixed, Frame, Loop, Node, Pad, has_bytes
from fusesoc_firm.frame.values import (
    BytesLike,
    CodecError,
    MessageValue,
    check_bound,
    dotted,
    leaf_of,
    listed,
    packed,
    part_of,
    put,
    put_leaf,
    reject_unknown,
    shown,
    units_of,
)
from fusesoc_firm.message.wire import WireType


@lru_cache(maxsize=1024)
def encoder(frame: Frame) -> Callable[[Any], bytes]:
    """Return the generated function that encodes complete messages (`encoder_source`)."""
    # Imported only on use: NumPy is slow to import.
    from fusesoc_firm.frame.encoder_source import encoder_of

    return encoder_of(frame)


def encode(frame: Frame, message: MessageValue) -> bytes:
    """Return the payload of `message`; padding bytes are zero.

    A missing field is encoded with its default. Arrays are lists, tuples or NumPy arrays; `uint8` arrays may also be
    bytes.

    Raises:
        CodecError: a field has neither value nor default, a value does not fit, or a name is unknown.
    """
    write = encoder(frame)
    try:
        return write(message)
    except Exception:  # noqa: BLE001 - a value of any type may raise any exception
        reject_unknown(frame, message)
        return write(_checked(frame.nodes, message, 0))


def _checked(nodes: Sequence[Node], value: Any, depth: int) -> Any:
    """Return a message, or an element at the end of `depth` names, as the generated encoder accepts it.

    The result has all fields, and no other names. Raise `CodecError` for the first value that does not fit.
    """
    checked: dict[str, Any] = {}
    for node in nodes:
        match node:
            case Fixed():
                for leaf in node.fields:
                    if leaf.first == 0:
                        elements = _numbers(leaf.type, leaf_of(value, leaf, depth), leaf.names)
                        put_leaf(checked, leaf.path[depth:], iter(elements))
            case Data() | Loop():
                part = part_of(value, node, depth)
                found = _data(node, part) if isinstance(node, Data) else _loop(node, part)
                if len(node.path) == depth:
                    return found  # the element is a string
                put(checked, node.path[depth:], found)
            case Pad():
                pass
    return checked


def _data(node: Data, value: Any) -> Any:
    if node.kind is not DataKind.ARRAY:
        check_bound(node, len(units_of(node, value)) // node.element.size)
        return value
    found: Sequence[Any] = _array(node, value, "")
    check_bound(node, len(found))
    return found


def _loop(node: Loop, value: Any) -> Sequence[Any]:
    elements = _array(node, value, "" if node.count is None else f" of {node.count}")
    check_bound(node, len(elements))
    if not has_bytes(node.body) and len(elements) > MOST_EMPTY_ELEMENTS:
        raise empty_elements(node, len(elements))
    return elements if node.number else [_checked(node.body, element, len(node.path)) for element in elements]


def _array(node: Data | Loop, value: Any, length: str) -> Sequence[Any]:
    """Return the elements of an array, numbers after a check. Raise `CodecError` for a value that is not an array."""
    type_ = node.element if isinstance(node, Data) else node.number.type if node.number else None
    if type_ and type_.code == "B" and isinstance(node, Data) and isinstance(value, BytesLike):
        return bytes(value)
    elements = listed(value, type_)
    if not isinstance(elements, list | tuple) or (isinstance(node, Loop) and node.count not in (None, len(elements))):
        raise CodecError(f"'{dotted(node.names)}' must be a list{length}, not {shown(value)}")
    return _numbers(type_, elements, node.names) if type_ else elements


def _numbers(type_: WireType, values: Sequence[Any], names: tuple[str, ...]) -> list[Any]:
    """Return the values, with bools of Python. Raise `CodecError` for the first one that does not fit."""
    try:
        return _fitting(type_, values)
    except (struct.error, OverflowError, TypeError, ValueError):
        for value in values:
            try:
                _fitting(type_, [value])
            except (struct.error, OverflowError, TypeError, ValueError) as error:
                raise CodecError(f"'{dotted(names)}' must be of type {type_.name}, not {shown(value)}") from error
        raise


def _fitting(type_: WireType, values: Sequence[Any]) -> list[Any]:
    packed(type_.code, values)
    if type_.code != "?":
        return [*values]
    # `struct` accepts any value as a bool, and would encode the text "False" as true.
    if any(value not in (False, True) for value in values):
        raise TypeError
    return [bool(value) for value in values]


def empty_elements(node: Loop, count: int) -> CodecError:
    """Return the error of an array with too many elements that have no bytes."""
    most = f"at most {MOST_EMPTY_ELEMENTS}, since its elements have no bytes"
    return CodecError(f"the length of '{dotted(node.names)}' must be {most}, not {count}")
