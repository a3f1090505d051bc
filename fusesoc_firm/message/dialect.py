"""The rules for `.msg` files in ROS 1 and ROS 2, one table for each, so that the parser needs no special cases.

ROS 1 follows genmsg 0.6.0, ROS 2 rosidl_adapter 4.9.5. docs/reference/messages.md lists the few cases in which FIRM
accepts more text (blanks, `pkg/msg/Type`) or less text (values that no generator could use).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.naming import LONGEST_TEXT

LARGEST_SIZE = 2**32 - 1  # element and character counts are uint32 on the wire


@dataclass(frozen=True)
class NameRule:
    """The legal spellings of one kind of name; `description` completes the hint "a field name consists of ..."."""

    kind: str
    pattern: re.Pattern[str]
    description: str

    def accepts(self, name: str) -> bool:
        """Return whether the whole `name` is legal."""
        return len(name) <= LONGEST_TEXT and self.pattern.fullmatch(name) is not None

    def fault(self, name: str, title: str) -> str:
        """Return the fault of a name that is not accepted."""
        if len(name) > LONGEST_TEXT:
            return f"a {self.kind} has at most {LONGEST_TEXT} characters, not {len(name)}"
        return f"'{name}' is not a legal {self.kind} in {title}" if name else f"the {self.kind} is missing"

    @property
    def hint(self) -> str:
        """A description of the legal names."""
        return f"a {self.kind} consists of {self.description}"


@dataclass(frozen=True)
class Dialect:
    """The rules of one ROS version; `integer_ranges` holds each type's smallest and largest legal value."""

    title: str
    package_name: NameRule
    message_name: NameRule
    field_name: NameRule
    constant_name: NameRule
    integer_ranges: Mapping[str, tuple[int, int]]
    # Primitives that cannot be constants: ROS 1's `time` and `duration`.
    opaque_primitives: frozenset[str]
    strings: frozenset[str]
    # Words that abbreviate a message type, and whether each may precede `[`.
    shorthands: Mapping[str, MessageName]
    has_array_shorthands: bool
    booleans: Mapping[str, bool]
    # Only in ROS 2: `<=` after a string or in an array's brackets, default values, `0x10`, quoted strings.
    has_bounds: bool
    has_defaults: bool
    has_integer_prefixes: bool
    has_quoted_strings: bool
    # A ROS 1 string constant takes the rest of the line, including `#`.
    has_comments_behind_strings: bool
    smallest_array: int
    # The text between a service's name and `Request`, and whether `pkg/msg/Type` is a type.
    joint: str
    has_long_types: bool

    @property
    def primitives(self) -> frozenset[str]:
        """The names of all types except strings and messages."""
        return frozenset({"bool", "float32", "float64"}) | frozenset(self.integer_ranges) | self.opaque_primitives

    @property
    def builtin_types(self) -> frozenset[str]:
        """The names of all types except messages."""
        return self.primitives | self.strings


def _integer_ranges(byte: tuple[int, int]) -> dict[str, tuple[int, int]]:
    ranges = {"byte": byte, "char": (0, 255)}
    for bits in (8, 16, 32, 64):
        ranges[f"int{bits}"] = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        ranges[f"uint{bits}"] = (0, 2**bits - 1)
    return ranges


_ANY_CASE = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_ANY_CASE_TEXT = "letters, digits and '_', and starts with a letter"
_LOWER_SNAKE = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_LOWER_SNAKE_TEXT = "lower-case letters, digits and single '_' between them, and starts with a letter"
_UPPER_SNAKE = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*")
_UPPER_SNAKE_TEXT = "upper-case letters, digits and single '_' between them, and starts with a letter"
# ROS 2 adds the suffixes to the names of messages that it derives from services and actions.
_UPPER_CAMEL = re.compile(
    r"[A-Z][A-Za-z0-9]*(?:_(?:Request|Response|Event|Goal|Result|Feedback|FeedbackMessage|SendGoal|GetResult))*"
)
_UPPER_CAMEL_TEXT = "letters and digits, and starts with a capital letter"

IDL_NAME = NameRule("name", _ANY_CASE, _ANY_CASE_TEXT)
"""The rule for names in `.idl` files, which rosidl restricts less than names in `.msg` files."""

ROS1 = Dialect(
    title="ROS 1",
    package_name=NameRule("package name", _ANY_CASE, _ANY_CASE_TEXT),
    message_name=NameRule("message name", _ANY_CASE, _ANY_CASE_TEXT),
    field_name=NameRule("field name", _ANY_CASE, _ANY_CASE_TEXT),
    constant_name=NameRule("constant name", _ANY_CASE, _ANY_CASE_TEXT),
    integer_ranges=_integer_ranges(byte=(-128, 127)),
    opaque_primitives=frozenset({"time", "duration"}),
    strings=frozenset({"string"}),
    shorthands={"Header": MessageName("std_msgs", "Header")},
    has_array_shorthands=False,
    booleans={"True": True, "1": True, "False": False, "0": False},
    has_bounds=False,
    has_defaults=False,
    has_integer_prefixes=False,
    has_quoted_strings=False,
    has_comments_behind_strings=False,
    smallest_array=0,
    joint="",
    has_long_types=False,
)

ROS2 = Dialect(
    title="ROS 2",
    package_name=NameRule("package name", _LOWER_SNAKE, _LOWER_SNAKE_TEXT),
    message_name=NameRule("message name", _UPPER_CAMEL, _UPPER_CAMEL_TEXT),
    field_name=NameRule("field name", _LOWER_SNAKE, _LOWER_SNAKE_TEXT),
    constant_name=NameRule("constant name", _UPPER_SNAKE, _UPPER_SNAKE_TEXT),
    integer_ranges=_integer_ranges(byte=(0, 255)),
    opaque_primitives=frozenset(),
    strings=frozenset({"string", "wstring"}),
    shorthands={
        "time": MessageName("builtin_interfaces", "Time"),
        "duration": MessageName("builtin_interfaces", "Duration"),
    },
    has_array_shorthands=True,
    booleans={"true": True, "1": True, "false": False, "0": False},
    has_bounds=True,
    has_defaults=True,
    has_integer_prefixes=True,
    has_quoted_strings=True,
    has_comments_behind_strings=True,
    smallest_array=1,
    joint="_",
    has_long_types=True,
)
