"""An estimate of the cells and the clock of a scheduled function, from `operators.yaml` and its registers.

Operators have the cells that the file states. Their operand registers choose among the values of their operations. The
factors below were fitted to placed functions; docs/how-to/explore-an-accelerator.md compares estimates and
measurements.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from fusesoc_firm.compiler.answers import Made
from fusesoc_firm.compiler.binding import Binding, bound
from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.interface import Elements, Part
from fusesoc_firm.compiler.kinds import BOOL
from fusesoc_firm.compiler.operators import Cost, is_operator
from fusesoc_firm.compiler.schedule import TRANSPARENT, Schedule, Unit
from fusesoc_firm.compiler.selection import selected

# LUT4 for each bit: of each of several sources of an operand, of comparisons of two floats or of one with a constant,
# and of the other operations between registers.
_SOURCE, _COMPARISON, _BOUND, _CHOICE, _SUM, _QUIET = 0.65, 3.6, 2.0, 1.0, 1.0, 1.2
# LUT4 for each step in which registers are loaded, and for each bit of an array's element.
_STEP, _ELEMENT = 2.0, 2.0
# The time in ns from one register to the next one without logic.
_REGISTER = 2.7
_TENTH = 0.1
# The cells of a bit of an operator whose description has no clock, since it is not measured.
_UNMEASURED_LUT, _UNMEASURED_FF = 8, 5
_DSP_BITS = 18


@dataclass(frozen=True)
class Estimate:
    """Estimated LUT4, registers, MULT18X18D, and the clock in MHz in an ECP5-8."""

    lut: int
    ff: int
    dsp: int
    megahertz: float

    def data(self) -> dict[str, float]:
        """Return the estimate as plain data."""
        return {"lut": self.lut, "ff": self.ff, "dsp": self.dsp, "mhz": round(self.megahertz, 1)}


def estimate(schedule: Schedule) -> Estimate:
    """Return the estimate of a schedule's entity."""
    binding = bound(schedule)
    units = [_cost(unit) for unit in schedule.units]
    lut = sum(cost.lut for cost in units) + _logic(schedule) + _selections(binding) + _control(schedule)
    ff = sum(cost.ff for cost in units) + _registers(binding)
    dsp = sum(cost.dsp for cost in units) + sum(map(_multipliers, schedule.program.needed()))
    return Estimate(round(lut), ff, dsp, _clock(schedule))


def _cost(unit: Unit) -> Cost:
    """Return the cells of an operator; those of one that is not measured are proportional to its bits."""
    cost, bits = unit.operator.cost, unit.operator.operand
    return cost if cost.megahertz else replace(cost, lut=_UNMEASURED_LUT * bits, ff=_UNMEASURED_FF * bits)


def _logic(schedule: Schedule) -> float:
    """Return the LUT4 of operations between registers, and of floats in answers."""
    found = sum(map(_of_operation, schedule.program.needed()))
    for answer in schedule.program.answers:
        found += sum(_QUIET * node.bits for nodes in answer.fields.values() for node in nodes if node.kind.is_float)
    return found


def _of_operation(node: Node) -> float:
    if node.operation in LEAVES or node.operation in TRANSPARENT or is_operator(node):
        return 0.0
    match node.operation:
        case "less" | "at_most" | "equal" if node.operands[0].kind.is_float:
            is_bound = any(item.is_constant for item in node.operands)
            return (_BOUND if is_bound else _COMPARISON) * node.operands[0].bits
        case "less" | "at_most" | "equal":
            return _SUM * node.operands[0].bits
        case "choose":
            return _CHOICE * node.bits
    return _SUM * node.bits if node.kind != BOOL else 1.0


def _multipliers(node: Node) -> int:
    """Return the multipliers of a product of integers."""
    if node.operation != "multiply" or is_operator(node):
        return 0
    one, other = (-(-item.bits // _DSP_BITS) for item in node.operands)
    return one * other


def _selections(binding: Binding) -> float:
    """Return the LUT4 that choose the operands of operators, and the elements of lists."""
    found = sum(_SOURCE * unit.operator.operand * count for unit, count in _choices(binding) if count > 1)
    answers = binding.schedule.program.answers
    listed = (node for answer in answers for sent in answer.parts for node in sent.listed())
    return found + sum(_SOURCE * node.bits for node in listed if not node.is_constant)


def _choices(binding: Binding) -> Iterator[tuple[Unit, int]]:
    """Yield the number of places from which each operand of each operator comes; constants need few cells."""
    for unit in binding.schedule.units:
        issues = [item for item in binding.schedule.issues.values() if item.unit == unit]
        for sources in selected(issues, binding.source):
            yield unit, sum(not isinstance(item, Node) or not item.is_constant for item in sources)


def _control(schedule: Schedule) -> float:
    loads = {(item.node.phase, item.start) for item in schedule.issues.values()}
    loads |= {(time.phase, time.step) for time in schedule.times.values()}
    return _STEP * len(loads) + _ELEMENT * sum(_streams(schedule))


def _streams(schedule: Schedule) -> Iterator[int]:
    """Yield the bits of an element of each array that the function reads element by element, or makes."""
    numbers = {loop.number for loop in schedule.program.loops}
    for side in schedule.program.inputs:
        yield from (_bits(part) for part in side.parts if part.number in numbers)
    for answer in schedule.program.answers:
        yield from (_bits(sent.part) for sent in answer.parts if isinstance(sent.value, Made))


def _bits(part: Part | Elements) -> int:
    return part.bits if isinstance(part, Part) else sum(leaf.kind.bits * leaf.count for leaf in part.leaves)


def _registers(binding: Binding) -> int:
    schedule = binding.schedule
    program = schedule.program
    found = sum(register.bits for register in binding.registers) + sum(state.value.bits for state in program.states)
    found += sum(item.value.bits for loop in program.loops for item in loop.carried.values())
    found += sum(node.bits for node, _ in binding.delays())
    found += sum(len(unit.operator.inputs) * unit.operator.operand for unit in schedule.units)
    found += sum(unit.operator.has_wait for unit in schedule.units) + len(program.answers)
    found += sum(_streams(schedule))
    # The step has a number, and a bit for each one.
    return found + schedule.bases[-1].bit_length() + schedule.bases[-1] + 1


def _clock(schedule: Schedule) -> float:
    """Return the clock in MHz: that of the slowest operator, or of the longest path between registers."""
    delay = max((time.delay for time in schedule.times.values()), default=0) * _TENTH
    known = [clock for unit in schedule.units if (clock := unit.operator.cost.megahertz)]
    return min([*known, 1000 / (_REGISTER + delay)])
