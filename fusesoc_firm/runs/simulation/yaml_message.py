"""Read a message written in YAML, check each value against its type, and report each fault at its place.

The message's types, not YAML's rules, determine the values: to PyYAML, `1e-3` is text and `1` is an integer, but both
are legal for a float64.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import yaml

from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, Loop, Path, all_nodes
from fusesoc_firm.frame.values import CodecError, check_bound, units_of
from fusesoc_firm.message.wire import WireType
from fusesoc_firm.text.diagnostics import Diagnostics, nearest
from fusesoc_firm.text.yaml_text import YamlText, is_null, items, kind

# Fields of times, each with its name in the other version of ROS.
_OF_OTHER_ROS = {"nsec": "nanosec", "nanosec": "nsec", "nsecs": "nsec", "secs": "sec"}
_SPECIAL_FLOAT = re.compile(r"([-+]?)\.?(inf|infinity|nan)", re.IGNORECASE)


@dataclass
class _Branch:
    """A field, each element of which is a value of `type`, a `text`, or a message with `fields`.

    An array of fixed size has `count` elements; `array` describes an array of variable size.
    """

    count: int | None = None
    array: Data | Loop | None = None
    type: WireType | None = None
    text: Data | None = None
    fields: dict[str, _Branch] = field(default_factory=dict)

    def at(self, path: Path) -> _Branch:
        """Return the field at a path."""
        branch = self
        for step in path:
            branch = branch.fields.setdefault(step.name, _Branch(step.count))
        return branch


def read_message(text: YamlText, node: yaml.Node, frame: Frame, faults: Diagnostics) -> dict[str, Any]:
    """Return the message of `frame` in a node; note faults and omit the faulty values.

    Fields may be missing, and so may be all of them.
    """
    if is_null(node):
        return {}
    reader = _Reader(text, faults, str(frame.message))
    return reader.message(node, _tree(frame), "")


def _tree(frame: Frame) -> _Branch:
    root = _Branch()
    for node in all_nodes(frame.nodes):
        match node:
            case Fixed(fields=fields):
                for leaf in fields:
                    root.at(leaf.path).type = leaf.type
            case Data(kind=DataKind.ARRAY):
                branch = root.at(node.path)
                branch.array, branch.type = node, node.element
            case Data():
                root.at(node.path).text = node
            case Loop():
                branch = root.at(node.path)
                branch.count, branch.array = node.count, node
    return root


@dataclass(frozen=True)
class _Reader:
    """A reader for one message; `name` is the message's name in faults that concern the whole message."""

    text: YamlText
    faults: Diagnostics
    name: str

    def message(self, node: yaml.Node, branch: _Branch, path: str) -> dict[str, Any]:
        """Return the message at `path`, which is empty for the whole message."""
        what = f"'{path}'" if path else f"a {self.name}"
        if not isinstance(node, yaml.MappingNode):
            self._error(f"{what} must be a mapping of fields, not {kind(node)}", node, _as_mapping(node, branch))
            return {}
        found: dict[str, Any] = {}
        for key, key_node, value in items(self.text, node, self.faults):
            if key in branch.fields:
                found[str(key)] = self._field(value, branch.fields[key], f"{path}.{key}" if path else str(key))
            else:
                near = _OF_OTHER_ROS.get(key, "")
                hint = f"did you mean '{near}'?" if near in branch.fields else nearest(key, branch.fields)
                if key.isdigit() and is_null(value):
                    hint = "a decimal number has a point: 0.5"
                self._error(f"{what} has no field '{key}'", key_node, hint)
        return found

    def _field(self, node: yaml.Node, branch: _Branch, path: str) -> Any:
        if branch.count is None and branch.array is None:
            return self._element(node, branch, path)
        size = "" if branch.count is None else f" of {branch.count}"
        if not isinstance(node, yaml.SequenceNode):
            hint = f"write [{node.value}, ...]" if isinstance(node, yaml.ScalarNode) and not is_null(node) else ""
            self._error(f"'{path}' must be a list{size}, not {kind(node)}", node, hint)
            return None
        if branch.count is not None and len(node.value) != branch.count:
            self._error(f"'{path}' must be a list{size}, not of {len(node.value)}", node)
        elif branch.array is not None:
            self._check_bound(branch.array, len(node.value), node)
        return [self._element(item, branch, f"{path}[{number}]") for number, item in enumerate(node.value)]

    def _element(self, node: yaml.Node, branch: _Branch, path: str) -> Any:
        if branch.text is not None:
            return self._text(node, branch.text, path)
        if branch.type is None:
            return self.message(node, branch, path)
        if not isinstance(node, yaml.ScalarNode) or is_null(node) or node.style:
            self._error(f"'{path}' must be of type {branch.type.name}, not {kind(node)}", node)
            return None
        try:
            return _value(str(node.value), branch.type)
        except ValueError as error:
            self._error(f"'{path}' must be of type {branch.type.name}, not '{node.value}'", node, str(error))
            return None

    def _text(self, node: yaml.Node, text: Data, path: str) -> str | None:
        if not isinstance(node, yaml.ScalarNode) or is_null(node):
            self._error(
                f"'{path}' must be of type {text.kind.value}, not {kind(node)}", node, "write an empty text as ''"
            )
            return None
        self._check_bound(text, len(units_of(text, node.value)) // text.element.size, node)
        return str(node.value)

    def _check_bound(self, part: Data | Loop, count: int, node: yaml.Node) -> None:
        try:
            check_bound(part, count)
        except CodecError as error:
            self._error(str(error), node)

    def _error(self, message: str, node: yaml.Node, hint: str = "") -> None:
        self.faults.error(message, self.text.source(node), hint)


def _as_mapping(node: yaml.Node, branch: _Branch) -> str:
    """Return a hint with the mapping that a value means: its list with the names of the fields, or these names."""
    values = node.value if isinstance(node, yaml.SequenceNode) else ()
    if len(values) != len(branch.fields) or not all(isinstance(item, yaml.ScalarNode) for item in values):
        return f"legal fields: {', '.join(branch.fields)}"
    pairs = (f"{name}: {item.value}" for name, item in zip(branch.fields, values, strict=True))
    return f"write {{{', '.join(pairs)}}}"


def _value(text: str, type_: WireType) -> bool | int | float:
    """Return the value of a text. Raise `ValueError`, with the legal values, if the text is illegal."""
    if type_.code == "?":
        return _boolean(text)
    return _float(text, type_) if type_.code in "fd" else _integer(text, type_)


def _boolean(text: str) -> bool:
    words: Mapping[str, bool] = {"true": True, "false": False}
    if text.lower() not in words:
        raise ValueError("legal here: true, false")
    return words[text.lower()]


def _integer(text: str, type_: WireType) -> int:
    is_signed = type_.code.islower()
    bits = 8 * type_.size
    least, most = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if is_signed else (0, 2**bits - 1)
    legal = f"legal here: {least} to {most}"
    try:
        # This rejects `017`, which YAML reads as 15 and most people as 17.
        value = int(text, 0)
    except ValueError:
        raise ValueError(legal) from None
    if not least <= value <= most:
        raise ValueError(legal)
    return value


def _float(text: str, type_: WireType) -> float:
    if special := _SPECIAL_FLOAT.fullmatch(text):
        return float("".join(special.groups()))
    try:
        value = float(text)
        is_too_large = math.isinf(struct.unpack(f"<{type_.code}", struct.pack(f"<{type_.code}", value))[0])
    except ValueError:
        raise ValueError("legal here: numbers such as 1, -0.5, 1e-3, .inf, .nan; YAML does not calculate") from None
    except OverflowError:
        is_too_large = True
    if is_too_large:
        raise ValueError("the number is too large; write infinity as .inf")
    return value
