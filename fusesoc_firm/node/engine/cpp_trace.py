"""Convert the steps that a C++ node writes (`firm/trace.hpp`), one per line, to a table like that of `Trace`.

    write_ways(Path("steps.csv"), Path("ways.csv"), describe(loaded))

A step names converters by id only, so the node's description supplies their names and connections.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.node.engine.trace import Entry, Trace
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.text.diagnostics import fail

COLUMNS = ("wall_ns", "event", "converter", "message", "bytes", "first_cycle", "last_cycle")
_EVENTS = ("received", "queued", "sent", "taken", "burst", "published")


@dataclass(frozen=True)
class _Step:
    time_ns: int
    event: str
    converter: int
    message: int
    size: int
    cycles: tuple[int, int] | None


def are_steps(table: Path) -> bool:
    """Return whether a table lists steps instead of routes. Raise `InputError` if it cannot be read."""
    try:
        with table.open(newline="", encoding="utf-8") as file:
            return tuple(next(csv.reader(file), ())) == COLUMNS
    except OSError as error:
        fail(f"cannot read {table}: {error.strerror}")
    except (UnicodeDecodeError, csv.Error) as error:
        fail(f"cannot read {table}: {error}")


def write_ways(steps: Path, table: Path, description: NodeDescription) -> None:
    """Write the table of the routes that these steps form. May raise `InputError`."""
    _Fold(description, [*_read(steps, description)]).write(table)


class _Fold:
    """A replay of the steps into a `Trace`, with the original times."""

    def __init__(self, description: NodeDescription, steps: list[_Step]) -> None:
        self._description = description
        self._steps = steps
        self._now = steps[0].time_ns if steps else 0
        # By subscriber and number. Messages being sent stay here, since simulated hardware may accept them before or
        # after the step `sent`.
        self._entries: dict[tuple[int, int], Entry] = {}
        # For the current frame of each publisher: the time of its last burst, and its cycles.
        self._bursts: dict[int, tuple[int, tuple[int, int] | None]] = {}

    def write(self, table: Path) -> None:
        trace = Trace(table, self._description, lambda: self._now)
        try:
            for step in self._steps:
                self._now = step.time_ns
                self._tell(trace, step)
        finally:
            trace.close()

    def _tell(self, trace: Trace, step: _Step) -> None:
        if step.event == "burst":
            self._note_burst(step)
        elif step.event == "published":
            came_ns, cycles = self._bursts.pop(step.converter, (step.time_ns, None))
            self._now = came_ns
            trace.came(step.converter, step.size, cycles, is_published=True)
            trace.published(step.converter, step.time_ns)
        elif step.event == "received":
            self._entries[step.converter, step.message] = Entry(
                step.converter, step.size, step.time_ns, queued_ns=step.time_ns
            )
        # A message that was received before the trace began is unknown.
        elif entry := self._entries.get((step.converter, step.message)):
            self._go_on(trace, step, entry)

    def _go_on(self, trace: Trace, step: _Step, entry: Entry) -> None:
        """Handle the next step of a message on its route to the hardware."""
        if step.event == "queued":
            entry.queued_ns = step.time_ns
            return
        if entry.number < 0:
            trace.sending(entry)
        if step.event == "sent":
            trace.sent(entry)
        else:
            entry.cycles = step.cycles

    def _note_burst(self, step: _Step) -> None:
        _, before = self._bursts.get(step.converter, (0, None))
        cycles = (before[0], step.cycles[1]) if before and step.cycles else step.cycles
        self._bursts[step.converter] = (step.time_ns, cycles)


def _read(steps: Path, description: NodeDescription) -> Iterator[_Step]:
    inputs = {item.id for item in description.inputs}
    outputs = {item.id for item in description.outputs}
    with steps.open(newline="", encoding="utf-8") as file:
        for number, row in enumerate(csv.DictReader(file), start=2):
            step = _step(row, f"{steps}:{number}")
            known = outputs if step.event in ("burst", "published") else inputs
            if step.converter not in known:
                end = f"converter {step.converter} and step '{step.event}'"
                fail(f"{steps}:{number}: '{description.name}' has no topic for {end}")
            yield step


def _step(row: dict[str, str], place: str) -> _Step:
    try:
        time_ns, converter, message, size = (int(row[name]) for name in ("wall_ns", "converter", "message", "bytes"))
        first, last = row["first_cycle"], row["last_cycle"]
        cycles = (int(first), int(last)) if first and last else None
    except (TypeError, ValueError):
        fail(f"{place} is not a step in a node's trace")
    if row["event"] not in _EVENTS:
        fail(f"{place}: unknown step '{row['event']}'", hint=f"legal: {', '.join(_EVENTS)}")
    return _Step(time_ns, row["event"], converter, message, size, cycles)
