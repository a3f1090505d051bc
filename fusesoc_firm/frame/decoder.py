"""Decode payload bytes to nested dictionaries and lists, and find the bytes that carry values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from fusesoc_firm.frame.model import COUNT_BYTES, Data, DataKind, Fixed, Frame, FrameField, Loop, Node, Pad, Path
from fusesoc_firm.frame.values import CodecError, check_bound, dotted, put, put_leaf, text_of, unpacked


def decode(frame: Frame, payload: bytes) -> dict[str, Any]:
    """Decode a payload. Numbers become Python numbers, arrays become lists, and `uint8` sequences become bytes.

    Bytes after a message of ROS 2 are ignored, as every reader of ROS 2 does.

    Raises:
        CodecError: the payload is too short or too long, has another encoding, or contains invalid values.
    """
    return _read(frame, payload)[0]


def used_bytes(frame: Frame, payload: bytes) -> bytes:
    """Return one byte for each byte of the payload: 1 for values, counts and the prefix, 0 for padding.

    Raise `CodecError` like `decode`.
    """
    used = bytearray(len(payload))
    for first, end, _ in _read(frame, payload)[1]:
        used[first:end] = b"\1" * (end - first)
    return bytes(used)


def field_at(frame: Frame, payload: bytes, offset: int) -> str:
    """Return the dotted name of the field with the byte at `offset`, or "" for the prefix and padding.

    Raise `CodecError` like `decode`.
    """
    return next((name for first, end, name in field_ranges(frame, payload) if first <= offset < end), "")


def field_ranges(frame: Frame, payload: bytes) -> Iterator[tuple[int, int, str]]:
    """Yield the (first, end) ranges of the bytes that carry values, with the field's dotted name, "" for the prefix.

    Raise `CodecError` like `decode`.
    """
    for first, end, names in _read(frame, payload)[1]:
        yield first, end, dotted(names)


def _read(frame: Frame, payload: bytes) -> tuple[dict[str, Any], list[tuple[int, int, tuple[str, ...]]]]:
    """Return the message, and the (first, end, names) ranges of the payload bytes that carry the message."""
    if frame.is_fixed_size and not _may_have(len(payload), frame.payload_bytes, frame):
        least = "at least " if frame.trailing_bytes else ""
        size = f"{least}{frame.payload_bytes} bytes, not {len(payload)}"
        raise CodecError(f"the payload of {frame.message} must have {size}")
    checked = payload[: frame.checked_prefix]
    if checked != frame.prefix[: frame.checked_prefix]:
        raise CodecError(f"the payload of {frame.message} has the unknown encoding {checked.hex()}")
    reader = _Reader(frame, payload)
    message = reader.read(frame.nodes, 0)
    if not _may_have(len(payload), reader.position, frame):
        raise CodecError(f"{frame.message} ends after {reader.position} bytes, but the payload has {len(payload)}")
    return message, reader.used


def _may_have(size: int, content: int, frame: Frame) -> bool:
    """Return whether a payload of `size` bytes may have a message of `content` bytes."""
    return size >= content if frame.trailing_bytes else size == content


class _Reader:
    """A reader at `position` in a payload; `used` lists the (first, end, names) ranges that carry values.

    The names are the path to the range's field; they are empty for the prefix.
    """

    def __init__(self, frame: Frame, payload: bytes) -> None:
        self.position = 0
        self.used: list[tuple[int, int, tuple[str, ...]]] = [(0, len(frame.prefix), ())]
        self._frame = frame
        self._payload = payload

    def read(self, nodes: Sequence[Node], depth: int) -> Any:
        """Read the message, or the loop's element, that `nodes` describe.

        `depth` is the number of names above the nodes.
        """
        message: dict[str, Any] = {}
        leaves: dict[Path, list[Any]] = {}
        for node in nodes:
            match node:
                case Fixed():
                    self._fixed(node, leaves)
                case Pad(alignment):
                    self._align(alignment)
                case Data() | Loop():
                    # Earlier leaves are stored first, so that a message contains its fields in wire order.
                    _put_leaves(message, leaves, depth)
                    value = self._data(node) if isinstance(node, Data) else self._loop(node)
                    if len(node.path) == depth:
                        return value  # the element is a string
                    put(message, node.path[depth:], value)
        for path, elements in leaves.items():
            if len(path) == depth:
                return elements[0]  # the element is a number
        _put_leaves(message, leaves, depth)
        return message

    def _fixed(self, node: Fixed, leaves: dict[Path, list[Any]]) -> None:
        start = self.position
        for leaf in node.fields:
            elements = leaves.setdefault(leaf.path, [])
            for run in leaf.runs:
                self.position = start + run.offset
                elements += self._numbers(leaf, run.count)
        self.position = start + node.size
        if self.position > len(self._payload):
            self._fail("")

    def _numbers(self, leaf: FrameField, count: int) -> Sequence[Any]:
        return unpacked(leaf.type.code, self._take(count * leaf.type.size, leaf.names))

    def _align(self, alignment: int) -> None:
        self.position += (len(self._frame.prefix) - self.position) % alignment

    def _data(self, node: Data) -> Any:
        count = self._count(node) - node.terminator
        if count < 0:
            raise CodecError(f"'{dotted(node.names)}' has no terminator")
        check_bound(node, count)
        if count and node.padding is None:
            self._align(node.alignment)
        elif count and node.padding:
            self.position += node.padding
        units = self._take(count * node.element.size, node.names)
        if any(self._take(node.terminator, node.names)):
            raise CodecError(f"'{dotted(node.names)}' does not end with a zero")
        if node.kind is not DataKind.ARRAY:
            return text_of(node, units)
        return units if node.element.code == "B" else [*unpacked(node.element.code, units)]

    def _loop(self, node: Loop) -> list[Any]:
        count = self._count(node) if node.count is None else node.count
        check_bound(node, count)
        if node.number and len(node.body) == 1:
            return list(self._numbers(node.number, count))
        return [self.read(node.body, len(node.path)) for _ in range(count)]

    def _count(self, node: Data | Loop) -> int:
        return int.from_bytes(self._take(COUNT_BYTES, node.names), "little")

    def _take(self, size: int, names: tuple[str, ...]) -> bytes:
        first, self.position = self.position, self.position + size
        if self.position > len(self._payload):
            self._fail(f" within '{dotted(names)}'")
        self.used.append((first, self.position, names))
        return self._payload[first : self.position]

    def _fail(self, where: str) -> None:
        raise CodecError(f"the payload of {self._frame.message} ends{where} after {len(self._payload)} bytes")


def _put_leaves(message: dict[str, Any], leaves: dict[Path, list[Any]], depth: int) -> None:
    """Store the leaves' elements in the message, and clear `leaves`."""
    for path, elements in leaves.items():
        put_leaf(message, path[depth:], iter(elements))
    leaves.clear()
