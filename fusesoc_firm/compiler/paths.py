"""The paths through a function while it is compiled: names, memory, and where paths part and meet."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NoReturn

from fusesoc_firm.compiler.arithmetic import Arithmetic, RefusalError
from fusesoc_firm.compiler.conversions import UnmergeableError
from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.compiler.values import Array, Memory, Merge, Stream, Value


@dataclass(frozen=True)
class Exit:
    """The state of a path that leaves a function, a loop or a turn of a loop."""

    condition: Node
    value: Value
    names: dict[str, Value]
    memory: Memory


@dataclass
class Frame:
    """A call of a function: its names, and the paths that left it."""

    names: dict[str, Value] = field(default_factory=dict)
    returns: list[Exit] = field(default_factory=list)


@dataclass
class Turns:
    """The loop that is running: the paths that left the turn and the loop; the stream, if it is over one."""

    continues: list[Exit] = field(default_factory=list)
    breaks: list[Exit] = field(default_factory=list)
    stream: Loop | None = None


@dataclass
class Carried:
    """A value that a loop over a stream carries from one element to the next one."""

    name: str
    first: Node
    value: Node
    next: Node | None = None

    def sources(self) -> Iterator[Node]:
        """Yield the values that the register loads."""
        yield self.first
        if self.next is not None:
            yield self.next


@dataclass
class Loop:
    """A loop over a stream, at a node of the source: the carried values, and the lists to which it appends."""

    stream: Stream
    node: ast.AST
    carried: dict[Any, Carried] = field(default_factory=dict)
    appended: dict[Array, Value] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """The number of the stream in its message."""
        return self.stream.number

    @property
    def phase(self) -> int:
        """The phase of the computations for an element."""
        return self.stream.phase


@dataclass
class Paths:
    """The state of a run of a source, with nodes in place of numbers; each method may raise `InputError`."""

    source: Source
    graph: Graph = field(default_factory=Graph)
    memory: Memory = field(default_factory=Memory)
    loops: list[Loop] = field(default_factory=list)
    is_alive: bool = True
    _frames: list[Frame] = field(default_factory=list)
    _turns: list[Turns] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.arithmetic = Arithmetic(self.graph)
        self.path = self.graph.true()

    @property
    def names(self) -> dict[str, Value]:
        """The names of the function that is running."""
        return self._frames[-1].names

    @names.setter
    def names(self, names: dict[str, Value]) -> None:
        self._frames[-1].names = names

    @contextmanager
    def _own_frame(self) -> Iterator[Frame]:
        """Run a part of the source with names, loops and paths of its own."""
        kept = self.path, self.is_alive, self._turns
        self.path, self.is_alive, self._turns = self.graph.true(), True, []
        self._frames.append(Frame())
        yield self._frames[-1]
        self._frames.pop()
        self.path, self.is_alive, self._turns = kept

    def _leave(self, exits: list[Exit], value: Value) -> None:
        """End the current path."""
        exits.append(Exit(self.path, value, dict(self.names), self.memory.copy()))
        self.is_alive = False

    def _merged(self, exits: Sequence[Exit], node: ast.AST, names: dict[str, Value] | None = None) -> Value:
        """Return the value of paths that met, and let the memory and, if given, the names be those of these paths."""
        *before, last = exits
        value, memory, known = last.value, last.memory, last.names
        for item in reversed(before):
            merge = Merge(self.graph, item.condition, Memory())
            with self._merging(node):
                merge.merge_memory(item.memory, memory)
                value = merge.value(item.value, value, "the result")
                known = merge.names(item.names, known) if names is not None else known
            memory = merge.memory
        self.memory = memory.copy()
        if names is not None:
            names.clear()
            names.update(known)
        return value

    @contextmanager
    def _merging(self, node: ast.AST) -> Iterator[None]:
        try:
            yield
        except UnmergeableError as error:
            self.refuse(
                node,
                f"two paths leave {error} in one place",
                "give both paths the same type, as int() or numpy.float32() does",
            )

    def _join(self, exits: list[Exit], node: ast.AST) -> None:
        """Continue with the current path, if it is alive, and those that left earlier."""
        if not exits:
            return
        if self.is_alive:
            self._leave(exits, None)
        self.path = self._either(exits, self.graph.true())
        self._merged(exits, node, self.names)
        self.is_alive = True
        exits.clear()

    def _either(self, ends: Sequence[Exit], path: Node) -> Node:
        """Return the condition that one of the ends is reached."""
        found = self.graph.constant(value=False)
        for item in ends:
            found = self.graph.either(found, item.condition)
        return self.graph.both(path, found)

    def checked(self, node: ast.AST, operation: Callable[..., Node], *operands: Any) -> Node:
        """Return the result of an operation; report a refusal at the node."""
        try:
            return operation(*operands)
        except RefusalError as refusal:
            self.refuse(node, str(refusal), refusal.hint)

    def refuse(self, node: ast.AST, message: str, hint: str = "") -> NoReturn:
        """Raise `InputError` for a part of the source."""
        self.source.refuse(node, message, hint)
