"""The registers of a scheduled program: which values are stored, and which values share a register."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.operators import is_operator
from fusesoc_firm.compiler.schedule import TRANSPARENT, Issue, Schedule, Unit

_FOR_EVER = 1 << 30


@dataclass(frozen=True)
class Use:
    """The use of a value in a step of a phase."""

    node: Node
    phase: int
    step: int


@dataclass(eq=False)
class Register:
    """A register and the values that it holds, one after the other; it is free after the step `last`."""

    bits: int
    values: list[Node]
    last: int


@dataclass
class Binding:
    """The registers of a program, and the register of each stored value."""

    schedule: Schedule
    registers: list[Register] = field(default_factory=list)
    by_node: dict[int, Register] = field(default_factory=dict)
    # The values of pipelines that are read in later stages, each with the last one.
    delayed: dict[int, tuple[Node, int]] = field(default_factory=dict)

    def source(self, issue: Issue, operand: Node) -> Unit | Register | Node:
        """Return where an operation reads an operand: at a unit, in a register, or the value itself."""
        (read, *_) = _read(operand)
        time = self.schedule.times.get(read.number)
        if time is None or (time.phase, time.step) != (issue.node.phase, issue.start):
            return self.by_node.get(read.number, read)
        own = self.schedule.issues.get(read.number)
        return own.unit if own else read

    def delays(self) -> Iterator[tuple[Node, int]]:
        """Yield each value that a pipeline hands on from one stage to the next, with the number of the latter."""
        for node, last in self.delayed.values():
            yield from ((node, stage) for stage in range(self.schedule.stage(node) + 1, last + 1))


def bound(schedule: Schedule) -> Binding:
    """Return the registers: a value is stored if it is used in a later step than that in which it appears.

    Values of the same unit in the same phase share a register if the first one is no longer used (the left-edge
    algorithm). Such a register needs no multiplexer, since all its values come from one place.
    """
    last: dict[int, tuple[Node, int]] = {}
    bases = schedule.bases
    binding = Binding(schedule)
    for use in uses(schedule):
        if use.phase in schedule.depths:
            _delay(binding, use)
        for node in sources(use.node):
            time = schedule.times[node.number]
            if time.phase == use.phase and use.phase in schedule.depths:
                continue
            if time.phase == use.phase and time.step == use.step:
                continue
            # Values for later phases, and for all elements of a loop, keep their register.
            end = bases[use.phase] + use.step if time.phase == use.phase and use.phase % 2 == 0 else _FOR_EVER
            last[node.number] = node, max(end, last.get(node.number, (node, 0))[1])
    shared: dict[object, list[Register]] = {}
    for node, end in sorted(last.values(), key=lambda item: _appears(schedule, item[0])):
        begin = _appears(schedule, node)
        issue = schedule.issues.get(node.number)
        known = shared.setdefault(issue.unit, []) if issue else []
        register = next((item for item in known if item.last <= begin and node.phase % 2 == 0), None)
        if register is None:
            register = Register(node.bits, [], 0)
            binding.registers.append(register)
            known.append(register)
        register.values.append(node)
        register.last = end
        binding.by_node[node.number] = register
    return binding


def _delay(binding: Binding, use: Use) -> None:
    """Note the stage in which a pipeline reads a value of its own."""
    for node in _read(use.node):
        if node.phase == use.phase:
            before = binding.delayed.get(node.number, (node, 0))[1]
            binding.delayed[node.number] = node, max(before, use.step)


def _appears(schedule: Schedule, node: Node) -> int:
    time = schedule.times[node.number]
    return schedule.bases[time.phase] + time.step


def sources(node: Node) -> Iterator[Node]:
    """Yield the values that are read to evaluate a value: itself, unless it is a leaf or wires of other values."""
    yield from (item for item in _read(node) if item.operation not in LEAVES)


def _read(node: Node) -> Iterator[Node]:
    """Yield the values that are read to evaluate a value, and leaves."""
    if node.operation in TRANSPARENT:
        for item in node.operands:
            yield from _read(item)
    else:
        yield node


def uses(schedule: Schedule) -> Iterator[Use]:
    """Yield all uses of values; results are used in a phase after the last one."""
    program = schedule.program
    end = len(schedule.steps)
    for node in program.needed():
        if node.operation in LEAVES or node.operation in TRANSPARENT:
            continue
        time = schedule.times[node.number]
        step = schedule.issues[node.number].start if is_operator(node) else time.step
        yield from (Use(item, time.phase, step) for item in node.operands)
    for loop in program.loops:
        phase = loop.phase
        for item in loop.carried.values():
            yield Use(item.first, phase - 1, schedule.steps[phase - 1] - 1)
            if item.next is not None:
                yield Use(item.next, phase, schedule.carried.get(item.value.number, schedule.steps[phase] - 1))
    for made in program.made():
        phase = made.loop.phase
        yield from (Use(node, phase, schedule.end(phase)) for node in chain(*made.fields.values()))
    yield from (Use(state.next, end, 0) for state in program.states)
    for answer in program.answers:
        yield from (Use(node, end, 0) for node in answer.nodes())
