"""Encode a message, given as nested dictionaries and lists, as payload bytes."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from fusesoc_firm.frame.model import COUNT_BYTES, Data, DataKind, Fixed, Frame, Loop, Node, Pad
from fusesoc_firm.frame.values import (
    BytesLike,
    CodecError,
    MessageValue,
    check_bound,
    dotted,
    leaf_of,
    packed,
    part_of,
    reject_unknown,
    shown,
    units_of,
)
from fusesoc_firm.message.wire import WireType


def encode(frame: Frame, message: MessageValue) -> bytes:
    """Return the payload of `message`; padding bytes are zero.

    A missing field is encoded with its default. Arrays are lists or tuples; `uint8` arrays may also be bytes.

    Raises:
        CodecError: a field has neither value nor default, a value does not fit, or a name is unknown.
    """
    reject_unknown(frame, message)
    writer = _Writer(len(frame.prefix))
    writer.write(frame.nodes, message, 0)
    writer.payload[: len(frame.prefix)] = frame.prefix
    return bytes(writer.payload)


class _Writer:
    """The payload so far; alignment counts from the end of the prefix, which has `prefix_bytes` bytes."""

    def __init__(self, prefix_bytes: int) -> None:
        self.payload = bytearray()
        self._prefix_bytes = prefix_bytes

    def write(self, nodes: Sequence[Node], value: Any, depth: int) -> None:
        """Append the parts of `value` that `nodes` describe.

        The first `depth` names of the nodes' paths lead to `value`.
        """
        for node in nodes:
            match node:
                case Fixed():
                    self._fixed(node, value, depth)
                case Pad(alignment):
                    self._align(alignment)
                case Data():
                    self._data(node, part_of(value, node, depth))
                case Loop():
                    self._loop(node, part_of(value, node, depth))

    def _fixed(self, node: Fixed, value: Any, depth: int) -> None:
        start = len(self.payload)
        self.payload += bytes(node.size)
        for leaf in node.fields:
            elements = leaf_of(value, leaf, depth)[leaf.first :]
            taken = 0
            for run in leaf.runs:
                data = _pack(leaf.type, elements[taken : taken + run.count], leaf.names)
                offset = start + run.offset
                self.payload[offset : offset + len(data)] = data
                taken += run.count

    def _align(self, alignment: int) -> None:
        self.payload += bytes((self._prefix_bytes - len(self.payload)) % alignment)

    def _data(self, node: Data, value: Any) -> None:
        data = _pack_array(node, value) if node.kind is DataKind.ARRAY else units_of(node, value)
        count = len(data) // node.element.size
        check_bound(node, count)
        self._count(count + node.terminator)
        if count and node.padding is None:
            self._align(node.alignment)
        elif count and node.padding:
            self.payload += bytes(node.padding)
        self.payload += data
        self.payload += bytes(node.terminator)

    def _loop(self, node: Loop, value: Any) -> None:
        if not isinstance(value, list | tuple) or node.count not in (None, len(value)):
            length = "" if node.count is None else f" of {node.count}"
            raise CodecError(f"'{dotted(node.names)}' must be a list{length}, not {shown(value)}")
        check_bound(node, len(value))
        if node.count is None:
            self._count(len(value))
        if node.number and len(node.body) == 1:
            self.payload += _pack(node.number.type, value, node.names)
            return
        for element in value:
            self.write(node.body, element, len(node.path))

    def _count(self, count: int) -> None:
        self.payload += count.to_bytes(COUNT_BYTES, "little")


def _pack_array(node: Data, value: Any) -> BytesLike:
    if node.element.code == "B" and isinstance(value, BytesLike):
        return value
    if not isinstance(value, list | tuple):
        raise CodecError(f"'{dotted(node.names)}' must be a list, not {shown(value)}")
    return _pack(node.element, value, node.names)


def _pack(type_: WireType, values: Sequence[Any], names: tuple[str, ...]) -> bytes:
    """Return the bytes of the values in sequence. Raise `CodecError` for the first value that does not fit."""
    try:
        return _packed(type_, values)
    except (struct.error, OverflowError, TypeError, ValueError):
        for value in values:
            try:
                _packed(type_, [value])
            except (struct.error, OverflowError, TypeError, ValueError) as error:
                raise CodecError(f"'{dotted(names)}' must be of type {type_.name}, not {shown(value)}") from error
        raise


def _packed(type_: WireType, values: Sequence[Any]) -> bytes:
    # `struct` accepts any value as a bool, and would encode the text "False" as true.
    if type_.code == "?" and any(value not in (False, True) for value in values):
        raise TypeError
    return packed(type_.code, values)
