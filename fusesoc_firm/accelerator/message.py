"""Messages as users' functions and models receive them: dictionaries whose fields are also attributes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Message(dict[str, Any]):
    """A message as a dictionary whose fields are also attributes."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"the message has no field '{name}'", name=name, obj=self) from None

    def copy(self) -> Message:
        """Return a copy of the message, whose nested messages are the same."""
        return Message(self)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


def with_attributes(value: Any) -> Any:
    """Return a copy of a message in which the fields are also attributes, at all levels."""
    if isinstance(value, Mapping):
        return Message({name: with_attributes(item) for name, item in value.items()})
    return [with_attributes(item) for item in value] if isinstance(value, list) else value
