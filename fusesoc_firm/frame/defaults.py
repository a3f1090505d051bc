"""What is sent for a field that nobody gives a value: its default, or zeros."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any

from fusesoc_firm.frame.decoder import decode
from fusesoc_firm.frame.encoder import encode
from fusesoc_firm.frame.model import Fixed, Frame, FrameField
from fusesoc_firm.frame.values import MessageValue, leaf_of


def default_bytes(node: Fixed) -> bytes:
    """The bytes of a `Fixed` whose fields all have their defaults; zeros where there is none, in padding and prefix.

    Every element of an array of messages has the defaults of its members.
    """
    data = bytearray(node.size)
    for leaf in node.fields:
        for offset, value in default_elements(leaf):
            data[offset : offset + len(value)] = value
    return bytes(data)


def default_elements(leaf: FrameField) -> Iterator[tuple[int, bytes]]:
    """The offset and bytes of each element of a leaf that lies here, if it has a default."""
    if leaf.default is not None:
        given = leaf.default if isinstance(leaf.default, tuple) else (leaf.default,)
        for number, offset in enumerate(leaf.offsets, leaf.first):
            yield offset, struct.pack(f"<{leaf.type.code}", given[number % len(given)])


def default_payload(frame: Frame) -> bytes:
    """The payload of a message of fixed size whose fields all have their defaults."""
    payload = b"".join(default_bytes(node) for node in frame.nodes if isinstance(node, Fixed))
    return frame.prefix + payload[len(frame.prefix) :]


def encode_used(frame: Frame, message: MessageValue) -> bytes:
    """The payload that a publisher of the used fields sends: the other ones, which may be missing, as defaults.

    The message has a fixed size. Raises `CodecError` as `encode` does.
    """
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


def _filled(default: Any, value: Any) -> Any:
    """`value` with what is missing in it from `default`."""
    if isinstance(default, Mapping) and isinstance(value, Mapping):
        filled = {name: _filled(inner, value[name]) for name, inner in default.items() if name in value}
        return {**default, **value, **filled}
    if isinstance(default, list) and isinstance(value, list | tuple) and len(default) == len(value):
        return [_filled(*pair) for pair in zip(default, value, strict=True)]
    return value
