"""Compute the bytes of fields without a value: defaults or zeros."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any

from fusesoc_firm.frame.decoder import decode
from fusesoc_firm.frame.encoder import encode
from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, FrameField, Loop, Node
from fusesoc_firm.frame.values import CodecError, MessageValue, leaf_of, part_of, put, put_leaf, without_arrays
from fusesoc_firm.message.model import Scalar


def default_bytes(node: Fixed) -> bytes:
    """Return the bytes of a `Fixed` with the defaults of all fields; all other bytes are zero.

    Every element of an array of messages has the defaults of its members.
    """
    data = bytearray(node.size)
    for leaf in node.fields:
        for offset, value in default_elements(leaf):
            data[offset : offset + len(value)] = value
    return bytes(data)


def default_elements(leaf: FrameField) -> Iterator[tuple[int, bytes]]:
    """Yield the offset and bytes of each element of a leaf in this node, if the leaf has a default."""
    if leaf.default is not None:
        given = leaf.default if isinstance(leaf.default, tuple) else (leaf.default,)
        for number, offset in enumerate(leaf.offsets, leaf.first):
            yield offset, struct.pack(f"<{leaf.type.code}", given[number % len(given)])


def default_payload(frame: Frame) -> bytes:
    """Return the payload of a fixed-size message in which all fields have their defaults."""
    payload = b"".join(default_bytes(node) for node in frame.nodes if isinstance(node, Fixed))
    return frame.prefix + payload[len(frame.prefix) :]


def encode_used(frame: Frame, message: MessageValue) -> bytes:
    """Return the payload that a publisher of the used fields sends.

    Unused fields, which may be missing in `message`, have their defaults. Raise `CodecError` like `encode`.
    """
    if not frame.is_fixed_size:
        return encode(frame, _as_sent(frame.nodes, message, 0))
    for leaf in frame.fields:
        if leaf.is_used:
            leaf_of(message, leaf, 0)
    defaults = default_payload(frame)
    payload = bytearray(encode(frame, _filled(decode(frame, defaults), message)))
    for leaf in frame.fields:
        if not leaf.is_used:
            for offset in leaf.offsets:
                payload[offset : offset + leaf.type.size] = defaults[offset : offset + leaf.type.size]
    return bytes(payload)


def encode_answer(frame: Frame, message: MessageValue) -> bytes:
    """Return the payload of a message that a user's code computed.

    Missing fields are filled in as by `completed`, and sequences may be arrays of NumPy. Raise `CodecError` like
    `encode`.
    """
    return encode_used(frame, completed(frame, without_arrays(message)))


def completed(frame: Frame, message: MessageValue) -> MessageValue:
    """Return the message with missing fields filled in: defaults, zeros or empty values."""
    filled: MessageValue = _filled(_whole(frame.nodes, message, 0), message)
    return filled


def _whole(nodes: Sequence[Node], value: Any, depth: int) -> dict[str, Any]:
    """Return the values of all fields of a message, or of an element at the end of `depth` names.

    Fields have their defaults, zero or empty, and variable parts the number of elements in `value`.
    """
    sent: dict[str, Any] = {}
    for node in nodes:
        if isinstance(node, Fixed):
            for leaf in node.fields:
                if leaf.count:
                    put_leaf(sent, leaf.path[depth:], _defaults(leaf))
        elif isinstance(node, Data | Loop):
            put(sent, node.path[depth:], _whole_part(node, value, depth))
    return sent


def _whole_part(node: Data | Loop, value: Any, depth: int) -> Any:
    try:
        given = part_of(value, node, depth)
    except CodecError:
        return _part_as_sent(node, _whole)
    if isinstance(node, Loop) and isinstance(given, list | tuple) and node.has_fields:
        return [_whole(node.body, item, len(node.path)) for item in given]
    return given


def _as_sent(nodes: Sequence[Node], value: Any, depth: int) -> Any:
    """Return a message, or an element at the end of `depth` names, with unused parts at their defaults or empty."""
    sent: dict[str, Any] = deepcopy(dict(value)) if isinstance(value, Mapping) else {}
    for node in nodes:
        match node:
            case Fixed(fields=fields):
                for leaf in fields:
                    if not leaf.is_used and leaf.count:
                        put_leaf(sent, leaf.path[depth:], _defaults(leaf))
            case Data() | Loop() if not node.is_used:
                put(sent, node.path[depth:], _part_as_sent(node, _as_sent))
            case Loop():
                elements = part_of(value, node, depth)
                if isinstance(elements, list | tuple) and node.has_fields:
                    put(sent, node.path[depth:], [_as_sent(node.body, item, len(node.path)) for item in elements])
    return sent


def _part_as_sent(node: Data | Loop, element_of: Callable[[Sequence[Node], Any, int], Any]) -> Any:
    """Return the value sent for a part without a value."""
    if node.default is not None:
        return node.default
    if isinstance(node, Data):
        return [] if node.kind is DataKind.ARRAY else ""
    if node.number:
        element: Any = next(_defaults(node.number))
    else:
        element = "" if node.text else element_of(node.body, {}, len(node.path))
    return [element] * (node.count or 0)


def _defaults(leaf: FrameField) -> Iterator[Scalar]:
    """Yield the values of an unused leaf's elements."""
    given = leaf.default if isinstance(leaf.default, tuple) else (0 if leaf.default is None else leaf.default,)
    values = (given[number % len(given)] for number in range(leaf.count))
    return (bool(value) if leaf.type.code == "?" else value for value in values)


def _filled(default: Any, value: Any) -> Any:
    """Return `value` with missing parts filled in from `default`."""
    if isinstance(default, Mapping) and isinstance(value, Mapping):
        filled = {name: _filled(inner, value[name]) for name, inner in default.items() if name in value}
        return {**default, **value, **filled}
    if isinstance(default, list) and isinstance(value, list | tuple) and len(default) == len(value):
        return [_filled(*pair) for pair in zip(default, value, strict=True)]
    return value
