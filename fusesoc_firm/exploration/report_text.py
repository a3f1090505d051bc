"""The report of a scheduled function as text of at most 100 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from fusesoc_firm.exploration.report import Operation, Report, unit_name
from fusesoc_firm.exploration.tables import WIDTH, aligned, cut
from fusesoc_firm.system.hardware.estimate import estimate

_CHAIN_MARK = "*"


def report_text(report: Report) -> str:
    """Return the report for people."""
    return "\n\n".join("\n".join(part) for part in (_head(report), _operators(report), _times(report), _chain(report)))


def _head(report: Report) -> Iterator[str]:
    schedule, size = report.schedule, estimate(report.schedule)
    longest = f", at most {report.longest} with the slowest operands" if report.longest > schedule.latency else ""
    yield cut(f"{schedule.program.name}: {schedule.program.source.name}", WIDTH)
    yield f"latency {_cycles(schedule.latency)}{longest}; interval {_cycles(schedule.interval)}"
    yield "of the function alone; the latency in 'firm sim' includes converters and stalls"
    for name, cycles in report.elements.items():
        stages = f", in {report.stages[name]} stages" if name in report.stages else ""
        yield cut(f"{_cycles(cycles)} more for each element of '{name}'{stages}", WIDTH)
    time = 1000 * schedule.latency / size.megahertz
    yield (
        f"estimate: {size.lut} LUT4, {size.ff} FF, {size.dsp} DSP, {size.megahertz:.0f} MHz in an ECP5-8: {time:.0f} ns"
    )


def _cycles(number: int) -> str:
    return f"{number} cycle{'' if number == 1 else 's'}"


def _operators(report: Report) -> Iterator[str]:
    if not report.uses:
        yield "no operators: all operations are logic between registers"
        return
    rows: list[Sequence[str]] = [("operator", "operations", "busy", "use", "LUT4", "FF", "DSP", "MHz")]
    cycles = max(1, report.schedule.starts[-1])
    for use in report.uses:
        cost = use.unit.operator.cost
        numbers = use.operations, use.busy, f"{100 * use.busy / cycles:.0f} %"
        # An operator without a clock is not measured.
        sizes = (cost.lut, cost.ff, cost.dsp, f"{cost.megahertz:.0f}") if cost.megahertz else "----"
        rows.append((unit_name(use.unit), *map(str, numbers), *map(str, sizes)))
    yield from aligned(rows, left=1)


def _times(report: Report) -> Iterator[str]:
    """Yield the table of all operations; equal operations of one line and cycle are one row."""
    chain = {link.operation.node.number for link in report.chain}
    begins = {phase: f"after '{cut(field, 50)}'" for phase, field in report.waits.items()}
    loops = report.schedule.program.loops
    begins |= {loop.phase: f"for each element of '{cut(loop.stream.path, 40)}'" for loop in loops}
    rows: list[tuple[str, ...]] = [("cycles", "", "operator", "line", "source")]
    for phase, found in groupby(report.operations, key=lambda item: item.node.phase):
        if phase in begins:
            rows.append(("", "", "", "", f"{begins[phase]}:"))
        rows += [_row(list(same), chain) for _, same in groupby(found, key=_place)]
    yield from aligned(rows, left=5)


def _place(item: Operation) -> tuple[object, ...]:
    return item.first, item.last, item.unit, item.line, item.node.operation


def _row(same: Sequence[Operation], chain: set[int]) -> tuple[str, ...]:
    first = same[0]
    cycles = f"{first.first}-{first.last}" if first.unit else str(first.first)
    mark = _CHAIN_MARK if any(item.node.number in chain for item in same) else ""
    count = f" x{len(same)}" if len(same) > 1 else ""
    return cycles, mark, first.unit or f"({first.node.operation}{count})", str(first.line), cut(first.text, 60)


def _chain(report: Report) -> Iterator[str]:
    yield f"critical chain ({_CHAIN_MARK} above), from the message to the answer:"
    steps = [link for link in report.chain if link.operation.unit]
    if not steps:
        yield "  no operators"
    for link in steps:
        item = link.operation
        waits = ", after the operator was free" if link.reason == "operator" else ""
        cycles = f"{item.first}-{item.last}"
        yield cut(f"  {cycles:9} {item.unit:14} line {item.line}{waits}: {item.text}", WIDTH)
