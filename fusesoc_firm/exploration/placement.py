"""The cells and the clock of one entity that is compiled from Python, measured by Yosys and nextpnr."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.compiler.schedule import Schedule
from fusesoc_firm.exploration.resources import resources_of_netlist, translated, yosys_program
from fusesoc_firm.netlist.translation import Translation
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.hardware.compiled import entity_of
from fusesoc_firm.text.render import render
from fusesoc_firm.tools.library_path import library_root

# The folders with the VHDL of the units below a compiled entity.
_SOURCES = ("axis/rtl", "acc/cordic/rtl", "acc/float/rtl", "acc/python/rtl")


@dataclass(frozen=True)
class Placed:
    """Measured cells, and the clock in MHz if nextpnr is installed; `missing` tells how to install it.

    `operators` are the LUT4 and registers in operators; the rest are registers, multiplexers and control.
    """

    lut: int
    ff: int
    dsp: int
    megahertz: float | None
    operators: tuple[int, int]
    missing: str = ""

    def data(self) -> dict[str, Any]:
        """Return the measurement as plain data."""
        rounded = None if self.megahertz is None else round(self.megahertz, 1)
        return {"lut": self.lut, "ff": self.ff, "dsp": self.dsp, "mhz": rounded}


def check_programs() -> None:
    """Raise `InputError` if GHDL or Yosys is missing."""
    yosys_program()


def place(type_: AcceleratorType, schedule: Schedule, tell: Callable[[str], None]) -> Placed:
    """Place the entity of a schedule in an ECP5, or recall this; `tell` receives the steps. May raise `InputError`."""
    return asyncio.run(_place(type_, schedule, tell))


async def _place(type_: AcceleratorType, schedule: Schedule, tell: Callable[[str], None]) -> Placed:
    async def news(item: dict[str, Any]) -> None:
        tell(item["step"])

    made = entity_of(type_, schedule)
    with tempfile.TemporaryDirectory(prefix="firm-place-") as name:
        folder = Path(name)
        (folder / "kernel.vhd").write_text(render(made.template, made.context), encoding="utf-8")
        request = folder / "kernel.ghdlsynth"
        request.write_text(_translation(type_.entity).to_json(), encoding="utf-8")
        tell("netlist")
        await translated(request)
        found = await resources_of_netlist(folder / "kernel.v", type_.entity, yosys_program(), news)
    return _placed(found)


def _translation(entity: str) -> Translation:
    cores = library_root() / "cores"
    firm = [str(path) for folder in _SOURCES for path in sorted((cores / folder).glob("*.vhd"))]
    return Translation(entity, "kernel.v", {"firm": firm, "work": ["kernel.vhd"]}, {})


def _placed(found: dict[str, Any]) -> Placed:
    blocks = found["blocks"]
    lut, ff, dsp = (sum(block[key] for block in blocks) for key in ("lut", "ff", "dsp"))
    # The logic of the entity itself is not in one of its instances.
    inner = [block for block in blocks if block["name"] != "between blocks"]
    operators = sum(block["lut"] for block in inner), sum(block["ff"] for block in inner)
    return Placed(lut, ff, dsp, min(found["clocks"].values(), default=None), operators, found["missing"])
