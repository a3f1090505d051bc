"""Edalize's tool `ghdlsynth` in a flow: VHDL and Verilog are simulated as one, and only what changed is made again."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.tools import manifest

ROOT = Path(__file__).resolve().parents[2]

ADDER = """
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library base;

entity adder is
  generic (STEP : integer := 1; NAME : string := "none"; IS_UP : boolean := false);
  port (a : in std_logic_vector(7 downto 0); sum : out std_logic_vector(7 downto 0); is_named : out std_logic);
end entity;

architecture rtl of adder is
begin
  add : process (a)
  begin
    sum <= std_logic_vector(unsigned(a) - STEP);
    if IS_UP then
      sum <= std_logic_vector(unsigned(a) + STEP + base.numbers.ZERO);
    end if;
    is_named <= '0';
    if NAME = "seven" then
      is_named <= '1';
    end if;
  end process add;
end architecture;
"""
NUMBERS = "package numbers is\n  constant ZERO : natural := 0;\nend package;\n"
BENCH_VHDL = "entity bench is end entity;\narchitecture a of bench is begin\n  process begin wait; end process;\nend;\n"
BENCH = """
module bench;
  wire [7:0] sum;
  wire       is_named;
  adder dut (.a(8'd40), .sum(sum), .is_named(is_named));
  initial #1 $display("sum %0d %b", sum, is_named);
endmodule
"""
FLOW = """
import json
from pathlib import Path
from edalize.flows.sim import Sim
flow = Sim(json.loads(Path("edam.json").read_text()), Path("."))
flow.configure()
flow.build()
flow.run()
"""


class Build:
    """A build in a folder."""

    def __init__(self, folder: Path, **parameters: Any) -> None:
        self.folder = folder
        (folder / "adding.eda.yml").touch()
        files = {"numbers.vhd": NUMBERS, "adder.vhd": ADDER, "bench.vhd": BENCH_VHDL, "bench.v": BENCH}
        for name, text in files.items():
            (folder / name).write_text(text)
        self.edam: dict[str, Any] = {
            "name": "adding",
            "toplevel": "bench",
            "files": [
                # A package after what uses it, and a test bench that is no hardware.
                {"name": "adder.vhd", "file_type": "vhdlSource-93"},
                {"name": "numbers.vhd", "file_type": "vhdlSource-93", "logical_name": "base"},
                {"name": "bench.vhd", "file_type": "vhdlSource-93", "tags": ["simulation"]},
                {"name": "bench.v", "file_type": "verilogSource-2005"},
            ],
            "flow_options": {"tool": "icarus", "frontends": ["ghdlsynth"], "ghdlsynth_top": "adder"},
            "parameters": {
                name: {"datatype": "str", "paramtype": "generic", "default": value}
                for name, value in parameters.items()
            },
        }

    @property
    def netlist(self) -> Path:
        return self.folder / "adding_netlist.v"

    def run(self, path: str | None = None) -> subprocess.CompletedProcess[str]:
        (self.folder / "edam.json").write_text(json.dumps(self.edam))
        variables = {**os.environ, "PYTHONPATH": str(ROOT), **({"PATH": path} if path else {})}
        done = subprocess.run(
            [sys.executable, "-c", FLOW],
            cwd=self.folder,
            env=variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        print(done.stdout)
        return done

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))


def test_generics_of_the_top_level_pass(tmp_path: Path) -> None:
    assert "sum 39 0" in Build(tmp_path).run().stdout
    assert "sum 47 1" in Build(tmp_path, STEP=7, NAME="seven", IS_UP=True).run().stdout


def test_only_what_changed_is_made_again(tmp_path: Path) -> None:
    build = Build(tmp_path)
    assert "fusesoc_firm.netlist" in build.run().stdout
    first = build.netlist.stat().st_mtime_ns
    second = build.run().stdout
    assert "sum 39 0" in second
    assert "fusesoc_firm.netlist" not in second
    assert build.netlist.stat().st_mtime_ns == first
    # A package of another library.
    build.edit("numbers.vhd", ":= 0", ":= 2")
    build.edit("adder.vhd", "IS_UP : boolean := false", "IS_UP : boolean := true")
    assert "sum 43 0" in build.run().stdout
    # A test bench is no part of the netlist.
    third = build.netlist.stat().st_mtime_ns
    build.edit("bench.vhd", "wait;", "wait; ")
    assert "fusesoc_firm.netlist" not in build.run().stdout
    # Other generics make another netlist, though no file changes.
    build.edam["parameters"] = {"STEP": {"datatype": "int", "paramtype": "generic", "default": 5}}
    assert "sum 47 0" in build.run().stdout
    assert build.netlist.stat().st_mtime_ns > third


def test_a_latch_ends_the_build(tmp_path: Path) -> None:
    build = Build(tmp_path)
    assert build.run().returncode == 0
    build.edit("adder.vhd", "    is_named <= '0';\n", "")
    build.edit("adder.vhd", 'if NAME = "seven" then', "if a(0) = '1' then")
    done = build.run()
    assert done.returncode != 0
    assert 'latch infered for net "is_named"' in done.stdout
    assert "ghdlsynth: adder: no Verilog netlist" in done.stdout
    assert not re.search(r"^sum \d", done.stdout, re.MULTILINE)
    # It is not taken for done afterwards.
    assert build.run().returncode != 0


def test_a_missing_program_is_named_with_its_package(tmp_path: Path) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("make", "sh", "ghdl"):
        (programs / name).symlink_to(shutil.which(name) or "")
    done = Build(tmp_path).run(str(programs))
    assert done.returncode != 0
    assert "missing programs: iverilog" in done.stdout
    assert "apt-get install --no-install-recommends iverilog" in done.stdout


def test_another_launcher_may_have_what_is_not_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("make", "sh", "env"):
        (programs / name).symlink_to(shutil.which(name) or "")
    # Debian's is a script, and looks for its libraries from where it lies.
    (programs / "ghdl").write_text(f'#!/bin/sh\nPATH={os.environ["PATH"]} exec ghdl "$@"\n')
    (programs / "ghdl").chmod(0o755)
    monkeypatch.setenv("EDALIZE_LAUNCHER", "env")
    build = Build(tmp_path)
    assert build.run(str(programs)).returncode != 0
    assert build.netlist.exists()
    assert set(manifest.read(tmp_path)) == {"edalize", "fusesoc", "fusesoc-firm", "ghdl"}


@pytest.mark.parametrize("option", ["", "base."])
def test_the_top_level_may_be_in_a_library(tmp_path: Path, option: str) -> None:
    build = Build(tmp_path)
    build.edam["flow_options"]["ghdlsynth_top"] = f"{option}adder"
    if option:
        build.edam["files"][0]["logical_name"] = "base"
    assert "sum 39 0" in build.run().stdout


def test_a_file_of_vhdl_2008_is_read_as_such(tmp_path: Path) -> None:
    build = Build(tmp_path)
    build.edit("adder.vhd", "add : process (a)", "add : process (all)")
    assert build.run().returncode != 0
    build.edam["files"][0]["file_type"] = "vhdlSource-2008"
    assert "sum 39 0" in build.run().stdout
