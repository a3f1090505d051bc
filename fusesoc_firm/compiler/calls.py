"""Calls while a function is compiled: functions and classes of the source, and those that hardware knows."""

from __future__ import annotations

import ast
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fusesoc_firm.compiler.expressions import Expressions
from fusesoc_firm.compiler.functions import CALLS, called
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.names import bound_names
from fusesoc_firm.compiler.source import stored_attributes
from fusesoc_firm.compiler.values import (
    Array,
    Class,
    Function,
    Instance,
    Named,
    Produced,
    Record,
    Stream,
    Value,
    described,
)
from fusesoc_firm.text.diagnostics import nearest

_DEEPEST = 50
EXTREMES = ("min", "max")
# What a function of NumPy that chooses or combines arrays becomes.
_REMEDIES = {
    "where": "use 'a if condition else b'",
    "clip": "use 'min(max(value, low), high)'",
    "dot": "write the sum of products, in a loop over 'range'",
    "array": "use a list",
    "zeros": "use a list: [0.0] * 4",
}


@dataclass
class Calls(Expressions):
    """A run that calls functions."""

    @abstractmethod
    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Run statements until the path ends."""

    @abstractmethod
    def fixed(self, node: ast.expr) -> Sequence[Value]:
        """Return the values of a loop that has a fixed number of them."""

    @abstractmethod
    def reduced_stream(self, name: str, node: ast.Call) -> Node | None:
        """Return the result of `min`, `sum` and so on of an array of variable size, or None for another argument."""

    def call(self, function: Function, values: Sequence[Value], named: Mapping[str, Value], node: ast.AST) -> Value:
        """Return the result of a function of the source, whose statements are run here."""
        if len(self._frames) > _DEEPEST:
            self.refuse(node, "a recursion is not hardware", "write a loop over 'range'")
        definition = function.definition
        given = [*([function.owner] if function.owner else []), *values]
        bound = self._parameters(definition, given, named, node)
        with self._own_frame() as frame:
            frame.names |= bound
            if isinstance(definition, ast.Lambda):
                return self.expression(definition.body)
            self.block(definition.body)
            if self.is_alive:
                self._leave(frame.returns, None)
            return self._merged(frame.returns, node)

    def _parameters(
        self,
        definition: ast.FunctionDef | ast.Lambda,
        values: Sequence[Value],
        named: Mapping[str, Value],
        node: ast.AST,
    ) -> dict[str, Value]:
        """Return the values of a function's parameters."""
        arguments = definition.args
        for item in (arguments.vararg, arguments.kwarg):
            if item:
                self.refuse(item, "'*' and '**' parameters are not hardware", "name each parameter")
        names = [item.arg for item in (*arguments.posonlyargs, *arguments.args)]
        defaults = dict(zip(names[len(names) - len(arguments.defaults) :], arguments.defaults, strict=True))
        defaults |= {
            item.arg: value
            for item, value in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
            if value is not None
        }
        all_names = [*names, *(item.arg for item in arguments.kwonlyargs)]
        found = {**dict(zip(names, values, strict=False)), **named}
        wrong = [name for name in named if name not in all_names]
        missing = [name for name in all_names if name not in found and name not in defaults]
        title = f"'{getattr(definition, 'name', 'lambda')}'"
        if len(values) > len(names) or wrong:
            self.refuse(node, f"{title} has no parameter for {wrong[0] if wrong else 'the last value'}")
        if missing:
            self.refuse(node, f"{title} needs a value for '{missing[0]}'")
        return {name: found[name] if name in found else self.expression(defaults[name]) for name in all_names}

    def _value_call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and (method := self._method(node, node.func)) is not None:
            return method[0]
        function = self.expression(node.func)
        match function:
            case Function():
                values = [self.expression(item) for item in node.args]
                named = {str(item.arg): self.expression(item.value) for item in node.keywords}
                return self.call(function, values, named, node)
            case Class(definition=definition):
                return self._construct(definition, node)
            case Named(name=name):
                return self._known_call(name, node)
        return self.refuse(node, f"{described(function)} cannot be called")

    def _method(self, node: ast.Call, function: ast.Attribute) -> tuple[Value] | None:
        """Return the result of a method of a list or a message, or None for another call."""
        if function.attr not in ("append", "copy"):
            return None
        owner = self.expression(function.value)
        if isinstance(owner, Record | Array) and function.attr == "copy":
            return (self.memory.new(type(owner)(), self.memory.cells[owner]),)
        if not isinstance(owner, Array):
            return None
        if len(node.args) != 1:
            self.refuse(node, "'append' takes one element")
        value = self.expression(node.args[0])
        stream = next((turns.stream for turns in reversed(self._turns) if turns.stream), None)
        content = self.memory.cells[owner]
        if stream is None:
            if not self.path.is_constant:
                self.refuse(node, "the number of elements depends on a condition", "append in each case")
            content[len(content)] = value
            return (None,)
        if content or owner in stream.appended or not self.path.is_constant or not isinstance(value, Node | Record):
            self.refuse(
                node,
                "a loop over an array appends one number or message for each element, always, to an empty list",
                "append one at the end of the loop's body, and choose it with 'if' before",
            )
        stream.appended[owner] = value
        return (None,)

    def _construct(self, definition: ast.ClassDef, node: ast.Call) -> Instance:
        if definition.bases:
            self.refuse(definition.bases[0], "a class in hardware has no base class", "write its methods in the class")
        made = self.memory.new(Instance(definition), {})
        values = [self.expression(item) for item in node.args]
        named = {str(item.arg): self.expression(item.value) for item in node.keywords}
        begin = next(
            (item for item in definition.body if isinstance(item, ast.FunctionDef) and item.name == "__init__"), None
        )
        self._set_class_attributes(made)
        if begin:
            self.call(Function(begin, made), values, named, node)
        elif values or named:
            self.refuse(node, f"'{definition.name}' takes no values")
        instance: Instance = made
        return instance

    def _set_class_attributes(self, made: Instance) -> None:
        """Give an object the values of its class that its methods change, which are its own from then on."""
        changed = {item.attr for item in stored_attributes(made.type)}
        for item in made.type.body:
            if isinstance(item, ast.Assign | ast.AnnAssign) and item.value:
                for name in sorted(changed.intersection(bound_names(item))):
                    self.memory.cells[made][name] = self.expression(item.value)

    def _known_call(self, name: str, node: ast.Call) -> Value:
        """Return the result of a function of Python, `math` or NumPy."""
        if node.keywords and name != "dict" and not _has_default(name, node):
            self.refuse(node.keywords[0], f"'{name}' has no such parameter in hardware", "give the values in order")
        match name:
            case "len":
                return self._length(node)
            case "dict":
                return self._dict(node)
            case "tuple" | "list" if len(node.args) == 1:
                values = self.fixed(node.args[0])
                return tuple(values) if name == "tuple" else self.list_of(values)
            case "list" if not node.args:
                return self.list_of([])
            case "sum" | "min" | "max" | "any" | "all" if len(node.args) == 1:
                return self._reduced(name, node)
        if name not in CALLS:
            module = name.rpartition(".")[0]
            if name == "print":
                self.refuse(node, "'print' is not hardware", "remove it")
            known = [item.rpartition(".")[2] for item in CALLS if item.rpartition(".")[0] == module]
            hint = (
                _REMEDIES.get(name.rpartition(".")[2])
                or ("return the fields of the message: {'data': ...}" if module.endswith(".msg") else "")
                or nearest(name.rpartition(".")[2], known)
                or "legal here: functions of this file, of math and of numpy"
            )
            self.refuse(node, f"'{name}' is not hardware", hint)
        return self.checked(node, called, name, self.arithmetic, [self.number(item) for item in node.args])

    def _length(self, node: ast.Call) -> Node:
        value = self.expression(node.args[0]) if len(node.args) == 1 else self.refuse(node, "'len' takes one value")
        if isinstance(value, Stream):
            return value.length
        if isinstance(value, Produced):
            return next(loop.stream.length for loop in self.loops if loop.number == value.loop)
        return self.graph.constant(len(self.elements(value, node)))

    def _dict(self, node: ast.Call) -> Value:
        content: dict[str, Value] = {}
        for item in node.args:
            content |= self.fields_of(self.expression(item), item)
        for keyword in node.keywords:
            value = self.expression(keyword.value)
            content |= {keyword.arg: value} if keyword.arg else self.fields_of(value, keyword.value)
        return self.memory.new(Record(), content)

    def _reduced(self, name: str, node: ast.Call) -> Node:
        """Return the sum, the extreme or the conjunction of the elements of a list of fixed size."""
        argument = node.args[0]
        if (found := self.reduced_stream(name, node)) is not None:
            return found
        values = self._fixed_numbers(argument)
        if not values and node.keywords:
            values = [self.number(node.keywords[0].value)]
        if name == "sum":
            values = [self.graph.constant(0), *values]
        if name in ("any", "all"):
            values = [
                self.graph.constant(name == "all"),
                *(self.checked(node, self.arithmetic.each, self.arithmetic.truth, item) for item in values),
            ]
        if not values:
            self.refuse(node, f"'{name}' of no elements")
        steps: dict[str, Callable[[Node, Node], Node]] = {
            "sum": lambda one, other: self.arithmetic.binary(ast.Add, one, other),
            "min": self.arithmetic.smallest,
            "max": self.arithmetic.largest,
            "any": self.graph.either,
            "all": self.graph.both,
        }
        result = values[0]
        for item in values[1:]:
            result = self.checked(node, steps[name], result, item)
        return result

    def _fixed_numbers(self, node: ast.expr) -> list[Node]:
        values = (
            self.fixed(node) if not isinstance(node, ast.GeneratorExp) else self.elements(self.expression(node), node)
        )
        for value in values:
            if not isinstance(value, Node):
                self.refuse(node, f"{described(value)} is not a number")
        return [*values]


def _has_default(name: str, node: ast.Call) -> bool:
    """Whether the only parameter of an extreme by its name is its value without elements."""
    return name in EXTREMES and len(node.args) == 1 and [item.arg for item in node.keywords] == ["default"]
