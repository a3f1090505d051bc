"""A reference for both ROS versions: rosbags serialises any definition that its parser can read."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Any

import numpy as np
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from fusesoc_firm.frame.codec import MessageValue
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.middleware import Definitions, Middleware, middlewares
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, MessageType, PrimitiveType, SequenceType
from fusesoc_firm.runs.verify.definitions import NoJudgementError, plain_text

TITLE = "rosbags"
# rosbags lacks `time` and `duration`; the corresponding ROS 2 messages, which have the same bits, replace them.
_TIMES = {"time": MessageName("builtin_interfaces", "Time"), "duration": MessageName("builtin_interfaces", "Duration")}
_TIME_TEXT = "int32 sec\nuint32 nanosec\n"
_LARGEST_INT8, _LARGEST_INT32 = 2**7 - 1, 2**31 - 1


def version() -> str:
    """Return the version of rosbags."""
    return metadata.version(TITLE)


def serialise(name: MessageName, definitions: Definitions, values: Sequence[MessageValue]) -> list[bytes]:
    """Return the payload of each value, with zero padding. Raise `NoJudgementError` if rosbags rejects the message."""
    ros = definitions[name].ros
    texts = {other: plain_text(definition) for other, definition in definitions.items()}
    if ros is ROS1:
        texts |= dict.fromkeys(_TIMES.values(), _TIME_TEXT)
    with _lock:
        store = _stores[ros].holding(texts)
        write = store.serialize_ros1 if ros is ROS1 else store.serialize_cdr
        return [bytes(write(_message(store, name, definitions, value), _long(name))) for value in values]


class _Store:
    """A cached type store, since rosbags compiles a serialiser for every type that it receives."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.EMPTY)
        self._texts: dict[MessageName, str] = {}

    def holding(self, texts: Mapping[MessageName, str]) -> Typestore:
        """Return a store with exactly these definitions for these names. May raise `NoJudgementError`."""
        if any(self._texts.get(name, text) != text for name, text in texts.items()):
            self._store, self._texts = get_typestore(Stores.EMPTY), {}
        for name, text in texts.items():
            if name not in self._texts:
                try:
                    self._store.register(get_types_from_msg(text, _long(name)))
                except TypesysError as error:
                    raise NoJudgementError(str(error).splitlines()[-1]) from error
                self._texts[name] = text
        return self._store


_stores = {ros: _Store() for ros in middlewares()}
_lock = threading.Lock()


def _long(name: MessageName) -> str:
    return f"{name.package}/msg/{name.name}"


def _message(store: Typestore, name: MessageName, definitions: Definitions, value: MessageValue) -> object:
    arguments = {
        normalize_fieldname(field.name): _argument(
            store, field.type, definitions, definitions[name].ros, value[field.name]
        )
        for field in definitions[name].fields
    }
    return store.types[_long(name)](**arguments)


def _argument(
    store: Typestore,
    type_: FieldType,
    definitions: Definitions,
    ros: Middleware,
    value: Any,
) -> Any:
    match type_:
        case MessageType(name):
            return _message(store, name, definitions, value)
        case PrimitiveType("time" | "duration" as name):
            return _time(store, name, value)
        case ArrayType(PrimitiveType(name), _) | SequenceType(PrimitiveType(name), _) if name not in _TIMES:
            return np.array(list(value), dtype=_dtype(name, ros))
        case ArrayType(element, _) | SequenceType(element, _):
            return [_argument(store, element, definitions, ros, item) for item in value]
        case PrimitiveType("byte") if value > _LARGEST_INT8:
            # A single `byte` is packed as a signed number, even in ROS 2, where its range is 0 to 255.
            return value - 2**8
    return value


def _time(store: Typestore, name: str, value: MessageValue) -> object:
    seconds, nanoseconds = value["sec"], value["nsec"] % 2**32
    return store.types[_long(_TIMES[name])](
        sec=seconds - 2**32 if seconds > _LARGEST_INT32 else seconds, nanosec=nanoseconds
    )


def _dtype(name: str, ros: Middleware) -> np.dtype[Any]:
    if name == "byte":
        return np.dtype("i1" if ros is ROS1 else "u1")
    return np.dtype({"char": "u1", "bool": "?"}.get(name, name))
