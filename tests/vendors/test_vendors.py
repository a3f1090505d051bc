"""Projects for the tools of FPGAs' makers, which are not here: their scripts run in Tcl, with commands that check.

`vivado.tcl` and `quartus.tcl` know the commands, and what each may be told; `ip.tcl` what IP has which pins, interfaces
and properties. A script that is broken in any way that they know of must be found.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fusesoc_firm.cli import main

ROOT = Path(__file__).resolve().parents[2]
TOOLS = Path(__file__).resolve().parent
ZYNQ = ("zynq7000", "zcu104", "kr260")
WITH_KERNELS = "quat2euler_hls"
# Six applications (docs/reference/applications.md), and two of them with accelerators in C++ and in Verilog.
CORES = (
    *("image_pipeline", "mobile_robot", "multi_type", "quat2euler", "robotic_arm", "sobel"),
    *(WITH_KERNELS, "multi_type_verilog"),
)

pytestmark = pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")

# Three clocks, a preemptive scheduler, a status, pins of both directions and kinds.
COPY = """\
library ieee;
use ieee.std_logic_1164.all;
entity copy is
  port (clk, rst_n : in std_logic);
end entity;
"""
SPECIFICATION = """\
project:
  name: robot
  width: 512
  scheduler: fixed_priority_preemptive
  clock: 80 MHz
  status: axi_lite
  clocks: [{name: fast, frequency: 200 MHz}, {name: odd, frequency: 66.6 MHz}]
accelerators:
  - name: copy
    type: VHDL
    sources: copy.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Point}]
      output: [{middleware: ROS, message: geometry_msgs/Point}]
    pins: [{name: lamp, direction: out}, {name: level, direction: in, bits: 12}]
blocks:
  - {name: left, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: first}]}
  - {name: right, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: second}]}
  - {name: first, type: copy, clock: fast, outgoing: [{name: first_out}]}
  - {name: second, type: copy, clock: odd, outgoing: [{name: second_out}]}
  - {name: first_out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
  - {name: second_out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
"""


class Project:
    """What FuseSoC and Edalize set up for a core on a board."""

    def __init__(self, folder: Path, core: str, board: str, *, library: Path = ROOT) -> None:
        command = [sys.executable, "-m", "fusesoc.main", f"--cores-root={library}", "run", "--setup"]
        done = subprocess.run(
            [*command, f"--build-root={folder}", f"--target={board}", f"robot:sys:{core}"],
            cwd=ROOT,
            env={
                **os.environ,
                "PYTHONPATH": str(ROOT),
                "FUSESOC_FIRM_CACHE": str(folder.parent / "store"),
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        (self.script,) = folder.glob(f"robot_sys_{core}_*/{board}*/robot_sys_{core}_[0-9]?[0-9]?[0-9].tcl")
        self.folder = self.script.parent
        self.tool = "quartus" if board == "quartus" else "vivado"

    def generated(self, name: str) -> Path:
        """A generated file of the project."""
        (path,) = (self.folder / "src").rglob(name)
        return path

    def check(self, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run the project's script with commands that check; `variables` are those of `vivado.tcl`."""
        return subprocess.run(
            ["tclsh", str(TOOLS / f"{self.tool}.tcl"), str(self.script)],
            cwd=self.folder,
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            check=False,
        )

    def lines(self, **variables: str) -> list[str]:
        """What a script without faults makes."""
        done = self.check(**variables)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    def fault(self, name: str, old: str, new: str) -> str:
        """What is said of the project with `old` in one of its files replaced; `new` may be empty."""
        path = self.script if name == self.script.name else self.generated(name)
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{name} has no {old!r}"
        path.write_text(text.replace(old, new), encoding="utf-8")
        try:
            done = self.check()
        finally:
            path.write_text(text, encoding="utf-8")
        assert done.returncode == 1, f"{old!r} became {new!r}, and nobody noticed"
        return done.stderr


@pytest.mark.one_in(9, 3)
@pytest.mark.parametrize("board", ZYNQ)
@pytest.mark.parametrize("core", CORES)
def test_every_system_beside_a_processor(tmp_path: Path, core: str, board: str) -> None:
    lines = Project(tmp_path / "build", core, board).lines()
    cells = {line.split()[1]: line.split()[2] for line in lines if line.startswith("cell ")}
    assert cells["processor"] == ("processing_system7" if board == "zynq7000" else "zynq_ultra_ps_e")
    assert cells["dma"] == "axi_dma"
    assert cells["system"].endswith("_system")
    assert [line for line in lines if line.startswith("kernel ")] == (
        ["kernel robot:hls:QuaternionToEuler:1.0"] if core == WITH_KERNELS else []
    )


@pytest.mark.one_in(2)
@pytest.mark.parametrize("core", ["quat2euler", "multi_type_verilog"])
def test_a_project_of_quartus(tmp_path: Path, core: str) -> None:
    lines = Project(tmp_path / "build", core, "quartus").lines()
    assert [line.split()[:3] for line in lines if line.startswith("clock")] == [["clock", "clk", "clk"]]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A core of a system with several clocks."""
    folder = tmp_path_factory.mktemp("library")
    (folder / "copy.vhd").write_text(COPY, encoding="ascii")
    (folder / "robot.yaml").write_text(SPECIFICATION, encoding="ascii")
    assert main(["system", "core", str(folder / "robot.yaml")]) == 0
    return folder


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("board", "clock", "pin"), [("zynq7000", "clk_fpga_", "FCLK_CLK"), ("zcu104", "clk_pl_", "pl_clk")]
)
def test_clocks_widths_and_pins(tmp_path: Path, library: Path, board: str, clock: str, pin: str) -> None:
    project = Project(tmp_path / "build", "robot", board, library=library)
    lines = project.lines()
    for net in (
        f"processor/{pin}0 system/clk 1",
        f"processor/{pin}1 system/clk_fast 1",
        f"processor/{pin}2 system/clk_odd 1",
        "dma/m_axis_mm2s_tdata system/s_axis_tdata 512",
        "records/m_axis_tkeep dma/s_axis_s2mm_tkeep 64",
        "first_level system/first_level 12",
        "system/second_lamp second_lamp 1",
        "system/status_interrupt interrupts/In2 1",
    ):
        assert f"net {net}" in lines
    # Cycles of the clocks in ns: 12.5, 5 and 15.015.
    crossing = "u_left_to_first_in_crossing"
    for delay in (
        f"{crossing}/request_r_reg* {crossing}/u_request/first_r_reg* 5.000",
        f"{crossing}/answer_r_reg* {crossing}/u_return/first_r_reg* 12.500",
        f"u_left/* {clock}1 5.000",
        f"u_second/* {clock}0 12.500",
    ):
        assert f"max_delay {delay}" in lines
    paths = [line.removeprefix("false_path ") for line in lines if line.startswith("false_path")]
    assert paths[:2] == [f"u_{block}_level_sync/first_r_reg*" for block in ("first", "second")]
    for label in ("u_system_rst", "u_domains_rst", "u_rst_fast", "u_seen_fast", "u_rst_odd", "u_seen_odd"):
        assert {f"{label}/first_r_reg*/D", f"{label}/*_r_reg*/CLR"} <= set(paths)
    design = project.generated(f"robot_{board}.tcl").read_text(encoding="utf-8")
    assert "FREQMHZ 80\n" in design
    assert "FREQMHZ 200\n" in design
    assert "FREQMHZ 66.6\n" in design
    assert f"there is no clock {clock}3" in project.fault(f"{board}.xdc", f"{clock}2", f"{clock}3")
    assert "unknown option -datapath" in project.fault(f"{board}.xdc", "-datapath_only", "-datapath")
    assert "there is no instance u_left_to" in project.fault(f"{board}.xdc", f"{crossing}/", "u_left_to/")


def test_clocks_in_quartus(tmp_path: Path, library: Path) -> None:
    project = Project(tmp_path / "build", "robot", "quartus", library=library)
    lines = project.lines()
    assert "clock clk_fast clk_fast 5.000" in lines
    crossing = "u_right_to_second_in_crossing"
    assert f"max_delay {crossing}|request_r* {crossing}|u_request|first_r* 15.015" in lines
    assert f"min_delay {crossing}|answer_r* {crossing}|u_return|first_r* -100" in lines
    assert "max_delay u_right|* clk_odd 15.015" in lines
    assert "false_path u_second_level_sync|first_r*" in lines
    assert "false_path u_seen_odd|*_r*|clrn" in lines
    assert "there is no instance u_again" in project.fault("quartus.sdc", "|u_return|", "|u_again|")
    assert "there is no port clk_slow" in project.fault("quartus.sdc", "[get_ports clk_odd]", "[get_ports clk_slow]")
    assert "there is no clock clk_o" in project.fault(
        "quartus.sdc", "-to [get_clocks clk_odd]", "-to [get_clocks clk_o]"
    )
    assert "invalid command name" in project.fault("quartus.sdc", "derive_clock_uncertainty", "derive_uncertainty")
    name = project.script.name
    assert "unknown assignment" in project.fault(name, "-name DEVICE", "-name DEVISE")
    assert "there is no top level" in project.fault(name, "ENTITY robot_system", "ENTITY robots_system")
    assert "there are no constraints" in project.fault(name, "-name SDC_FILE src", "-name VHDL_FILE src")
    assert "there is no entity firm_manager" in project.fault("firm_manager.vhd", "entity firm_manager is", "")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory, library: Path) -> Project:
    return Project(tmp_path_factory.mktemp("broken") / "build", "robot", "zynq7000", library=library)


def net(source: str, sink: str) -> str:
    return f"connect_bd_net [get_bd_pins {source}] [get_bd_pins {sink}]\n"


CLOCK = net("processor/FCLK_CLK0", "dma/m_axi_sg_aclk")
RESET = net("reset/interconnect_aresetn", "control/aresetn")
LAST = net("dma/m_axis_mm2s_tlast", "system/s_axis_tlast")
LISTS = "connect_bd_intf_net [get_bd_intf_pins dma/M_AXI_SG] [get_bd_intf_pins memory/S00_AXI]\n"
ADDRESS = "assign_bd_address -offset 0x40400000 -range 64K -target_address_space [get_bd_addr_spaces processor/Data]"
DESIGN = "robot_zynq7000.bd"


@pytest.mark.one_in(5)
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("save_bd_design", "save_design", 'invalid command name "save_design"'),
        ("-import -top", "-import -topmost", "unknown option -topmost of make_wrapper"),
        ("-type module -reference robot_system", "-type module -reference robots", "there is no entity robots"),
        ("update_compile_order -fileset sources_1\n", "", "the hierarchy of sources is not known yet"),
        ("ip:smartconnect control", "ip:smart_connect control", "unknown IP xilinx.com:ip:smart_connect"),
        ("ilconcat:1.0 interrupts", "ilconcat:1.0 interrupt", "there is no cell interrupts"),
        ("inline_hdl:ilconcat:1.0", "ip:xlconcat", "unknown IP xilinx.com:ip:xlconcat"),
        ("BUSIF s_axis:m_axis:s_axi", "BUSIF s_axis:s_axi", "BD 41-967: AXI interface pin system/m_axis is not"),
        ("BUSIF s_axis:m_axis:s_axi", "BUSIF s_axis:m_axi", "there is no interface system/m_axi"),
        ("STEPS.ROUTE_DESIGN.TCL.POST", "STEPS.ROUTE.TCL.POST", "unknown property STEPS.ROUTE.TCL.POST of impl_1"),
        ("zynq7000_checks.tcl", "checks.tcl", "there is no file"),
        ("[get_runs impl_1]", "[get_runs impl]", "there is no run impl"),
        ("CONFIG.NUM_SI 3", "CONFIG.NUM_S 3", "unknown property NUM_S of smartconnect"),
        ("CONFIG.NUM_SI 3", "CONFIG.NUM_SI 17", "NUM_SI of memory cannot be 17"),
        ("CONFIG.NUM_SI 3", "CONFIG.NUM_SI 2", "memory/S02_AXI is not there, as the properties are"),
        ("CONFIG.NUM_SI 3", "CONFIG.NUM_SI 4", "memory/S03_AXI is not connected"),
        ("c_sg_length_width 26", "c_sg_length_width 27", "c_sg_length_width of dma cannot be 27"),
        (
            "c_m_axi_s2mm_data_width 512",
            "c_m_axi_s2mm_data_width 256",
            "dma breaks the rule $c_s_axis",
        ),
        ("c_s_axis_s2mm_tdata_width 512", "c_s_axis_s2mm_tdata_width 64", "has 512 bits, dma/s_axis_s2mm_tdata has 64"),
        (
            "-from 11 -to 0 first_level",
            "-from 10 -to 0 first_level",
            "first_level has 11 bits, system/first_level has",
        ),
        ("PCW_USE_S_AXI_HP0 1", "PCW_USE_S_AXI_HP0 0", "processor/S_AXI_HP0 is not there, as the properties are"),
        ("PCW_USE_M_AXI_GP1 0", "PCW_USE_M_AXI_GP1 1", "clock processor/M_AXI_GP1_ACLK is not connected"),
        ("PCW_EN_CLK2_PORT 1", "PCW_EN_CLK2_PORT 0", "processor/FCLK_CLK2 is not there, as the properties are"),
        ("dma/axi_resetn", "dma/axi_aresetn", "axi_dma has no pin axi_aresetn"),
        ("system/s_axis_tkeep", "system/s_axis_tstrb", "robot_system has no port s_axis_tstrb"),
        (CLOCK, "", "clock dma/m_axi_sg_aclk is not connected"),
        (RESET, "", "reset_n control/aresetn is not connected"),
        (LAST, "", "input system/s_axis_tlast is not connected"),
        (LAST, LAST + LAST, "system/s_axis_tlast is driven by dma/m_axis_mm2s_tlast already"),
        (
            LAST,
            net("processor/FCLK_CLK0", "system/s_axis_tlast"),
            "FCLK_CLK0 is a clock, system/s",
        ),
        (LAST, net("system/m_axis_tlast", "dma/m_axis_mm2s_tlast"), "both have direction O"),
        (LISTS, "", "dma/M_AXI_SG is not connected"),
        (LISTS, LISTS.replace("memory/S00_AXI", "memory/M00_AXI"), "are both of mode master"),
        (LISTS, LISTS + LISTS, "dma/M_AXI_SG is connected to memory/S00_AXI already"),
        ("connect_bd_net [get_bd_ports second_lamp]", "get_bd_ports second_lamp ;#", "port second_lamp leads nowhere"),
        ("C_AUX_RESET_HIGH 0", "C_AUX_RESET_HIGH 1", "system_reset/aux_reset_in is not there"),
        ("C_AUX_RESET_HIGH.VALUE_SRC USER", "C_AUX_RESET_HIGH.VALUE_SRC ME", "VALUE_SRC cannot be ME"),
        (ADDRESS, "get_bd_pins dma/axi_resetn ;#", "dma/S_AXI_LITE/Reg has no address"),
        ("-offset 0x40400000", "-offset 0x80400000", "0x80400000 is not within"),
        ("dma/S_AXI_LITE/Reg", "dma/S_AXI_LITE/Registers", "there is no segment dma/S_AXI_LITE/Registers"),
        ("assign_bd_address\n", "", "not all addresses are assigned"),
        ("bd_rule:processing_system7", "bd_rule:processing_system8", "unknown rule"),
        ("apply_board_preset", "apply_preset", "unknown setting apply_preset"),
        ("validate_bd_design\n", "", "the design is not validated"),
        (f"generate_target all [get_files {DESIGN}]\n", "", "its files are not generated"),
        (f"make_wrapper -files [get_files {DESIGN}] -import -top", "", "there is no top level robot_zynq7000_wrapper"),
        ("[get_files zynq7000.xdc]", "[get_files zcu104.xdc]", "the project has no file zcu104.xdc"),
        ("used_in_synthesis false", "used_in_syntheses false", "unknown property used_in_syntheses of zynq7000.xdc"),
        ("target_language", "language", "unknown property language of current_project"),
    ],
)
def test_a_broken_design_is_found(project: Project, old: str, new: str, message: str) -> None:
    assert message in project.fault("robot_zynq7000.tcl", old, new)


@pytest.mark.parametrize("release", ["2023.2", "2024.1", "2024.2", "2025.1", "2025.2", "2026.1"])
def test_every_release_has_what_a_design_uses(project: Project, release: str) -> None:
    lines = project.lines(VIVADO_VERSION=release)
    assert f"cell interrupts {'ilconcat' if release == '2026.1' else 'xlconcat'}" in lines
    assert "cdc robot_zynq7000_cdc.rpt" in lines


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("max", "the worst setup slack is -0.123 ns, from from/C to to/D"),
        ("min", "the worst hold slack is -0.123 ns, from from/C to to/D"),
        ("path", "the path between clk_fpga_0 and clk_fpga_1, from from/C to to/D, belongs to no crossing"),
        ("skew", "the bits of a pointer between two clocks have more skew than set_bus_skew allows"),
        *(
            (f"{name}_reg*", f"no register has the name {name}_reg*, so its constraint has no effect")
            for name in (
                "u_left_to_first_in_crossing/request_r",
                "u_left_to_first_in_crossing/u_return/first_r",
                "u_first_level_sync/first_r",
                "u_rst_odd/first_r",
            )
        ),
    ],
)
def test_a_routed_design_with_faults_ends_the_build(project: Project, fault: str, message: str) -> None:
    done = project.check(VIVADO_FINDS=fault)
    assert done.returncode == 1
    assert f"ERROR: {message}" in done.stdout
    assert "the routed design has" in done.stderr


def test_the_checks_name_the_registers_of_the_constraints(project: Project) -> None:
    """All but fields, of which a system may use none."""
    names = set(re.findall(r"^  (\S+_reg\*)$", project.generated("zynq7000_checks.tcl").read_text(), re.MULTILINE))
    constraints = project.generated("zynq7000.xdc").read_text(encoding="utf-8")
    named = set(re.findall(r"NAME =~ \*/(\S+?_reg\*)(?:/D)?\}", constraints))
    assert names == {name for name in named if not name.endswith(("fields_r_reg*", "memory_reg*"))}


def test_a_broken_project_is_found(project: Project) -> None:
    project.lines()
    name = project.script.name
    assert "Vivado has to manage the sources" in project.fault(name, "source_mgmt_mode All", "source_mgmt_mode None")
    assert "does not have the part" in project.fault(name, "xc7z020clg400-1", "xc7z010clg400-1")
    assert "there is no entity copy" in project.fault(
        name, "read_vhdl {src/robot_sys_robot-system_0.1.0/copy/copy.vhd}", ""
    )
    assert "there is no file" in project.fault(name, "copy/copy.vhd", "copy.vhd")


KERNEL_SCRIPT, KERNEL_DESIGN = "QuaternionToEuler.tcl", "quaterniontoeuler_zcu104.tcl"


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Project:
    return Project(tmp_path_factory.mktemp("kernel") / "build", WITH_KERNELS, "zcu104")


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        (
            KERNEL_SCRIPT,
            "set_top QuaternionToEuler",
            "set_top QuaternionToEulers",
            "no function QuaternionToEulers",
        ),
        (KERNEL_SCRIPT, "add_files", "add_file", 'invalid command name "add_file"'),
        (KERNEL_SCRIPT, "QuaternionToEuler.cpp", "Quaternion.cpp", "there is no file"),
        (KERNEL_SCRIPT, "xczu7ev-ffvc1156-2-e", "xczu7ev-ffvc1156-1-e", "is for another part"),
        (KERNEL_SCRIPT, "-period 10.000", "-period ten", "create_clock -period ten"),
        (KERNEL_SCRIPT, "csynth_design\n", "", "export_design before csynth_design"),
        (KERNEL_SCRIPT, "-format ip_catalog", "-format xo", "the form is xo"),
        (KERNEL_SCRIPT, "\nexit", "", "does not leave Vitis HLS"),
        (KERNEL_DESIGN, "--mode hls --tcl", "--mode hls --file", "vitis-run does not take"),
        (
            KERNEL_DESIGN,
            "robot:hls:",
            "robot:ip:",
            "the catalog has no robot:ip:QuaternionToEuler:1.0",
        ),
        (
            KERNEL_DESIGN,
            "_hls/solution/impl/ip]\n",
            "/solution/impl/ip]\n",
            "the catalog has no",
        ),
        (
            KERNEL_DESIGN,
            "QuaternionToEuler_kernel",
            "Kernel",
            "there is no entity quaterniontoeuler_kernel",
        ),
    ],
)
def test_a_broken_kernel_is_found(kernel: Project, name: str, old: str, new: str, message: str) -> None:
    assert message in kernel.fault(name, old, new)
