"""What a middleware is to all other rooms: where its messages come from, and how they lie on the wire.

A middleware is a module with one `Middleware` value, and the line in `message/__init__.py` that registers it.
docs/how-to/add-a-middleware.md shows how a third one is added.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from fusesoc_firm.message.model import MIDDLEWARES, InterfaceKind, MessageDefinition, MessageName, RosVersion
from fusesoc_firm.message.wire import WireRules
from fusesoc_firm.text.diagnostics import Diagnostics


class Store(Protocol):
    """Definitions that are there without a file of the user; `title` says whose they are."""

    title: str

    @property
    def names(self) -> frozenset[MessageName]:
        """All messages of the store."""

    def text(self, name: MessageName) -> str:
        """The definition of one of `names`."""

    def file(self, name: MessageName) -> str:
        """What stands for a file's name in errors."""


class Parse(Protocol):
    """Reads a definition; every fault goes to `diagnostics`, what is right to the result."""

    def __call__(
        self, text: str, name: MessageName, ros: RosVersion, file: str, diagnostics: Diagnostics
    ) -> MessageDefinition:
        """The definition of message `name` in the text of `file`."""


class Signature(Protocol):
    """Tells by one word whether two ends of a topic mean the same message."""

    def __call__(
        self,
        name: MessageName,
        definitions: Mapping[MessageName, MessageDefinition],
        kind: InterfaceKind = InterfaceKind.MESSAGE,
    ) -> str:
        """The signature of a message, or of a service or action; `definitions` hold all within it."""


@dataclass(frozen=True)
class Middleware:
    """All that is asked about a middleware.

    `words` are what the files of users call it. `suffixes` are those of the files that define its messages, without the
    dot, and `folders` the places where an environment has such files. `store` gives the definitions of one of
    `distributions`, of a default for None; it raises `InputError` for any other. `builtin_types` are the types that are
    no message, for hints. `aliases` are former names of messages, each with the present one: both are the same message.
    """

    ros: RosVersion
    words: tuple[str, ...]
    rules: WireRules
    parse: Parse
    signature: Signature
    builtin_types: frozenset[str]
    suffixes: Mapping[str, InterfaceKind]
    folders: Callable[[Mapping[str, str]], list[Path]]
    distributions: Callable[[], list[str]]
    store: Callable[[str | None], Store]
    aliases: Mapping[MessageName, MessageName] = field(default_factory=dict)


_registered: dict[RosVersion, Middleware] = {}


def register(middleware: Middleware) -> None:
    """Make a middleware known to everybody."""
    _registered[middleware.ros] = middleware
    MIDDLEWARES.update(dict.fromkeys(middleware.words, middleware.ros))


def middleware_of(ros: RosVersion) -> Middleware:
    """The middleware of a number; KeyError for one that is not registered."""
    return _registered[ros]


def known_suffixes() -> dict[str, InterfaceKind]:
    """The suffixes of the files that define messages, of whichever middleware."""
    return {suffix: kind for middleware in _registered.values() for suffix, kind in middleware.suffixes.items()}
