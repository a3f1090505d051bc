"""The answers of a compiled function: their fields, and the strings and arrays that they contain."""

from __future__ import annotations

import ast
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from itertools import chain
from operator import getitem
from typing import Any, NoReturn

from fusesoc_firm.compiler.conversions import converted
from fusesoc_firm.compiler.front import Interpreter
from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.interface import Elements, Leaf, Part, Side, places
from fusesoc_firm.compiler.kinds import INTEGERS, Kind, number_of
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.values import Array, Maybe, Memory, Produced, Record, Stream, Unbound, Value, described
from fusesoc_firm.frame.model import Data, Fixed, Frame, Path, all_nodes, names_of
from fusesoc_firm.frame.model import Loop as FrameLoop
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.text.diagnostics import nearest

_BYTE = 8
# The ends of the words for the type of an array.
_ARRAYS = ("]", "messages")


@dataclass
class Made:
    """An array of an answer that a loop makes: the elements' fields by port, or the element itself by its signal."""

    loop: Loop
    fields: dict[str, list[Node]]


@dataclass
class Listed:
    """A text or an array of an answer with a fixed number of elements: the fields of each one by port, as of `Made`."""

    length: Node
    elements: list[dict[str, list[Node]]]

    def nodes(self) -> Iterator[Node]:
        """Yield the numbers of all elements."""
        yield from chain(*(chain(*fields.values()) for fields in self.elements))


@dataclass
class Sent:
    """A string or an array of an answer: passed on from an input, made by a loop, listed, or empty.

    `absent` leads to what the answer lacks, if it leaves the part out: the part itself, or a message that contains it.
    """

    part: Part | Elements
    value: Stream | Made | Listed | None
    absent: tuple[str, ...] = ()

    def listed(self) -> list[Node]:
        """Return the numbers of all elements that are listed."""
        return [*self.value.nodes()] if isinstance(self.value, Listed) else []


@dataclass
class Answer:
    """A message that the function returns: the condition to send it, its fields by port, and its parts."""

    side: Side
    condition: Node
    fields: dict[str, list[Node]] = field(default_factory=dict)
    parts: list[Sent] = field(default_factory=list)

    @property
    def is_conditional(self) -> bool:
        """Whether the answer is not always sent."""
        return not self.condition.is_constant or not self.condition.payload

    def nodes(self) -> Iterator[Node]:
        """Yield all values that the answer needs, except for those that loops make."""
        yield self.condition
        yield from chain(*self.fields.values(), *(sent.listed() for sent in self.parts))


@dataclass(frozen=True)
class AnswerMaker:
    """What makes the answers from the result of a function, whose definition is `node`."""

    interpreter: Interpreter
    node: ast.AST
    outputs: Sequence[Side]

    @property
    def graph(self) -> Graph:
        """The graph of the function."""
        return self.interpreter.graph

    @property
    def memory(self) -> Memory:
        """The contents of its lists and messages."""
        return self.interpreter.memory

    def _refuse(self, message: str, hint: str = "") -> NoReturn:
        self.interpreter.refuse(self.node, message, hint)

    def answers(self, value: Value) -> list[Answer]:
        """Return the answers that a function's result contains, one for each output. May raise `InputError`."""
        values = [value] if len(self.outputs) == 1 else self._several(value)
        return [self._answer(side, value) for side, value in zip(self.outputs, values, strict=True)]

    def _several(self, value: Value) -> Sequence[Value]:
        if value is None:
            return [None] * len(self.outputs)
        if isinstance(value, Maybe) and isinstance(value.value, tuple):
            value = tuple(Maybe(value.condition, item) for item in value.value)
        if not isinstance(value, tuple) or len(value) != len(self.outputs):
            self._refuse(
                f"the function returns {described(value)}, not {len(self.outputs)} messages",
                "return a tuple with a message, or None, for each output",
            )
        return value

    def _answer(self, side: Side, value: Value) -> Answer:
        condition = self.graph.true()
        while isinstance(value, Maybe):
            condition, value = self.graph.both(condition, value.condition), value.value
        if value is None:
            return Answer(
                side,
                self.graph.constant(value=False),
                self._fields(side, side.leaves, None),
                [Sent(part, None) for part in side.parts],
            )
        if not isinstance(value, Record):
            self._refuse(
                f"the function returns {described(value)}, not a message",
                "return {'field': value}, or None to send nothing",
            )
        self._check_names(side.frame, value)
        fields = self._fields(side, side.leaves, value)
        return Answer(side, condition, fields, [self._sent(side, part, value) for part in side.parts])

    def _check_names(self, frame: Frame, value: Record, names: tuple[str, ...] = ()) -> None:
        """Refuse a field that the message at the end of `names` lacks, and a message in place of another value."""
        known: Any = reduce(getitem, names, frame.names)
        for name, item in self.memory.cells[value].items():
            path = (*names, str(name))
            if name not in known:
                self._refuse(f"the answer has no field '{dotted(path)}'", nearest(str(name), [*known]))
            inner = item.value if isinstance(item, Maybe) else item
            if isinstance(inner, Record):
                if type_ := _type_words(frame, path):
                    self._refuse_type(path, type_, inner)
                self._check_names(frame, inner, path)
            elif isinstance(inner, tuple | Array) and known[name]:
                elements = inner if isinstance(inner, tuple) else self.memory.items(inner)
                for element in elements:
                    if isinstance(element, Record):
                        self._check_names(frame, element, path)

    def _refuse_type(self, path: tuple[str, ...], type_: str, given: Value) -> NoReturn:
        """Refuse a value in the place of one of another type, of which `type_` are the words."""
        hint = "return a text, or pass one of the message on" if "string" in type_ else "give a number"
        if type_.endswith(_ARRAYS):
            hint = "return a list, pass one of the message on, or append to an empty list in a loop over an array"
        what = f"'{given.path}' of the message" if isinstance(given, Stream) else described(given)
        self._refuse(f"'{dotted(path)}' is {type_}, and the answer gives {what}", hint)

    def _fields(self, side: Side, leaves: Sequence[Leaf], value: Value, skipped: int = 0) -> dict[str, list[Node]]:
        """Return the fields of a message by their ports; `value` is that behind `skipped` steps of their paths."""
        found: dict[str, list[Node]] = {}
        for leaf in leaves:
            self._check_lists(value, leaf.path, skipped)
            defaults = _defaults(side, leaf.path)
            for element, steps in enumerate(places(leaf.path)):
                condition, given = self._at(value, steps[skipped:])
                fallback = converted(self.graph, self.graph.constant(defaults[element % len(defaults)]), leaf.kind)
                node = fallback if given is None else self._field(given, leaf.kind, steps)
                found.setdefault(leaf.port, []).append(self.graph.choose(condition, node, fallback))
        return found

    def _check_lists(self, value: Value, path: Path, skipped: int) -> None:
        """Refuse a list that has not the elements of the array of fixed size in its place."""
        for number, step in enumerate(path[skipped:], skipped + 1):
            lists = {steps[:-1] for steps in places(path[:number])} if step.count is not None else ()
            for steps in lists:
                _, given = self._at(value, steps[skipped:])
                count = len(given) if isinstance(given, tuple) else step.count
                if isinstance(given, Array):
                    count = len(self.memory.cells[given])
                if count != step.count:
                    name = dotted(names_of(path[:number]))
                    hint = f"return a list of {step.count}"
                    self._refuse(f"'{name}' has {step.count} elements, and the list has {count}", hint)

    def _at(self, value: Value, steps: Sequence[str | int]) -> tuple[Node, Value]:
        """Return the value at a path of an answer, or None without one, and the condition that it is there."""
        condition = self.graph.true()
        for step in (*steps, None):
            while isinstance(value, Maybe):
                condition, value = self.graph.both(condition, value.condition), value.value
            if step is None or value is None:
                break
            if isinstance(value, tuple) and isinstance(step, int):
                value = value[step] if step < len(value) else None
            elif isinstance(value, Record | Array):
                value = self.memory.cells[value].get(step)
            else:
                self._refuse(f"field '{step}' is in {described(value)}, which has no fields")
        return condition, value

    def _field(self, value: Value, kind: Kind, steps: Sequence[str | int]) -> Node:
        name = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).lstrip(".")
        if isinstance(value, Unbound):
            self._refuse(f"field '{name}' has no value on one of the paths", "give it one on each path")
        if not isinstance(value, Node):
            self._refuse(f"field '{name}' is {described(value)}, not a number")
        if any(item.is_real for item in value.kinds) and not kind.is_float:
            self._refuse(
                f"field '{name}' is an integer ({kind}), and the answer is {described(value)}",
                "convert it with int() or round()",
            )
        arithmetic = self.interpreter.arithmetic
        made: Node = self.interpreter.checked(self.node, arithmetic.each, partial(arithmetic.to, kind=kind), value)
        return made

    def _sent(self, side: Side, part: Part | Elements, value: Record) -> Sent:
        condition, given = self._at(value, names_of(part.path))
        name = dotted(names_of(part.path))
        if not condition.is_constant and given is not None:
            self._refuse(f"'{name}' is only in some answers", "send it always, or return None")
        is_fixed = part.count is not None
        match given:
            case Stream() if given.part is not None and given.part.shape == part.shape:
                return Sent(part, given)
            case Produced(loop=number, element=element):
                loop = next(item for item in self.interpreter.loops if item.number == number)
                if not is_fixed or loop.stream.part.count == part.count:
                    return Sent(part, Made(loop, self._element(side, part, element)))
            case None | "" if not is_fixed:
                return Sent(part, None, self._absent(value, names_of(part.path)) if given is None else ())
            case Array() | tuple():
                items = given if isinstance(given, tuple) else self.memory.items(given)
                return Sent(part, self._listed(side, part, items) if items else None)
            case str() if isinstance(part, Part) and part.kind is None:
                return Sent(part, self._text(part, given))
        return self._refuse_type(names_of(part.path), _type_words(side.frame, names_of(part.path)), given)

    def _absent(self, value: Value, steps: tuple[str, ...]) -> tuple[str, ...]:
        """Return the steps to the first value that is not in the answer."""
        lengths = range(1, len(steps) + 1)
        return next(steps[:length] for length in lengths if self._at(value, steps[:length])[1] is None)

    def _listed(self, side: Side, part: Part | Elements, items: Sequence[Value]) -> Listed:
        """Return an array whose elements are in a list."""
        self._check_count(part, len(items))
        if isinstance(part, Elements) and not part.leaves:
            hint = "pass one of the message on, or leave it out"
            self._refuse(f"'{dotted(names_of(part.path))}' is an array of texts, which lists do not make", hint)
        length = self.graph.constant(len(items))
        return Listed(length, [self._element(side, part, item) for item in items])

    def _text(self, part: Part, text: str) -> Listed:
        """Return a text that is a constant."""
        data = text.encode("utf-8" if part.bits == _BYTE else "utf-16-le")
        units = struct.unpack(f"<{len(data) * _BYTE // part.bits}{'B' if part.bits == _BYTE else 'H'}", data)
        self._check_count(part, len(units))
        kind = INTEGERS[f"uint{part.bits}"]
        nodes = [self.graph.constant(number_of(kind, unit)) for unit in units]
        return Listed(self.graph.constant(len(units)), [{part.stream: [node]} for node in nodes])

    def _check_count(self, part: Part | Elements, count: int) -> None:
        """Refuse a number of elements that the message does not have."""
        name = dotted(names_of(part.path))
        if part.count not in (None, count):
            hint = f"return a list of {part.count}"
            self._refuse(f"'{name}' has {part.count} elements, and the list has {count}", hint)
        if part.bound is not None and count > part.bound:
            self._refuse(f"'{name}' has at most {part.bound} elements, and the answer has {count}", "return fewer")

    def _element(self, side: Side, part: Part | Elements, value: Value) -> dict[str, list[Node]]:
        """Return the fields of an element that a loop makes."""
        names = names_of(part.path)
        if isinstance(part, Part):
            if part.kind is None:
                self._refuse(f"'{dotted(names)}' is a text, not an array", "return a text, or pass one on")
            return {part.stream: [self._field(value, part.kind, names)]}
        if isinstance(value, Record):
            self._check_names(side.frame, value, names)
        for path in part.within:
            _, given = self._at(value, names_of(path)[len(names) :])
            if given not in (None, ""):
                self._refuse(
                    f"'{dotted(names_of(path))}' is a text or an array within an element, which loops do not make",
                    "leave it out, or pass the whole array on",
                )
        return self._fields(side, part.leaves, value, len(names))


def _type_words(frame: Frame, names: tuple[str, ...]) -> str:
    """Return words for the type of a field, or an empty text for a message."""
    for node in all_nodes(frame.nodes):
        if isinstance(node, Data | FrameLoop) and node.names == names:
            return f"of type {node.ros_type}"
        for leaf in node.fields if isinstance(node, Fixed) else ():
            if leaf.names[: len(names)] == names:
                count = leaf.path[len(names) - 1].count
                if leaf.names == names:
                    return f"of type {leaf.type.name}" + ("" if count is None else f"[{count}]")
                return "" if count is None else f"an array of {count} messages"
    return ""


def _defaults(side: Side, path: Path) -> Sequence[Any]:
    """Return the default values of a field's elements."""
    fields = chain(*(node.fields for node in all_nodes(side.frame.nodes) if isinstance(node, Fixed)))
    leaf = next(item for item in fields if item.path == path)
    if leaf.default is None:
        return [False if leaf.type.name == "bool" else 0]
    return leaf.default if isinstance(leaf.default, tuple) else [leaf.default]
