"""Decode payload bytes to nested dictionaries and lists, and find the bytes that carry values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any

from fusesoc_firm.frame.encoder import empty_elements
from fusesoc_firm.frame.model import COUNT_BYTES, MOST_EMPTY_ELEMENTS, Data, Fixed, Frame, Loop, Node, Pad, has_bytes
from fusesoc_firm.frame.values import CodecError, check_bound, dotted

Range = tuple[int, int, tuple[str, ...]]
"""The first byte of a value, the end, and the path to its field, which is empty for the prefix."""


def decode(frame: Frame, payload: bytes) -> dict[str, Any]:
    """Decode a payload. Numbers become Python numbers, arrays become lists, and `uint8` sequences become bytes.

    Bytes after a message of ROS 2 are ignored, as every reader of ROS 2 does.

    Raises:
        CodecError: the payload is too short or too long, has another encoding, or contains invalid values.
    """
    return _decoded(_decoder(frame, has_arrays=False), frame, payload)


def decode_arrays(frame: Frame, payload: bytes | bytearray) -> dict[str, Any]:
    """Decode a payload like `decode`, but arrays of numbers become NumPy arrays.

    They are views of the payload, which are read-only if it is of type `bytes`.
    """
    return _decoded(_decoder(frame, has_arrays=True), frame, payload)


@lru_cache(maxsize=1024)
def _decoder(frame: Frame, has_arrays: bool) -> Callable[[bytes | bytearray], Any]:
    # Imported only on use: NumPy is slow to import.
    from fusesoc_firm.frame.decoder_source import decoder_of

    return decoder_of(frame, has_arrays)


def _decoded(read: Callable[[bytes | bytearray], Any], frame: Frame, payload: bytes | bytearray) -> dict[str, Any]:
    try:
        message: dict[str, Any] = read(payload)
    except Exception:
        _ranges(frame, payload)
        raise
    return message


def used_bytes(frame: Frame, payload: bytes) -> bytes:
    """Return one byte for each byte of the payload: 1 for values, counts and the prefix, 0 for padding.

    Raise `CodecError` like `decode`.
    """
    used = bytearray(len(payload))
    for first, end, _ in _ranges(frame, payload):
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
    for first, end, names in _ranges(frame, payload):
        yield first, end, dotted(names)


def _ranges(frame: Frame, payload: bytes | bytearray) -> list[Range]:
    """Return the ranges of the payload bytes that carry the message. Raise `CodecError` like `decode`."""
    if frame.is_fixed_size and not _may_have(len(payload), frame.payload_bytes, frame):
        least = "at least " if frame.trailing_bytes else ""
        size = f"{least}{frame.payload_bytes} bytes, not {len(payload)}"
        raise CodecError(f"the payload of {frame.message} must have {size}")
    checked = payload[: frame.checked_prefix]
    if checked != frame.prefix[: frame.checked_prefix]:
        raise CodecError(f"the payload of {frame.message} has the unknown encoding {checked.hex()}")
    walk = _Walk(frame, payload)
    walk.pass_by(frame.nodes)
    if not _may_have(len(payload), walk.position, frame):
        raise CodecError(f"{frame.message} ends after {walk.position} bytes, but the payload has {len(payload)}")
    return walk.used


def _may_have(size: int, content: int, frame: Frame) -> bool:
    """Return whether a payload of `size` bytes may have a message of `content` bytes."""
    return size >= content if frame.trailing_bytes else size == content


class _Walk:
    """A walk to `position` in a payload; `used` lists the ranges that carry values so far."""

    def __init__(self, frame: Frame, payload: bytes | bytearray) -> None:
        self.position = 0
        self.used: list[Range] = [(0, len(frame.prefix), ())]
        self._frame = frame
        self._payload = payload

    def pass_by(self, nodes: Sequence[Node]) -> None:
        """Move behind the parts that `nodes` describe. Raise `CodecError` where the payload does not fit."""
        for node in nodes:
            match node:
                case Fixed():
                    self._fixed(node)
                case Pad(alignment):
                    self._align(alignment)
                case Data():
                    self._data(node)
                case Loop():
                    self._loop(node)

    def _fixed(self, node: Fixed) -> None:
        start = self.position
        for leaf in node.fields:
            for run in leaf.runs:
                self.position = start + run.offset
                self._take(run.count * leaf.type.size, leaf.names)
        self.position = start + node.size
        if self.position > len(self._payload):
            self._fail("")

    def _align(self, alignment: int) -> None:
        self.position += (len(self._frame.prefix) - self.position) % alignment

    def _data(self, node: Data) -> None:
        count = self._count(node) - node.terminator
        if count < 0:
            raise CodecError(f"'{dotted(node.names)}' has no terminator")
        check_bound(node, count)
        if count and node.padding is None:
            self._align(node.alignment)
        elif count and node.padding:
            self.position += node.padding
        self._take(count * node.element.size, node.names)
        if any(self._take(node.terminator, node.names)):
            raise CodecError(f"'{dotted(node.names)}' does not end with a zero")

    def _loop(self, node: Loop) -> None:
        count = self._count(node) if node.count is None else node.count
        check_bound(node, count)
        if not has_bytes(node.body) and count > MOST_EMPTY_ELEMENTS:
            raise empty_elements(node, count)
        if node.number and len(node.body) == 1:
            self._take(count * node.number.type.size, node.number.names)
            return
        for _ in range(count):
            self.pass_by(node.body)

    def _count(self, node: Data | Loop) -> int:
        return int.from_bytes(self._take(COUNT_BYTES, node.names), "little")

    def _take(self, size: int, names: tuple[str, ...]) -> bytes | bytearray:
        first, self.position = self.position, self.position + size
        if self.position > len(self._payload):
            self._fail(f" within '{dotted(names)}'")
        self.used.append((first, self.position, names))
        return self._payload[first : self.position]

    def _fail(self, where: str) -> None:
        raise CodecError(f"the payload of {self._frame.message} ends{where} after {len(self._payload)} bytes")
