"""Write an IP-XACT component: a folder with `component.xml` and the files that it names."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.export.component.model import Component
from fusesoc_firm.export.component.package import Package, write_files
from fusesoc_firm.export.ip_xact.writer import STANDARDS, gui_path, instance_name, write_component
from fusesoc_firm.text.outputs import write
from fusesoc_firm.text.render import render

VIVADO = 2009
_GUI_TEMPLATE = "ip_xact/xgui.tcl"


def write_package(package: Package, year: int, folder: Path) -> None:
    """Write `component.xml` in the standard of a year, and the files that it names. May raise `InputError`."""
    write_files(package.places, folder)
    if year == VIVADO:
        write(folder / gui_path(package.component), _gui(package.component))
    write(folder / "component.xml", write_component(package.component, STANDARDS[year]))


def _gui(component: Component) -> str:
    free = [{"name": generic.name} for generic in component.generics if generic.is_free]
    return render(_GUI_TEMPLATE, {"instance": instance_name(component), "generics": free})
