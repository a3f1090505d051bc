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
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from fusesoc_firm.frame import decoder_source, encoder_source  # noqa: F401 - NumPy loads before the first message
from fusesoc_firm.frame.codec import MessageValue, decode_arrays, encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.encoder import encoder
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.tree import rows
from fusesoc_firm.message.library import libraries
from fusesoc_firm.message.middleware import Definitions, middlewares
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
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
        try:
            return encoder(self._frame)(message)
        except Exception:  # noqa: BLE001 - the encoder accepts only complete messages
            return encode(self._frame, completed(self._frame, message))

    def decode(self, payload: bytes | bytearray | memoryview) -> dict[str, Any]:
        """Return the message in a payload.

        Arrays are views of the payload: those of `bytes` are read-only, and those of a `bytearray` change it.

        Raise `CodecError`, a `ValueError`, for a payload that is too short or too long or has invalid values.
        """
        return decode_arrays(self._frame, payload if isinstance(payload, bytes | bytearray) else bytes(payload))

    def new(self) -> dict[str, Any]:
        """Return a message in which all fields have their defaults, or are zero or empty."""
        return self.decode(bytearray(self.encode({})))
