"""The clock for test benches: the same edges in VHDL and in Verilog, at the average of its period, at any phase."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES, Library, core_files
from tests.hdl.verilator import simulator
from tests.hdl.verilog import compile_verilog
from tests.seeds import seeded

SEED = seeded(20261201)
PERIOD = 13469
EDGES = 40
VHDL = f"""
library ieee;
use ieee.std_logic_1164.all;
library firm;
entity clock_bench is
  generic (SEED : integer := 1; NUMBER : integer := 1);
end entity;
architecture simulation of clock_bench is
  signal reference : std_logic := '0';
  signal clk       : std_logic;
  signal is_over   : boolean := false;
begin
  reference <= not reference after 5 ns when not is_over;
  u_clock : entity firm.firm_sim_clock
    generic map (PERIOD_PS => {PERIOD}, SEED => NUMBER + 1000 * (SEED mod 1000003))
    port map (reference => reference, clk => clk);
  process
  begin
    for edge in 1 to {EDGES} loop
      wait on clk until clk = '1' or clk'last_value = '1';
      report "edge " & integer'image(now / 1 ps);
    end loop;
    is_over <= true;
    wait;
  end process;
end architecture;
"""
VERILOG = f"""
`timescale 1ns / 1ps
module clock_bench;
  wire clk;
  integer edges;
  firm_sim_clock #(.PERIOD_PS({PERIOD}), .NUMBER({{number}})) u_clock (.clk(clk));
  initial edges = 0;
  always @(clk)
    if ($realtime > 0) begin
      $display("edge %.3f", $realtime);
      edges = edges + 1;
      if (edges == {EDGES})
        $finish;
    end
endmodule
"""
CLOCK = CORES / "sim" / "rtl" / "firm_sim_clock.v"


def edges(printed: str) -> list[int]:
    """The times in the output of a bench, in picoseconds."""
    return [int(time.replace(".", "")) for time in re.findall(r"\bedge ([\d.]+)", printed)]


def sources(folder: Path, number: int) -> list[Path]:
    """The bench and the clock in Verilog."""
    bench = folder / f"bench_{number}.v"
    bench.write_text(VERILOG.replace("{number}", str(number)), encoding="ascii")
    return [bench, CLOCK]


def in_vhdl(folder: Path, seed: int, number: int) -> list[int]:
    Library("firm", folder).analyse(core_files("axis/package", "sim/checker", "sim/host"))
    (folder / "bench.vhd").write_text(VHDL, encoding="ascii")
    work = Library("work", folder)
    work.analyse([folder / "bench.vhd"])
    return edges(work.run("clock_bench", {"SEED": seed, "NUMBER": number}).output)


def in_icarus(folder: Path, seed: int, number: int) -> list[int]:
    return edges(compile_verilog("clock_bench", sources(folder, number), folder).run(folder, SEED=seed).output)


def in_verilator(folder: Path, seed: int, number: int) -> list[int]:
    program = [str(simulator("clock_bench", sources(folder, number), folder)), f"+SEED={seed}"]
    return edges(subprocess.run(program, check=True, capture_output=True, text=True).stdout)


@pytest.mark.parametrize(
    ("program", "simulated"),
    [("iverilog", in_icarus), pytest.param("verilator", in_verilator, marks=pytest.mark.check)],
)
def test_the_edges_are_those_in_vhdl(
    tmp_path: Path, program: str, simulated: Callable[[Path, int, int], list[int]]
) -> None:
    if not shutil.which(program):
        pytest.skip(f"{program} is not installed")
    for seed, number in ((1, 1), (SEED, 2)):
        print(f"seed {seed}")
        expected, found = in_vhdl(tmp_path, seed, number), simulated(tmp_path, seed, number)
        assert len(expected) == len(found) == EDGES
        # VHDL counts femtoseconds.
        assert all(abs(one - other) <= 1 for one, other in zip(expected, found, strict=True))


def test_phase_and_period_depend_on_the_seed(tmp_path: Path) -> None:
    runs = [in_vhdl(tmp_path, seed, number) for seed, number in ((1, 1), (1, 2), (2, 1))]
    assert len({run[0] for run in runs}) == len(runs)
    for run in runs:
        half = (run[-1] - run[0]) / (EDGES - 1)
        assert 0.4994 * PERIOD < half < 0.5006 * PERIOD


@pytest.mark.parametrize(
    ("parameter", "value", "legal"),
    [("PERIOD_PS", 1, "2 or more"), ("NUMBER", 0, "1 to 999"), ("NUMBER", 1000, "1 to 999")],
)
def test_illegal_parameters(tmp_path: Path, parameter: str, value: int, legal: str) -> None:
    if not shutil.which("iverilog"):
        pytest.skip("iverilog is not installed")
    done = compile_verilog("firm_sim_clock", [CLOCK], tmp_path, {parameter: value}).run(tmp_path)
    assert f"firm_sim_clock: {parameter} is {value}; legal: {legal}" in done.output
