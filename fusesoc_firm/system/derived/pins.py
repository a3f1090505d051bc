"""The pins of accelerators: ports that are not part of a message and that the top level exports."""

from __future__ import annotations

from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.sides import accelerator_ports
from fusesoc_firm.system.written.specification import PYTHON, SOFTWARE, Pin
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_text import Text

# The width of the largest port that a message can have.
_MOST_BITS = 65536
_OWN_PORTS = ("clk", "rst_n")
# The kinds of ports that are missing in accelerators of some types.
_WITHOUT_PINS = {"HLS": "ports except for messages", PYTHON: "ports except for messages", SOFTWARE: "ports"}


def check_pins(type_: AcceleratorType, faults: Diagnostics) -> None:
    """Note every pin that cannot be a port of its accelerator."""
    accelerator = type_.accelerator
    if accelerator.type in _WITHOUT_PINS and accelerator.pins:
        message = (
            f"'{accelerator.name}' has the type {accelerator.type}, which cannot have {_WITHOUT_PINS[accelerator.type]}"
        )
        faults.error(message, accelerator.pins[0].source, "write this accelerator in VHDL")
        return
    taken = port_owners(type_)
    for pin in accelerator.pins:
        _check_pin(pin, taken, faults)


def port_owners(type_: AcceleratorType) -> dict[str, str]:
    """Return the owner of each port of an accelerator except pins and parameters, by the name in lower case."""
    taken = dict.fromkeys(_OWN_PORTS, "a port of every accelerator")
    return taken | {f"{prefix}{port.name}".lower(): "a port of a message" for prefix, port in accelerator_ports(type_)}


def _check_pin(pin: Pin, taken: dict[str, str], faults: Diagnostics) -> None:
    if pin.bits is not None and not 1 <= pin.bits <= _MOST_BITS:
        message = f"'bits' of pin '{pin.name}' cannot be {pin.bits}"
        faults.error(message, pin.place("bits"), f"legal here: 1 to {_MOST_BITS}")
    if "synchroniser" in pin.places and pin.direction == "out":
        message = f"'synchroniser' is legal only for inputs, but pin '{pin.name}' has the direction {pin.direction}"
        faults.error(message, pin.place("synchroniser"), "remove the key")
    check_name("pin", pin.name, taken, faults)


def check_name(what: str, name: Text, taken: dict[str, str], faults: Diagnostics) -> None:
    """Note a name that cannot be a port beside those in `taken`, and add it to them."""
    if not name:
        return
    if identifier(name) != name:
        hint = "legal here: letters, digits and single '_' between them, except VHDL and Verilog keywords"
        faults.error(f"'{name}' is not a legal port name", name.source, hint)
    elif owner := taken.get(name.lower()):
        hint = "the names of an entity's ports must differ in more than case"
        faults.error(f"a {what} cannot have the name '{name}', which is {owner}", name.source, hint)
    taken[name.lower()] = f"the {what} at {name.source}"
