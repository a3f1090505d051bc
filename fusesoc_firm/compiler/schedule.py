"""The time of each operation: steps within the phases of a program.

Each phase has its own steps. An operator takes its operands at the end of a step, into registers, and its result can
be read from one step on. All other operations are combinational: they are evaluated in the step in which their operands
can be read, if the delay since a register remains below a budget.

The elements of a stream are computed one after the other, or as a pipeline if each operation of the loop has a unit of
its own and no value is needed earlier than it is known: an element enters with each cycle, and steps are its stages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate

from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.kinds import BOOL
from fusesoc_firm.compiler.operators import SHORT, Operator, is_operator, operator_of
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.program import Program

# Operations that are part of the reader's expression: wires, or one inverter a bit.
_OF_FLOATS = ("negate", "absolute", "copy_sign", "rename", "sine", "cosine")
TRANSPARENT = (*_OF_FLOATS, "quotient", "remainder", "wrap", "shift_left", "shift_right", "invert")
# Delays in tenths of a nanosecond in an ECP5-8, and the most that lie between two registers.
_BUDGET = 60
_FOR_EVER = 1 << 30
RELEASE = 2
"""The cycles in which an answer is taken and the message released."""
_SELECTION = 15
_LOGIC, _CHOICE, _EQUALITY, _CARRY, _PER_BIT = 3, 8, 20, 20, 0.35


@dataclass(frozen=True)
class Time:
    """The step of a phase in which a value can be read, and the delay since the last register."""

    phase: int
    step: int
    delay: int = 0


@dataclass(frozen=True)
class Unit:
    """One instance of an operator."""

    operator: Operator
    number: int


@dataclass
class Issue:
    """An operation on a unit: the step at whose end it takes its operands, and the step of its result."""

    node: Node
    unit: Unit
    start: int
    ready: int


@dataclass
class Schedule:
    """The times of all values; `steps` is the number of steps of each phase.

    A phase in `depths` is a pipeline, which takes one step: the number of its last stage, counted from 0. A value that
    it carries from one element to the next is replaced in the stage `carried`.
    """

    program: Program
    steps: list[int]
    depths: dict[int, int] = field(default_factory=dict)
    carried: dict[int, int] = field(default_factory=dict)
    times: dict[int, Time] = field(default_factory=dict)
    issues: dict[int, Issue] = field(default_factory=dict)
    units: list[Unit] = field(default_factory=list)

    @property
    def latency(self) -> int:
        """The cycles from a complete message to its answer, without those of elements of streams."""
        return sum(self.steps[::2])

    @property
    def interval(self) -> int:
        """The cycles between two messages: the answer is taken, and the message released, in two more cycles."""
        return self.latency + RELEASE

    @property
    def element(self) -> int:
        """The most cycles for an element of an array."""
        return max(self.steps[1::2], default=0)

    @property
    def bases(self) -> list[int]:
        """The first step of each phase, counted from the begin of the program, and the step after the last one."""
        return [0, *accumulate(self.steps)]

    @property
    def starts(self) -> list[int]:
        """The first cycle of each phase with one element of each array, and the cycle after the last one."""
        return [0, *accumulate(self.depths.get(phase, count - 1) + 1 for phase, count in enumerate(self.steps))]

    def end(self, phase: int) -> int:
        """Return the last step of a phase, or the last stage of a pipeline."""
        return self.depths.get(phase, self.steps[phase] - 1)

    def stage(self, node: Node) -> int:
        """Return the first stage of its pipeline in which a value can be read."""
        if node.operation in LEAVES:
            return self.carried.get(node.number, 0)
        return self.times[node.number].step


def scheduled(program: Program, limits: Mapping[str, int] | None = None, form: str = SHORT) -> Schedule:
    """Return the schedule of a program with at most `limits` units of an operation (default: 1)."""
    nodes = program.needed()
    last = max((2 * part.number + 2 for side in program.inputs for part in side.parts), default=0)
    schedule = Schedule(program, [0] * (last + 1))
    builder = _Builder(schedule, limits or {}, form)
    for phase in range(last + 1):
        builder.run(phase, [node for node in nodes if node.phase == phase and node.operation not in LEAVES])
    return schedule


class _Builder:
    """List scheduling by the longest path, phase by phase."""

    def __init__(self, schedule: Schedule, limits: Mapping[str, int], form: str) -> None:
        self.schedule, self.limits, self.form = schedule, limits, form
        self.free: dict[Unit, int] = {}
        self.waits: list[int] = []
        self.is_pipeline = False
        self.loops = {loop.phase: loop for loop in schedule.program.loops}
        # Of the phase that is scheduled: the users of each value, the operands that each lacks, and what can start.
        self.phase = 0
        self.users: dict[int, list[Node]] = {}
        self.lacking: dict[int, int] = {}
        self.ready: list[Node] = []

    def run(self, phase: int, nodes: Sequence[Node]) -> None:
        """Schedule the operations of a phase, which are in the order of their operands."""
        loop = self.loops.get(phase)
        if loop is None or not self._is_pipeline(loop, nodes):
            self._sequence(phase, nodes)
            self.schedule.steps[phase] = self._length(phase, nodes)

    def _is_pipeline(self, loop: Loop, nodes: Sequence[Node]) -> bool:
        """Schedule the operations of a loop as a pipeline; return whether it is one."""
        operators = Counter(operator_of(node, self.form) for node in nodes if is_operator(node))
        for operator, count in operators.items():
            if operator.has_wait or count > self.limits.get(operator.operation, 1):
                return False
        phase, units = loop.phase, len(self.schedule.units)
        stages = dict.fromkeys((item.value.number for item in loop.carried.values()), 0)
        self.is_pipeline = True
        for _ in range(len(stages) + 2):
            self.schedule.carried |= stages
            self._sequence(phase, nodes)
            before, stages = stages, self._replaced(loop)
            if before == stages:
                break
        self.is_pipeline = False
        depth = max([*(self.time(node).step for node in nodes), *stages.values()], default=0)
        if before == stages and depth:
            self.schedule.depths[phase], self.schedule.steps[phase] = depth, 1
            return True
        del self.schedule.units[units:]
        for node in nodes:
            self.schedule.issues.pop(node.number, None)
        self.schedule.carried = {
            number: stage for number, stage in self.schedule.carried.items() if number not in stages
        }
        return False

    def _replaced(self, loop: Loop) -> dict[int, int]:
        """Return the stage in which each value that a pipeline carries is replaced: not before the new one is known.

        It is not read in an earlier stage, where that of an earlier element would still be there.
        """
        return {
            item.value.number: max(self.schedule.carried[item.value.number], self.time(item.next).step)
            for item in loop.carried.values()
            if item.next is not None
        }

    def _sequence(self, phase: int, nodes: Sequence[Node]) -> None:
        """Set the times of the operations of a phase, as early as units are free."""
        self.phase, self.waits, self.ready = phase, [], []
        self.free = dict.fromkeys(self.schedule.units, 0)
        own = {node.number for node in nodes}
        self.users = {number: [] for number in own}
        self.lacking = {}
        for node in nodes:
            inner = [item for item in node.operands if item.number in own]
            self.lacking[node.number] = len(inner)
            for item in inner:
                self.users[item.number].append(node)
        urgency = self._urgency(nodes)
        for node in [item for item in nodes if not self.lacking[item.number]]:
            self._enter(node)
        left, step = sum(map(is_operator, nodes)), 0
        while left:
            for node in sorted(self.ready, key=lambda item: (-urgency[item.number], item.number)):
                if self._can_start(node, step) and self._start(node, step):
                    self.ready.remove(node)
                    left -= 1
            step += 1

    def _enter(self, node: Node) -> None:
        """Note that all operands of a value have times: an operator can start, and all else is evaluated."""
        waiting = [node]
        while waiting:
            item = waiting.pop()
            if is_operator(item):
                self.ready.append(item)
                continue
            self.schedule.times[item.number] = self._evaluated(item)
            waiting += self._released(item)

    def _released(self, node: Node) -> Iterator[Node]:
        """Yield the users of a value that lack no other operand."""
        for user in self.users[node.number]:
            self.lacking[user.number] -= 1
            if not self.lacking[user.number]:
                yield user

    def _urgency(self, nodes: Sequence[Node]) -> dict[int, float]:
        """Return the longest path from each node to the end of the phase, in steps."""
        found = {node.number: 0.0 for node in nodes}
        for node in reversed(nodes):
            own = operator_of(node, self.form).latency + 1 if is_operator(node) else _delay(node) / _BUDGET
            found[node.number] += own
            for item in node.operands:
                if item.number in found:
                    found[item.number] = max(found[item.number], found[node.number])
        return found

    def _can_start(self, node: Node, step: int) -> bool:
        times = [self.time(item) for item in node.operands]
        return all(time.step < step or (time.step == step and time.delay <= _BUDGET - _SELECTION) for time in times)

    def _start(self, node: Node, step: int) -> bool:
        """Issue an operation at a step if a unit is free; return whether it is issued."""
        operator = operator_of(node, self.form)
        end = step + 1 + operator.latency
        if not operator.has_wait and any(step < wait < end for wait in self.waits):
            # While a result is awaited, the results of pipelines would pass.
            return False
        unit = self._free_unit(operator, step)
        if unit is None:
            return False
        self.free[unit] = _FOR_EVER if self.is_pipeline else end if operator.has_wait else step + 1
        if operator.has_wait:
            self.waits.append(end)
        self.schedule.issues[node.number] = Issue(node, unit, step, end)
        self.schedule.times[node.number] = Time(self.phase, end)
        for user in self._released(node):
            self._enter(user)
        return True

    def _free_unit(self, operator: Operator, step: int) -> Unit | None:
        own = [unit for unit in self.schedule.units if unit.operator == operator]
        for unit in own:
            if self.free.get(unit, 0) <= step:
                return unit
        if len(own) >= self.limits.get(operator.operation, 1):
            return None
        unit = Unit(operator, len(own))
        self.schedule.units.append(unit)
        return unit

    def time(self, node: Node) -> Time:
        """Return when a value can be read in the phase that is scheduled."""
        if node.operation in LEAVES or node.phase < self.phase:
            return Time(self.phase, self.schedule.carried.get(node.number, 0) if node.phase == self.phase else 0)
        return self.schedule.times[node.number]

    def _evaluated(self, node: Node) -> Time:
        """Return when a combinational operation is evaluated."""
        phase, times = self.phase, [self.time(item) for item in node.operands]
        step = max(time.step for time in times)
        before = max(time.delay for time in times if time.step == step)
        if node.operation in TRANSPARENT:
            return Time(phase, step, before)
        late = before + _delay(node)
        condition = times[0]
        # A comparison before a choice of numbers becomes a register of one bit, unless each element needs a step.
        has_flag = (
            node.operation == "choose" and node.kind != BOOL and condition.step == step and condition.delay > _LOGIC
        )
        if late > _BUDGET or (has_flag and phase % 2 == 0):
            return Time(phase, step + 1, _delay(node))
        return Time(phase, step, late)

    def _length(self, phase: int, nodes: Sequence[Node]) -> int:
        """Return the number of steps of a phase: all its values are in registers at the end."""
        ends = [self.time(node).step + 1 for node in nodes]
        loop = self.loops.get(phase)
        if loop is not None or phase + 1 in self.loops:
            # A loop has a step for each element, and one before for the first values.
            return max(ends, default=1) + (phase % 2 == 0 and bool(ends))
        return max(ends, default=0)


def _delay(node: Node) -> int:
    """Return the delay of a combinational operation."""
    operand = node.operands[0]
    match node.operation:
        case "and" | "or" | "xor":
            return _LOGIC
        case "choose":
            return _CHOICE if node.kind != BOOL else _LOGIC
        case "equal" | "saturate":
            return _EQUALITY
        case "less" | "at_most" | "add" | "subtract":
            return int(_CARRY + _PER_BIT * operand.bits)
        case "multiply":
            return _BUDGET
    return 0


def printed(schedule: Schedule) -> Iterator[str]:
    """Yield a line for each operation on a unit, in the order of time."""
    for item in sorted(schedule.issues.values(), key=lambda issue: (issue.node.phase, issue.start)):
        yield f"phase {item.node.phase} step {item.start}: {item.unit.operator.entity} {item.unit.number}: {item.node}"
