"""The text of a Python source, the places of its nodes, and what is refused in it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

from fusesoc_firm.compiler.graph import Place
from fusesoc_firm.text.diagnostics import SourceRef, fail

# The constructs of Python that are not hardware, with what to do instead.
REFUSED: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("'while' has no known number of turns", "use 'for ... in range(N)' with a constant N, and 'break'"),
    ast.AsyncFor: ("'async for' is not hardware", "use 'for'"),
    ast.AsyncFunctionDef: ("'async' is not hardware", "use a function without 'async'"),
    ast.AsyncWith: ("'async with' is not hardware", "remove it"),
    ast.Await: ("'await' is not hardware", "remove it: a function waits for nothing but its message"),
    ast.With: ("'with' is not hardware", "remove it"),
    ast.Try: ("exceptions are not hardware", "test the condition with 'if' before the operation"),
    ast.Raise: ("exceptions are not hardware", "return None, which sends nothing"),
    ast.Assert: ("'assert' is not hardware", "use 'if' and return None, which sends nothing"),
    ast.Global: ("a function in hardware cannot change a global name", "write a class, and keep the value in 'self'"),
    ast.Nonlocal: ("a function in hardware cannot change a name of another function", "return the value"),
    ast.Delete: ("'del' is not hardware", "remove it; a state of fixed size is a list of which elements are replaced"),
    ast.Import: ("an import within a function is not hardware", "put it at the top of the file"),
    ast.ImportFrom: ("an import within a function is not hardware", "put it at the top of the file"),
    ast.ClassDef: ("a class within a function is not hardware", "put it at the top of the file"),
    ast.Match: ("'match' is not hardware", "use 'if' and 'elif'"),
    ast.Yield: ("a generator is not hardware", "return the value, or append to a list"),
    ast.YieldFrom: ("a generator is not hardware", "return the value, or append to a list"),
    ast.Set: ("a set is not hardware", "use a tuple or a list"),
    ast.SetComp: ("a set is not hardware", "use a list"),
    ast.DictComp: ("a dictionary of computed keys is not hardware", "name the fields: {'x': ..., 'y': ...}"),
    ast.JoinedStr: ("a text cannot be computed in hardware", "pass a text of the message on"),
    ast.FormattedValue: ("a text cannot be computed in hardware", "pass a text of the message on"),
    ast.NamedExpr: ("':=' is not hardware", "assign the name in a line of its own"),
    ast.Starred: ("'*' is not hardware here", "name the elements"),
    ast.MatMult: ("'@' is not hardware", "write the sums of products, in loops over 'range'"),
}


@dataclass(frozen=True)
class Source:
    """A Python file: the name for messages, and its text."""

    name: str
    text: str

    @cached_property
    def lines(self) -> list[str]:
        """The lines of the file."""
        return self.text.split("\n")

    @cached_property
    def module(self) -> ast.Module:
        """The parsed file. Raise `InputError` if it is not Python."""
        try:
            return ast.parse(self.text)
        except (SyntaxError, ValueError) as error:
            line, column = (error.lineno, error.offset) if isinstance(error, SyntaxError) else (1, 1)
            message = f"the file is not valid Python: {getattr(error, 'msg', error)}"
            fail(message, SourceRef(self.name, line or 1, column or 1, self._line(line or 1)))

    def _line(self, number: int) -> str:
        return self.lines[number - 1] if number <= len(self.lines) else ""

    def place(self, node: ast.AST) -> SourceRef:
        """Return the place of a node for a message."""
        line, offset = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
        text = self._line(line)
        # The parser counts bytes of UTF-8.
        column = len(text.encode()[:offset].decode(errors="replace")) + 1
        same = getattr(node, "end_lineno", line) == line
        end = len(text.encode()[: getattr(node, "end_col_offset", offset)].decode(errors="replace")) + 1
        return SourceRef(self.name, line, column, text, max(1, end - column) if same else 1)

    def line(self, node: ast.AST) -> Place:
        """Return the line of a node for a comment."""
        number = getattr(node, "lineno", 1)
        return Place(number, self._line(number).strip())

    def refuse(self, node: ast.AST, message: str, hint: str = "") -> NoReturn:
        """Raise `InputError` for a construct that is not hardware."""
        fail(message, self.place(node), hint)

    def refuse_construct(self, node: ast.AST) -> NoReturn:
        """Raise `InputError` for a kind of construct that is never hardware."""
        what, remedy = REFUSED.get(
            type(node), (f"'{type(node).__name__}' is not hardware", "see docs/reference/python.md")
        )
        self.refuse(node, what, remedy)


def stored_attributes(tree: ast.AST) -> Iterator[ast.Attribute]:
    """Yield the attributes to which functions assign or append, also within elements, except when they construct."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef) and function.name != "__init__":
            for node in ast.walk(function):
                match node:
                    case ast.Attribute(ctx=ast.Store()) | ast.Subscript(ctx=ast.Store()) as changed:
                        pass
                    case ast.Call(func=ast.Attribute(value=changed, attr="append")):
                        pass
                    case _:
                        continue
                yield from (item for item in ast.walk(changed) if isinstance(item, ast.Attribute))
