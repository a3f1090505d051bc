"""The operators of a compiled function: as few as a limit in cycles needs, or the fastest ones within a budget."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import prod

from fusesoc_firm.compiler.operators import Operator, is_operator, operator_of
from fusesoc_firm.compiler.program import Program
from fusesoc_firm.compiler.schedule import Schedule, scheduled
from fusesoc_firm.system.derived.resolution import MOST_OPERATORS
from fusesoc_firm.system.hardware.estimate import estimate

# With more combinations, only powers of two and the largest number of each kind are tried.
_MOST_TRIED = 200


LATENCY, ELEMENT = "latency", "element"


@dataclass(frozen=True)
class Limits:
    """The most cycles from a message to its answer, and for an element of an array; None is no limit."""

    latency: int | None = None
    element: int | None = None

    def check(self, schedule: Schedule) -> None:
        """Raise `LimitError` if a schedule exceeds a limit."""
        if self.latency is not None and schedule.latency > self.latency:
            raise LimitError(LATENCY, schedule.latency)
        if self.element is not None and schedule.element > self.element:
            raise LimitError(ELEMENT, schedule.element)

    def allow(self, schedule: Schedule) -> bool:
        """Whether a schedule meets the limits."""
        try:
            self.check(schedule)
        except LimitError:
            return False
        return True


class LimitError(Exception):
    """A schedule exceeds the limit `name`, with `cycles` cycles."""

    def __init__(self, name: str, cycles: int) -> None:
        super().__init__(f"the {name} is {cycles} cycles")
        self.name, self.cycles = name, cycles


def operations_of(program: Program) -> dict[str, Operator]:
    """Return the operations of a program that need operators, each with its largest operator, the most costly first."""
    found: dict[str, Operator] = {}
    for node in program.needed():
        if is_operator(node):
            operator = operator_of(node)
            before = found.setdefault(node.operation, operator)
            found[node.operation] = max(before, operator, key=_price)
    return dict(sorted(found.items(), key=lambda item: (_price(item[1]), item[0]), reverse=True))


def _price(operator: Operator) -> tuple[int, int]:
    # A device has far fewer multipliers than LUTs.
    return operator.cost.dsp, operator.cost.lut


def most_useful(program: Program, fixed: Mapping[str, int]) -> dict[str, int]:
    """Return the numbers of operators beyond which the schedule is not shorter; those in `fixed` are given."""
    return used(scheduled(program, {**dict.fromkeys(operations_of(program), MOST_OPERATORS), **fixed}))


def used(schedule: Schedule) -> dict[str, int]:
    """Return the number of operators of each operation; those of several widths count once."""
    widest: Counter[str] = Counter()
    for unit in schedule.units:
        widest[unit.operator.operation] = max(widest[unit.operator.operation], unit.number + 1)
    return dict(widest)


def fastest_within(program: Program, fixed: Mapping[str, int], limits: Limits) -> Schedule:
    """Return the schedule with one operator of a kind, or with as few more as limits need.

    The numbers in `fixed` are given. Fewer operators of any one kind would not meet the limits. Costly operators are
    spared first. Raise `LimitError`, with the cycles of the fastest schedule, if no number of operators meets them.
    """
    found = scheduled(program, fixed)
    if limits.allow(found):
        return found
    counts = most_useful(program, fixed)
    found = scheduled(program, counts)
    limits.check(found)
    for operation in operations_of(program):
        for count in () if operation in fixed else range(1, counts[operation]):
            fewer = scheduled(program, counts | {operation: count})
            if limits.allow(fewer):
                found, counts[operation] = fewer, count
                break
    return found


def counts_to_try(program: Program, fixed: Mapping[str, int]) -> Iterator[dict[str, int]]:
    """Yield the combinations of numbers of operators; those in `fixed` are given."""
    most = most_useful(program, fixed)
    tried = {
        kind: [fixed[kind]] if kind in fixed else [*range(1, most[kind] + 1)]
        for kind in operations_of(program)
        if kind in most
    }
    if prod(map(len, tried.values())) > _MOST_TRIED:
        tried = {kind: [n for n in all_ if n == all_[-1] or n & (n - 1) == 0] for kind, all_ in tried.items()}
    for counts in product(*tried.values()):
        yield dict(zip(tried, counts, strict=True))


class BudgetError(Exception):
    """No number of operators is within a budget; `least` are the cells of the smallest schedule."""

    def __init__(self, least: Mapping[str, int]) -> None:
        super().__init__(f"the smallest function needs {dict(least)}")
        self.least = least


def fastest_of_budget(program: Program, fixed: Mapping[str, int], budget: Mapping[str, int]) -> Schedule:
    """Return the fastest schedule whose estimated `lut` and `dsp` are within a budget, of equal ones the smallest.

    The numbers in `fixed` are given. Raise `BudgetError` if none is within the budget.
    """
    found = [(item, estimate(item)) for item in (scheduled(program, n) for n in counts_to_try(program, fixed))]
    sizes = [(item, {"lut": size.lut, "dsp": size.dsp}) for item, size in found]
    fitting = [(item, size) for item, size in sizes if all(size[name] <= most for name, most in budget.items())]
    if not fitting:
        raise BudgetError(min((size for _, size in sizes), key=lambda size: [size[name] for name in budget]))
    # Elements of arrays are as frequent as messages at least.
    best, _ = min(fitting, key=lambda pair: (sum(pair[0].steps[1::2]), pair[0].latency, *pair[1].values()))
    return best
