"""What `firm sim` says about a faulty accelerator, and about faults that a tool finds in copies and generated files."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.cores import solved
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.sources import with_libraries
from fusesoc_firm.cli import main
from fusesoc_firm.cli.common import coloured
from fusesoc_firm.cli.failed_build import print_errors
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import artifacts

Captured = pytest.CaptureFixture[str]

LOG = """\
INFO: Building
src/robot_sys_img_0.1.0/rtl/img.v:12: error: Unable to bind wire
%Error: src/robot_sys_img_0.1.0/rtl/img.v:13:2: Cannot find file
src/robot_sys_img-system_0.1.0/img_system.vhd:{line}:5: no declaration for "in_x"
"""


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("FUSESOC_CORES", "")
    arguments = ("--language", "verilog", "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Point")
    assert main(["init", "img", *arguments]) == 0


def test_a_faulty_accelerator_is_refused_before_the_build(capsys: Captured) -> None:
    source = Path("img/rtl/img.v")
    source.write_text(source.read_text(encoding="utf-8").replace("in_x", "in_xx", 1), encoding="utf-8")
    assert main(["sim", "img/img.yaml"]) == 1
    error = capsys.readouterr().err
    assert "img/rtl/img.v:9:22: error: port 'in_xx' is not in the interface" in error
    assert main(["system", "check", "img/img.yaml"]) == 1
    assert capsys.readouterr().err == error


@pytest.mark.skipif(not shutil.which("iverilog"), reason="Icarus Verilog is not installed")
def test_a_simulator_that_cannot_is_refused_before_the_build(capsys: Captured) -> None:
    assert main(["init", "wide", "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Point"]) == 0
    spec = Path("wide/wide.yaml")
    spec.write_text(spec.read_text(encoding="utf-8").replace("project:\n", "project:\n  idBytes: 2\n", 1))
    assert main(["check", str(spec)]) == 0
    assert main(["sim", str(spec), "--tool", "icarus"]) == 1
    assert "error: icarus cannot simulate a system with 'idBytes: 2'" in capsys.readouterr().err
    assert not [*Path("build").glob("robot_sys_wide_*")]


def test_a_netlist_has_the_synchronisers_of_the_hardware() -> None:
    """The accelerator is in Verilog, so the target `sim` simulates a netlist."""
    fusesoc = with_libraries("robot:sys:img:0.1.0", Path("img"))
    names = {str(core.name) for core, _ in solved(fusesoc, fusesoc.get_core("robot:sys:img:0.1.0"), "sim")}
    assert "robot:cdc:firm_cdc_sync:0.2.0" in names
    assert "robot:sim:firm_sim_sync:0.2.0" not in names


def test_a_tools_messages_name_the_users_files(capsys: Captured) -> None:
    loaded = load_beside(Path("img/img.yaml"))
    top = artifacts(loaded)[-1].text
    line = next(number for number, text in enumerate(top.splitlines(), 1) if text.startswith("  u_img : "))
    work = Path("build/robot_sys_img_0.1.0/sim_icarus")
    for name, text in (("-system_0.1.0/img_system.vhd", top), ("_0.1.0/rtl/img.v", "")):
        path = work / f"src/robot_sys_img{name}"
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
    shutil.copy("img/rtl/img.v", work / "src/robot_sys_img_0.1.0/rtl/img.v")
    build = Build("robot:sys:img:0.1.0", "sim_icarus", work)
    build.log.write_text(LOG.format(line=line), encoding="utf-8")
    print_errors(build, Path("img"), loaded)
    place = next(block.name.source for block in loaded.specification.blocks if block.name == "img")
    assert capsys.readouterr().err.splitlines() == [
        "img/rtl/img.v:12: error: Unable to bind wire",
        "%Error: img/rtl/img.v:13:2: Cannot find file",
        f'src/robot_sys_img-system_0.1.0/img_system.vhd:{line}:5: no declaration for "in_x"',
        f"      = this generated line belongs to {place}",
    ]


def test_a_violated_rule_of_a_stream_is_told(capsys: Captured) -> None:
    work = Path("build/robot_sys_img_0.1.0/sim")
    work.mkdir(parents=True)
    build = Build("robot:sys:img:0.1.0", "sim", work)
    rule = "firm_axis_checker.vhd:84:5:@1290ns:(assertion failure): firm_axis_checker: to the host: known: a bit"
    build.log.write_text(f"seed 1, stalls\n{rule}\nghdl:error: assertion failed\n", encoding="utf-8")
    print_errors(build, None, None)
    assert capsys.readouterr().err.splitlines()[0] == rule


def test_colours_are_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert coloured("PASS", is_good=True) == "PASS"
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert coloured("PASS", is_good=True) == "\033[32mPASS\033[0m"
    assert coloured("FAIL", is_good=False) == "\033[31mFAIL\033[0m"
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured("FAIL", is_good=False) == "FAIL"
