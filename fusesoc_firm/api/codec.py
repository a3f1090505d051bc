"""Messages as bytes, and back, for scripts and notebooks.

>>> from fusesoc_firm import codec
>>> vector = codec("geometry_msgs/Vector3", ros=2)
>>> vector.encode({"x": 1.5}).hex(" ", 4)
'00010000 00000000 0000f83f 00000000 00000000 00000000 00000000'
>>> vector.decode(vector.encode({"x": 1.5}))
{'x': 1.5, 'y': 0.0, 'z': 0.0}
>>> vector.layout["y"]
Place(type='float64', offset=12, size=8)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fusesoc_firm.frame.codec import MessageValue, decode, encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.tree import rows
from fusesoc_firm.frame.values import packed, unpacked
from fusesoc_firm.message.library import libraries
from fusesoc_firm.message.middleware import Definitions, middlewares
from fusesoc_firm.message.model import ArrayType, MessageName, PrimitiveType, SequenceType, nested_message
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.message.wire import WireType
from fusesoc_firm.text.diagnostics import fail


class Place(NamedTuple):
    """The place of a field: `offset` from the payload's start and `size`, both in bytes, or None if they vary.

    Within a sequence of messages, `size` is that of one element.
    """

    type: str
    offset: int | None
    size: int | None


def codec(name: str, ros: int = 2, paths: Iterable[str | Path] = (), distro: str | None = None) -> Codec:
    """Return the codec of a message, such as `sensor_msgs/Imu`, in ROS 1 or ROS 2.

    The definition is that of the first source that contains it: `paths` (folders with `.msg` files, packages,
    workspaces and bags), a sourced ROS, and the messages of `distro` (by default the newest one). Messages of services
    and actions have names such as `std_srvs/SetBool_Request`. Raise `InputError` for an unknown message or source.
    """
    known = {middleware.number: middleware for middleware in middlewares()}
    if ros not in known:
        fail(f"unknown ROS version {ros!r}", hint=f"legal here: {', '.join(map(str, known))}")
    library = libraries([Path(path) for path in paths], os.environ, distro)[known[ros]]
    message = parse_name(name)
    return Codec(message, library.closure(message))


class Codec:
    """The bytes of a message as its middleware sends them.

    A message is a dictionary with nested dictionaries and lists. Arrays and sequences of numbers are NumPy arrays;
    lists are accepted, too.
    """

    def __init__(self, name: MessageName, definitions: Definitions, frame: Frame | None = None) -> None:
        """Use the definitions of the message and its nested messages; `frame` may select fields."""
        self.name = str(name)
        self._name, self._definitions = name, definitions
        self._frame = frame or frame_of(name, definitions)

    def __repr__(self) -> str:
        size = length_of(self._frame)
        most = "" if size.maximum == size.minimum else " or more" if size.maximum is None else f" to {size.maximum}"
        return f"<codec of {self.name} in {self._frame.ros.title}: {size.minimum}{most} bytes>"

    @property
    def ros(self) -> int:
        """The version of ROS: 1 or 2."""
        return self._frame.ros.number

    @property
    def hash(self) -> str:
        """The text that both ends of a topic compare: the MD5 sum in ROS 1, the `RIHS01` type hash in ROS 2."""
        return signature(self._name, self._definitions, self._definitions[self._name].kind)

    @property
    def layout(self) -> dict[str, Place]:
        """The place of each field in the payload, by dotted names and in the order of the definition."""
        names: list[str] = []
        places = {}
        for row in [*rows(self._name, self._definitions, self._frame)][1:]:
            names[row.depth - 1 :] = [row.name]
            places[".".join(names)] = Place(row.type, row.offset, None if row.bits is None else row.bits // 8)
        return places

    def encode(self, message: MessageValue) -> bytes:
        """Return the payload of a message; missing fields have their defaults, or are zero or empty.

        Raise `CodecError`, a `ValueError`, for an unknown field and for a value that does not fit.
        """
        plain = self._converted(self._name, message, _plain)
        return encode(self._frame, completed(self._frame, plain))

    def decode(self, payload: bytes | bytearray | memoryview) -> dict[str, Any]:
        """Return the message in a payload.

        Raise `CodecError`, a `ValueError`, for a payload that is too short or too long or has invalid values.
        """
        found: dict[str, Any] = self._converted(self._name, decode(self._frame, bytes(payload)), _array)
        return found

    def new(self) -> dict[str, Any]:
        """Return a message in which all fields have their defaults, or are zero or empty."""
        return self.decode(self.encode({}))

    def _converted(self, name: MessageName, value: Any, convert: Callable[[WireType, Any], Any]) -> Any:
        """Return a copy of a message in which arrays of numbers are converted.

        Values that are not messages are kept, since the encoder reports them.
        """
        if not isinstance(value, Mapping):
            return value
        message, scalars = dict(value), self._frame.ros.rules.scalars
        for field in self._definitions[name].fields:
            given = message.get(field.name)
            element = field.type.element if isinstance(field.type, ArrayType | SequenceType) else None
            nested = nested_message(field.type)
            if isinstance(element, PrimitiveType) and element.name in scalars and given is not None:
                message[field.name] = convert(scalars[element.name], given)
            elif nested and element and isinstance(given, list | tuple):
                message[field.name] = [self._converted(nested, item, convert) for item in given]
            elif nested and not element and given is not None:
                message[field.name] = self._converted(nested, given, convert)
            elif isinstance(given, np.ndarray):
                message[field.name] = given.tolist()
        return message


def _array(type_: WireType, values: Any) -> np.ndarray[Any, Any]:
    """Return numbers as an array of their type. Bits are kept, also those of a signalling NaN."""
    content = values if isinstance(values, bytes) else packed(type_.code, values)
    return np.frombuffer(content, _dtype(type_)).copy()


def _plain(type_: WireType, values: Any) -> Any:
    """Return an array as numbers for the encoder, which reports all other values."""
    if not isinstance(values, np.ndarray):
        return values
    if values.dtype != _dtype(type_) or values.ndim != 1:
        return values.tolist()
    return values.tobytes() if type_.code == "B" else [*unpacked(type_.code, values.tobytes())]


def _dtype(type_: WireType) -> np.dtype[Any]:
    return np.dtype(f"<{type_.code}")
