"""A target as a component: its ports, interfaces and files, from the sources or from a Verilog netlist."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from fusesoc_firm.export.component.design import Design, is_verilog, is_vhdl, vlnv
from fusesoc_firm.export.component.interfaces import infer
from fusesoc_firm.export.component.model import Component, Generic, Port, SourceFile
from fusesoc_firm.export.component.verilog_module import read_module
from fusesoc_firm.export.component.vhdl_entity import Entity, read_entity
from fusesoc_firm.netlist.instantiated import entities
from fusesoc_firm.system.derived.model import StatusAccess
from fusesoc_firm.system.hardware.registers import Register
from fusesoc_firm.system.system_core import status_registers
from fusesoc_firm.text.diagnostics import fail, nearest
from fusesoc_firm.text.outputs import write

SOURCES, NETLIST = VIEWS = ("sources", "netlist")
# The types and endings of files that are neither VHDL nor Verilog but belong to the hardware.
_OTHER_TYPES = ("xdc", "mem")
_MEMORIES = (".mem", ".hex", ".mif", ".coe", ".dat")


@dataclass(frozen=True)
class Package:
    """A component, and the place of each of its files."""

    component: Component
    places: Mapping[PurePosixPath, Path]


def package(design: Design, view: str) -> Package:
    """Return the component of a target, with its sources or with a Verilog netlist instead of its VHDL.

    Raise `InputError` if the top unit cannot be read or has no ports, or if there is no netlist.
    """
    entity, needed = _entity(design)
    files = _netlist(design) if view == NETLIST and design.vhdl() else _sources(design, needed)
    generics, ports = _interface(design, files, entity, view)
    if not ports:
        fail(f"'{design.top}' has no ports, so it is no component", hint="name a target whose top unit is hardware")
    paths = [(path, file) for file in files if (path := _path(file, design))]
    vendor, library, _, version = vlnv(design.build)
    component = Component(
        vendor,
        library,
        design.unit,
        version,
        design.description,
        "VHDL" if entity and view == SOURCES else "Verilog",
        ports,
        infer(ports, _registers(design), _frequencies(design)),
        [_source_file(path, file) for path, file in paths],
        generics,
    )
    return Package(component, {path: design.build.work_root / file["name"] for path, file in paths})


def write_files(places: Mapping[PurePosixPath, Path], folder: Path) -> None:
    """Copy files to their paths in a folder. May raise `InputError`."""
    for path, place in places.items():
        write(folder / path, place.read_bytes())


def _entity(design: Design) -> tuple[Entity | None, Container[str]]:
    """Return the top unit if it is an entity, and the VHDL files that the design needs."""
    libraries, root = design.vhdl(), design.build.work_root
    known = entities({library: [str(root / name) for name in names] for library, names in libraries.items()})
    whole = {name for names in libraries.values() for name in names}
    has_verilog = any(map(is_verilog, design.files))
    if design.unit.lower() not in {name.lower() for name in known}:
        if not has_verilog:
            fail(f"the sources of {design.build} have no entity '{design.unit}'", hint=nearest(design.unit, known))
        return None, whole
    entity, needed = read_entity(design.top, root, libraries, design.standard, design.parameters("generic"))
    # GHDL knows no entities below a module in Verilog.
    return entity, whole if has_verilog else needed


def _sources(design: Design, needed: Container[str]) -> Sequence[Mapping[str, Any]]:
    return [file for file in design.files if not is_vhdl(file) or file["name"] in needed]


def _netlist(design: Design) -> Sequence[Mapping[str, Any]]:
    """Translate the VHDL of a target to Verilog; return the netlist's file and the target's other files."""
    from edalize.tools.ghdlsynth import Ghdlsynth

    options = {
        name: value for name, value in design.edam.get("flow_options", {}).items() if name in Ghdlsynth.TOOL_OPTIONS
    }
    tool = Ghdlsynth()
    tool.work_root = str(design.build.work_root)
    # The translation needs no programs of later steps.
    tool.setup({**design.edam, "files": design.files, "tool_options": {"ghdlsynth": options}})
    tool.write_config_files()
    done = subprocess.run(
        [sys.executable, "-m", "fusesoc_firm.netlist", f"{tool.name}.ghdlsynth"],
        cwd=design.build.work_root,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode:
        fail(f"there is no netlist of '{design.top}'", hint=done.stderr.strip())
    netlist, *others = tool.edam["files"]
    return [{**netlist, "is_netlist": True}, *others]


def _interface(
    design: Design, files: Sequence[Mapping[str, Any]], entity: Entity | None, view: str
) -> tuple[Sequence[Generic], Sequence[Port]]:
    """Return the generics and ports of the top unit in these files; those of a netlist are fixed."""
    if entity and view == SOURCES:
        return entity.generics(), entity.ports()
    verilog = [design.build.work_root / file["name"] for file in files if is_verilog(file)]
    parameters = {} if entity else design.parameters("vlogparam")
    generics, ports = read_module(design.unit, verilog, design.parameters("vlogdefine"), parameters)
    return ([], _with_defaults(ports, entity)) if entity else (generics, ports)


def _with_defaults(ports: Sequence[Port], entity: Entity) -> list[Port]:
    """Return the ports of a netlist, in which no port has a default value, with the defaults of the entity."""
    defaults = entity.defaults()
    return [Port(port.name, port.direction, port.bounds, defaults.get(port.name)) for port in ports]


def _path(file: Mapping[str, Any], design: Design) -> PurePosixPath | None:
    """Return the path of a file in the component, or None if the file is not part of the hardware."""
    type_, name = str(file.get("file_type", "")), PurePosixPath(file["name"])
    is_hardware = is_verilog(file) or is_vhdl(file) or type_ in _OTHER_TYPES or name.suffix in _MEMORIES
    if not is_hardware:
        return None
    if file.get("is_netlist"):
        return PurePosixPath(f"src/{design.unit}_netlist.v")
    if name.is_absolute() or ".." in name.parts:
        return PurePosixPath("src", str(file.get("core", "")).replace(":", "_"), name.name)
    return name


def _source_file(path: PurePosixPath, file: Mapping[str, Any]) -> SourceFile:
    library = str(file.get("logical_name") or "")
    return SourceFile(path, str(file["file_type"]), library, bool(file.get("is_include_file")))


def _registers(design: Design) -> Sequence[Register]:
    """Return the registers at the AXI4-Lite interface of a system."""
    loaded = design.system
    is_mapped = loaded is not None and loaded.system.status is StatusAccess.AXI_LITE
    return status_registers(loaded).registers if loaded and is_mapped else ()


def _frequencies(design: Design) -> dict[str, int]:
    """Return the frequencies of a system's clocks in Hz, by port."""
    if not design.system:
        return {}
    system = design.system.system
    clocks = {clock.port: clock.frequency for clock in system.clocks} | ({"clk": system.clock} if system.clock else {})
    return {port: round(frequency) for port, frequency in clocks.items()}
