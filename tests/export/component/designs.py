"""Targets that FuseSoC has set up, and the ports of their netlists as Yosys reads them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from fusesoc_firm.cli.here import core_named
from fusesoc_firm.export.component.design import Design, plan_target
from fusesoc_firm.tools.programs import find
from fusesoc_firm.tools.yosys import Yosys
from tests.hdl.ghdl import REPOSITORY

_DIRECTIONS = {"input": "in", "output": "out", "inout": "inout"}
_CONVERTER = """\
CAPI=2:
name: me:robots:{name}:1.0
description: A converter
filesets:
  base: {{depend: ["robot:firm:generators"]}}
generate:
  converter:
    generator: firm
    parameters: {{message: {message}, ros: 2, width: {width}}}
    position: prepend
targets:
  default: {{filesets: [base], generate: [converter], toplevel: {top}}}
  none: {{filesets: [base], generate: [converter]}}
"""
_VERILOG_CORE = """\
CAPI=2:
name: me:robots:filter:2.1.4
filesets:
  rtl: {files: [filter.v: {file_type: verilogSource}, sizes.vh: {file_type: verilogSource, is_include_file: true},
    pins.xdc: {file_type: xdc}, notes.txt: {file_type: user}, rom.mem: {file_type: user}]}
parameters:
  WIDTH: {datatype: int, default: 24, paramtype: vlogparam}
targets:
  default: {filesets: [rtl], toplevel: filter, parameters: [WIDTH]}
  lint: {filesets: [rtl], toplevel: filter, flow: lint, flow_options: {tool: verilator}}
"""
_VERILOG = """\
module filter #(parameter WIDTH = 8) (
`include "sizes.vh"
  input aclk, input aresetn, input [WIDTH-1:0] s_axis_tdata, input s_axis_tvalid
);
endmodule
"""


def alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make an empty folder the current one, from which FuseSoC knows no cores."""
    monkeypatch.chdir(folder)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(folder))
    monkeypatch.setenv("FUSESOC_CORES", "")


def designed(core: str) -> Design:
    """Let FuseSoC set up the default target of a core."""
    target = plan_target(*core_named(core), "default")
    assert target.set_up(lambda _: None) == 0, target.build.log.read_text(encoding="utf-8")
    return target.read()


def netlist_ports(top: str, paths: Sequence[Path], folder: Path) -> dict[str, tuple[str, int]]:
    """The direction and width of each port after Yosys has elaborated all Verilog below the top; `folder` is Yosys'."""
    program = find("yosys")
    assert program
    yosys = Yosys(program, folder)
    modules = yosys.modules(f"{yosys.reading(paths)}; hierarchy -check -top {top}; proc")
    ports = modules[top]["ports"]
    return {name: (_DIRECTIONS[port["direction"]], len(port["bits"])) for name, port in ports.items()}


def write_system(folder: Path, name: str, changes: Mapping[str, str]) -> Path:
    """A demo system in which each text of the specification that `changes` names has become another one."""
    shutil.copytree(REPOSITORY / "specs" / name, folder, ignore=shutil.ignore_patterns("*_*"))
    core, spec = folder / f"{name}.core", folder / f"{name}.yaml"
    text = core.read_text(encoding="utf-8").replace(f"robot:sys:{name}:", f"me:robots:{name}:")
    core.write_text(text, encoding="utf-8")
    text = spec.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    spec.write_text(text, encoding="utf-8")
    return spec


def write_converter(folder: Path, message: str, *, is_subscriber: bool, width: int = 8) -> str:
    """A core whose top unit is a converter."""
    name = message.replace("/", "_").lower()
    top = f"axis_to_{name}" if is_subscriber else f"{name}_to_axis"
    path = folder / f"{top}_{width}" / "converter.core"
    path.parent.mkdir()
    path.write_text(_CONVERTER.format(name=f"{top}_{width}", message=message, width=width, top=top), encoding="utf-8")
    return str(path)


def write_verilog(folder: Path) -> str:
    """A core in Verilog with an included file, pins of a board and a memory."""
    files = {"filter.core": _VERILOG_CORE, "filter.v": _VERILOG, "sizes.vh": "input [3:0] level,\n", "rom.mem": "00\n"}
    for name in (*files, "pins.xdc", "notes.txt"):
        (folder / name).write_text(files.get(name, ""), encoding="utf-8")
    return "filter.core"
