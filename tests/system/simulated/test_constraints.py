"""Constraints on the paths between clocks: each path of a system's netlist has one, and each has a path."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
import yaml

from tests.cores.crossing_paths import Crossed, Domains, Names, crossing_paths
from tests.hdl.ghdl import Library, core_files
from tests.system.simulated.systems import DATA, HARDWARE, generate_system
from tests.system.simulated.test_clock_domains import block, pass_through, project
from tests.system.simulated.test_parameters import specification as with_parameters
from tests.system.simulated.test_variable_system import converter

POINT, POSE, TEXT = "geometry_msgs/Point", "geometry_msgs/Pose", "std_msgs/String"
CLOCKS = {"clk": "clk", "clk_fast": "fast", "clk_slow": "slow"}
CLOCKS_OF_THE_PROCESSOR = {"clk_fpga_0": "clk", "clk_fpga_1": "fast", "clk_fpga_2": "slow"}
SIDES = {"lit_button": "outside", "lit_lamp": "fast", "rst_n": "outside"}


@dataclass(frozen=True)
class Constraint:
    """Patterns for the registers at both ends of paths, as Vivado names them, or a clock; a missing one matches all."""

    source: str
    sink: str
    clock: str

    def covers(self, path: Crossed) -> bool:
        is_clocked = not self.clock or CLOCKS_OF_THE_PROCESSOR[self.clock] == path.side
        return is_clocked and _matches(self.source, path.source) and _matches(self.sink, path.sink)


def _matches(pattern: str, names: Names) -> bool:
    # The system is an instance of the design, and Vivado ends the names of registers with _reg.
    return not pattern or any(fnmatchcase(f"design/{name.replace('.', '/')}_reg[0]", pattern) for name in names)


def read(text: str) -> list[Constraint]:
    """The constraints of an .xdc file but those on pointers' skew and on asynchronous clears."""
    found = []
    for line in text.splitlines():
        ends = dict(
            re.findall(r"-(from|to) \[get_\w+ -hierarchical -filter \{NAME =~ (\S+?)(?:/D|/CLR| &&[^}]*)?\}\]", line)
        )
        if ends and "/CLR" not in line and "set_bus_skew" not in line:
            clock = re.search(r"-to \[get_clocks (\w+)\]", line)
            found.append(Constraint(ends.get("from", ""), ends.get("to", ""), clock[1] if clock else ""))
    return found


def specification(folder: Path) -> Path:
    """Messages of fixed and of variable size in three domains, and a pin."""
    for name in ("swap", "lamp"):
        shutil.copy(DATA / f"{name}.vhd", folder)
    pose, point = ({"middleware": "ROS2", "message": message} for message in (POSE, POINT))
    part = {**pose, "include": ["position.x", "position.y"]}
    pins = [{"name": "button", "direction": "in"}, {"name": "lamp", "direction": "out"}]
    accelerators = [
        {"name": "swap", "type": "VHDL", "sources": "swap.vhd", "interface": {"input": [part], "output": [part]}},
        {
            "name": "lamp",
            "type": "VHDL",
            "sources": "lamp.vhd",
            "interface": {"input": [point], "output": [point]},
            "pins": pins,
        },
        pass_through(folder, "way", TEXT, 8),
    ]
    blocks = [
        {**converter("pose", "subscriber", POSE, "first"), **part},
        block("first", "swap", "second", clock="fast"),
        block("second", "swap", "pose_out", clock="slow"),
        {**converter("pose_out", "publisher", POSE), **part},
        converter("text", "subscriber", TEXT, "through"),
        block("through", "way", "text_out", clock="slow"),
        converter("text_out", "publisher", TEXT, buffer=100),
        converter("point", "subscriber", POINT, "lit"),
        block("lit", "lamp", "point_out", clock="fast"),
        converter("point_out", "publisher", POINT),
    ]
    spec = folder / "spec.yaml"
    clocks = {"name": "crossed", **project(8, "100 MHz", fast="270 MHz", slow="31 MHz")}
    content = {"project": clocks, "accelerators": accelerators, "blocks": blocks}
    spec.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return spec


def test_each_path_between_clocks_has_its_own_constraint(tmp_path: Path) -> None:
    spec = specification(tmp_path)
    files = generate_system(spec, tmp_path, "zynq7000")
    Library("firm", tmp_path).analyse(core_files(*HARDWARE))
    work = Library("work", tmp_path)
    work.analyse(files)
    verilog = work.synthesise("crossed_system", language="verilog")
    domains = Domains(CLOCKS, lambda port: SIDES.get(port, "clk"))
    paths = crossing_paths(verilog, "crossed_system", tmp_path, domains)
    text = (tmp_path / "zynq7000.xdc").read_text(encoding="utf-8")
    constraints = read(text)
    covered = [{path for path in paths if item.covers(path)} for item in constraints]
    assert paths == set().union(*covered)
    # No constraint is missed without a path that it alone covers.
    unused = [
        (item.source or item.sink, item.clock)
        for item, own in zip(constraints, covered, strict=True)
        if not own - set().union(*(other for other in covered if other is not own))
    ]
    # A RAM has no paths here, and the first chains wait for no other domain. swap registers the fields, so that none
    # come from the blocks before it, and lamp wires them back to clk.
    assert unused == [
        ("*/u_pose/*", "clk_fpga_2"),
        ("*/u_first/*", "clk_fpga_0"),
        ("*/u_text_to_through_in_data_axis_crossing/memory_reg*", ""),
        ("*/u_through_out_to_text_out_data_axis_crossing/memory_reg*", ""),
        ("*/u_point/*", "clk_fpga_1"),
        ("*/u_lit/*", "clk_fpga_0"),
        ("*/u_system_rst/first_r_reg*", ""),
        ("*/u_seen_fast/first_r_reg*", ""),
    ]
    # Two streams: there and back.
    assert text.count("set_bus_skew ") == 4
    assert "-from [get_clocks" not in text


def test_each_path_of_a_parameter_has_its_own_constraint(tmp_path: Path) -> None:
    """The constraints without a path are those of the messages, which tuned holds in registers of its own."""
    files = generate_system(with_parameters(tmp_path, 8, "270 MHz"), tmp_path, "zynq7000")
    Library("firm", tmp_path).analyse(core_files(*HARDWARE))
    work = Library("work", tmp_path)
    work.analyse(files)
    verilog = work.synthesise("tuning_system", language="verilog")
    domains = Domains({"clk": "clk", "clk_own": "fast"}, lambda port: "outside" if port == "rst_n" else "clk")
    paths = crossing_paths(verilog, "tuning_system", tmp_path, domains)
    constraints = read((tmp_path / "zynq7000.xdc").read_text(encoding="utf-8"))
    covered = [{path for path in paths if item.covers(path)} for item in constraints]
    assert paths == set().union(*covered)
    of_parameters = [own for item, own in zip(constraints, covered, strict=True) if "u_block_gain_" in item.source]
    assert len(of_parameters) == 6
    assert all(of_parameters)


@pytest.mark.parametrize("what", ["-from", "-to"])
def test_both_tools_get_the_same_names(tmp_path: Path, what: str) -> None:
    spec = specification(tmp_path)
    for board in ("zynq7000", "quartus"):
        generate_system(spec, tmp_path, board)
    vivado, quartus = ((tmp_path / name).read_text(encoding="utf-8") for name in ("zynq7000.xdc", "quartus.sdc"))
    in_vivado = re.findall(rf"{what} \[get_cells -hierarchical -filter {{NAME =~ \*/(\S+?)(?:_reg\*|\*)[ }}]", vivado)
    in_quartus = re.findall(rf'{what} \[get_registers -compatibility_mode "(\S+?)\*"', quartus)
    own = {name for name in in_quartus if what == "-to" and name.endswith("|first_r") and name.count("|") == 1}
    resets = {f"{label}|first_r" for label in re.findall(r"\*/(\w+)/\*_r_reg\*/CLR", vivado)}
    assert {name.replace("/", "|") for name in in_vivado} | (own & resets) == set(in_quartus)
    assert "create_clock -name clk_fast" in quartus and "-from [get_clocks" not in quartus
