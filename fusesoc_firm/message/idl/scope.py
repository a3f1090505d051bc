"""The types and constants that IDL text has declared so far, and what a scoped name means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from fusesoc_firm.message.idl.names import Path, constants_module
from fusesoc_firm.message.idl.tokens import IdlError, IdlText, Token
from fusesoc_firm.message.model import Constant, FieldType, Scalar

_T = TypeVar("_T")


@dataclass(eq=False)
class Enum:
    """An enum: its name and its enumerators."""

    name: str
    enumerators: list[Constant] = field(default_factory=list)


@dataclass(frozen=True)
class Declared:
    """A type, and the enum whose values it contains, if any."""

    type: FieldType
    enum: Enum | None = None


class Scope:
    """The current modules, and all declarations by their paths."""

    def __init__(self, text: IdlText) -> None:
        self.modules: Path = ()
        # The struct that is parsed; rosidl looks up names in the module with its constants, too.
        self.struct = ""
        self._text = text
        self._types: dict[Path, Declared] = {}
        self._constants: dict[Path, Constant] = {}
        self._places: dict[Path, Token] = {}
        self._by_module: dict[Path, list[Constant]] = {}

    @contextmanager
    def within(self, module: str) -> Iterator[None]:
        """Enter a module for the context."""
        outer, self.modules = self.modules, (*self.modules, module)
        try:
            yield
        finally:
            self.modules = outer

    def declare(self, name: Token) -> None:
        """Note a name of the current module. Raise `IdlError` if it is known."""
        path = (*self.modules, name.text)
        if path in self._places:
            raise twice(self._text, name, self._places[path])
        self._places[path] = name

    def add_type(self, name: Token, declared: Declared) -> None:
        """Declare a type. Raise `IdlError` if its name is known, and not for an equal type."""
        path = (*self.modules, name.text)
        # rosidl_adapter repeats the typedefs of a service's request for its response.
        if self._types.get(path) != declared or path not in self._places:
            self.declare(name)
        self._types[path] = declared

    def announce(self, name: Token, declared: Declared) -> None:
        """Declare a type that a later declaration defines."""
        self._types.setdefault((*self.modules, name.text), declared)

    def add_constant(self, name: Token, constant: Constant) -> None:
        """Declare a constant. Raise `IdlError` if its name is known."""
        self.declare(name)
        self._constants[*self.modules, name.text] = constant
        self._by_module.setdefault(self.modules, []).append(constant)

    def add_enum(self, name: Token, enum: Enum) -> None:
        """Make the enumerators of an enum known by its name, too."""
        for enumerator in enum.enumerators:
            self._constants[*self.modules, name.text, enumerator.name] = enumerator

    def constants_of(self, modules: Path, struct: str) -> list[Constant]:
        """Return the constants of a struct in these modules."""
        return self._by_module.get((*modules, constants_module(struct)), [])

    def type_of(self, is_absolute: bool, words: Path) -> Declared | None:
        """Return the type with a scoped name, or None."""
        return self._resolved(self._types, is_absolute, words)

    def value_of(self, is_absolute: bool, words: Path) -> Scalar | None:
        """Return the value of the constant with a scoped name, or None."""
        own = (constants_module(self.struct), *words)
        found = self._resolved(self._constants, is_absolute, words) or self._resolved(self._constants, is_absolute, own)
        return found.value if found else None

    def _resolved(self, known: Mapping[Path, _T], is_absolute: bool, words: Path) -> _T | None:
        """Return the declaration in the innermost module that has one."""
        scopes = [0] if is_absolute else range(len(self.modules), -1, -1)
        found = (known.get((*self.modules[:count], *words)) for count in scopes)
        return next((item for item in found if item is not None), None)


def twice(text: IdlText, name: Token, first: Token) -> IdlError:
    """Return the fault of a name that was declared before, at `first`."""
    hint = f"the first declaration is in line {text.place(first).line}"
    return text.fault(f"'{name.text}' is declared twice", name, hint)
