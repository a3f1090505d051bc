"""The line of the specification to which a line of a generated file belongs."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.names import Names, blocks
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import SourceRef

# The first line of an instance in the top level.
_INSTANCE = re.compile(r"  (u_\w+) : ")


def origin(loaded: LoadedSystem, unit: str, lines: Sequence[str], line: int) -> SourceRef | None:
    """Return the place of the block whose converter or instance has `line` in a generated unit with these `lines`.

    A line of the top level outside instances belongs to the project's name. For an unknown unit, return None.
    """
    specification, system = loaded.specification, loaded.system
    block = _converters(system).get(unit)
    if unit == system.entity:
        block = _instantiated(system, lines[:line])
        if block is None:
            return specification.project.name.source
    return next((item.name.source for item in specification.blocks if item.name == block), None)


def _converters(system: DerivedSystem) -> dict[str, str]:
    """Return the first block of each converter's entity."""
    found = [(publisher_entity(item.frame, item.suffix), item.block) for item in system.publishers]
    found += [(subscriber_entity(item.frame, item.suffix), item.block) for item in system.subscribers]
    return dict(reversed(found))


def _instantiated(system: DerivedSystem, lines: Sequence[str]) -> str | None:
    """Return the block of the last instance that begins in the lines; the labels of its parts begin with its label."""
    label = next((match[1] for line in reversed(lines) if (match := _INSTANCE.match(line))), "")
    names = Names(system)
    own = {names.label(block): block for block, _ in blocks(system)}
    found = [item for item in own if label == item or label.startswith(f"{item}_")]
    return own[max(found, key=len)] if found else None
