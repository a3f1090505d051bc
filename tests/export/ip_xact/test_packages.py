"""`firm ip-xact` on systems, converters and other cores, compared with their sources, netlists and registers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from systemrdl.compiler import RDLCompiler
from systemrdl.node import RegNode

from fusesoc_firm.cli import main
from fusesoc_firm.export.component.design import Design
from fusesoc_firm.export.component.package import package
from fusesoc_firm.export.ip_xact.package import write_package
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import status_text
from tests.export.component.designs import alone, designed, netlist_ports, write_converter, write_system, write_verilog
from tests.export.ip_xact.component_file import YEARS, ComponentFile, read_component
from tests.hdl.ghdl import REPOSITORY

Captured = pytest.CaptureFixture[str]
SYSTEMS = (
    "obstacle",
    "multi_type",
    "quat2euler",
    "joint_pid",
    "complementary_filter",
    "scan_sectors",
    "resize",
    "mobile_robot",
)
MESSAGES = (
    "std_msgs/Bool",
    "std_msgs/String",
    "geometry_msgs/Point",
    "geometry_msgs/Pose",
    "geometry_msgs/PoseWithCovariance",
    "sensor_msgs/Range",
    "sensor_msgs/Imu",
    "sensor_msgs/LaserScan",
    "sensor_msgs/JointState",
    "sensor_msgs/Temperature",
)
WIDTHS = (8, 32)


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone(tmp_path, monkeypatch)


def packaged(design: Design, folder: str, view: str = "sources", year: int = 2009) -> ComponentFile:
    write_package(package(design, view), year, Path(folder))
    return read_component(Path(folder), year)


def run(core: str, folder: str, *words: str) -> ComponentFile:
    """Run the command."""
    assert main(["ip-xact", core, "-o", folder, *words]) == 0
    return read_component(Path(folder))


def ports_of(folder: str, component: ComponentFile, tmp_path: Path) -> dict[str, tuple[str, int]]:
    """The ports of the top as Yosys has them after elaborating all Verilog of a component."""
    paths = [Path(folder, name) for name in component.files if name.endswith(".v")]
    return netlist_ports(component.vlnv[2], paths, tmp_path)


def vectors_in_source(folder: str, component: ComponentFile) -> dict[str, bool]:
    """Whether each port is a vector, by the text of the entity."""
    top = component.vlnv[2]
    text = next(Path(folder).glob(f"src/**/{top}.vhd")).read_text(encoding="utf-8")
    entity = text.partition(f"entity {top} is")[2].partition("end entity")[0]
    ports = entity.partition("  port (")[2]
    return {
        name: "vector" in kind
        for name, kind in re.findall(r"^\s*(\w+)\s*: (?:in|out|inout)\s+(\w+)", ports, re.MULTILINE)
    }


def check_both_views(design: Design, tmp_path: Path) -> ComponentFile:
    """Package a target's sources and its netlist; return the former. The ports are those of sources and netlist."""
    sources, netlist = packaged(design, "sources"), packaged(design, "netlist", "netlist")
    assert netlist.widths == ports_of("netlist", netlist, tmp_path)
    assert sources.widths == netlist.widths
    assert {name: bool(bounds) for name, (_, bounds) in sources.ports.items()} == vectors_in_source("sources", sources)
    assert all((bounds is None) == (netlist.widths[name][1] == 1) for name, (_, bounds) in netlist.ports.items())
    assert sources.interfaces == netlist.interfaces
    assert sources.defaults == netlist.defaults
    assert netlist.files == [f"src/{netlist.vlnv[2]}_netlist.v"]
    compile_files("sources", sources, tmp_path / "compiled")
    for year in YEARS[1:]:
        found = packaged(design, f"of_{year}", year=year)
        assert (found.ports, found.interfaces) == (sources.ports, sources.interfaces)
    return sources


def compile_files(folder: str, component: ComponentFile, work: Path) -> None:
    """Compile the files of a component in their order, each into its library, and elaborate the top with GHDL."""
    work.mkdir()
    for file in component.find("file", component.find("fileSets/fileSet")[0]):
        library = next(iter(component.find("logicalName/text()", file)), "work")
        ghdl("-a", f"--work={library}", f"{folder}/{component.text('name', file)}", work=work)
    ghdl("--elab-run", component.vlnv[2], "--no-run", work=work)


def ghdl(command: str, *words: str, work: Path) -> None:
    options = ["--std=93", f"--workdir={work}", f"-P{work}"]
    done = subprocess.run(["ghdl", command, *options, *words], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr


def rdl_registers(spec: Path, folder: Path) -> list[RegNode]:
    """The registers in a system's SystemRDL."""
    path = folder / "status.rdl"
    path.write_text(status_text(load_beside(spec, [], None)), encoding="utf-8")
    compiler = RDLCompiler()
    compiler.compile_file(str(path))
    return [node for node in compiler.elaborate().top.descendants(unroll=True) if isinstance(node, RegNode)]


def rdl_fields(registers: list[RegNode]) -> dict[int, dict[str, tuple[int, int, str, bool]]]:
    """The fields by address, in the form of `ComponentFile.registers`."""
    return {
        register.absolute_address: {
            field.inst_name: (
                field.low,
                field.width,
                "read-write" if field.is_sw_writable else "read-only",
                field.get_property("onwrite") is not None,
            )
            for field in register.fields()
        }
        for register in registers
    }


def rdl_resets(registers: list[RegNode]) -> dict[int, dict[str, object]]:
    """The values after reset by address, in the form of `ComponentFile.resets`."""
    return {
        register.absolute_address: {
            field.inst_name: value for field in register.fields() if (value := field.get_property("reset")) is not None
        }
        for register in registers
    }


def test_a_system(tmp_path: Path) -> None:
    project = "{name: obstacle, status: axi_lite, clock: 100 MHz, clocks: [{name: slow, frequency: 25 MHz}]}"
    changes = {"{name: obstacle}": project, "type: obstacle,": "type: obstacle, clock: slow,"}
    spec = write_system(tmp_path / "robot", "obstacle", changes)
    sources = check_both_views(designed(str(spec)), tmp_path)
    assert {name: (bus, is_initiator) for name, (bus, is_initiator, _) in sources.interfaces.items()} == {
        "s_axis": ("interface:axis", False),
        "m_axis": ("interface:axis", True),
        "s_axi": ("interface:aximm", False),
        "rst_n": ("signal:reset", False),
        "clk": ("signal:clock", False),
        "clk_slow": ("signal:clock", False),
        "status_interrupt": ("signal:interrupt", True),
    }
    clock = {"ASSOCIATED_BUSIF": "s_axis:m_axis:s_axi", "ASSOCIATED_RESET": "rst_n", "FREQ_HZ": "100000000"}
    assert sources.parameters("clk") == clock
    assert sources.parameters("clk_slow") == {"FREQ_HZ": "25000000"}
    assert sources.parameters("m_axis")["TID_WIDTH"] == "8"
    assert sources.defaults["s_axis_tuser"] == 0
    # Only what the system uses is packaged.
    assert not [name for name in sources.files if "firm_net" in name]
    registers = rdl_registers(spec, tmp_path)
    assert len(registers) > 20
    for folder, year in (("sources", 2009), ("netlist", 2009), ("of_2014", 2014), ("of_2022", 2022)):
        found = read_component(Path(folder), year)
        assert found.registers == rdl_fields(registers)
        assert found.resets == rdl_resets(registers)
        assert found.text("memoryMaps/memoryMap/addressBlock/range") == str(2**16)


def test_a_converter(tmp_path: Path) -> None:
    core = write_converter(tmp_path, "sensor_msgs/Range", is_subscriber=True)
    sources = check_both_views(designed(core), tmp_path)
    assert sources.vlnv == ["me", "robots", "axis_to_sensor_msgs_range", "1.0"]
    # The text of the header is a stream of its own.
    assert list(sources.interfaces) == ["s_axis", "header_frame_id_axis", "rst_n", "clk"]
    assert sources.find("model/modelParameters/modelParameter/name/text()") == ["MAX_LENGTH"]
    assert sources.text("description") == "A converter"


@pytest.mark.thorough
@pytest.mark.parametrize("name", SYSTEMS)
def test_systems(tmp_path: Path, name: str) -> None:
    sources = check_both_views(designed(str(REPOSITORY / "specs" / name / f"{name}.yaml")), tmp_path)
    assert {"clk", "rst_n", "s_axis", "m_axis"} <= sources.interfaces.keys()


@pytest.mark.thorough
@pytest.mark.parametrize("is_subscriber", [True, False])
@pytest.mark.parametrize("message", MESSAGES)
def test_converters(tmp_path: Path, message: str, is_subscriber: bool) -> None:
    width = WIDTHS[MESSAGES.index(message) % len(WIDTHS)]
    core = write_converter(tmp_path, message, is_subscriber=is_subscriber, width=width)
    sources = check_both_views(designed(core), tmp_path)
    stream = "s_axis" if is_subscriber else "m_axis"
    assert sources.parameters(stream)["TDATA_NUM_BYTES"] == str(width // 8)


def test_a_core_in_verilog(tmp_path: Path, capsys: Captured) -> None:
    """Its ports have the widths of the target's parameters; a target with a flow is packaged, too."""
    core = write_verilog(tmp_path)
    found = run(core, "ip")
    assert capsys.readouterr().out.splitlines() == [
        "component:  me:robots:filter:2.1, IEEE 1685-2009, sources",
        "interfaces: s_axis, aresetn, aclk; 5 ports",
        "written:    ip/component.xml and 4 files of the hardware",
        "next:       in Vivado's Tcl console: set_property ip_repo_paths {ip} [current_project]",
    ]
    assert found.widths["s_axis_tdata"] == ("in", 24)
    assert found.widths["level"] == ("in", 4)
    assert [Path(name).name for name in found.files] == ["filter.v", "sizes.vh", "pins.xdc", "rom.mem"]
    assert found.parameters("aclk") == {"ASSOCIATED_BUSIF": "s_axis", "ASSOCIATED_RESET": "aresetn"}
    (value,) = found.find("model/modelParameters/modelParameter/value")
    assert value.text == "24"
    assert run(core, "linted", "--target", "lint").widths["s_axis_tdata"] == ("in", 8)


RECORD_CORE = """\
CAPI=2:
name: ::filter:1.0
filesets:
  rtl: {files: [sizes.vhd: {file_type: vhdlSource-2008, logical_name: parts},
    Filter.vhd: {file_type: vhdlSource-2008, logical_name: parts}]}
  both: {files: [top.v: {file_type: verilogSource}]}
targets:
  default: {filesets: [rtl], toplevel: parts.Filter}
  mixed: {filesets: [rtl, both], toplevel: Top}
"""
RECORD = """\
library ieee;
use ieee.std_logic_1164.all;
package sizes is
  type pair is record a, b : std_logic; end record;
end package;
"""
WITH_RECORD = """\
library ieee;
use ieee.std_logic_1164.all;
use work.sizes.all;
entity Filter is
  port (
    Clk  : in std_logic;
    Data : in std_logic_vector(3 downto 0) := "0001";
    Both : in pair;
    Q    : out std_logic_vector(0 downto 0)
  );
end entity;
architecture rtl of Filter is
begin
  process (Clk) begin
    if rising_edge(Clk) then Q(0) <= Both.a and Both.b and Data(0); end if;
  end process;
end architecture;
"""
MIXED = """\
module Top (input Clk, input [3:0] Data, output Q);
  Filter f (.Clk(Clk), .Data(Data), .Q(Q));
endmodule
"""


def test_a_record_and_both_languages(tmp_path: Path, capsys: Captured) -> None:
    """A record's elements are wires of the netlist; names keep their case; VHDL below Verilog is packaged whole."""
    files = {"filter.core": RECORD_CORE, "sizes.vhd": RECORD, "Filter.vhd": WITH_RECORD, "top.v": MIXED}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="ascii")
    assert "port 'Both' of 'Filter' is of type pair" in fault(capsys, "filter.core")
    netlist = run("filter.core", "netlist", "--view", "netlist")
    wires = {"Clk": ("in", 1), "Data": ("in", 4), "Both_a": ("in", 1), "Both_b": ("in", 1), "Q": ("out", 1)}
    assert netlist.vlnv == ["local", "user", "Filter", "1.0"]
    assert netlist.widths == wires == ports_of("netlist", netlist, tmp_path)
    assert netlist.defaults == {"Data": 1}
    mixed = run("filter.core", "mixed", "--target", "mixed")
    assert [Path(name).name for name in mixed.files] == ["sizes.vhd", "Filter.vhd", "top.v"]
    assert mixed.widths == {name: wires[name] for name in ("Clk", "Data", "Q")}


def fault(capsys: Captured, *words: str) -> str:
    assert main(["ip-xact", "-o", "ip", *words]) == 1
    return capsys.readouterr().err


def test_faults(tmp_path: Path, capsys: Captured) -> None:
    core = write_converter(tmp_path, "std_msgs/Bool", is_subscriber=True)
    assert "has no target 'defualt'\n      = did you mean 'default'?" in fault(capsys, core, "--target", "defualt")
    none = fault(capsys, core, "--target", "none")
    assert "target 'none' of me:robots:axis_to_std_msgs_bool_8:1.0 has no top unit" in none
    assert "add 'toplevel: UNIT' to the target" in none
    assert "unknown core 'me:robots:other'" in fault(capsys, "me:robots:other")
    path = Path(core)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("toplevel: axis_to_std", "toplevel: axis_to_sdt"), encoding="utf-8")
    wrong = fault(capsys, core)
    assert "have no entity 'axis_to_sdt_msgs_bool'\n      = did you mean 'axis_to_std_msgs_bool'?" in wrong
    path.write_text(text.replace("width: 8", "width: 9"), encoding="utf-8")
    wrong = fault(capsys, core)
    assert "converter.core:9:" in wrong
    assert "FuseSoC cannot set up me:robots:axis_to_std_msgs_bool_8:1.0 default" in wrong


def test_a_test_bench_is_no_component(tmp_path: Path, capsys: Captured) -> None:
    core = write_verilog(tmp_path)
    (tmp_path / "filter.v").write_text("module filter; endmodule\n", encoding="utf-8")
    assert "'filter' has no ports, so it is no component" in fault(capsys, core, "--target", "lint")
