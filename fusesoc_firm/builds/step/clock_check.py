"""The check that nextpnr judged a layout by the board's clocks: run between layout and bitstream of each open flow.

    python -m fusesoc_firm.builds.step.clock_check REPORT NAME=MHZ...

A constraint may be lost: nextpnr 0.11 for Nexus forgets it when the clock moves to a global net, and then judges by
12 MHz. A layout is accepted only if the report names each clock of the board with its frequency, and no other clock.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.text.quoting import make_argument
from fusesoc_firm.tools.open_flows import OPEN_FLOWS, REPORT

# nextpnr rounds a period to picoseconds.
_TOLERANCE = 1e-3
_WORD = re.compile(r"[A-Za-z0-9_]+")


def checked(flow: type[Any], name: str, clocks: Mapping[str, str]) -> type[Any]:
    """Return Edalize's class of an open flow, with a check of these clocks, in MHz, before the packer."""

    class Checked(flow):  # type: ignore[misc]
        def configure_tools(self, graph: Any) -> None:
            super().configure_tools(graph)
            words = [sys.executable, "-m", __name__, REPORT, *(f"{clock}={mhz}" for clock, mhz in clocks.items())]
            bitstream = f"{self.edam['name']}{OPEN_FLOWS[name].bitstream}"
            for command in self.commands.commands:
                if bitstream in command.targets and any(command.commands):
                    command.commands.insert(0, [*map(make_argument, words)])

    Checked.__name__ = flow.__name__
    return Checked


def faults(report: Mapping[str, Any], clocks: Mapping[str, float]) -> list[str]:
    """Return what differs between nextpnr's report and the board's clocks, in MHz by name; nothing if all agree."""
    found: dict[str, list[float]] = {clock: [] for clock in clocks}
    notes = []
    for net, item in report["fmax"].items():
        # Nets have prefixes and suffixes, such as `u_system.clk$glb_clk` for clk.
        clock = next((word for word in _WORD.findall(net) if word in clocks), None)
        if clock is None:
            notes.append(f"clock '{net}' is none of the board's: {', '.join(clocks)}")
            continue
        found[clock].append(item["constraint"])
        if item["achieved"] < item["constraint"]:
            notes.append(f"clock '{net}' reaches {item['achieved']:.2f} MHz, not {item['constraint']:g} MHz")
    for clock, needed in clocks.items():
        if not found[clock]:
            notes.append(f"the report has no clock '{clock}' of {needed:g} MHz")
        wrong = [judged for judged in found[clock] if abs(judged - needed) > needed * _TOLERANCE]
        notes += [f"clock '{clock}' was judged by {judged:g} MHz; the board's has {needed:g} MHz" for judged in wrong]
    return notes


def main(arguments: Sequence[str]) -> int:
    """Check a report; return the exit status."""
    path, *given = arguments
    clocks = {name: float(mhz) for name, _, mhz in (item.partition("=") for item in given)}
    if not Path(path).is_file():
        notes = [f"there is no {path}; nextpnr writes it with the option --report {path}"]
    else:
        notes = faults(json.loads(Path(path).read_text(encoding="utf-8")), clocks)
    for note in notes:
        print(f"ERROR: {note}")
    return 1 if notes else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
