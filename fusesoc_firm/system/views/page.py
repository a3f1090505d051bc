"""One page in HTML about a system: diagram, interfaces, resources, timing, schedule, coverage of stimuli."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from fusesoc_firm.system.derived.model import DerivedSystem, MessageSide
from fusesoc_firm.system.derived.sides import side_ports
from fusesoc_firm.system.derived.timing import bounds_of
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.text.render import Context, render

_TEMPLATE = "project/report.html"
# Names of constant fields in one cell.
_SHOWN = 8


@dataclass(frozen=True)
class Table:
    """A table of the page, with a note above it."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""


def page(system: DerivedSystem, picture: str, reports: Iterable[Path], stimuli: Sequence[tuple[str, Any]]) -> str:
    """Return the page with a picture in SVG.

    `reports` are the files `report.json` of builds by nextpnr. `stimuli` are messages, each with the name of its block.
    """
    tables = [
        _converters(system),
        _ports(system),
        _schedule(system),
        _resources(reports),
        _coverage(stimuli),
    ]
    drawn: list[Context] = [
        {
            "title": table.title,
            "note": [table.note] if table.note else [],
            "columns": [*table.columns],
            "rows": [{"cells": [*map(str, row)]} for row in table.rows],
        }
        for table in tables
    ]
    return render(_TEMPLATE, {"name": system.name, "picture": picture[picture.index("<svg") :], "tables": drawn})


def _converters(system: DerivedSystem) -> Table:
    converters = derived_description(system)["Converters"]
    rows = [
        (
            way,
            item["block"],
            next((item[end] for end in ("topic", "service", "action") if end in item), ""),
            item["nameMW"],
            item["ROS"],
            item["id"],
            item["payloadBytes"],
        )
        for way, items in (("in", converters["AXIS_to_msg"]), ("out", converters["msg_to_AXIS"]))
        for item in items
    ]
    return Table("Topics", ("", "block", "topic, service or action", "message", "ROS", "id", "bytes of payload"), rows)


def _ports(system: DerivedSystem) -> Table:
    rows = [
        (block.block, f"{side.prefix}{port.name}", "out" if port.is_output else "in", port.width or 1)
        for block in system.accelerators
        for side, gives in _sides(block.type.inputs, block.type.outputs)
        for port in side_ports(side.frame, system.width_of(block.block), gives=gives, has_valid=True)
    ]
    return Table("Ports of accelerators", ("block", "port", "direction", "bits"), rows)


def _sides(inputs: Iterable[MessageSide], outputs: Iterable[MessageSide]) -> Iterator[tuple[MessageSide, bool]]:
    yield from ((side, False) for side in inputs)
    yield from ((side, True) for side in outputs)


def _schedule(system: DerivedSystem) -> Table:
    columns = ("publisher", "period", "deadline", "transfer", "longest response")
    rows = []
    for publisher, times, bound in zip_longest(system.publishers, system.scheduling.times, bounds_of(system)):
        known = (times.period, times.deadline, times.transfer_time) if times else (None,) * 3
        found = (*known, bound.response if bound else None)
        rows.append((publisher.block, *("unknown" if cycles is None else cycles for cycles in found)))
    return Table("Schedule", columns, rows, f"Scheduler: {_scheduler(system)}. Times are in cycles of clk.")


def _scheduler(system: DerivedSystem) -> str:
    groups = [f"{group.policy} of {', '.join(group.blocks)}" for group in system.scheduling.groups]
    return f"{system.scheduling.policy}{' among ' if groups else ''}{'; '.join(groups)}"


def _resources(reports: Iterable[Path]) -> Table:
    rows: list[tuple[object, ...]] = []
    for path in reports:
        content = json.loads(path.read_text(encoding="utf-8"))
        target = path.parent.name
        for clock in content["fmax"].values():
            rows.append((target, "clock", f"{clock['achieved']:.1f} MHz", f"{clock['constraint']:.1f} MHz required"))
        used = {name: item for name, item in content["utilization"].items() if item["used"]}
        rows += [(target, name, item["used"], f"of {item['available']}") for name, item in used.items()]
    note = "" if rows else "No build for a board beside the specification has a report.json yet."
    return Table("Resources and timing", ("target", "resource", "used", "available"), rows, note)


def _coverage(stimuli: Sequence[tuple[str, Any]]) -> Table:
    """Return the number of messages of each block, and the fields that have the same value in all of them."""
    rows = []
    for block in dict.fromkeys(name for name, _ in stimuli):
        messages = [dict(_leaves("", message)) for name, message in stimuli if name == block]
        names = [*dict.fromkeys(name for message in messages for name in message)]
        constant = [name for name in names if len({message.get(name) for message in messages}) == 1]
        shown = ", ".join(constant[:_SHOWN]) + (f" and {len(constant) - _SHOWN} more" if len(constant) > _SHOWN else "")
        rows.append((block, len(messages), f"{len(names) - len(constant)} of {len(names)}", shown or "none"))
    note = "" if rows else "No stimuli are given."
    return Table("Stimuli", ("subscriber", "messages", "fields that vary", "constant fields"), rows, note)


def _leaves(path: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield each field outside of arrays with its value as text."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(f"{path}.{name}" if path else name, inner)
    else:
        yield path, str(value)
