"""The clocks of a specification, and checks of their use."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from fusesoc_firm.system.derived.model import Clock
from fusesoc_firm.system.derived.timing import frequency
from fusesoc_firm.system.written.specification import ClockDomain, Specification
from fusesoc_firm.text.diagnostics import Diagnostics, nearest
from fusesoc_firm.text.naming import identifier


def clocks_of(specification: Specification, own: Fraction | None, faults: Diagnostics) -> tuple[Clock, ...]:
    """Return all clocks except clk, in the order of the specification, and note their faults.

    `own` is the frequency of clk in Hz, or None.
    """
    project = specification.project
    _check_names(specification, faults)
    _check_uses(specification, faults)
    if not project.clocks:
        return ()
    if project.clock is None:
        if project.is_sound:
            message = "'clocks' needs the frequency of clk, which is missing"
            hint = "add 'clock' to 'project', such as 'clock: 100 MHz'"
            faults.error(message, project.clocks[0].source, hint)
        return ()
    found = []
    for clock in project.clocks:
        hertz = frequency("frequency", clock.frequency, faults) if clock.frequency else None
        if own is not None and hertz is not None:
            found.append(Clock(str(clock.name), hertz, hertz / own))
    return tuple(found)


def _check_names(specification: Specification, faults: Diagnostics) -> None:
    seen: dict[str, ClockDomain] = {}
    for clock in specification.project.clocks:
        if not clock.name:
            continue
        twin = seen.setdefault(clock.name.lower(), clock)
        if identifier(clock.name) != clock.name:
            hint = "legal here: letters, digits and single '_' between them, except VHDL and Verilog keywords"
            faults.error(f"'{clock.name}' is not a legal clock name", clock.name.source, hint)
        elif twin is not clock:
            hint = "VHDL ignores case" if twin.name != clock.name else ""
            message = f"duplicate clock '{clock.name}'; the first is at {twin.name.source}"
            faults.error(message, clock.name.source, hint)
        elif pin := _pin_called(specification, f"clk_{clock.name}"):
            message = f"clock '{clock.name}' has the port 'clk_{clock.name}', which is {pin}"
            faults.error(message, clock.name.source)


def _pin_called(specification: Specification, port: str) -> str:
    """Return the pin with this port name at the top level, or an empty string if the pin does not exist."""
    pins = {str(item.name): item.pins for item in specification.accelerators}
    for block in specification.blocks:
        for pin in pins.get(str(block.type), ()):
            if identifier(block.name, pin.name).lower() == port.lower():
                return f"also pin '{pin.name}' of '{block.name}'"
    return ""


def _check_uses(specification: Specification, faults: Diagnostics) -> None:
    """Note every block with an unknown clock, and every clock without a block."""
    project, blocks = specification.project, specification.blocks
    names: Sequence[str] = [clock.name for clock in project.clocks]
    software = {item.name for item in specification.accelerators if item.is_software}
    for item in specification.accelerators:
        if item.is_software and item.width is not None:
            message = f"'width' is legal only for hardware, but '{item.name}' has the type {item.type}"
            faults.error(message, item.place("width"), "remove the key: software exchanges whole messages")
    used = set()
    for block in blocks:
        if block.clock is None:
            continue
        used.add(block.clock.lower())
        if block.type is None and block.mode is not None:
            message = f"'clock' is legal only for accelerators, but '{block.name}' is a {block.mode}"
            faults.error(message, block.clock.source)
        elif block.type in software:
            message = f"'clock' is legal only for hardware, but '{block.name}' runs on the host"
            faults.error(message, block.clock.source)
        elif all(names) and project.is_sound and block.clock not in names:
            hint = nearest(block.clock, names) if names else "add 'clocks' to 'project'"
            faults.error(f"unknown clock '{block.clock}'", block.clock.source, hint)
    are_known = not specification.is_cut and all(block.is_sound for block in blocks)
    for clock in project.clocks:
        if are_known and clock.name and clock.name.lower() not in used:
            message = f"no block uses clock '{clock.name}'"
            faults.error(message, clock.name.source, f"set 'clock: {clock.name}' in an accelerator's block")
