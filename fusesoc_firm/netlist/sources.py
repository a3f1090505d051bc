"""What the operators and functions in VHDL sources are, by their places: numeric_std has many of one name."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from io import StringIO
from xml.etree import ElementTree as ET

_FUNCTION = re.compile(
    r'<el id="(\d+)" kind="function_declaration"[^>]*? implicit_definition="IIR_PREDEFINED_IEEE_(\w+)"'
)
_CALL = re.compile(r'<implementation ref="(\d+)"')


def calls(tree: str, functions: Collection[str]) -> Mapping[str, str]:
    """By `file:line:column`, which of these functions is called there.

    `tree` is what `ghdl --file-to-xml` prints, and a function is called as GHDL calls it, `NUMERIC_STD_SUB_INT_SGN`.
    """
    names = {number: name for number, name in _FUNCTION.findall(tree) if name in functions}
    # Most sources have none of them, and reading the whole tree takes its time.
    if not any(number in names for number in _CALL.findall(tree)):
        return {}
    found: dict[str, str] = {}
    around: list[Mapping[str, str]] = []
    for event, element in ET.iterparse(StringIO(tree), ["start", "end"]):
        if event == "end":
            around.pop()
            element.clear()
            continue
        if element.tag == "implementation" and element.get("ref") in names and "line" in around[-1]:
            node = around[-1]
            found[f"{node['file']}:{node['line']}:{node['col']}"] = names[element.attrib["ref"]]
        around.append(element.attrib)
    return found
