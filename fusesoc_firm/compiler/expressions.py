"""The expressions of a function while it is compiled, and the targets of assignments."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.compiler.conversions import integer_of
from fusesoc_firm.compiler.functions import CONSTANTS, MODULES
from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.kinds import INT, MIXED, is_number
from fusesoc_firm.compiler.names import Names, bound_names
from fusesoc_firm.compiler.values import (
    Array,
    Function,
    Instance,
    Maybe,
    Merge,
    Named,
    Produced,
    Record,
    Stream,
    Unbound,
    Value,
    described,
)
from fusesoc_firm.text.diagnostics import nearest

# What takes the place of the methods of a node, by a part of their names.
_OF_NODES = {
    "log": "remove the logging",
    "publish": "return the message",
    "create_": "the interface of the accelerator has the topics",
    "parameter": "give it a value in __init__",
    "clock": "take the time from the message's header",
}


@dataclass
class Expressions(Names):
    """A run that computes expressions and assigns their values."""

    def number(self, node: ast.expr) -> Node:
        """Return the value of an expression that must be a number."""
        value = self.expression(node)
        if not isinstance(value, Node):
            self.refuse(node, f"{described(value)} is not a number", self._remedy(value))
        return value

    def _remedy(self, value: Value) -> str:
        return "None is only returned, to send nothing" if value is None or isinstance(value, Maybe) else ""

    def truth(self, node: ast.expr) -> Node:
        """Return the truth value of an expression."""
        value = self.expression(node)
        if value is None or isinstance(value, str | tuple):
            return self.graph.constant(bool(value))
        if isinstance(value, Maybe):
            return value.condition
        if not isinstance(value, Node):
            self.refuse(node, f"{described(value)} is not a condition", "compare numbers")
        return self.checked(node, self.arithmetic.each, self.arithmetic.truth, value)

    def expression(self, node: ast.expr) -> Value:
        """Return the value of an expression, by the method with its name."""
        compute = getattr(self, f"_value_{type(node).__name__.lower()}", None)
        if compute is None:
            self.source.refuse_construct(node)
        return compute(node)

    def _value_name(self, node: ast.Name) -> Value:
        return self.named(node.id, node)

    def _value_binop(self, node: ast.BinOp) -> Value:
        return self.binary(node, type(node.op), self.expression(node.left), self.expression(node.right))

    def _value_unaryop(self, node: ast.UnaryOp) -> Node:
        if isinstance(node.op, ast.Not):
            return self.graph.opposite(self.truth(node.operand))
        value = self.number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        operation = self.arithmetic.negative if isinstance(node.op, ast.USub) else self.arithmetic.inverted
        return self.checked(node, self.arithmetic.each, operation, value)

    def _value_tuple(self, node: ast.Tuple) -> Value:
        return tuple(self._listed(node.elts))

    def _value_list(self, node: ast.List) -> Value:
        return self.list_of([*self._listed(node.elts)])

    def _listed(self, items: Sequence[ast.expr]) -> Iterator[Value]:
        """Yield the elements of a list or tuple; '*' inserts those of another one."""
        for item in items:
            if isinstance(item, ast.Starred):
                yield from self.elements(self.expression(item.value), item)
            else:
                yield self.expression(item)

    def _value_subscript(self, node: ast.Subscript) -> Value:
        return self._item(self.expression(node.value), node.slice, node)

    def _value_lambda(self, node: ast.Lambda) -> Value:
        return Function(node)

    def list_of(self, values: Sequence[Value]) -> Array:
        """Return a new list."""
        made: Array = self.memory.new(Array(), dict(enumerate(values)))
        return made

    def _value_constant(self, node: ast.Constant) -> Value:
        value: Any = node.value
        if value is None or isinstance(value, str):
            return value
        if not is_number(value) or (isinstance(value, int) and value.bit_length() > INT.bits):
            self.refuse(
                node, f"{value!r} is not a number of hardware", "legal: integers of 64 bits, floats, truth values"
            )
        found: Node = self.checked(node, self.arithmetic.literal, value)
        return found

    def binary(self, node: ast.AST, kind: type[ast.operator], one: Value, other: Value) -> Value:
        """Return the result of an operator; lists and tuples are also joined and repeated."""
        if isinstance(one, Node) and isinstance(other, Node):
            return self.checked(node, self.arithmetic.binary, kind, one, other)
        if kind is ast.Mult and isinstance(one, Array) and isinstance(other, Node) and other.is_constant:
            return self.list_of(self.memory.items(one) * int(other.payload))
        if kind is ast.Add and isinstance(one, Array) and isinstance(other, Array):
            return self.list_of([*self.memory.items(one), *self.memory.items(other)])
        if kind is ast.Add and isinstance(one, tuple) and isinstance(other, tuple):
            return one + other
        wrong = one if not isinstance(one, Node) else other
        return self.refuse(node, f"{described(wrong)} is not a number", self._remedy(wrong))

    def _value_boolop(self, node: ast.BoolOp) -> Node:
        """Return `a and b` or `a or b`, which is one of the operands."""
        found = [self.number(item) for item in node.values]
        result = found[-1]
        for value in reversed(found[:-1]):
            condition = self.checked(node, self.arithmetic.truth, value)
            pair = (result, value) if isinstance(node.op, ast.And) else (value, result)
            result = self.checked(node, self.arithmetic.choose, condition, *pair)
        return result

    def _value_compare(self, node: ast.Compare) -> Node:
        one, result = self.expression(node.left), self.graph.true()
        for kind, item in zip(node.ops, node.comparators, strict=True):
            other = self.expression(item)
            result = self.graph.both(result, self._compared(node, kind, one, other))
            one = other
        return result

    def _compared(self, node: ast.AST, kind: ast.cmpop, one: Value, other: Value) -> Node:
        if isinstance(kind, ast.Is | ast.IsNot) and None in (one, other):
            value = other if one is None else one
            condition = value.condition if isinstance(value, Maybe) else self.graph.constant(value is not None)
            return condition if isinstance(kind, ast.IsNot) else self.graph.opposite(condition)
        if isinstance(one, str) and isinstance(other, str) and isinstance(kind, ast.Eq | ast.NotEq):
            return self.graph.constant((one == other) is isinstance(kind, ast.Eq))
        for value in (one, other):
            if not isinstance(value, Node):
                self.refuse(node, f"{described(value)} cannot be compared in hardware", self._remedy(value))
        return self.checked(node, self.arithmetic.compare, type(kind), one, other)

    def _value_ifexp(self, node: ast.IfExp) -> Value:
        condition = self.truth(node.test)
        if condition.is_constant:
            return self.expression(node.body if condition.payload else node.orelse)
        one, other = self.expression(node.body), self.expression(node.orelse)
        with self._merging(node):
            return Merge(self.graph, condition, self.memory).value(one, other)

    def _value_dict(self, node: ast.Dict) -> Value:
        content: dict[str, Value] = {}
        for key, item in zip(node.keys, node.values, strict=True):
            value = self.expression(item)
            if key is None:
                content |= self.fields_of(value, item)
            elif isinstance(key, ast.Constant) and isinstance(key.value, str):
                content[key.value] = value
            else:
                self.refuse(key, "a field is named by a text", "write {'x': ..., 'y': ...}")
        return self.memory.new(Record(), content)

    def fields_of(self, value: Value, node: ast.AST) -> dict[Any, Value]:
        """Return the fields of a message."""
        if not isinstance(value, Record):
            self.refuse(node, f"{described(value)} has no fields")
        return self.memory.cells[value]

    def _value_attribute(self, node: ast.Attribute) -> Value:
        owner, name = self.expression(node.value), node.attr
        match owner:
            case Named(name=module) if module in MODULES:
                full = f"{module}.{name}"
                if full in CONSTANTS:
                    return self.checked(node, self.arithmetic.literal, CONSTANTS[full])
                return Named(full)
            case Named(name=module):
                return Named(f"{module}.{name}")
            case Record():
                return self._field(owner, name, node)
            case Instance():
                return self.member(owner, name, node)
            case Maybe():
                self.refuse(node, "the value may be None here", "test it before: 'if value is not None'")
        return self.refuse(node, f"{described(owner)} has no '{name}'")

    def _field(self, owner: Record, name: str, node: ast.AST) -> Value:
        content = self.memory.cells[owner]
        if name in content:
            if isinstance(content[name], Unbound):
                self.refuse(node, f"field '{name}' has no value on one of the paths to here")
            return content[name]
        if name in ("get", "copy", "items", "keys", "values", "update") and isinstance(node, ast.Attribute):
            self.refuse(node, f"'{name}' of a message is not hardware", "name the fields; {**message, 'x': ...} copies")
        return self.refuse(node, f"the message has no field '{name}'", nearest(name, [*map(str, content)]))

    def member(self, owner: Instance, name: str, node: ast.AST) -> Value:
        """Return an attribute or a method of an object."""
        content = self.memory.cells[owner]
        if name in content:
            return content[name]
        for item in owner.type.body:
            if isinstance(item, ast.FunctionDef) and item.name == name:
                return Function(item, owner)
            if isinstance(item, ast.Assign | ast.AnnAssign) and item.value and name in bound_names(item):
                return self.expression(item.value)
        known = [*content, *(item.name for item in owner.type.body if isinstance(item, ast.FunctionDef))]
        hint = next((hint for word, hint in _OF_NODES.items() if word in name), nearest(name, known))
        return self.refuse(node, f"'{owner.type.name}' has no '{name}'", hint)

    def _item(self, owner: Value, node: ast.expr, whole: ast.AST) -> Value:
        if isinstance(node, ast.Slice):
            return self._slice(owner, node, whole)
        index = self.expression(node)
        if isinstance(owner, Record) and isinstance(index, str):
            return self._field(owner, index, node)
        if isinstance(owner, Stream | Produced):
            self.refuse(
                whole,
                "an array of variable size is not stored, so its elements have no index",
                "loop over the array: for i, x in enumerate(...)",
            )
        if not isinstance(owner, tuple | Array) or not isinstance(index, Node):
            self.refuse(whole, f"{described(owner)} has no such element")
        values = self.elements(owner, whole)
        if index.is_constant:
            return values[self._position(index, len(values), node)]
        if not values:
            self.refuse(whole, "the list is empty")
        *others, found = values
        matches = dict(self._matches(index, len(values), node))
        for place, value in reversed([*enumerate(others)]):
            with self._merging(whole):
                found = Merge(self.graph, matches[place], self.memory).value(value, found)
        return found

    def _slice(self, owner: Value, node: ast.Slice, whole: ast.AST) -> Value:
        if not isinstance(owner, tuple | Array):
            self.refuse(whole, f"{described(owner)} has no slices", "loop over it")
        bounds = [None if item is None else self.integer(item) for item in (node.lower, node.upper, node.step)]
        values = self.elements(owner, whole)[slice(*bounds)]
        return tuple(values) if isinstance(owner, tuple) else self.list_of(values)

    def elements(self, value: Value, node: ast.AST) -> Sequence[Value]:
        """Return the elements of a tuple or a list."""
        match value:
            case tuple():
                return value
            case Array():
                return self.memory.items(value)
        return self.refuse(node, f"a loop over {described(value)} is not hardware", "use 'range', a list or an array")

    def integer(self, node: ast.expr) -> int:
        """Return the value of an expression that must be a constant integer."""
        value = self.expression(node)
        if not isinstance(value, Node) or not value.is_constant or value.kind.is_real:
            self.refuse(
                node, "the number of turns is not a constant", "loop to a constant limit, with 'if' and 'break'"
            )
        return int(value.payload)

    def _position(self, index: Node, count: int, node: ast.AST) -> int:
        value = int(index.payload)
        if index.kind.is_real or not -count <= value < count:
            self.refuse(node, f"{index.payload} is not an index of {count} elements")
        return value % count

    def _matches(self, index: Node, count: int, node: ast.AST) -> Iterator[tuple[int, Node]]:
        """Yield each index of a list, with the condition that it is this one; negative ones count from the end."""
        if any(kind.is_real for kind in index.kinds):
            self.refuse(node, "an index must be an integer", "convert it with int()")
        if index.kind == MIXED:
            index = integer_of(self.graph, index)
        for place in range(count):
            found = self.arithmetic.compare(ast.Eq, index, self.graph.constant(place))
            if index.low < 0:
                other = self.arithmetic.compare(ast.Eq, index, self.graph.constant(place - count))
                found = self.graph.either(found, other)
            yield place, found

    def assign(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a name, an attribute, an element or several of them."""
        match target:
            case ast.Name(id=name):
                self.names[name] = value
                if isinstance(value, Node) and value.operation not in LEAVES:
                    value.name = value.name or name
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                values = self.elements(value, target)
                if len(values) != len(targets):
                    self.refuse(target, f"{len(values)} values for {len(targets)} names")
                for item, part in zip(targets, values, strict=True):
                    self.assign(item, part)
            case ast.Attribute(value=owner, attr=name):
                self._set_field(self.expression(owner), name, value, target)
            case ast.Subscript(value=owner, slice=index):
                self._set_item(self.expression(owner), self.expression(index), value, target)
            case _:
                self.source.refuse_construct(target)

    def _set_field(self, owner: Value, name: str, value: Value, node: ast.AST) -> None:
        if not isinstance(owner, Instance | Record):
            self.refuse(node, f"{described(owner)} has no attribute that can be set")
        self.memory.cells[owner][name] = value

    def _set_item(self, owner: Value, index: Value, value: Value, node: ast.AST) -> None:
        if isinstance(owner, Record) and isinstance(index, str):
            self.memory.cells[owner][index] = value
            return
        if not isinstance(owner, Array) or not isinstance(index, Node):
            self.refuse(
                node, f"an element of {described(owner)} cannot be set", "only elements of lists and fields can"
            )
        content = self.memory.cells[owner]
        if index.is_constant:
            content[self._position(index, len(content), node)] = value
            return
        if not isinstance(value, Node):
            self.refuse(node, f"{described(value)} cannot be put at an index that is not constant")
        for place, condition in self._matches(index, len(content), node):
            before = content[place]
            if not isinstance(before, Node):
                self.refuse(node, f"element {place} is {described(before)}, not a number")
            content[place] = self.checked(node, self.arithmetic.choose, condition, value, before)
