"""What a middleware is to all other rooms: where its messages come from, and how they lie on the wire.

A middleware is a module with one `Middleware` value, and the line in `message/__init__.py` that registers it.
docs/how-to/add-a-middleware.md shows how a third one is added.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from fusesoc_firm.message.dialect import Dialect
from fusesoc_firm.message.model import Definitions, InterfaceKind, MessageDefinition, MessageName
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
        self, text: str, name: MessageName, ros: Middleware, file: str, diagnostics: Diagnostics
    ) -> MessageDefinition:
        """The definition of message `name` in the text of `file`."""


class Signature(Protocol):
    """Tells by one word whether two ends of a topic mean the same message."""

    def __call__(
        self,
        name: MessageName,
        definitions: Definitions,
        kind: InterfaceKind = InterfaceKind.MESSAGE,
    ) -> str:
        """The signature of a message, or of a service or action; `definitions` hold all within it."""


@dataclass(frozen=True, eq=False, repr=False)
class Middleware:
    """All that is asked about a middleware: there is one value of each, which is compared by identity.

    `title` is its name in comments and messages, `number` the one that options and reports have, `words` are what the
    files of users call it. `suffixes` are those of the files that define its messages, without the dot, and `folders`
    the places where an environment has such files. `store` gives the definitions of one of `distributions`, of a
    default for None; it raises `InputError` for any other. `builtin_types` are the types that are no message, for
    hints. `aliases` are former names of messages, each with the present one: both are the same message.
    """

    number: int
    title: str
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
    dialect: Dialect | None = None
    """The rules of its `.msg` files, which `message/parser.py` reads."""

    def __repr__(self) -> str:
        return self.title

    def __hash__(self) -> int:
        """The same in every process, and so the order of sets."""
        return self.number

    def __reduce__(self) -> tuple[Callable[[int], Middleware], tuple[int]]:
        """Another process has its own value."""
        return middleware_of, (self.number,)


_registered: dict[int, Middleware] = {}

MIDDLEWARES: dict[str, Middleware] = {}
"""By the words of the files of users."""


def register(middleware: Middleware) -> None:
    """Make a middleware known to everybody; ValueError if its number is taken."""
    if middleware.number in _registered:
        raise ValueError(f"{middleware.number} is {_registered[middleware.number].title}")
    _registered[middleware.number] = middleware
    MIDDLEWARES.update(dict.fromkeys(middleware.words, middleware))


def middleware_of(number: int) -> Middleware:
    """The middleware of a number; KeyError for one that is not registered."""
    return _registered[number]


def middlewares() -> list[Middleware]:
    """All of them, in the order of their numbers."""
    return [_registered[number] for number in sorted(_registered)]


def known_suffixes() -> dict[str, InterfaceKind]:
    """The suffixes of the files that define messages, of whichever middleware."""
    return {suffix: kind for middleware in _registered.values() for suffix, kind in middleware.suffixes.items()}
