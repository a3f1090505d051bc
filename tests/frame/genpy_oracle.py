"""The reference for ROS 1: genpy creates classes for any definition, which serialise themselves.

Debian installs it (python3-genpy) outside every virtual environment, so its folder is searched last. `has_genpy` is
false if it is not installed.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import keyword
import sys
from collections.abc import Mapping
from typing import Any

from fusesoc_firm.message.middleware import MessageDefinition
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, MessageType, PrimitiveType, SequenceType
from tests.frame.oracle import plain_text

_DEBIAN = "/usr/lib/python3/dist-packages"
if _DEBIAN not in sys.path:
    sys.path.append(_DEBIAN)

genpy: Any = None
dynamic: Any = None
with contextlib.suppress(ImportError):
    genpy = importlib.import_module("genpy")
    dynamic = importlib.import_module("genpy.dynamic")

has_genpy = dynamic is not None


class GenpyOracle:
    """One message and its nested messages."""

    def __init__(self, name: MessageName, definitions: Mapping[MessageName, MessageDefinition]) -> None:
        others = [definition for other, definition in definitions.items() if other != name]
        texts = [plain_text(definitions[name])]
        texts += [f"{'=' * 80}\nMSG: {definition.name}\n{plain_text(definition)}" for definition in others]
        self._name = name
        self._definitions = definitions
        self._classes = dynamic.generate_dynamic(str(name), "\n".join(texts))

    def serialise(self, value: Mapping[str, Any]) -> bytes:
        """The payload."""
        buffer = io.BytesIO()
        self._message(self._name, value).serialize(buffer)
        return buffer.getvalue()

    def _message(self, name: MessageName, value: Mapping[str, Any]) -> Any:
        message = self._classes[str(name)]()
        for field in self._definitions[name].fields:
            # genpy renames fields that are Python keywords.
            attribute = f"{field.name}_" if keyword.iskeyword(field.name) else field.name
            setattr(message, attribute, self._argument(field.type, value[field.name]))
        return message

    def _argument(self, type_: FieldType, value: Any) -> Any:
        match type_:
            case ArrayType(element, _) | SequenceType(element, _) if not isinstance(value, bytes):
                return [self._argument(element, item) for item in value]
            case MessageType(name):
                return self._message(name, value)
            case PrimitiveType("time" | "duration" as name):
                time = genpy.Time() if name == "time" else genpy.Duration()
                # The constructor would normalise nanoseconds beyond a second.
                time.secs, time.nsecs = value["sec"], value["nsec"]
                return time
        return value
