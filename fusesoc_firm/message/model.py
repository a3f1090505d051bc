"""The message model, the first stage: fields and constants as their authors wrote them.

This module knows neither the wire layout (`frame`) nor the hardware (`converter`). All values are frozen, so they
can be dictionary keys and can be shared. `middleware.py` adds the definition that consists of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from fusesoc_firm.text.diagnostics import SourceRef


class InterfaceKind(StrEnum):
    """The kind of an interface.

    Its value is the file's suffix, the folder, and the middle part of full names in ROS 2.
    """

    MESSAGE = "msg"
    SERVICE = "srv"
    ACTION = "action"


@dataclass(frozen=True, order=True)
class MessageName:
    """A name such as `geometry_msgs/Quaternion`; ROS 2 also spells this name `geometry_msgs/msg/Quaternion`."""

    package: str
    name: str

    def __str__(self) -> str:
        return f"{self.package}/{self.name}"


@dataclass(frozen=True)
class PrimitiveType:
    """A number, `bool`, or ROS 1's `time` or `duration`, by its ROS name (including `byte` and `char`).

    `is_character` marks the `char` of an `.idl` file; only its hash differs from that of `char` in a `.msg` file.
    """

    name: str
    is_character: bool = False

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class StringType:
    """`string` or, if `is_wide`, `wstring`; `bound` limits the number of characters and may be None."""

    is_wide: bool = False
    bound: int | None = None

    def __str__(self) -> str:
        name = "wstring" if self.is_wide else "string"
        return name if self.bound is None else f"{name}<={self.bound}"


@dataclass(frozen=True)
class MessageType:
    """The type of a field that contains another message."""

    name: MessageName

    def __str__(self) -> str:
        return str(self.name)


ElementType = PrimitiveType | StringType | MessageType


@dataclass(frozen=True)
class ArrayType:
    """An array with a fixed number of elements, such as `float64[9]`."""

    element: ElementType
    length: int

    def __str__(self) -> str:
        return f"{self.element}[{self.length}]"


@dataclass(frozen=True)
class SequenceType:
    """An array with a variable number of elements: `float64[]`, or `float64[<=9]` with a bound."""

    element: ElementType
    bound: int | None = None

    def __str__(self) -> str:
        return f"{self.element}[]" if self.bound is None else f"{self.element}[<={self.bound}]"


FieldType = ElementType | ArrayType | SequenceType


def nested_message(kind: FieldType) -> MessageName | None:
    """Return the message that a field of this type contains, directly or as array elements."""
    element = kind.element if isinstance(kind, ArrayType | SequenceType) else kind
    return element.name if isinstance(element, MessageType) else None


Scalar = bool | int | float | str
DefaultValue = Scalar | tuple[Scalar, ...]


@dataclass(frozen=True)
class Field:
    """A field; `default` is None if the definition has no default (only ROS 2 has defaults)."""

    name: str
    type: FieldType
    source: SourceRef
    default: DefaultValue | None = None


@dataclass(frozen=True)
class Constant:
    """A named value in a definition, which is never sent.

    `text` is the value as written, without surrounding blanks, since ROS 1's MD5 sum distinguishes `1` from `+1`.
    """

    name: str
    type: PrimitiveType | StringType
    value: Scalar
    text: str
    source: SourceRef
