"""The report of a scheduled function: which operation runs when, on which operator, and the critical chain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fusesoc_firm.compiler.binding import sources
from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.schedule import TRANSPARENT, Issue, Schedule, Unit
from fusesoc_firm.frame.model import names_of
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.system.hardware.estimate import estimate


@dataclass(frozen=True)
class Operation:
    """An operation with its first cycle and the cycle in which its result can be read.

    Cycles are counted from the complete message; those in a loop, from the first element. `unit` is empty for logic
    between registers.
    """

    node: Node
    first: int
    last: int
    unit: str = ""

    @property
    def line(self) -> int:
        """The line of the source, or 0."""
        return self.node.place.line if self.node.place else 0

    @property
    def text(self) -> str:
        """The text of the line."""
        return self.node.place.text if self.node.place else ""

    def data(self) -> dict[str, Any]:
        """Return the operation as plain data."""
        return {
            "operation": self.node.operation,
            "operator": self.unit or None,
            "first": self.first,
            "last": self.last,
            "line": self.line,
            "source": self.text,
            "loop": self.node.phase // 2 if self.node.phase % 2 else None,
        }


@dataclass(frozen=True)
class Use:
    """The use of an operator: its operations, and the cycles of a message in which it has one."""

    unit: Unit
    operations: int
    busy: int


@dataclass(frozen=True)
class Link:
    """An operation of the critical chain, with what it waited for: operands, or a busy operator."""

    operation: Operation
    reason: str


@dataclass(frozen=True)
class Report:
    """The facts about a schedule."""

    schedule: Schedule

    @cached_property
    def operations(self) -> Sequence[Operation]:
        """All operations in the order of time."""
        found = [self._operation(node) for node in self.schedule.program.needed() if _is_evaluated(node)]
        return sorted(found, key=lambda item: (item.node.phase, item.first, item.last, item.line, item.node.number))

    def _operation(self, node: Node) -> Operation:
        base = self.schedule.starts[node.phase]
        issue = self.schedule.issues.get(node.number)
        if issue is None:
            step = base + self.schedule.times[node.number].step
            return Operation(node, step, step)
        return Operation(node, base + issue.start, base + issue.ready, unit_name(issue.unit))

    @cached_property
    def uses(self) -> Sequence[Use]:
        """The operators, in their order."""
        issues = self.schedule.issues.values()
        return [_use(unit, [item for item in issues if item.unit == unit]) for unit in self.schedule.units]

    @property
    def longest(self) -> int:
        """The most cycles that the latency can have, with the slowest operands of all operators."""
        waits = [item.unit.operator for item in self.schedule.issues.values() if item.node.phase % 2 == 0]
        return self.schedule.latency + sum(operator.cost.longest - operator.latency for operator in waits)

    @property
    def elements(self) -> Mapping[str, int]:
        """The cycles for each element of the arrays over which the function loops."""
        return {loop.stream.path: self.schedule.steps[loop.phase] for loop in self.schedule.program.loops}

    @property
    def stages(self) -> Mapping[str, int]:
        """The stages of the arrays whose elements are computed by a pipeline."""
        depths = self.schedule.depths
        loops = {loop.stream.path: loop.phase for loop in self.schedule.program.loops}
        return {path: depths[phase] + 1 for path, phase in loops.items() if phase in depths}

    @property
    def waits(self) -> Mapping[int, str]:
        """The phases that begin when a string or an array has passed, each with its field."""
        parts = [part for side in self.schedule.program.inputs for part in side.parts]
        return {2 * part.number + 2: dotted(names_of(part.path)) for part in parts}

    @cached_property
    def chain(self) -> Sequence[Link]:
        """The operations that determine the latency, each of which waits for the one before."""
        by_node = {item.node.number: item for item in self.operations if item.node.phase % 2 == 0}
        now = max(by_node.values(), key=lambda item: (item.last, -item.node.number), default=None)
        found: list[Link] = []
        while now:
            before, reason = self._cause(now, by_node)
            found.append(Link(now, reason))
            now = before
        return found[::-1]

    def _cause(self, item: Operation, known: Mapping[int, Operation]) -> tuple[Operation | None, str]:
        """Return the operation that an operation waited for, and why."""
        values = [value for operand in item.node.operands for value in sources(operand)]
        read = [known[value.number] for value in values if value.number in known]
        latest = max(read, key=lambda other: (other.last, -other.node.number), default=None)
        if not item.unit or (latest and latest.last >= item.first - 1) or not item.first:
            return latest, "operand" if latest else ""
        others = [other for other in known.values() if other is not item and other.unit]
        same = [other for other in others if _kind(other) == _kind(item) and other.first < item.first]
        busy = [other for other in same if item.first in (other.first + 1, other.last)]
        # While an operator that may wait is at work, no other operation begins.
        waited = busy or [other for other in others if other.last == item.first]
        return (max(waited, key=lambda other: other.last), "operator") if waited else (latest, "operand")

    def data(self) -> dict[str, Any]:
        """Return the report as plain data."""
        schedule = self.schedule
        return {
            "function": schedule.program.name,
            "source": schedule.program.source.name,
            "latency": schedule.latency,
            "longestLatency": self.longest,
            "interval": schedule.interval,
            "cyclesOfElements": dict(self.elements),
            "stages": dict(self.stages),
            "estimate": estimate(schedule).data(),
            "operators": [
                {"operator": unit_name(use.unit), "operations": use.operations, "busy": use.busy} for use in self.uses
            ],
            "operations": [item.data() for item in self.operations],
            "chain": [link.operation.data() | {"waitsFor": link.reason or None} for link in self.chain],
        }


def unit_name(unit: Unit) -> str:
    """Return the name of an operator: its operation, the bits of its operands, and its number."""
    return f"{unit.operator.operation}{unit.operator.operand} {unit.number}"


def _kind(item: Operation) -> str:
    return item.unit.partition(" ")[0]


def _is_evaluated(node: Node) -> bool:
    return node.operation not in LEAVES and node.operation not in TRANSPARENT


def _use(unit: Unit, issues: Sequence[Issue]) -> Use:
    return Use(unit, len(issues), len({cycle for item in issues for cycle in _cycles(item)}))


def _cycles(issue: Issue) -> Iterator[tuple[int, int]]:
    """Yield the cycles in which an operation is in its operator, with their phase."""
    yield from ((issue.node.phase, step) for step in range(issue.start + 1, issue.ready + 1))
