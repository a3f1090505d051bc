"""The points of an exploration: operators of each kind and types of numbers, with cycles and estimated cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fusesoc_firm.compiler.fixed import MOST_BITS, format_of
from fusesoc_firm.compiler.program import Program
from fusesoc_firm.compiler.schedule import Schedule, scheduled
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.hardware.compiled import program_of, schedule_of
from fusesoc_firm.system.hardware.estimate import Estimate, estimate
from fusesoc_firm.system.hardware.limits import counts_to_try, used
from fusesoc_firm.text.diagnostics import Diagnostic, InputError

FIELDS, ANY = "fields", "any"
"""The numbers of a function whose fields have several types, and those of one to which they do not matter."""
# A point may be beaten by one with the same or a later type; fixed-point numbers precede them by their bits.
_BY_WIDTH = ("float32", FIELDS, "float64", ANY)

Tell = Callable[[str], None]
"""Receives the current step."""


@dataclass(frozen=True)
class Point:
    """A schedule with some numbers of operators; `elements` are its cycles for one element of all arrays.

    `is_front` marks points that no other point beats: with no more cycles and cells, and numbers at least as wide.
    `is_current` marks the point that the specification selects.
    """

    numbers: str
    schedule: Schedule = field(repr=False)
    operators: Mapping[str, int]
    elements: int
    estimate: Estimate
    is_front: bool = False
    is_current: bool = False

    @property
    def nanoseconds(self) -> float:
        """The estimated latency."""
        return 1000 * self.schedule.latency / self.estimate.megahertz

    @property
    def costs(self) -> tuple[int, ...]:
        """What a better point has less of: cycles, cells, and rounding."""
        size = self.estimate
        return self.schedule.latency, self.elements, size.lut, size.ff, size.dsp, -_rank(self.numbers)

    def data(self) -> dict[str, Any]:
        """Return the point as plain data."""
        return {
            "numbers": self.numbers,
            "operators": dict(self.operators),
            "latency": self.schedule.latency,
            "interval": self.schedule.interval,
            "cyclesOfElement": self.elements,
            "nanoseconds": round(self.nanoseconds, 1),
            "estimate": self.estimate.data(),
            "front": self.is_front,
            "current": self.is_current,
        }


def possible_numbers(
    type_: AcceleratorType, folder: Path, numbers: Sequence[str]
) -> tuple[list[str], dict[str, Diagnostic]]:
    """Return the numbers with which a function compiles, and for each other one the first fault.

    A function may name a type, as a state with `numpy.float32` does. Raise `InputError` if it compiles with none.
    """
    possible, refused = list[str](), dict[str, InputError]()
    for name in numbers:
        try:
            program_of(type_, folder, name)
        except InputError as error:
            refused[name] = error
        else:
            possible.append(name)
    if not possible:
        raise refused[numbers[-1]]
    return possible, {name: error.diagnostics[0] for name, error in refused.items()}


def explored(type_: AcceleratorType, folder: Path, numbers: Sequence[str], tell: Tell) -> list[Point]:
    """Return all points of an accelerator by numbers, latency and LUT4. May raise `InputError`."""
    current = _current(type_, folder)
    found = []
    for name, program in _programs(type_, folder, numbers).items():
        if current and _text(current.program) == _text(program):
            found.append(_point(name, current, is_current=True))
        for counts in counts_to_try(program, {}):
            tell(f"scheduling {name}: {', '.join(f'{count} {kind}' for kind, count in counts.items())}")
            found.append(_point(name, scheduled(program, counts)))
    return _with_front(sorted(_distinct(found), key=lambda item: (_rank(item.numbers), item.costs)))


def _rank(numbers: str) -> int:
    format_ = format_of(numbers)
    return format_.width - MOST_BITS if format_ else 1 + _BY_WIDTH.index(numbers)


def _current(type_: AcceleratorType, folder: Path) -> Schedule | None:
    """Return the schedule that the specification selects, or None if it has limits that cannot be met."""
    with suppress(InputError):
        return schedule_of(type_, folder)
    return None


def _programs(type_: AcceleratorType, folder: Path, numbers: Sequence[str]) -> dict[str, Program]:
    """Return the distinct programs by their numbers."""
    found = {name: program_of(type_, folder, name) for name in numbers}
    texts = [_text(program) for program in found.values()]
    if len(texts) > 1 and all(text == texts[0] for text in texts):
        return {ANY: found[numbers[0]]}
    if type_.accelerator.numbers is None:
        own = program_of(type_, folder)
        if _text(own) not in texts:
            found[FIELDS] = own
    return found


def _text(program: Program) -> list[str]:
    """Return the operations of a program, without the numbers of others between them."""
    nodes = program.needed()
    order = {node.number: place for place, node in enumerate(nodes)}
    return [
        f"{node.operation} {[order[item.number] for item in node.operands]} {node.kind} {node.payload}"
        for node in nodes
    ]


def _point(numbers: str, schedule: Schedule, *, is_current: bool = False) -> Point:
    elements = sum(schedule.steps[1::2])
    return Point(numbers, schedule, used(schedule), elements, estimate(schedule), is_current=is_current)


def _distinct(points: Sequence[Point]) -> list[Point]:
    """Return the points without those that use the same operators as an earlier one."""
    return [*{(item.numbers, *sorted(item.operators.items()), item.costs): item for item in reversed(points)}.values()]


def _with_front(points: Sequence[Point]) -> list[Point]:
    return [replace(item, is_front=not any(_beats(other, item) for other in points)) for item in points]


def _beats(one: Point, other: Point) -> bool:
    return one.costs != other.costs and all(a <= b for a, b in zip(one.costs, other.costs, strict=True))
