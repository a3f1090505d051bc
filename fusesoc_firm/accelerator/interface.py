"""The comparison of an accelerator's entity or module with the interface in the specification."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from fusesoc_firm.accelerator.unit import Unit, UnitPort
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.sides import accelerator_ports
from fusesoc_firm.text.diagnostics import Diagnostics, closest
from fusesoc_firm.text.naming import identifier

# A port's comment begins with the path of its field: `pose.position.x: float64`.
_FIELD = re.compile(r"([\w.\[\]]+): ")
# Names of fields that exist in only one version of ROS; a source file may serve both versions.
_OF_ONE_ROS = ("nsec", "nanosec", "seq")
_WORDS = {"in": "input", "out": "output"}
_KINDS = {"in": "an input", "out": "an output"}
# The maximum number of superfluous ports that are reported separately.
_MOST_PORTS = 4


@dataclass(frozen=True)
class WantedPort:
    """A port that the top level connects; `width` is None for a `std_logic`, `origin` names its field or side."""

    name: str
    direction: str
    width: int | None
    origin: str

    @property
    def bits(self) -> int:
        """The number of bits."""
        return 1 if self.width is None else self.width

    @property
    def declaration(self) -> str:
        """The port's declaration in VHDL, without its name."""
        return f"{self.direction} {vhdl_type(self.width)}"


def wanted_ports(type_: AcceleratorType) -> dict[str, WantedPort]:
    """Return the ports of an accelerator's interface by their names in lower case."""
    messages = {side.prefix: str(side.frame.message) for side in (*type_.inputs, *type_.outputs)}
    ports = [WantedPort(name, "in", None, "every accelerator") for name in ("clk", "rst_n")]
    for prefix, port in accelerator_ports(type_):
        field = _FIELD.match(port.comment)
        origin = f"{messages[prefix]}.{field[1]}" if field else messages[prefix]
        ports.append(WantedPort(f"{prefix}{port.name}", "out" if port.is_output else "in", port.width, origin))
    ports += [WantedPort(str(pin.name), pin.direction, pin.bits, "the pins") for pin in type_.accelerator.pins]
    ports += [
        WantedPort(type_.parameter_port(item), "in", item.port_bits, "the parameters") for item in type_.parameters
    ]
    return {port.name.lower(): port for port in ports}


def compare(type_: AcceleratorType, units: Sequence[Unit], faults: Diagnostics) -> None:
    """Add every difference between an accelerator's interface and its unit among `units`.

    VHDL ignores case, so names are compared in lower case; Verilog does not.
    """
    is_vhdl = type_.accelerator.type == "VHDL"
    kind, name = ("entity", identifier(type_.accelerator.name).lower()) if is_vhdl else ("module", type_.entity)
    unit = next((unit for unit in units if unit.name == name), None)
    if unit is None:
        named = closest(name, [unit.name for unit in units]) or (units[-1].name if units else "")
        if found := next((unit for unit in units if unit.name == named), None):
            message = f"the {kind} is '{found.name}', and the specification's accelerator is '{name}'"
            faults.error(message, found.place, "give both the same name")
        return
    for generic, place in unit.unset.items():
        faults.error(f"generic '{generic}' has no value", place, "give it a default value")
    wanted = wanted_ports(type_) if is_vhdl else {port.name: port for port in wanted_ports(type_).values()}
    missing = {key: port for key, port in wanted.items() if key not in {port.name for port in unit.ports}}
    for port in unit.ports:
        if port.name in wanted:
            _compare_port(port, wanted[port.name], faults)
    others = [port for port in unit.ports if port.name not in wanted]
    _report_inputs([port for port in others if _lacks_driver(port, missing, faults)], faults)
    for absent in missing.values():
        what = f"{absent.declaration}" if is_vhdl else f"{_WORDS[absent.direction]} of {absent.bits} bits"
        faults.error(
            f"{kind} '{unit.name}' has no port '{absent.name}' for {absent.origin}", unit.place, f"needed here: {what}"
        )


def _compare_port(port: UnitPort, wanted: WantedPort, faults: Diagnostics) -> None:
    if port.direction != wanted.direction:
        kind = _KINDS.get(port.direction, f"a {port.direction} port")
        message = f"{port.name} is {kind}, and {wanted.origin} needs {_KINDS[wanted.direction]}"
        faults.error(message, port.place)
    legal = ("std_logic", "std_ulogic") if wanted.width is None else ("std_logic_vector",)
    if port.type and port.type not in legal:
        message = f"{port.name} has the type {port.type}, {wanted.origin} needs {vhdl_type(wanted.width)}"
        faults.error(message, port.place)
    elif port.bits is not None and port.bits != wanted.bits:
        faults.error(f"{port.name} has {_bits(port.bits)}, {wanted.origin} has {wanted.bits}", port.place)


def _lacks_driver(port: UnitPort, missing: dict[str, WantedPort], faults: Diagnostics) -> bool:
    """Return whether a port that the top level does not connect is an input without a value; report other faults.

    If the port was probably misspelt, the other name is not missing.
    """
    if near := closest(port.name, missing):
        missing.pop(near)
        faults.error(f"port '{port.name}' is not in the interface", port.place, f"did you mean '{near}'?")
        return False
    if port.direction == "out" or not port.type:
        # Legal: an output of an entity, and any port of a Verilog module.
        if port.name.rpartition("_")[2] not in _OF_ONE_ROS:
            faults.warn(f"port '{port.name}' is not in the interface, and stays open", port.place)
        return False
    return not port.is_optional


def _report_inputs(ports: Sequence[UnitPort], faults: Diagnostics) -> None:
    """Report inputs that nothing drives; many of them count as one fault, as after an edit of the specification."""
    if len(ports) > _MOST_PORTS:
        names = ", ".join(f"'{port.name}'" for port in ports[:_MOST_PORTS])
        message = f"ports {names} and {len(ports) - _MOST_PORTS} more are not in the interface"
        faults.error(message, ports[0].place, "remove them, or write the file anew with 'firm system skeleton'")
        return
    hint = "remove it, give it a default value, or declare it under 'pins' in the specification"
    for port in ports:
        faults.error(f"port '{port.name}' is not in the interface", port.place, hint)


def _bits(count: int) -> str:
    return f"{count} bit" if count == 1 else f"{count} bits"
