"""Draws payloads of a message and determines the expected ports, from rosbags' types and without the project's code.

    payloads = Payloads(ROS2, "sensor_msgs/Image")
    payload = payloads.draw(random.Random(7))        # rosbags serialises it
    payloads.shown(payload)                          # {"height": b"...", "encoding_axis": b"...", ...}

`shown` walks a payload from its first byte to its last by the rules of ROS 1 or of CDR, and raises
`BrokenPayloadError` where a converter must refuse it. The tests compare it with rosbags and with our own codec.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import normalize_fieldname

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware

_STORES = {ROS1: Stores.ROS1_NOETIC, ROS2: Stores.ROS2_JAZZY}
_ENCODING = b"\x00\x01"
_PREFIX_BYTES = 4
# After a message of fixed size, a converter accepts padding only.
_PADDING = {ROS1: 0, ROS2: 3}
_LONGEST_ARRAY = 6
_COUNT_BYTES = 4
# rosbags names both halves of ROS 1's time as ROS 2 does.
_ROS1_NAMES = {"nanosec": "nsec"}
_STAND_IN = "structure_needs_at_least_one_member"


class BrokenPayloadError(Exception):
    """A payload that is none of the message."""


class Payloads:
    """The payloads of a message; of strings and arrays of numbers and messages, without wstring and bool[]."""

    def __init__(self, ros: Middleware, message: str) -> None:
        self.ros = ros
        self._store = get_typestore(_STORES[ros])
        package, _, name = message.partition("/")
        self._name = f"{package}/msg/{name}"

    def draw(self, source: random.Random, given: Mapping[str, Any] | None = None) -> bytes:
        """A random message, as rosbags serialises it; `given` holds values as rosbags takes them, by path: `a_b`."""
        value = self._drawn_message(self._name, source, given or {}, "")
        if self.ros is ROS1:
            return bytes(self._store.serialize_ros1(value, self._name))
        return bytes(self._store.serialize_cdr(value, self._name))

    def shown(self, payload: bytes) -> dict[str, bytes]:
        """Return each port's values for a payload, elements in sequence; raises `BrokenPayloadError`."""
        shown, tail = self.with_tail(payload)
        if tail and (tail > _PADDING[self.ros] if self._is_fixed(self._name) else self.ros is ROS1):
            raise BrokenPayloadError("bytes behind the last field")
        return shown

    def with_tail(self, payload: bytes) -> tuple[dict[str, bytes], int]:
        """Return what `shown` does, and the number of bytes behind the last field, which may be any."""
        return _Reader(self.ros, self._store, payload).shown(self._name)

    def _is_fixed(self, name: str) -> bool:
        return all(self._is_fixed_kind(kind) for _, kind in self._store.fielddefs[name][1])

    def _is_fixed_kind(self, kind: Any) -> bool:
        match kind:
            case (Nodetype.NAME, name):
                return self._is_fixed(name)
            case (Nodetype.ARRAY, (inner, _)):
                return self._is_fixed_kind(inner)
            case (Nodetype.BASE, (name, _)):
                return bool(name != "string")
        return False

    def _drawn_message(self, name: str, source: random.Random, given: Mapping[str, Any], path: str) -> Any:
        values = {
            normalize_fieldname(field): self._drawn(kind, source, given, f"{path}_{field}" if path else field)
            for field, kind in self._store.fielddefs[name][1]
        }
        return self._store.types[name](**values)

    def _drawn(self, kind: Any, source: random.Random, given: Mapping[str, Any], path: str) -> Any:
        if path in given:
            return given[path]
        match kind:
            case (Nodetype.NAME, name):
                return self._drawn_message(name, source, given, path)
            case (Nodetype.BASE, ("string", _)):
                return "".join(source.choices("abcdefgh", k=source.randint(0, _LONGEST_ARRAY)))
            case (Nodetype.BASE, (name, _)):
                (number,) = _numbers(name, 1, source)
                return number
            case (Nodetype.ARRAY, ((Nodetype.BASE, (name, _)), count)) if name != "string":
                return _numbers(name, count, source)
            case (Nodetype.SEQUENCE, ((Nodetype.BASE, (name, _)), _)) if name != "string":
                return _numbers(name, source.randint(0, 4 * _LONGEST_ARRAY), source)
            case (Nodetype.ARRAY, (inner, count)):
                return [self._drawn(inner, source, given, path) for _ in range(count)]
            case (Nodetype.SEQUENCE, (inner, _)):
                return [self._drawn(inner, source, given, path) for _ in range(source.randint(0, _LONGEST_ARRAY))]
        raise AssertionError(kind)


class _Reader:
    """One walk over a payload."""

    def __init__(self, ros: Middleware, store: Any, payload: bytes) -> None:
        self._ros, self._store, self._payload = ros, store, payload
        self._place = 0
        self._shown: dict[str, bytearray] = defaultdict(bytearray)

    def shown(self, name: str) -> tuple[dict[str, bytes], int]:
        if self._ros is ROS2 and self._take(_PREFIX_BYTES)[:2] != _ENCODING:
            raise BrokenPayloadError("encoding")
        self._message(name, "")
        return {port: bytes(data) for port, data in self._shown.items()}, len(self._payload) - self._place

    def _message(self, name: str, path: str) -> None:
        for field, kind in self._store.fielddefs[name][1]:
            known = _ROS1_NAMES.get(field, field) if self._ros is ROS1 else field
            self._field(kind, f"{path}_{known}" if path else known)

    def _field(self, kind: Any, path: str) -> None:
        match kind:
            case (Nodetype.NAME, name):
                self._message(name, path)
            case (Nodetype.BASE, ("string", _)):
                self._string(path)
            case (Nodetype.BASE, (name, _)):
                self._shown[path] += self._numbers(name)
            case (Nodetype.ARRAY, (inner, count)):
                for _ in range(count):
                    self._field(inner, path)
            case (Nodetype.SEQUENCE, (inner, bound)):
                self._sequence(inner, bound, path)
            case _:
                raise AssertionError(kind)

    def _string(self, path: str) -> None:
        count = self._count()
        text = self._take(count)
        if self._ros is ROS2:
            if not text.endswith(b"\x00"):
                raise BrokenPayloadError("a string without its zero")
            text = text[:-1]
        self._shown[f"{path}_length"] += len(text).to_bytes(_COUNT_BYTES, "little")
        self._shown[f"{path}_axis"] += text

    def _sequence(self, inner: Any, bound: int, path: str) -> None:
        count = self._count()
        if bound and count > bound:
            raise BrokenPayloadError("more elements than the bound")
        self._shown[f"{path}_length"] += count.to_bytes(_COUNT_BYTES, "little")
        if inner[0] is Nodetype.BASE and inner[1][0] != "string":
            self._shown[f"{path}_axis"] += self._numbers(inner[1][0], count) if count else b""
            return
        # Every element takes at least a byte, so a wrong count ends here.
        for _ in range(count):
            self._field(inner, path)

    def _numbers(self, name: str, count: int = 1) -> bytes:
        """One number or more in a row; the padding is in front of the first."""
        size = _dtype(name).itemsize
        if self._ros is ROS2:
            self._take(-(self._place - _PREFIX_BYTES) % size)
        data = self._take(count * size)
        return bytes(byte != 0 for byte in data) if name == "bool" else data

    def _count(self) -> int:
        return int.from_bytes(self._numbers("uint32"), "little")

    def _take(self, count: int) -> bytes:
        if count > len(self._payload) - self._place:
            raise BrokenPayloadError("it ends early")
        self._place += count
        return self._payload[self._place - count : self._place]


@cache
def _dtype(name: str) -> np.dtype[Any]:
    # rosbags packs a lone `byte` as a signed number.
    return np.dtype({"char": "u1", "byte": "i1", "bool": "?"}.get(name, name))


def _numbers(name: str, count: int, source: random.Random) -> Any:
    """Any bits but those of a NaN, which are not kept; a bool is 0 or 1."""
    dtype = _dtype(name)
    if dtype.kind == "b":
        return np.array([source.random() < 0.5 for _ in range(count)], dtype)
    found = np.frombuffer(source.randbytes(count * dtype.itemsize), dtype)
    return np.nan_to_num(found, posinf=1.0, neginf=-1.0) if dtype.kind == "f" else found
