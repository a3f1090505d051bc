"""Loops and comprehensions while a function is compiled.

A loop over a range or a list runs as often as its body. A loop over a stream runs once, with the element and the values
that it carries from one element to the next as nodes.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.compiler.calls import EXTREMES, Calls
from fusesoc_firm.compiler.conversions import Range, converted, widened
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.kinds import INT
from fusesoc_firm.compiler.paths import Carried, Loop, Turns
from fusesoc_firm.compiler.values import Array, Memory, Produced, Record, Stream, Unbound, Value, described

_MOST_TURNS = 4096
# The most rounds until the kinds of the carried values of a loop are known: each is widened a few times.
_MOST_ROUNDS = 40
# The name of a loop's index among its carried values, which no name of Python equals.
_INDEX = "$index"

# The statements for each element of an array that is reduced to a number.
_REDUCTIONS = {
    "sum": "result = result + item",
    "any": "if item:\n    result = True",
    "all": "if not item:\n    result = False",
    "min": "value = item\nif not found or value < result:\n    result = value\nfound = True",
    "max": "value = item\nif not found or value > result:\n    result = value\nfound = True",
}


class _Filled(ast.NodeTransformer):
    """Puts an expression in the place of the name `item`; the other names become none of the source."""

    def __init__(self, item: ast.expr) -> None:
        self.item = item

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id == "item":
            return self.item
        node.id = f"${node.id}"
        return node


def _reduction(name: str, item: ast.expr, place: ast.AST) -> list[ast.stmt]:
    """Return the statements for an element of an array that is reduced."""
    module = ast.parse(_REDUCTIONS[name])
    for node in ast.walk(module):
        ast.copy_location(node, place)
    filled: ast.Module = _Filled(item).visit(module)
    return filled.body


@dataclass(frozen=True)
class OverStream:
    """The iteration over a stream, with an index from `first` or without one."""

    stream: Stream
    first: int | None = None


@dataclass
class Repetition(Calls):
    """A run that repeats statements and expressions."""

    def _run_for(self, node: ast.For) -> None:
        if node.orelse:
            self.refuse(node.orelse[0], "'else' after a loop is not hardware", "set a name before 'break'")
        iterated = self._iterated(node.iter)
        if isinstance(iterated, OverStream):
            self._for_stream(node, iterated)
            return
        if len(iterated) > _MOST_TURNS:
            self.refuse(node.iter, f"a loop of {len(iterated)} turns is too long", f"at most {_MOST_TURNS} turns")
        turns = Turns()
        self._turns.append(turns)
        for item in iterated:
            if not self.is_alive:
                break
            self.graph.place = self.source.line(node)
            self.assign(node.target, item)
            self.block(node.body)
            self._join(turns.continues, node)
        self._turns.pop()
        self._join(turns.breaks, node)

    def _iterated(self, node: ast.expr) -> Sequence[Value] | OverStream:
        """Return the values of a loop."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in self.names:
            known = getattr(self, f"_over_{node.func.id}", None)
            if known is not None:
                found: Sequence[Value] | OverStream = known(node, node.args)
                return found
        value = self.expression(node)
        return OverStream(value) if isinstance(value, Stream) else self.elements(value, node)

    def _over_range(self, node: ast.Call, values: Sequence[ast.expr]) -> Sequence[Value]:
        bounds = [self.integer(item) for item in values]
        if not 1 <= len(bounds) <= 3 or bounds[2:] == [0]:
            self.refuse(node, "'range' takes one to three numbers, and a step other than 0")
        return [self.graph.constant(number) for number in range(*bounds)]

    def _over_enumerate(self, node: ast.Call, values: Sequence[ast.expr]) -> Sequence[Value] | OverStream:
        if len(values) not in (1, 2):
            self.refuse(node, "'enumerate' takes a list and the first number")
        first = self.integer(values[1]) if values[1:] else 0
        inner = self._iterated(values[0])
        if isinstance(inner, OverStream):
            return OverStream(inner.stream, first)
        return [(self.graph.constant(number), item) for number, item in enumerate(inner, first)]

    def _over_reversed(self, node: ast.Call, values: Sequence[ast.expr]) -> Sequence[Value]:
        if len(values) != 1:
            self.refuse(node, "'reversed' takes a list")
        return [*reversed(self.fixed(values[0]))]

    def _over_zip(self, _: ast.Call, values: Sequence[ast.expr]) -> Sequence[Value]:
        return [*zip(*(self.fixed(item) for item in values), strict=False)]

    def fixed(self, node: ast.expr) -> Sequence[Value]:
        """Return the values of a loop that has a fixed number of them."""
        found = self._iterated(node)
        if isinstance(found, OverStream):
            self.refuse(node, "an array of variable size is read once, from its begin", "loop over the array itself")
        return found

    def _for_stream(self, node: ast.For, over: OverStream) -> None:
        if node.target is None or any(turns.stream for turns in self._turns):
            self.refuse(
                node, "a loop over an array within another one is not hardware", "use two functions of one array"
            )

        def turn(loop: Loop) -> None:
            element = self._element(over.stream, loop, node.iter)
            if over.first is None:
                self.assign(node.target, element)
            else:
                limits = over.first, over.first + (1 << 28)
                index = self.graph.leaf("carried", INT, (loop.number, _INDEX), limits, loop.phase)
                after = self.graph.node("add", (index, self.graph.constant(1)), INT, limits=limits)
                first = self.graph.constant(over.first)
                loop.carried[_INDEX] = Carried(f"index_{loop.number}", first, index, after)
                self.assign(node.target, (index, element))
            self.block(node.body)

        self.stream_loop(node, over.stream, turn)

    def _element(self, stream: Stream, loop: Loop, node: ast.AST) -> Value:
        if stream.element is None:
            self.refuse(node, f"'{stream.path}' can only be passed on", "loop over an array of numbers or messages")
        return stream.element(loop.phase, self.memory)

    def stream_loop(self, node: ast.AST, stream: Stream, turn: Callable[[Loop], None]) -> None:
        """Run the body of a loop over a stream, until the kinds of the values that it carries are known."""
        if any(item.stream is stream for item in self.loops):
            self.refuse(node, f"'{stream.path}' is read twice; its elements pass once", "compute both in one loop")
        # The loop runs on all paths; its results count on this one.
        path, self.path = self.path, self.graph.true()
        names, memory = dict(self.names), self.memory
        carried: dict[Any, Carried] = {}
        for _ in range(_MOST_ROUNDS):
            loop = Loop(stream, node, dict(carried))
            self.names, self.memory = dict(names), memory.copy()
            self.is_alive = True
            self._enter(carried)
            turns = Turns(stream=loop)
            self._turns.append(turns)
            turn(loop)
            self._join(turns.continues, node)
            self._turns.pop()
            lost = self._lost(names)
            changed = {} if lost else self._changes(loop, carried, names, memory, node)
            if not changed and not lost:
                break
            names |= lost
            carried |= changed
        else:
            self.refuse(node, "the types of this loop's values cannot be determined", "give them a type of NumPy")
        if any(element in memory.cells for element in loop.appended.values() if isinstance(element, Record)):
            self.refuse(node, "the loop appends the same message again and again", "append a new one: {'x': ...}")
        self.path = path
        self.loops.append(loop)
        self._after(loop, carried, names, memory)

    def _enter(self, carried: Mapping[Any, Carried]) -> None:
        for key, item in carried.items():
            self._put(key, item.value)

    def _put(self, key: Any, value: Value) -> None:
        """Set a name or a cell of the memory."""
        if isinstance(key, tuple):
            self.memory.cells[key[0]][key[1]] = value
        else:
            self.names[key] = value

    def _places(self, names: Mapping[str, Value], memory: Memory) -> Iterator[tuple[Any, Value]]:
        """Yield the names and the cells of the memory that exist before a loop, with their values."""
        yield from names.items()
        for owner, content in memory.cells.items():
            for key, value in content.items():
                yield (owner, key), value

    def _lost(self, names: Mapping[str, Value]) -> dict[str, Unbound]:
        """Return the names that have a number or another value before the loop, and none that hardware holds in it.

        They have no value before the loop assigns one, nor after it.
        """
        pairs = {key: (names[key], self.names[key]) for key in names if not isinstance(names[key], Unbound)}
        return {
            key: Unbound(key)
            for key, (before, after) in pairs.items()
            if before is not after and not (isinstance(before, Node) and isinstance(after, Node))
        }

    def _changes(
        self, loop: Loop, carried: Mapping[Any, Carried], names: Mapping[str, Value], memory: Memory, node: ast.AST
    ) -> dict[Any, Carried]:
        """Note the next values of a loop; return the values that are carried beyond expectation, or in other kinds."""
        changed: dict[Any, Carried] = {}
        now = dict(self._places(self.names, self.memory))
        for number, (key, before) in enumerate(self._places(names, memory)):
            after = now[key]
            known = carried.get(key)
            if isinstance(before, Unbound):
                continue
            if after is (known.value if known else before):
                if known:
                    loop.carried[key].next = known.value
                continue
            if not isinstance(after, Node) or not isinstance(before, Node):
                what = key if isinstance(key, str) else key[1]
                self.refuse(
                    node,
                    f"the loop leaves {described(after)} in '{what}', which was {described(before)}",
                    "a loop over an array carries numbers only",
                )
            expected = Range(known.value.kind, (known.value.low, known.value.high)) if known else None
            with self._merging(node):
                wanted = widened(self.graph, before, after, expected)
            if known and wanted == expected:
                loop.carried[key].next = converted(self.graph, after, known.value.kind)
                continue
            # The number of the place, since elements of several lists have the same index.
            payload = loop.number, number, *wanted.limits
            leaf = self.graph.leaf("carried", wanted.kind, payload, wanted.limits, loop.phase)
            changed[key] = Carried(self._label(key, names, memory), converted(self.graph, before, wanted.kind), leaf)
        return changed

    def _label(self, key: Any, names: Mapping[str, Value], memory: Memory) -> str:
        """Return the name of a place for readers of the hardware: `total`, `grid_3`."""
        if isinstance(key, str):
            return key
        owner, item = key
        holder = next((place for place, value in self._places(names, memory) if value is owner), "")
        return f"{self._label(holder, names, memory)}_{item}".lstrip("_")

    def _after(self, loop: Loop, carried: Mapping[Any, Carried], names: dict[str, Value], memory: Memory) -> None:
        """Set the names and the memory after a loop."""
        inner, made_in_loop = {key for key in self.names if key not in names}, self.memory
        self.names, self.memory = dict(names), memory
        for key in inner:
            self.names[key] = Unbound(key)
        for key, item in carried.items():
            made = loop.carried[key]
            made.name = f"{made.name}_{loop.number}"
            limits = item.value.low, item.value.high
            self._put(key, self.graph.leaf("final", item.value.kind, made.value.payload, limits, loop.phase + 1))
        for array, element in loop.appended.items():
            self._keep(element, made_in_loop)
            for key, value in [*self._places(self.names, self.memory)]:
                if value is array:
                    self._put(key, Produced(loop.number, element))

    def _keep(self, value: Value, memory: Memory) -> None:
        """Keep the content of a message that was made in a loop, as it was at the end of a turn."""
        if isinstance(value, Record | Array) and value not in self.memory.cells:
            self.memory.cells[value] = memory.cells[value]
            for item in memory.cells[value].values():
                self._keep(item, memory)

    def _value_listcomp(self, node: ast.ListComp | ast.GeneratorExp) -> Value:
        first, *others = node.generators
        if others:
            self.refuse(others[0].target, "a comprehension with two loops is not hardware", "write the loops")
        iterated = self._iterated(first.iter)
        if isinstance(iterated, OverStream):
            return self._produced(node, first, iterated)
        found: list[Value] = []
        with self._own_names(first.target):
            for item in iterated:
                self.assign(first.target, item)
                conditions = [self.truth(test) for test in first.ifs]
                if any(not condition.is_constant for condition in conditions):
                    self.refuse(first.ifs[0], "the number of elements depends on a value", "use 'if' in the element")
                if all(condition.payload for condition in conditions):
                    found.append(self.expression(node.elt))
        return self.list_of(found)

    _value_generatorexp = _value_listcomp

    @contextmanager
    def _own_names(self, target: ast.expr, **own: Value) -> Iterator[None]:
        """Run a comprehension: the names of its target, and those of `own`, are not those of the function."""
        kept = dict(self.names)
        hidden = {item.id for item in ast.walk(target) if isinstance(item, ast.Name)}
        self.names = {name: value for name, value in kept.items() if name not in hidden} | own
        yield
        self.names = {name: value if name in hidden else self.names[name] for name, value in kept.items()}

    def reduced_stream(self, name: str, node: ast.Call) -> Node | None:
        """Return the result of `min`, `sum` and so on of an array of variable size, or None for another argument."""
        argument = node.args[0]
        item = ast.Name("$item", ast.Load())
        part = ast.comprehension(ast.Name("$item", ast.Store()), argument, [], 0)
        if isinstance(argument, ast.GeneratorExp | ast.ListComp):
            part, item = argument.generators[0], argument.elt  # type: ignore[assignment]
            if argument.generators[1:]:
                return None
        over = self._iterated(part.iter)
        if not isinstance(over, OverStream):
            return None
        default = next((keyword.value for keyword in node.keywords), None)
        if name in EXTREMES and default is None:
            message = f"the array '{over.stream.path}' may be empty, and then '{name}' has no result"
            self.refuse(node, message, f"write {name}(..., default=math.inf)")
        first = self.number(default) if default else self.graph.constant({"sum": 0, "all": True}.get(name, False))
        body: list[ast.stmt] = _reduction(name, item, node)
        for condition in reversed(part.ifs):
            body = [ast.copy_location(ast.If(condition, body, []), node)]
        with self._own_names(part.target, **{"$result": first, "$found": self.graph.constant(value=False)}):
            self._for_stream(ast.copy_location(ast.For(part.target, part.iter, body, []), node), over)
            result: Node = self.names["$result"]
        return result

    def _produced(self, node: ast.ListComp | ast.GeneratorExp, part: ast.comprehension, over: OverStream) -> Value:
        """Return the array that a comprehension over a stream makes, an element for each one."""
        if part.ifs:
            self.refuse(part.ifs[0], "the number of elements must be known before the first one", "send all elements")
        array = self.list_of([])
        append = ast.Call(ast.Attribute(ast.Name("$made", ast.Load()), "append", ast.Load()), [], [])
        loop = ast.For(part.target, part.iter, [ast.Expr(append)], [])
        for item in (loop, *ast.walk(append)):
            ast.copy_location(item, node.elt)
        # The element keeps the places of its parts.
        append.args.append(node.elt)
        with self._own_names(part.target, **{"$made": array}):
            self._for_stream(loop, over)
            return self.names["$made"]
