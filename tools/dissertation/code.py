"""Table 6.2: the lines written for each demo system, and the lines generated from them, by their purpose."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from fusesoc_firm.converter.configuration import PUBLISHER_TEMPLATE, SUBSCRIBER_TEMPLATE
from fusesoc_firm.converter.constants import CONSTANTS_TEMPLATE
from fusesoc_firm.converter.payload_length import LENGTH_TEMPLATE
from fusesoc_firm.converter.variable_publisher import VARIABLE_PUBLISHER_TEMPLATE
from fusesoc_firm.converter.variable_subscriber import VARIABLE_SUBSCRIBER_TEMPLATE
from fusesoc_firm.system.hardware.configuration import SYSTEM_TEMPLATE
from fusesoc_firm.system.hardware.status import REGISTERS_TEMPLATE
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import artifacts
from fusesoc_firm.system.views.report import lines_of_code, report
from tests.hdl.ghdl import REPOSITORY
from tools.dissertation.tables import Table

_CONVERTERS, _WRAPPERS, _COMPONENTS = PURPOSES = ("converters", "accelerators' wrappers", "system components")
_PURPOSES = {
    CONSTANTS_TEMPLATE: _CONVERTERS,
    SUBSCRIBER_TEMPLATE: _CONVERTERS,
    PUBLISHER_TEMPLATE: _CONVERTERS,
    VARIABLE_SUBSCRIBER_TEMPLATE: _CONVERTERS,
    VARIABLE_PUBLISHER_TEMPLATE: _CONVERTERS,
    LENGTH_TEMPLATE: _COMPONENTS,
    REGISTERS_TEMPLATE: _COMPONENTS,
    SYSTEM_TEMPLATE: _COMPONENTS,
}


def table() -> Table:
    """Return the table of all demo systems."""
    columns = ("system", "written", "template configuration", *PURPOSES, "generated", "for each line written")
    return Table("6.2", "lines of code", columns, tuple(map(_row, _specifications())))


def _specifications() -> list[Path]:
    """Return the main specification of each demo system."""
    return [path for path in sorted(REPOSITORY.glob("specs/*/*.yaml")) if path.stem == path.parent.name]


def _row(specification: Path) -> tuple[str, ...]:
    loaded = load_beside(specification)
    lines: Counter[str] = Counter()
    for item in artifacts(loaded):
        lines[_PURPOSES.get(item.template, _WRAPPERS)] += lines_of_code(item.text, "--")
    found = report(specification, loaded)
    numbers = (found.written, found.configuration, *(lines[purpose] for purpose in PURPOSES), found.generated)
    return (specification.stem, *map(str, numbers), f"{found.ratio:.2f}")
