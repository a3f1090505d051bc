"""An independent reference for layouts: rosbags provides the types, serialises values, and describes fields.

    oracle = Oracle(ROS2, {"awkward_msgs/Flags": "bool[9] flags\n"})
    value = oracle.random_value("geometry_msgs/Point", random.Random(7))
    payload = oracle.serialise("geometry_msgs/Point", value)

Values are nested dictionaries and lists of Python numbers, as in our codec. Random values of a `float32` are
representable in it.
"""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_message, parse_name
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.typestores import typestore

_STORES = {ROS1: Stores.ROS1_NOETIC, ROS2: Stores.ROS2_JAZZY}
_ROS1_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
# ROS 2's placeholder for the fields of an empty message, which is never set.
_STAND_IN = "structure_needs_at_least_one_member"
_EXTREME_FLOATS = (0.0, -0.0, math.inf, -math.inf, math.nan, 1.0)
_LARGEST_SIGNED = 2**31 - 1
_LARGEST_INT8 = 127


class Oracle:
    """The messages of one distribution (by default the newest), and others given by their texts."""

    def __init__(
        self, ros: Middleware, texts: Mapping[str, str] | None = None, distribution: str | None = None
    ) -> None:
        self.ros = ros
        store = Stores(f"ros{ros.number}_{distribution}") if distribution else _STORES[ros]
        self._store = typestore(store)
        self._texts = dict(texts or {})
        self._library = MessageLibrary(ros, store=store.value.partition("_")[2])
        for name, text in self._texts.items():
            self._store.register(get_types_from_msg(text, _long_name(name)))

    def fixed_size_messages(self) -> list[str]:
        """Every message of the distribution without strings and sequences, sorted."""
        known = {str(name) for name in self._library.names()}
        return [name for name in sorted(known) if self._is_fixed(_long_name(name))]

    def messages(self) -> list[str]:
        """Every message of the distribution, sorted."""
        return sorted(str(name) for name in self._library.names())

    def closure(self, name: str) -> dict[MessageName, MessageDefinition]:
        """Our definitions of a message and all nested messages."""
        if name in self._texts:
            return parsed(self._texts, self.ros)
        return self._library.closure(parse_name(name))

    def frame(self, name: str) -> Frame:
        """Our frame of a message, which is under test."""
        return frame_of(parse_name(name), self.closure(name))

    def random_value(self, name: str, source: random.Random) -> dict[str, Any]:
        """A random value; about every fourth number is an extreme one."""
        return self._message_value(_long_name(name), source)

    def serialise(self, name: str, value: Mapping[str, Any]) -> bytes:
        """The payload; CDR's padding is zero."""
        message = self._message(_long_name(name), value)
        if self.ros is ROS1:
            return bytes(self._store.serialize_ros1(message, _long_name(name)))
        return bytes(self._store.serialize_cdr(message, _long_name(name)))

    def _fields(self, long_name: str) -> Iterator[tuple[str, Any]]:
        for name, kind in self._store.fielddefs[long_name][1]:
            if name != _STAND_IN:
                yield name, kind

    def _is_fixed(self, long_name: str) -> bool:
        return all(self._is_fixed_kind(kind) for _, kind in self._fields(long_name))

    def _is_fixed_kind(self, kind: Any) -> bool:
        match kind:
            case (Nodetype.BASE, (name, _)):
                return name not in ("string", "wstring")
            case (Nodetype.NAME, name):
                return self._is_fixed(name)
            case (Nodetype.ARRAY, (inner, _)):
                return self._is_fixed_kind(inner)
        return False

    def _message_value(self, long_name: str, source: random.Random) -> dict[str, Any]:
        if self.ros is ROS1 and long_name in _ROS1_TIMES:
            # rosbags gives both parts ROS 2's types; where the ranges overlap, the bytes match ROS 1's.
            return {half: source.choice((0, 1, _LARGEST_SIGNED, source.getrandbits(31))) for half in ("sec", "nsec")}
        return {name: self._value(kind, source) for name, kind in self._fields(long_name)}

    def _value(self, kind: Any, source: random.Random) -> Any:
        match kind:
            case (Nodetype.BASE, (name, _)):
                return _random_number(self._dtype(name), source)
            case (Nodetype.NAME, name):
                return self._message_value(name, source)
            case (Nodetype.ARRAY, (inner, count)):
                return [self._value(inner, source) for _ in range(count)]
        raise AssertionError(f"{kind} has no fixed size")

    def _message(self, long_name: str, value: Mapping[str, Any]) -> object:
        arguments = {}
        for name, kind in self._fields(long_name):
            if self.ros is ROS1 and long_name in _ROS1_TIMES:
                # rosbags gives both parts ROS 2's names and types, in which the same bits are different numbers.
                is_seconds = name == "sec"
                half = value["sec" if is_seconds else "nsec"] % 2**32
                arguments[name] = half - 2**32 if is_seconds and half > _LARGEST_SIGNED else half
                continue
            arguments[normalize_fieldname(name)] = self._argument(kind, value[name])
        return self._store.types[long_name](**arguments)

    def _argument(self, kind: Any, value: Any) -> Any:
        match kind:
            case (Nodetype.NAME, name):
                return self._message(name, value)
            case (Nodetype.ARRAY | Nodetype.SEQUENCE, ((Nodetype.BASE, (name, _)), _)) if name != "string":
                return np.array(list(value), dtype=self._dtype(name))
            case (Nodetype.ARRAY | Nodetype.SEQUENCE, (inner, _)):
                return [self._argument(inner, element) for element in value]
            case (Nodetype.BASE, ("byte", _)) if value > _LARGEST_INT8:
                # rosbags packs a single `byte` as a signed number, even in ROS 2, where it is 0 to 255.
                return value - 256
        return value

    def _dtype(self, name: str) -> np.dtype[Any]:
        if name == "byte":
            return np.dtype("i1" if self.ros is ROS1 else "u1")
        return np.dtype({"char": "u1", "bool": "?"}.get(name, name))


class DefinitionsOracle(Oracle):
    """The messages of `definitions`, even if distributions use the same names.

    `refused` holds those that rosbags cannot read, each with the reason.
    """

    def __init__(self, ros: Middleware, definitions: Mapping[MessageName, MessageDefinition]) -> None:
        super().__init__(ros)
        self._store = get_typestore(Stores.EMPTY)
        self.refused: dict[MessageName, str] = {}
        if ros is ROS1:
            for long_name in _ROS1_TIMES:
                self._store.register(get_types_from_msg("int32 sec\nuint32 nanosec\n", long_name))
        for name, definition in definitions.items():
            try:
                self._store.register(get_types_from_msg(plain_text(definition), _long_name(str(name))))
            except TypesysError as error:
                self.refused[name] = str(error).splitlines()[-1]


def parsed(texts: Mapping[str, str], ros: Middleware) -> dict[MessageName, MessageDefinition]:
    """The definitions in `texts`, by name; raises `InputError` for a fault in one."""
    diagnostics = Diagnostics()
    definitions = {
        parse_name(name): parse_message(text, parse_name(name), ros, f"{name}.msg", diagnostics)
        for name, text in texts.items()
    }
    diagnostics.raise_if_any()
    return definitions


def plain_text(definition: MessageDefinition) -> str:
    """The fields in a form that every parser reads: without defaults and constants, which are not sent."""
    return "".join(f"{field.type} {field.name}\n" for field in definition.fields)


def is_same(left: Any, right: Any) -> bool:
    """Whether two values are equal; NaN equals NaN, and parts without a number may be missing."""
    if isinstance(left, Mapping) and isinstance(right, Mapping):
        names = {name for side in (left, right) for name, value in side.items() if not _is_hollow(value)}
        return all(name in left and name in right and is_same(left[name], right[name]) for name in names)
    if isinstance(left, list) and isinstance(right, list):
        return len(left) == len(right) and all(is_same(*pair) for pair in zip(left, right, strict=True))
    if isinstance(left, float) and isinstance(right, float):
        return struct.pack("d", left) == struct.pack("d", right) or (math.isnan(left) and math.isnan(right))
    # A codec that returns 1 for True or 1.0 for 1 is wrong.
    return type(left) is type(right) and bool(left == right)


def _is_hollow(value: Any) -> bool:
    if isinstance(value, Mapping):
        return all(map(_is_hollow, value.values()))
    return isinstance(value, list) and all(map(_is_hollow, value))


def _long_name(name: str) -> str:
    package, _, message = name.partition("/")
    return f"{package}/msg/{message}"


def _random_number(dtype: np.dtype[Any], source: random.Random) -> bool | int | float:
    if dtype.kind == "b":
        return source.random() < 0.5
    is_extreme = source.random() < 0.25
    if dtype.kind == "f":
        extremes = (*_EXTREME_FLOATS, float(np.finfo(dtype).max), float(np.finfo(dtype).smallest_subnormal))
        drawn = float(dtype.type(source.gauss(0, 1) * 10.0 ** source.randint(-30, 30)))
        return source.choice(extremes) if is_extreme else drawn
    limits = np.iinfo(dtype)
    ends = (int(limits.min), int(limits.max), 0, 1)
    return source.choice(ends) if is_extreme else source.randint(int(limits.min), int(limits.max))
