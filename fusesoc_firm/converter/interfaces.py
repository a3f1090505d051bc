"""An interface: an entity that only instantiates a converter, with a name from the configuration file.

The wrapper's ports are read from the converter's text, so the two cannot differ. A converter can have any number of
names.
"""

from __future__ import annotations

import re
from typing import Any

from fusesoc_firm.text.naming import distinct_identifiers

INTERFACE_TEMPLATE = "vhdl/interface.vhd"

# The converters' templates end a list with ` );` on a separate line, and declare one name on each line.
_LIST = r"^  {} \(\n(.*?)^  \);\n"
_NAME = re.compile(r"^    (\w+) +: ", re.MULTILINE)


def interface_configuration(name: str, converter: str, vhdl: str, message: str) -> dict[str, Any]:
    """Return the configuration of the entity `name`, a wrapper of the entity `converter` with the text `vhdl`."""
    generics, ports = _declarations(vhdl, "generic"), _declarations(vhdl, "port")
    port_names = _NAME.findall(ports)
    (label,) = distinct_identifiers([("u_converter",)], reserved=port_names)
    return {
        "entity": name,
        "converter": converter,
        "message": message,
        "label": label,
        "generics": generics.splitlines(),
        "ports": ports.splitlines(),
        "generic_names": _NAME.findall(generics),
        "port_names": port_names,
    }


def _declarations(vhdl: str, kind: str) -> str:
    """Return the lines of an entity's list of generics or ports, or an empty string without such a list."""
    entity = vhdl.partition("\nentity ")[2].partition("\nend entity;")[0] + "\n"
    found = re.search(_LIST.format(kind), entity, re.MULTILINE | re.DOTALL)
    return found[1] if found else ""
