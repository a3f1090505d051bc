"""The parameters of accelerators: numbers that software sets at run time, and that are ports of the hardware."""

from __future__ import annotations

import math
import struct

from fusesoc_firm.message import dialect
from fusesoc_firm.message.model import PrimitiveType
from fusesoc_firm.message.values import scalar_of
from fusesoc_firm.message.wire import INTEGER_AND_FLOAT
from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem, Parameter
from fusesoc_firm.system.derived.pins import check_name, port_owners
from fusesoc_firm.system.written.specification import (
    NO_STATUS,
    PYTHON,
    STATUS_AXI_LITE,
    STATUS_FRAMES,
    Accelerator,
    ParameterSection,
    Project,
)
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.yaml_text import Text

# The types of accelerators that may have parameters.
_LANGUAGES = ("VHDL", "Verilog", PYTHON)
_MOST = 1024
_LARGEST_FLOAT = (2 - 2**-23) * 2.0**127


def parameters_of(accelerator: Accelerator, project: Project, faults: Diagnostics) -> tuple[Parameter, ...]:
    """Return the parameters of an accelerator that have no fault; note the faults of the others."""
    if not accelerator.parameters:
        return ()
    source = accelerator.parameters[0].source
    if accelerator.type not in _LANGUAGES:
        message = f"'{accelerator.name}' has the type {accelerator.type}, which cannot have parameters"
        faults.error(message, source, f"legal here: {', '.join(_LANGUAGES)}")
    if project.status == NO_STATUS:
        message = "parameters are registers of the status, which the system does not have"
        faults.error(message, source, f"add 'status: {STATUS_FRAMES}' or 'status: {STATUS_AXI_LITE}' to 'project'")
    return tuple(filter(None, (_parameter(section, faults) for section in accelerator.parameters)))


def check_parameters(type_: AcceleratorType, faults: Diagnostics) -> None:
    """Note every parameter whose name cannot be that of a port of its accelerator."""
    taken = port_owners(type_) | {pin.name.lower(): "a pin" for pin in type_.accelerator.pins}
    for parameter in type_.accelerator.parameters:
        check_name("parameter", parameter.name, taken, faults)


def check_number(system: DerivedSystem, project: Project, faults: Diagnostics) -> None:
    """Note a system with more parameters than the status has room for."""
    if len(system.parameters) > _MOST:
        message = f"the blocks have {len(system.parameters)} parameters"
        faults.error(message, project.source, f"legal here: up to {_MOST} in a system")


def _parameter(section: ParameterSection, faults: Diagnostics) -> Parameter | None:
    """Return the parameter of a section, or None after a fault."""
    if not section.is_sound:
        return None
    before = len(faults.found)
    kind = INTEGER_AND_FLOAT[section.type]
    default = _number(section.default, section, faults)
    least, most = _range(section, faults)
    if len(faults.found) > before or default is None or least is None or most is None:
        return None
    found = Parameter(str(section.name), kind, default, least, most)
    if not least <= default <= most:
        hint = f"legal here: {found.range}"
        faults.error(f"the default of '{section.name}' is {section.default}", section.default.source, hint)
        return None
    return found


def _range(section: ParameterSection, faults: Diagnostics) -> tuple[float | None, float | None]:
    """Return the least and the most value, or None in place of one with a fault."""
    whole = _whole_range(section.type)
    if not section.range:
        return whole
    if section.type == "bool" or len(section.range) != 2:
        hint = "remove the key" if section.type == "bool" else "write the least and the most value: [0, 10]"
        faults.error(f"'range' of '{section.name}' is not legal", section.range[0].source, hint)
        return None, None
    least, most = (_number(text, section, faults) for text in section.range)
    if least is not None and most is not None and least > most:
        message = f"the range of '{section.name}' is empty: {least} is more than {most}"
        faults.error(message, section.range[0].source, "write the least value first")
    return least, most


def _whole_range(name: str) -> tuple[float, float]:
    if name == "float32":
        return -_LARGEST_FLOAT, _LARGEST_FLOAT
    return (0, 1) if name == "bool" else dialect.ROS2.integer_ranges[name]


def _number(text: Text, section: ParameterSection, faults: Diagnostics) -> float | None:
    """Return the number in a text, or None after a fault."""
    try:
        value = scalar_of(text, PrimitiveType(str(section.type)), dialect.ROS2, has_quotes=False)
    except ValueError as fault:
        faults.error(f"'{text}' is not a value of {section.type}", text.source, str(fault))
        return None
    if isinstance(value, float) and not math.isfinite(value):
        faults.error(f"'{text}' cannot be the value of a parameter", text.source, "legal here: finite numbers")
        return None
    assert not isinstance(value, str), "no parameter is a text"
    # Without a negative zero.
    return struct.unpack("<f", struct.pack("<f", value))[0] + 0.0 if isinstance(value, float) else value
