"""Accelerators that use VHDL of other cores: its standard, its libraries, and the order and the faults of its files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from fusesoc_firm.accelerator.check import check_accelerators
from fusesoc_firm.accelerator.unit import Libraries
from fusesoc_firm.cli import main
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import system_core

HELPER = """\
CAPI=2:
name: me:p:helper:1.0
filesets: {{rtl: {{files: [{files}], file_type: {kind}, logical_name: helper}}}}
targets: {{default: {{filesets: [rtl]}}}}
"""
PACKAGE = """\
library ieee;
use ieee.std_logic_1164.all;
package levels is
  constant high : std_logic := '1';
end package levels;
"""
INVERTER = """\
library ieee;
use ieee.std_logic_1164.all;
use work.levels.all;
entity inverter is
  port (a : in std_logic; b : out std_logic);
end entity inverter;
architecture rtl of inverter is
begin
  b <= a xor high;
end architecture rtl;
"""
MODERN = """\
library ieee;
use ieee.std_logic_1164.all;
entity inverter is
  port (a : in std_logic; b : out std_logic);
end entity inverter;
architecture rtl of inverter is
begin
  p_invert : process (all) is
  begin
    b <= not a;
  end process p_invert;
end architecture rtl;
"""
ORDERED = {"files": "a_inverter.vhd, levels.vhd", "kind": "vhdlSource"}
INSTANCE = "begin\n\n  u_inverter : entity helper.inverter port map (a => in_msg_valid, b => is_not_there);\n"
Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new project, as the current folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("FUSESOC_CORES", "")
    assert main(["init", "img", "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Point"]) == 0
    monkeypatch.chdir(tmp_path / "img")
    return tmp_path / "img"


def use_helper(texts: Mapping[str, str], **core: str) -> None:
    """Add a core with a library, and let the accelerator use the library."""
    for name, text in texts.items():
        Path(name).write_text(text, encoding="utf-8")
    Path("helper.core").write_text(HELPER.format(**core), encoding="utf-8")
    own = Path("img.core")
    depend = "- robot:firm:firm_system\n"
    text = own.read_text(encoding="utf-8")
    assert depend in text
    own.write_text(text.replace(depend, f"{depend}      - me:p:helper\n"), encoding="utf-8")
    edit("library ieee;", "library helper;\nlibrary ieee;")
    edit("begin\n", INSTANCE)
    edit("  is_there <= in_msg_valid;", "  is_there <= not is_not_there;")
    edit("architecture rtl of img is\n", "architecture rtl of img is\n  signal is_not_there : std_logic;\n")


def edit(old: str, new: str, path: str = "rtl/img.vhd") -> None:
    text = Path(path).read_text(encoding="utf-8")
    assert old in text
    Path(path).write_text(text.replace(old, new, 1), encoding="utf-8")


def checked(capsys: Captured) -> str:
    """What `firm check` reports."""
    capsys.readouterr()
    status = main(["system", "check", "img.yaml"])
    found = capsys.readouterr().err
    assert (status == 0) == (not found)
    return found


def test_one_file_in_vhdl_2008_selects_it_for_all(capsys: Captured) -> None:
    use_helper({"inverter.vhd": MODERN}, files="inverter.vhd", kind="vhdlSource-2008")
    assert checked(capsys) == ""
    edit("in_x              : in  std_logic_vector(63", "in_x : in std_logic_vector(62")
    assert "in_x has 63 bits, geometry_msgs/Point.x has 64" in checked(capsys)


def test_a_subtype_of_the_vector_is_this_vector(capsys: Captured) -> None:
    for standard in ("", "    standard: 2008\n"):
        source = Path("rtl/img.vhd").read_text(encoding="utf-8")
        specification = Path("img.yaml").read_text(encoding="utf-8")
        edit("    sources:", f"{standard}    sources:", "img.yaml")
        package = "package kinds is subtype word is std_logic_vector(63 downto 0); end package kinds;\n"
        Path("rtl/kinds.vhd").write_text(f"library ieee; use ieee.std_logic_1164.all;\n{package}", encoding="utf-8")
        edit("rtl/img.vhd", "[rtl/kinds.vhd, rtl/img.vhd]", "img.yaml")
        edit("use ieee.std_logic_1164.all;", "use ieee.std_logic_1164.all; use work.kinds.all;")
        edit("in_x              : in  std_logic_vector(63 downto 0)", "in_x : in word")
        assert checked(capsys) == ""
        edit("in_y              : in  std_logic_vector(63", "in_y : in std_ulogic_vector(63")
        assert "in_y has the type std_ulogic_vector" in checked(capsys)
        Path("rtl/img.vhd").write_text(source, encoding="utf-8")
        Path("img.yaml").write_text(specification, encoding="utf-8")


def test_the_standard_of_an_accelerator(capsys: Captured) -> None:
    """GHDL reads the sources in this standard, and the generated core names it for all tools."""
    assert main(["system", "check", "img.yaml"]) == 0
    edit("  is_there <= in_msg_valid;", "  p : process (all) is begin is_there <= in_msg_valid; end process p;")
    assert "rtl/img.vhd" in checked(capsys)
    assert _file_types()["img/rtl/img.vhd"] == "vhdlSource-93"
    edit("    sources:", "    standard: 2008\n    sources:", "img.yaml")
    assert checked(capsys) == ""
    assert _file_types()["img/rtl/img.vhd"] == "vhdlSource-2008"
    assert _file_types()["img_system.vhd"] == "vhdlSource-93"


def _file_types() -> dict[str, str]:
    return {path: file.file_type for path, file in system_core(load_beside(Path("img.yaml"))).files.items()}


@pytest.mark.check
@pytest.mark.parametrize("target", ["sim", "lint", "sim_icarus"])
def test_every_target_keeps_the_standard(capsys: Captured, target: str) -> None:
    edit("  is_there <= in_msg_valid;", "  p : process (all) is begin is_there <= in_msg_valid; end process p;")
    edit("    sources:", "    standard: 2008\n    sources:", "img.yaml")
    assert main(["build", "robot:sys:img", "--target", target]) == 0, capsys.readouterr().out


def test_files_of_other_cores_are_read_in_ghdls_order(capsys: Captured) -> None:
    use_helper({"a_inverter.vhd": INVERTER, "levels.vhd": PACKAGE}, **ORDERED)
    assert checked(capsys) == ""


def test_a_fault_in_another_core_is_reported_in_its_file(capsys: Captured) -> None:
    use_helper({"a_inverter.vhd": INVERTER.replace("xor high", "xor low"), "levels.vhd": PACKAGE}, **ORDERED)
    found = checked(capsys)
    assert found.startswith("a_inverter.vhd:9:14: error: no declaration for ")
    assert "img.vhd" not in found


def test_a_fault_of_the_accelerator_beside_files_out_of_order(capsys: Captured) -> None:
    use_helper({"a_inverter.vhd": INVERTER, "levels.vhd": PACKAGE}, **ORDERED)
    edit("not is_not_there", "not is_not_their")
    assert "rtl/img.vhd:" in checked(capsys)


def test_the_core_with_a_missing_library_is_named(capsys: Captured) -> None:
    use_helper({"a_inverter.vhd": INVERTER, "levels.vhd": PACKAGE}, **ORDERED)
    edit("      - me:p:helper\n", "", "img.core")
    found = checked(capsys)
    assert "rtl/img.vhd:5:9: error: cannot find resource library " in found
    assert "it is in me:p:helper, on which the accelerator's core must depend" in found
    edit("      - robot:acc:firm_float\n", "      - me:p:helper\n", "img.core")
    edit("begin\n", "begin\n  u : entity firm.firm_float_add;\n")
    assert "it is in robot:acc:firm_float, on which" in checked(capsys)


def test_what_no_core_has_is_a_fault_without_a_hint() -> None:
    edit("library ieee;", "library helper;\nlibrary ieee;")
    edit("library firm;", "")
    loaded = load_beside(Path("img.yaml"))
    with pytest.raises(Exception, match="cannot find resource library") as raised:
        check_accelerators(loaded, lambda: Libraries(is_complete=True))
    assert "must depend" not in str(raised.value)
