"""What is sent for a field that nobody gives a value: its default, or zeros."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from fusesoc_firm.frame.model import Fixed, FrameField
from fusesoc_firm.message.model import Scalar


def default_bytes(node: Fixed) -> bytes:
    """The bytes of a `Fixed` whose fields all have their defaults; zeros where there is none, in padding and prefix.

    Every element of an array of messages has the defaults of its members.
    """
    data = bytearray(node.size)
    for leaf in node.fields:
        if leaf.default is not None:
            given = leaf.default if isinstance(leaf.default, tuple) else (leaf.default,)
            for number, offset in enumerate(leaf.offsets, leaf.first):
                data[offset : offset + leaf.type.size] = _packed(leaf, given, number)
    return bytes(data)


def _packed(leaf: FrameField, given: Sequence[Scalar], number: int) -> bytes:
    return struct.pack(f"<{leaf.type.code}", given[number % len(given)])
