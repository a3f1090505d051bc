"""The interface of a middleware: the sources of its messages, their definitions, and their serialisation rules.

A middleware consists of a module with one `Middleware` value, and of the line in `message/__init__.py` that registers
the value. docs/how-to/add-a-middleware.md explains how to add one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from fusesoc_firm.message.dialect import Dialect
from fusesoc_firm.message.model import Constant, Field, InterfaceKind, MessageName
from fusesoc_firm.message.wire import WireRules
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef


@dataclass(frozen=True)
class MessageDefinition:
    """The definition of a message in a `.msg` file or, depending on `kind`, derived from a `.srv` or `.action` file.

    `is_idl` tells that it is from an `.idl` file, whose names need not be legal in a `.msg` file.
    """

    name: MessageName
    ros: Middleware
    fields: tuple[Field, ...]
    constants: tuple[Constant, ...]
    source: SourceRef
    kind: InterfaceKind = InterfaceKind.MESSAGE
    is_idl: bool = False

    @property
    def full_name(self) -> str:
        """The name in ROS 2, such as `geometry_msgs/msg/Point`."""
        return f"{self.name.package}/{self.kind}/{self.name.name}"


Definitions = Mapping[MessageName, MessageDefinition]
"""The definitions of a message and of all nested messages, by name."""


class Store(Protocol):
    """A collection of definitions that needs no user files; `title` names the store in messages."""

    title: str

    @property
    def names(self) -> frozenset[MessageName]:
        """The names of all messages in the store."""

    def text(self, name: MessageName) -> str:
        """Return the definition text of one of `names`."""

    def file(self, name: MessageName) -> str:
        """Return the name for a message's definition in errors, in place of a file's name."""


class Parse(Protocol):
    """A function that parses a definition, adds faults to `diagnostics`, and returns the valid parts."""

    def __call__(
        self, text: str, name: MessageName, ros: Middleware, file: str, diagnostics: Diagnostics
    ) -> MessageDefinition:
        """Return the definition of message `name` in the text of `file`."""


class Signature(Protocol):
    """A function that computes a text for comparison at both ends of a topic; equal messages have equal texts."""

    def __call__(
        self,
        name: MessageName,
        definitions: Definitions,
        kind: InterfaceKind = InterfaceKind.MESSAGE,
    ) -> str:
        """Return the signature of a message, service or action; `definitions` contains all nested messages."""


@dataclass(frozen=True, eq=False, repr=False)
class Middleware:
    """All properties of a middleware. Each middleware has one value, and values are compared by identity.

    `title` is the name in comments and messages, `number` the number in options and reports, and `words` are the
    names in users' files. `suffixes` are the suffixes, without the dot, of the files that define messages, each with
    its kind; `.idl` files, which declare the kinds of their types, have None. `folders` returns the folders of these
    files in an environment. `store` returns the definitions of one of `distributions`, or of the default for None,
    and raises `InputError` for any other name. `builtin_types` lists, for hints, the types that are not messages.
    `aliases` maps former names of messages to current names; both mean the same message.
    """

    number: int
    title: str
    words: tuple[str, ...]
    rules: WireRules
    parse: Parse
    signature: Signature
    builtin_types: frozenset[str]
    suffixes: Mapping[str, InterfaceKind | None]
    folders: Callable[[Mapping[str, str]], list[Path]]
    distributions: Callable[[], list[str]]
    store: Callable[[str | None], Store]
    aliases: Mapping[MessageName, MessageName] = field(default_factory=dict)
    dialect: Dialect | None = None
    """The rules of the middleware's `.msg` files, if `message/parser.py` parses them."""

    def __repr__(self) -> str:
        return self.title

    def __hash__(self) -> int:
        """Return a hash that is equal in every process, so that the order of sets is also equal."""
        return self.number

    def __reduce__(self) -> tuple[Callable[[int], Middleware], tuple[int]]:
        """Return the data from which unpickling restores the receiving process's value."""
        return middleware_of, (self.number,)


_registered: dict[int, Middleware] = {}

MIDDLEWARES: dict[str, Middleware] = {}
"""The middlewares by their names in users' files."""


def register(middleware: Middleware) -> None:
    """Register a middleware. Raise `ValueError` if its number is already in use."""
    if middleware.number in _registered:
        raise ValueError(f"{middleware.number} is {_registered[middleware.number].title}")
    _registered[middleware.number] = middleware
    MIDDLEWARES.update(dict.fromkeys(middleware.words, middleware))


def middleware_of(number: int) -> Middleware:
    """Return the middleware with this number. Raise `KeyError` if it is not registered."""
    return _registered[number]


def middlewares() -> list[Middleware]:
    """Return all registered middlewares, in the order of their numbers."""
    return [_registered[number] for number in sorted(_registered)]


def known_suffixes() -> dict[str, InterfaceKind | None]:
    """Return the suffixes of the files that define messages, for all middlewares."""
    return {suffix: kind for middleware in _registered.values() for suffix, kind in middleware.suffixes.items()}
