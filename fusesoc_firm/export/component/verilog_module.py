"""The parameters and ports of a module in Verilog, as Yosys reads it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.export.component.model import Direction, Generic, Port
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools.programs import find, ways
from fusesoc_firm.tools.yosys import Yosys

_MODES = {"input": Direction.IN, "output": Direction.OUT, "inout": Direction.INOUT}


def read_module(
    name: str, paths: Sequence[Path], defines: Mapping[str, str], parameters: Mapping[str, str]
) -> tuple[list[Generic], list[Port]]:
    """Return the parameters, which are not free, and the ports of a module; a port of one bit is a scalar.

    Raise `InputError` if Yosys cannot read the files.
    """
    program = find("yosys")
    if program is None:
        fail("Yosys is not installed, which reads the ports", hint=ways("yosys"))
    with tempfile.TemporaryDirectory() as folder:
        yosys = Yosys(program, Path(folder), defines)
        values = "".join(f" -set {parameter} {_word(value)}" for parameter, value in parameters.items())
        # Bodies are irrelevant, and take most of the time; a module without a body has no parameters to set.
        whole = f"{yosys.reading(paths, '-noblackbox')}; chparam{values} {name}; blackbox"
        script = whole if values else yosys.reading(paths, "-lib")
        module = yosys.modules(script).get(name)
        if module is None:
            message = yosys.run(script).stderr.strip()
            fail(f"Yosys reads no module '{name}' in the sources", hint=message or ", ".join(map(str, paths)))
    generics = [
        Generic(parameter, "string" if isinstance(value, str) else "integer", value, is_free=False)
        for parameter, text in module.get("parameter_default_values", {}).items()
        if (value := _value(text)) is not None
    ]
    return generics, [_port(port, data) for port, data in module["ports"].items()]


def _word(value: str) -> str:
    """Return a parameter's value in a script of Yosys."""
    return value if re.fullmatch(r"-?\d+|\d+'s?[bdh]\w+", value) else f'"{value}"'


def _port(name: str, data: Mapping[str, Any]) -> Port:
    width, low = len(data["bits"]), int(data.get("offset", 0))
    high = low + width - 1
    bounds = None if width == 1 and not low else (low, high) if data.get("upto") else (high, low)
    return Port(name, _MODES[data["direction"]], bounds)


def _value(text: Any) -> int | str | None:
    """Return a parameter's value: Yosys' JSON has a number as its 32 bits, and other vectors as their bits."""
    if not isinstance(text, str):
        return int(text)
    if set(text) <= {"0", "1"} and len(text) == 32:
        return int(text, 2) - (int(text[0]) << 32)
    return text.rstrip() if not set(text) <= set("01xz") else None
