"""The flow `firm`: FuseSoC builds a target with the flow that its generated core or its family determines."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.step.flow import known_options, options_of, resolved
from fusesoc_firm.tools.flows import FAMILIES, SUFFIX, Flow, read_flow

ICESTORM = Flow("icestorm", {"frontends": ["ghdlsynth"], "nextpnr_options": ["--up5k", "--seed", "1"]})
QUARTUS = Flow("quartus", {"device": "5CSEBA6U23I7", "family": "Cyclone V"}, is_tool=True)
CORE = """\
CAPI=2:
name: me:lib:adder:1
filesets:
  vhdl: {files: [adder.vhd: {file_type: vhdlSource-93}]}
  verilog: {files: [adder.v: {file_type: verilogSource}]}
targets:
  vhdl: {filesets: [vhdl], toplevel: adder, flow: firm, flow_options: {family: ice40}}
  verilog: {filesets: [verilog], toplevel: adder, flow: firm, flow_options: {family: ice40}}
  nothing: {filesets: [vhdl], toplevel: adder, flow: firm}
"""
VHDL = """\
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity adder is
  port (clk : in std_logic; d : in unsigned(7 downto 0); q : out unsigned(7 downto 0));
end entity adder;

architecture rtl of adder is
  signal q_r : unsigned(7 downto 0);
begin
  q <= q_r;

  accumulate : process (clk) is
  begin
    if rising_edge(clk) then
      q_r <= q_r + d;
    end if;
  end process accumulate;
end architecture rtl;
"""
VERILOG = """\
module adder (input clk, input [7:0] d, output reg [7:0] q);
  always @(posedge clk) q <= q + d;
endmodule
"""


def build(folder: Path, *flows: Flow, **options: Any) -> dict[str, Any]:
    """The description of a build whose generated cores have these flows."""
    for flow in flows:
        (folder / flow.file_name()).write_text(flow.text(), encoding="utf-8")
    files = [{"name": "a.vhd", "file_type": "vhdlSource-93"}]
    files += [{"name": flow.file_name(), "file_type": "user"} for flow in flows]
    return {"name": "robot", "toplevel": "top", "files": files, "flow_options": options}


@pytest.mark.parametrize("flow", [ICESTORM, QUARTUS])
def test_a_flow_is_read_as_it_was_written(flow: Flow) -> None:
    assert read_flow(flow.text()) == flow


def test_another_option_is_another_file() -> None:
    """So FuseSoC, which compares the names of files, configures the build again."""
    changed = Flow("icestorm", {**ICESTORM.options, "nextpnr_options": ["--up5k"]})
    assert changed.file_name() != ICESTORM.file_name()
    assert changed.file_name().endswith(SUFFIX)


def test_lists_are_appended_and_words_replaced(tmp_path: Path) -> None:
    given = build(tmp_path, ICESTORM, nextpnr_options=["--seed", "7"], pnr="none")
    api, name, edam = resolved("flow", "firm", given, str(tmp_path))
    assert (api, name) == ("flow", "icestorm")
    assert edam["flow_options"] == {
        "frontends": ["ghdlsynth"],
        "nextpnr_options": ["--up5k", "--seed", "1", "--seed", "7"],
        "pnr": "none",
    }
    assert given["flow_options"] == {"nextpnr_options": ["--seed", "7"], "pnr": "none"}


def test_a_tool_without_a_flow_has_its_options_where_edalize_reads_them(tmp_path: Path) -> None:
    api, name, edam = resolved("flow", "firm", build(tmp_path, QUARTUS), str(tmp_path))
    assert (api, name, edam["tool_options"]) == ("tool", "quartus", {"quartus": QUARTUS.options})
    assert "flow_options" not in edam


def test_other_flows_are_left_alone(tmp_path: Path) -> None:
    edam = build(tmp_path, ICESTORM, tool="ghdl")
    assert resolved("flow", "sim", edam, str(tmp_path)) == ("flow", "sim", edam)


@pytest.mark.parametrize(
    ("flows", "options", "message"),
    [
        ((), {}, "no generated core determines the flow"),
        ((ICESTORM, QUARTUS), {}, "several generated cores determine the flow"),
        ((), {"family": "ice4"}, "unknown family 'ice4'; did you mean 'ice40'?"),
        ((ICESTORM,), {"nextpnr_option": ["x"]}, "the flow icestorm has no option 'nextpnr_option'; did you mean"),
        ((ICESTORM,), {"sim_options": ["x"]}, "the flow icestorm has no option 'sim_options'"),
        ((), {"family": "ecp5", "vivado": "x"}, "the flow generic with yosys has no option 'vivado'"),
    ],
)
def test_what_does_not_determine_a_flow_is_refused(
    tmp_path: Path, flows: tuple[Flow, ...], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(RuntimeError) as error:
        resolved("flow", "firm", build(tmp_path, *flows, **options), str(tmp_path))
    assert message in str(error.value)


def test_the_command_line_takes_the_options_of_all_flows() -> None:
    known = known_options()
    assert {"sim_options", "verilator_options", "iverilog_options", "nextpnr_options", "yosys_synth_options"} <= {
        *known
    }
    assert all({"type", "desc"} <= option.keys() for option in known.values())
    assert known.keys() >= options_of(ICESTORM).keys() - {"frontends"}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in {"c.core": CORE, "adder.vhd": VHDL, "adder.v": VERILOG, "fusesoc.conf": ""}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def fusesoc(project: Path, target: str, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", ".", "run", f"--target={target}", *words]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)


@pytest.mark.check
@pytest.mark.skipif(shutil.which("ghdl") is None, reason="GHDL is not installed")
@pytest.mark.skipif(shutil.which("yosys") is None, reason="Yosys is not installed")
@pytest.mark.parametrize("target", ["vhdl", "verilog"])
def test_the_cells_of_any_core_are_counted(project: Path, target: str) -> None:
    done = fusesoc(project, target, "me:lib:adder", "--yosys_synth_options=-noflatten")
    assert done.returncode == 0, done.stdout + done.stderr
    (makefile,) = project.glob("build/*/*/edalize_yosys_procs.tcl")
    options = " ".join(FAMILIES["ice40"].options)
    assert f"synth_ice40 {options} -noflatten" in " ".join(makefile.read_text().split())
    assert "SB_DFF" in done.stdout + done.stderr


def test_fusesoc_says_what_is_missing(project: Path) -> None:
    done = fusesoc(project, "nothing", "--setup", "me:lib:adder")
    assert done.returncode == 1
    assert "ERROR: no generated core determines the flow of this target" in done.stderr
    description = next(project.glob("build/*/nothing/*.eda.yml"))
    assert yaml.safe_load(description.read_text())["flow_options"] == {}
