"""The names of a source while a function is compiled: constants, functions, classes and imports of the module."""

from __future__ import annotations

import ast
import builtins
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

from fusesoc_firm.compiler.functions import CONSTANTS
from fusesoc_firm.compiler.paths import Paths
from fusesoc_firm.compiler.values import Class, Function, Named, Unbound, Value
from fusesoc_firm.text.diagnostics import nearest


@dataclass
class Names(Paths):
    """A run that knows the names of its source; `on_global` is called for each one after its first value."""

    on_global: Callable[[str], None] = lambda _: None
    module_names: dict[str, Value] = field(default_factory=dict)
    _pending: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.definitions = {name: node for node in self.source.module.body for name in bound_names(node)}

    @abstractmethod
    def expression(self, node: ast.expr) -> Value:
        """Return the value of an expression."""

    @abstractmethod
    def assign(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a name, an attribute, an element or several of them."""

    def global_value(self, name: str, node: ast.AST) -> Value:
        """Return the value of a name of the module, computed at its first use."""
        if name in self.module_names:
            return self.module_names[name]
        definition = self.definitions.get(name)
        if definition is None:
            return self._builtin(name, node)
        if name in self._pending:
            self.refuse(node, f"'{name}' is used before it has a value")
        self._pending.add(name)
        self.module_names[name] = self._defined(name, definition)
        self._pending.remove(name)
        self.on_global(name)
        return self.module_names[name]

    def _defined(self, name: str, definition: ast.stmt) -> Value:
        """Return the value that a statement of the module gives to a name."""
        match definition:
            case ast.FunctionDef():
                return Function(definition)
            case ast.ClassDef():
                return Class(definition)
            case ast.Import(names=names):
                return next(Named(item.name if item.asname else name) for item in names if name in _names_of(item))
            case ast.ImportFrom(module=module, names=names):
                original = next(item.name for item in names if (item.asname or item.name) == name)
                full = f"{module}.{original}"
                return self.arithmetic.literal(CONSTANTS[full]) if full in CONSTANTS else Named(full)
            case ast.Assign(targets=[ast.Name()], value=given) | ast.AnnAssign(value=ast.expr() as given):
                with self._own_frame():
                    return self.expression(given)
            case ast.Assign(targets=[ast.Tuple() as target], value=given):
                with self._own_frame() as frame:
                    self.assign(target, self.expression(given))
                    return frame.names[name]
        return self.refuse(definition, f"'{name}' is not a constant", "assign each name once, in a line of its own")

    def _builtin(self, name: str, node: ast.AST) -> Value:
        if hasattr(builtins, name):
            return Named(name)
        # The names of the compiler's own statements begin with '$'.
        local = [item for item in self.names if not item.startswith("$")] if self._frames else []
        known = [*local, *self.definitions]
        hint = nearest(name, known)
        if name[0].isupper() and "did you mean" not in hint:
            hint = "a message is a dictionary: {'linear': {'x': 0.0}}"
        return self.refuse(node, f"the name '{name}' has no value", hint)

    def named(self, name: str, node: ast.AST) -> Value:
        """Return the value of a name of the function or the module."""
        names = self.names
        if name not in names:
            return self.global_value(name, node)
        if isinstance(names[name], Unbound):
            self.refuse(
                node,
                f"'{name}' has no value on one of the paths to here",
                f"give '{name}' a value before the 'if' or loop",
            )
        return names[name]


def bound_names(node: ast.stmt) -> list[str]:
    """Return the names that a statement of a module or class binds."""
    match node:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Import(names=names):
            return [name for item in names for name in _names_of(item)]
        case ast.ImportFrom(names=names):
            return [item.asname or item.name for item in names]
        case ast.Assign(targets=targets):
            return [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
    return []


def _names_of(item: ast.alias) -> list[str]:
    return [item.asname or item.name.partition(".")[0]]
