"""From a Python function to its graph: the function is run once, with nodes of the graph in place of numbers.

An `if` whose condition is not constant runs both branches, and the names that differ are chosen by the condition.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass

from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.paths import Exit
from fusesoc_firm.compiler.repetition import Repetition

_MOST_NODES = 100_000


@dataclass
class Interpreter(Repetition):
    """The run of a source with nodes in place of numbers; each method may raise `InputError`."""

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Run statements until the path ends."""
        for statement in statements:
            if not self.is_alive:
                return
            self.graph.place = self.source.line(statement)
            if len(self.graph.nodes) > _MOST_NODES:
                self.refuse(statement, f"the function has more than {_MOST_NODES} operations", "use shorter loops")
            self._statement(statement)

    def _statement(self, statement: ast.stmt) -> None:
        """Run a statement, by the method with its name."""
        run = getattr(self, f"_run_{type(statement).__name__.lower()}", None)
        if run is None:
            self.source.refuse_construct(statement)
        run(statement)

    def _run_pass(self, _: ast.Pass) -> None:
        """Do nothing."""

    def _run_expr(self, node: ast.Expr) -> None:
        # A text is a comment.
        if not isinstance(node.value, ast.Constant):
            self.expression(node.value)

    def _run_assign(self, node: ast.Assign) -> None:
        value = self.expression(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _run_annassign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.assign(node.target, self.expression(node.value))

    def _run_augassign(self, node: ast.AugAssign) -> None:
        before = self.expression(node.target)
        self.assign(node.target, self.binary(node, type(node.op), before, self.expression(node.value)))

    def _run_return(self, node: ast.Return) -> None:
        if any(turns.stream for turns in self._turns):
            self.refuse(
                node, "'return' within a loop over an array is not hardware", "set a name, and return it after the loop"
            )
        self._leave(self._frames[-1].returns, self.expression(node.value) if node.value else None)

    def _run_break(self, node: ast.Break) -> None:
        if self._turns[-1].stream:
            self.refuse(node, "'break' in a loop over an array is not hardware", "use 'if' with a name instead")
        self._leave(self._turns[-1].breaks, None)

    def _run_continue(self, _: ast.Continue) -> None:
        self._leave(self._turns[-1].continues, None)

    def _run_functiondef(self, node: ast.FunctionDef) -> None:
        self.refuse(node, "a function within a function is not hardware", "put it at the top of the file")

    def _run_if(self, node: ast.If) -> None:
        condition = self.truth(node.test)
        if condition.is_constant:
            self.block(node.body if condition.payload else node.orelse)
            return
        names = self.names
        path, before, memory = self.path, dict(names), self.memory
        ends: list[Exit] = []
        for taken, statements in ((condition, node.body), (self.graph.opposite(condition), node.orelse)):
            self.names = dict(before)
            self.memory, self.path, self.is_alive = memory.copy(), self.graph.both(path, taken), True
            own = self.path
            self.block(statements)
            if self.is_alive:
                # The path is the condition itself, unless a part of the branch has left.
                ends.append(Exit(taken if self.path is own else self.path, None, self.names, self.memory))
        self.names = names
        self.is_alive = bool(ends)
        if ends:
            self.path = path if self._is_whole(ends, condition) else self._either(ends, path)
            self._merged(ends, node, names)

    def _is_whole(self, ends: Sequence[Exit], condition: Node) -> bool:
        """Whether all paths through both branches reach their ends."""
        return [item.condition for item in ends] == [condition, self.graph.opposite(condition)]
