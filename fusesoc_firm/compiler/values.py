"""The values of names while a function is compiled, the memory of mutable objects, and the merge of two paths."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.compiler.conversions import UnmergeableError, chosen
from fusesoc_firm.compiler.graph import Graph, Node


@dataclass(frozen=True, eq=False)
class Array:
    """A list; its elements are in the memory, by index."""


@dataclass(frozen=True, eq=False)
class Record:
    """A message or dictionary; its fields are in the memory, by name."""


@dataclass(frozen=True, eq=False)
class Instance:
    """An object of a class of the source; its attributes are in the memory, by name."""

    type: ast.ClassDef


@dataclass(frozen=True)
class Function:
    """A function of the source, or a method with its object."""

    definition: ast.FunctionDef | ast.Lambda
    owner: Instance | None = None


@dataclass(frozen=True)
class Named:
    """A module, or a function of Python, `math` or NumPy, by its full name."""

    name: str


@dataclass(frozen=True)
class Class:
    """A class of the source."""

    definition: ast.ClassDef


@dataclass(frozen=True)
class Stream:
    """A string or an array of a message: its ports, its number in the message and its length.

    `element` returns the value of an element for the loop that reads the array, in the loop's phase. Without it, as for
    a string, the value can only be passed on.
    """

    part: Any
    path: str
    number: int
    length: Node
    element: Callable[[int, Memory], Any] | None

    @property
    def phase(self) -> int:
        """The phase in which the elements pass."""
        return 2 * self.number + 1


@dataclass(frozen=True)
class Produced:
    """A list to which a loop over a stream appended one element for each of the stream's elements."""

    loop: int
    element: Value


@dataclass(frozen=True)
class Maybe:
    """None, unless the condition holds."""

    condition: Node
    value: Any


@dataclass(frozen=True)
class Unbound:
    """The value of a name that only some paths bind."""

    name: str


Value = Any
"""A `Node`, a tuple, a text, None, or a value of one of the classes above."""


@dataclass
class Memory:
    """The contents of mutable objects."""

    cells: dict[Any, dict[Any, Value]] = field(default_factory=dict)

    def copy(self) -> Memory:
        """Return a copy that can change without this one."""
        return Memory({key: dict(content) for key, content in self.cells.items()})

    def new(self, made: Array | Record | Instance, content: Mapping[Any, Value]) -> Any:
        """Add an object with its content, and return the object."""
        self.cells[made] = dict(content)
        return made

    def items(self, array: Array) -> list[Value]:
        """Return the elements of a list."""
        return [*self.cells[array].values()]


@dataclass(frozen=True)
class Merge:
    """The merge of two paths: the values if the condition holds, and the others.

    Lists and messages that differ between the paths are merged to new ones in `memory`, which has those of both paths.
    """

    graph: Graph
    condition: Node
    memory: Memory

    def value(self, one: Value, other: Value, name: str = "") -> Value:
        """Return the value that a name has after both paths. Raise `UnmergeableError` if there is none."""
        if one is other or (not isinstance(one, Node) and not isinstance(other, Node) and _same(one, other)):
            return one
        if isinstance(one, Node) and isinstance(other, Node):
            return chosen(self.graph, self.condition, one, other)
        if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
            return tuple(self.value(*pair, name) for pair in zip(one, other, strict=True))
        if isinstance(one, Unbound) or isinstance(other, Unbound):
            return Unbound(name)
        if (isinstance(one, Array) and isinstance(other, Array)) or (
            isinstance(one, Record) and isinstance(other, Record)
        ):
            return self._object(one, other)
        return self._maybe(one, other)

    def _object(self, one: Array | Record, other: Array | Record) -> Array | Record:
        contents = self.memory.cells[one], self.memory.cells[other]
        if isinstance(one, Array) and len(contents[0]) != len(contents[1]):
            raise UnmergeableError("a list and another one with another number of elements")
        # A field of one path alone is None on the other one.
        keys = dict.fromkeys((*contents[0], *contents[1]))
        merged = {key: self.value(contents[0].get(key), contents[1].get(key), str(key)) for key in keys}
        made: Array | Record = self.memory.new(type(one)(), merged)
        return made

    def _maybe(self, one: Value, other: Value) -> Value:
        if not isinstance(one, Maybe | None) and not isinstance(other, Maybe | None):
            raise UnmergeableError(f"{described(one)} and {described(other)}")
        has = [self._is_there(item) for item in (one, other)]
        inner = [item.value if isinstance(item, Maybe) else item for item in (one, other)]
        known = [item for item in inner if item is not None]
        value = known[0] if len(known) == 1 else self.value(*inner)
        return Maybe(self.graph.choose(self.condition, has[0], has[1]), value)

    def _is_there(self, value: Value) -> Node:
        return value.condition if isinstance(value, Maybe) else self.graph.constant(value is not None)

    def merge_memory(self, one: Memory, other: Memory) -> None:
        """Fill the memory with the contents after both paths; objects of one path alone are unchanged."""
        self.memory.cells |= {**one.copy().cells, **other.copy().cells}
        for key in one.cells.keys() & other.cells.keys():
            if one.cells[key] != other.cells[key]:
                self.memory.cells[key] = self.names(one.cells[key], other.cells[key])

    def names(self, one: Mapping[Any, Value], other: Mapping[Any, Value]) -> dict[Any, Value]:
        """Return the values of names after both paths."""
        keys = dict.fromkeys((*one, *other))
        return {
            key: self.value(one.get(key, Unbound(str(key))), other.get(key, Unbound(str(key))), str(key))
            for key in keys
        }


def _same(one: Value, other: Value) -> bool:
    return type(one) is type(other) and not isinstance(one, tuple) and one == other


def described(value: Value) -> str:
    """Return words for a value in a message to the user."""
    match value:
        case Node():
            return f"a {' or '.join(map(str, value.kinds))}"
        case None:
            return "None"
        case tuple():
            return f"a tuple of {len(value)}"
        case str():
            return "a text"
        case Array():
            return "a list"
        case Record():
            return "a message"
        case Stream() | Produced():
            return "an array of variable size"
        case Named():
            return f"'{value.name}'"
    return f"a {type(value).__name__.lower()}"
