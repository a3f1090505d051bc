"""Compile a Python function to a program: a graph, its loops over streams, its states and its answers."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, NoReturn

from fusesoc_firm.compiler.answers import Answer, AnswerMaker, Made
from fusesoc_firm.compiler.conversions import Range, UnmergeableError, converted, widened
from fusesoc_firm.compiler.front import Interpreter
from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.interface import Bits, Side, message_value
from fusesoc_firm.compiler.kinds import Kind, number_of
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.source import Source, stored_attributes
from fusesoc_firm.compiler.streaming import late, problems
from fusesoc_firm.compiler.values import Array, Class, Function, Instance, Named, Record, Value, described
from fusesoc_firm.text.diagnostics import InputError, nearest

_MOST_ROUNDS = 20
# The attributes on the path of a state.
_NAME = re.compile(r"\.(\w+)")


@dataclass
class State:
    """A value that the function keeps between messages: its path, its first value, and its next one."""

    path: str
    first: Node
    value: Node
    next: Node


@dataclass
class Program:
    """A compiled function."""

    name: str
    source: Source
    graph: Graph
    inputs: Sequence[Side]
    loops: list[Loop]
    states: list[State]
    answers: list[Answer]
    settings: Sequence[Setting] = ()

    def results(self) -> Iterator[Node]:
        """Yield all nodes whose values the hardware needs."""
        yield from self._kept()
        for item in chain(*(loop.carried.values() for loop in self.loops)):
            yield from item.sources()

    def _kept(self) -> Iterator[Node]:
        """Yield the values that leave the function: answers and next states."""
        yield from (state.next for state in self.states)
        yield from chain(*(chain(*made.fields.values()) for made in self.made()))
        yield from chain(*(answer.nodes() for answer in self.answers))

    def made(self) -> Iterator[Made]:
        """Yield the arrays that loops make."""
        yield from (sent.value for answer in self.answers for sent in answer.parts if isinstance(sent.value, Made))

    def needed(self) -> list[Node]:
        """Return the nodes that results depend on, in their order."""
        found = self._reached(self.results())
        return [item for item in self.graph.nodes if item.number in found]

    def drop_unused(self) -> None:
        """Remove the carried values of loops on which no result depends, such as an index that nobody reads."""
        read = self._reached(self._kept())
        for loop in self.loops:
            loop.carried = {key: item for key, item in loop.carried.items() if item.value.number in read}

    def _reached(self, results: Iterable[Node]) -> set[int]:
        """Return the numbers of all nodes that results depend on, also through values that loops carry."""
        carried = {item.value.payload: item for loop in self.loops for item in loop.carried.values()}
        found: set[int] = set()
        waiting = [*results]
        while waiting:
            node = waiting.pop()
            if node.number in found:
                continue
            found.add(node.number)
            waiting += node.operands
            if node.operation in ("carried", "final"):
                item = carried[node.payload]
                waiting += [item.value, *item.sources()]
        return found


@dataclass(frozen=True)
class Setting:
    """A number that is set from outside: an attribute of the function's object, and a port of the hardware.

    It is at least `low` and at most `high`, and `default` at first.
    """

    name: str
    port: str
    kind: Kind
    default: float
    low: float
    high: float


@dataclass(frozen=True)
class Task:
    """A function to compile: its source and name, its messages, and the kind of its floats, if one is given."""

    source: Source
    name: str
    inputs: Sequence[Side]
    outputs: Sequence[Side]
    numbers: Kind | None = None
    settings: Sequence[Setting] = ()


def compile_function(task: Task) -> Program:
    """Return the program of a function, or of a callable object, of a source. May raise `InputError`.

    The function is run until the kinds of its states are known. Unknown states have their first values.
    """
    states: dict[str, Range] = {}
    for _ in range(_MOST_ROUNDS):
        try:
            run = _Run(task, states)
        except InputError as error:
            # The first value may be refused where later ones are not: a quotient by zero.
            states |= _assumed(task, states, error)
            continue
        wider = run.changes()
        if not wider:
            return run.program()
        states |= wider
    source = task.source
    return source.refuse(source.module, "the types of the states cannot be determined", "give them a type of NumPy")


def _assumed(task: Task, states: dict[str, Range], error: InputError) -> dict[str, Range]:
    """Return further states: attributes that a method changes. Raise `error` if they do not help."""
    try:
        found = _Run(task, states, {item.attr for item in stored_attributes(task.source.module)}).changes()
    except InputError:
        raise error from None
    if not found:
        raise error
    return found


def _returned(definition: ast.FunctionDef | ast.Lambda) -> ast.AST:
    """Return the only expression other than None that a function returns, or the function."""
    found = [item.value for item in ast.walk(definition) if isinstance(item, ast.Return) and item.value]
    found = [item for item in found if not (isinstance(item, ast.Constant) and item.value is None)]
    return found[0] if len(found) == 1 else definition


class _Run:
    """One run of the function with states of given kinds; the attributes `assumed` are states, too, of first kinds."""

    def __init__(self, task: Task, states: dict[str, Range], assumed: Collection[str] = ()) -> None:
        self.name, self.inputs, self.outputs, self.states = task.name, task.inputs, task.outputs, states
        self.assumed = {*assumed}
        self.numbers = task.numbers
        self.settings = {f"{task.name}.{item.name}": item for item in task.settings}
        self.interpreter = Interpreter(task.source, on_global=self._enter)
        self.graph = self.interpreter.graph
        self.graph.format = task.numbers.format if task.numbers else None
        self.first: dict[str, Value] = {}
        self.next: dict[str, Node] = {}
        self.leaves: dict[str, Node] = {}
        function = self._function()
        memory = self.interpreter.memory
        self.graph.place = task.source.line(function.definition)
        messages = [message_value(side, self.graph, memory, task.numbers) for side in task.inputs]
        self.node = function.definition
        # The first parameter of a method is the object.
        parameters = [item.arg for item in (*self.node.args.posonlyargs, *self.node.args.args)]
        self.parameters = parameters[1:] if function.owner else parameters
        self.result = self.interpreter.call(function, messages, {}, self.node)

    def _function(self) -> Function:
        """Return the function, or the method that is called for an object."""
        source, run = self.interpreter.source, self.interpreter
        if self.name not in run.definitions:
            source.refuse(
                source.module, f"the file has no function '{self.name}'", nearest(self.name, [*run.definitions])
            )
        value = run.global_value(self.name, run.definitions[self.name])
        if isinstance(value, Instance):
            method = next((item for item in value.type.body if getattr(item, "name", "") == "__call__"), None)
            if method is None:
                source.refuse(
                    value.type, f"'{value.type.name}' has no method '__call__'", "the message is its argument"
                )
            value = run.member(value, "__call__", value.type)
        match value:
            case Function():
                return value
            case Class(definition=definition):
                hint = f"construct it: {self.name} = {definition.name}()"
                source.refuse(definition, f"'{self.name}' is a class, not an object", hint)
            case Named():
                source.refuse(
                    run.definitions[self.name], f"'{self.name}' is not defined in this file", "define it here"
                )
        return source.refuse(run.definitions[self.name], f"'{self.name}' is {described(value)}, not a function")

    def _enter(self, name: str) -> None:
        """Note the first values of the objects that a name of the module has, and put states in their place."""
        for path, owner, key, value in self._cells(name):
            self.first[path] = value
            if path in self.settings:
                self.first[path] = self.interpreter.memory.cells[owner][key] = self._setting(path, value)
                continue
            known = self.states.get(path)
            if known is None and isinstance(value, Node) and not self.assumed.isdisjoint(_NAME.findall(path)):
                known = Range(value.kind, (value.low, value.high))
            if known:
                leaf = self.graph.leaf("state", known.kind, path, known.limits)
                self.leaves[path] = leaf
                self.interpreter.memory.cells[owner][key] = leaf

    def _setting(self, path: str, first: Value) -> Node:
        """Return the value of a number that is set from outside. Raise `InputError` if its first value is another."""
        item = self.settings[path]
        is_fixed = self.numbers and self.numbers.format and item.kind.is_float
        kind = self.numbers if self.numbers and is_fixed else item.kind
        known = first.payload if isinstance(first, Node) and first.is_constant else None
        if known is None or number_of(kind, known) != number_of(kind, item.default):
            what = described(first) if known is None else known
            self._refuse_setting(
                f"'{path}' is {what} at first, and its default {item.default:.9g}", "use the same value"
            )
        limits = None if item.kind.is_float else (int(item.low), int(item.high))
        made = self.graph.leaf("input", item.kind, Bits(item.port), limits)
        return converted(self.graph, made, self.numbers) if self.numbers and item.kind.is_float else made

    def _check_settings(self, after: Mapping[str, Value]) -> None:
        """Refuse a number that is set from outside, and that the object lacks or changes."""
        for path, item in self.settings.items():
            if path not in after:
                hint = "set it in __init__ of the object's class"
                self._refuse_setting(f"'{self.name}' has no attribute '{item.name}' for the parameter", hint)
            if after[path] is not self.first[path]:
                self._refuse_state(path, "is a parameter, which the function cannot set", "use another attribute")

    def _refuse_setting(self, message: str, hint: str) -> NoReturn:
        source = self.interpreter.source
        source.refuse(self.interpreter.definitions.get(self.name, source.module), message, hint)

    def _cells(self, name: str) -> Iterator[tuple[str, Any, Any, Value]]:
        """Yield the path, the owner, the key and the value of each number to which a name leads."""
        yield from self._below(name, self.interpreter.module_names[name], set())

    def _below(self, path: str, owner: Value, seen: set[int]) -> Iterator[tuple[str, Any, Any, Value]]:
        if not isinstance(owner, Instance | Array | Record) or id(owner) in seen:
            return
        seen.add(id(owner))
        for key, value in [*self.interpreter.memory.cells[owner].items()]:
            below = f"{path}[{key}]" if isinstance(key, int) else f"{path}.{key}"
            if isinstance(value, Instance | Array | Record):
                yield from self._below(below, value, seen)
            else:
                yield below, owner, key, value

    def changes(self) -> dict[str, Range]:
        """Return the states that the function changes beyond expectation, with their ranges."""
        found: dict[str, Range] = {}
        after = {path: value for name in self.interpreter.module_names for path, _, _, value in self._cells(name)}
        for path in self.first.keys() - after.keys():
            self._refuse_state(path, "is lost with a message", "keep the number of elements of lists")
        self._check_settings(after)
        for path, value in after.items():
            if path not in self.first and (grown := self._grown(path)):
                hint = "use a list of fixed size, and replace its elements"
                self._refuse_state(grown, "grows with each message", hint)
            if path not in self.first:
                self._refuse_state(path, "has no value before the first message", "give it one in __init__")
            before = self.leaves.get(path, self.first[path])
            if value is before:
                if path in self.leaves:
                    self.next[path] = self.leaves[path]
                continue
            if not isinstance(value, Node) or not isinstance(self.first[path], Node):
                if self.first[path] is None:
                    hint = "give it a number in __init__, and a truth value of its own that tells whether it is set"
                    self._refuse_state(path, "is None at first, and a state is a number", hint)
                what = f"was {described(self.first[path])}, and becomes {described(value)}"
                self._refuse_state(path, what, "a state is a number")
            wanted = self._widened(path, self.first[path], value)
            if wanted != self.states.get(path):
                found[path] = wanted
            else:
                self.next[path] = converted(self.graph, value, wanted.kind)
        return found

    def _grown(self, path: str) -> str:
        """Return the path of the list of which an element that leads to a new value is new, or an empty text."""
        for index in re.finditer(r"\[\d+\]", path):
            element = path[: index.end()]
            if not any(item == element or item.startswith((f"{element}.", f"{element}[")) for item in self.first):
                return path[: index.start()]
        return ""

    def _widened(self, path: str, first: Node, value: Node) -> Range:
        try:
            return widened(self.graph, first, value, self.states.get(path))
        except UnmergeableError as error:
            self._refuse_state(path, f"is {error}", "give it one type, as int() or numpy.float32() does")

    def _refuse_state(self, path: str, what: str, hint: str) -> NoReturn:
        """Refuse a state where the function first sets it."""
        last = _NAME.findall(path)[-1:]
        stores = [item for item in stored_attributes(self.interpreter.source.module) if item.attr in last]
        place = min(stores, key=lambda item: (item.lineno, item.col_offset), default=self.node)
        self.interpreter.refuse(place, f"'{path}' {what}", hint)

    def program(self) -> Program:
        """Return the program of this run."""
        states = [
            State(
                path,
                self.graph.constant(number_of(self.states[path].kind, self.first[path].payload)),
                leaf,
                self.next[path],
            )
            for path, leaf in self.leaves.items()
        ]
        returned = _returned(self.node)
        answers = AnswerMaker(self.interpreter, returned, self.outputs).answers(self.result)
        inputs = dict(zip(self.parameters, self.inputs, strict=False))
        for message, hint in problems(answers, self.interpreter.loops, inputs):
            self.interpreter.refuse(returned, message, hint)
        program = Program(
            self.name,
            self.interpreter.source,
            self.graph,
            self.inputs,
            sorted(self.interpreter.loops, key=lambda loop: loop.number),
            states,
            answers,
            [*self.settings.values()],
        )
        program.drop_unused()
        for loop, name in late(program.loops, answers):
            message = f"the loop over '{loop.stream.path}' needs '{name}', which follows it in the message"
            self.interpreter.refuse(loop.node, message, "take an earlier field, or keep the value of the last message")
        return program
