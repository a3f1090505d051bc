"""The stimuli of a new project: messages with different values in all fields.

In one message, strings and arrays are longer than a beat of the streams. This detects hardware that takes only the
first beat, or mixes up beats.
"""

from __future__ import annotations

import string
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import yaml

from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, Loop, Node
from fusesoc_firm.frame.values import put, put_leaf

_IS_LONG = (False, True, False)
_SHORT = 3
# The bytes of a 128-bit beat; strings are longer than necessary for narrower streams.
_BEAT = 16
_LETTERS = "_" + 2 * (string.ascii_letters + string.digits)


def first_stimuli(subscriber: str, frame: Frame, width: int) -> str:
    """Return the text of stimuli for streams of `width` bits."""
    beat = max(_BEAT, width // 8)
    values = (_Values(number, beat if is_long else 0) for number, is_long in enumerate(_IS_LONG))
    stimuli = [{subscriber: item.message(frame.nodes)} for item in values]
    # Without a style, the innermost parts are on one line each.
    return yaml.safe_dump(stimuli, sort_keys=False, width=120, default_flow_style=None)


@dataclass
class _Values:
    """The values of message `number`; strings and arrays are longer than `beat` bytes."""

    number: int
    beat: int
    _numbers: Iterator[int] = field(init=False)

    def __post_init__(self) -> None:
        self._numbers = count(self.number + 1)

    def message(self, nodes: Sequence[Node], depth: int = 0) -> dict[str, Any]:
        """Return a message, or an element at the end of `depth` names."""
        message: dict[str, Any] = {}
        for node in nodes:
            match node:
                case Fixed(fields=fields):
                    for leaf in fields:
                        if leaf.first == 0 and leaf.count:
                            put_leaf(message, leaf.path[depth:], self._scalars(leaf.type.name))
                case Data():
                    put(message, node.path[depth:], self._part(node))
                case Loop() if not node.number:
                    # A long array of numbers is omitted, so it is sent as zeros.
                    put(message, node.path[depth:], self._elements(node))
        return message

    def _part(self, part: Data) -> Any:
        most = _bounded(self.beat // part.element.size + _SHORT, part.bound)
        if part.kind is DataKind.ARRAY:
            numbers = self._scalars(part.element.name)
            return [next(numbers) for _ in range(most)]
        text = f"n{next(self._numbers)}"
        return f"{text}{_LETTERS if self.beat else ''}"[:most]

    def _elements(self, loop: Loop) -> list[Any]:
        size = sum(node.size if isinstance(node, Fixed) else self.beat for node in loop.body)
        wanted = self.beat // size + 1 + bool(self.beat) if size else 1
        elements = _bounded(wanted, loop.bound) if loop.count is None else loop.count
        if loop.text:
            return [self._part(loop.text) for _ in range(elements)]
        return [self.message(loop.body, len(loop.path)) for _ in range(elements)]

    def _scalars(self, type_: str) -> Iterator[bool | int | float]:
        """Return legal values for the elements of a field; only `bool` values repeat soon."""
        return (_scalar(type_, number) for number in count(next(self._numbers)))


def _bounded(size: int, bound: int | None) -> int:
    return size if bound is None else min(size, bound)


def _scalar(type_: str, number: int) -> bool | int | float:
    if type_ == "bool":
        return number % 2 == 1
    return number / 2 if type_.startswith("float") else number % 100
