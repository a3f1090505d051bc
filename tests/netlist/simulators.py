"""Simulators of a batch of designs: GHDL with the VHDL, and Icarus and Verilator with the netlist, and
Icarus with what Yosys makes of it.

Each prints what all outputs of a batch are, before and after the edge of the clock, a line each, as digits of 4 bits
with the first design's output last.
"""

from __future__ import annotations

import atexit
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from random import Random

from fusesoc_firm.netlist.translation import Translation, translate
from tests.hdl.ghdl import GhdlError, Library
from tests.netlist.designs import INPUT, OUTPUT, Design
from tests.recall import RunResult, identity, recalled

TOP = "batch"
# The reset holds for the first of them.
RESETS = 2
TIMEOUT = 600


class ToolError(Exception):
    """A program refused its input; the text is what it printed."""


def stimuli(seed: str, number: int) -> list[int]:
    """Inputs: corners, and numbers whose parts are at corners."""
    random = Random(seed)
    full = (1 << INPUT) - 1
    found = [0, full, full // 3, full // 3 * 2, 1, 1 << INPUT - 1]
    while len(found) < number:
        value, place = 0, 0
        while place < INPUT:
            width = random.choice([1, 3, 8, 16, 21, 32])
            top = 1 << width
            part = random.choice(
                [0, 1, top - 1, top >> 1, (top >> 1) - 1, random.randrange(top), random.randrange(top)]
            )
            value |= part << place
            place += width
        found.append(value & full)
    return found[:number]


def run(command: Sequence[str | Path], folder: Path, *paths: Path) -> str:
    """What a program prints that reads and writes files of a folder, or what is known of that. Raises `ToolError`.

    The folders `paths` have only what the tool's version decides.
    """
    words = list(map(str, command))

    def run() -> RunResult:
        try:
            done = subprocess.run(
                words, cwd=folder, capture_output=True, encoding="latin-1", timeout=TIMEOUT, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise ToolError(f"{command[0]} did not end in {TIMEOUT} s") from error
        if done.returncode:
            raise ToolError(f"{command[0]}:\n{(done.stdout + done.stderr)[-4000:]}")
        return RunResult(0, done.stdout)

    # Other programs are in the folder.
    tool = identity(words[0]) if "/" not in words[0] else []
    return recalled({"tool": tool, "command": words}, [folder], run, paths, _is_of_ghdl).output


def _is_of_ghdl(path: str) -> bool:
    return path.endswith(".cf")


def write(designs: Sequence[Design], inputs: Sequence[int], folder: Path) -> None:
    """The sources of a batch: `batch.vhd`, test benches, and inputs."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{TOP}.vhd").write_text("".join(item.text for item in designs) + _batch(designs))
    (folder / "bench.vhd").write_text(_vhdl_bench(len(designs)))
    (folder / "bench.v").write_text(_verilog_bench(len(designs), len(inputs)))
    (folder / "inputs.txt").write_text("".join(f"{value:0{INPUT}b}\n" for value in inputs))
    (folder / "inputs.hex").write_text("".join(f"{value:0{INPUT // 4}x}\n" for value in inputs))


def ghdl(folder: Path) -> str:
    """The simulation of the VHDL."""
    work = folder / "ghdl"
    work.mkdir(exist_ok=True)
    library = Library("work", work)
    try:
        library.analyse([folder / f"{TOP}.vhd", folder / "bench.vhd"])
    except GhdlError as error:
        raise ToolError(f"ghdl:\n{str(error)[-4000:]}") from error
    done = library.run("bench", directory=folder, options=["--ieee-asserts=disable"], seconds=TIMEOUT)
    if done.exit_code:
        raise ToolError(f"ghdl:\n{done.output[-4000:]}")
    return done.output


def netlist(folder: Path) -> Path:
    """The netlist, as the product makes it. Raises `NetlistError`."""
    output = folder / "netlist.v"
    translate(Translation(TOP, str(output), {"work": [str(folder / f"{TOP}.vhd")]}, {}), folder / "netlist.ghdl")
    return output


def icarus(folder: Path) -> str:
    """The netlist in Icarus Verilog."""
    return _icarus(folder, "netlist.v")


def _icarus(folder: Path, file: str) -> str:
    run(["iverilog", "-g2012", "-s", "bench", "-o", f"{file}vp", "bench.v", file], folder)
    return run(["vvp", "-n", f"{file}vp"], folder)


def verilator(folder: Path) -> str:
    """The netlist in Verilator: all of it is one file for a compiler that does not optimise, which is fastest."""
    made = folder / "verilator"
    options: list[str | Path] = [
        "--cc",
        "--main",
        "--timing",
        "-Wno-fatal",
        "-Wno-lint",
        "-O3",
        "--x-assign",
        "0",
        "--Mdir",
        made,
    ]
    run(["verilator", *options, "--top-module", "bench", "bench.v", "netlist.v"], folder)
    sources = sorted(file.name for file in made.glob("*.cpp"))
    (made / "all.cpp").write_text("".join(f'#include "{name}"\n' for name in sources))
    run([*_COMPILER, *_includes(), "all.cpp", *_runtime(), "-pthread", "-o", "bench"], made, _runtime()[0].parent)
    return run([made / "bench"], folder)


_COMPILER = ("g++", "-O0", "-std=c++20", "-fcoroutines", "-DVM_TRACE=0", "-DVM_COVERAGE=0", "-DVM_SC=0")
_RUNTIME = ("verilated", "verilated_timing", "verilated_threads")


@cache
def _includes() -> list[str]:
    command = ["verilator", "--getenv", "VERILATOR_ROOT"]
    root = Path(subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()) / "include"
    return [f"-I{root}", f"-I{root / 'vltstd'}"]


@cache
def _runtime() -> list[Path]:
    """What all programs of Verilator have in common, compiled once."""
    folder = Path(tempfile.mkdtemp(prefix="netlist_verilator_"))
    atexit.register(shutil.rmtree, folder)
    root = _includes()[0].removeprefix("-I")
    run([*_COMPILER, *_includes(), "-c", *(f"{root}/{name}.cpp" for name in _RUNTIME)], folder)
    return [folder / f"{name}.o" for name in _RUNTIME]


def yosys(folder: Path) -> str:
    """What Yosys makes of the netlist, in Icarus."""
    script = (
        f"read_verilog netlist.v; hierarchy -check -top {TOP}; proc; opt_expr; clean; write_verilog -noattr yosys.v"
    )
    run(["yosys", "-q", "-p", script], folder)
    return _icarus(folder, "yosys.v")


# What judges a netlist.
JUDGES: Mapping[str, Callable[[Path], str]] = {"icarus": icarus, "verilator": verilator, "yosys": yosys}


def words(line: str) -> list[str]:
    """What each design puts out, the first one first."""
    digits = OUTPUT // 4
    return [line[place - digits : place].lower() for place in range(len(line), 0, -digits)]


def _batch(designs: Sequence[Design]) -> str:
    instances = "".join(
        f"  u{number} : entity work.{item.name} port map (clk => clk, rst => rst, x => x,\n"
        f"    y => y({OUTPUT * number + OUTPUT - 1} downto {OUTPUT * number}));\n"
        for number, item in enumerate(designs)
    )
    return (
        "library ieee;\nuse ieee.std_logic_1164.all;\n\n"
        f"entity {TOP} is\n  port (clk, rst : in std_logic; x : in std_logic_vector({INPUT - 1} downto 0);\n"
        f"    y : out std_logic_vector({OUTPUT * len(designs) - 1} downto 0));\nend entity {TOP};\n\n"
        f"architecture rtl of {TOP} is\nbegin\n{instances}end architecture rtl;\n"
    )


def _vhdl_bench(designs: int) -> str:
    return f"""
library ieee;
use ieee.std_logic_1164.all;
use std.textio.all;

entity bench is
end entity bench;

architecture test of bench is
  constant DIGITS : string(1 to 16) := "0123456789abcdef";
  file inputs : text open read_mode is "inputs.txt";
  signal clk : std_logic := '0';
  signal rst : std_logic := '1';
  signal x   : std_logic_vector({INPUT - 1} downto 0) := (others => '0');
  signal y   : std_logic_vector({OUTPUT * designs - 1} downto 0);
begin
  dut : entity work.{TOP} port map (clk => clk, rst => rst, x => x, y => y);

  process
    variable given : line;
    variable text  : string(1 to {INPUT});
    variable cycle : natural := 0;
    variable shown : string(1 to {OUTPUT // 4 * designs});
    variable result : line;

    procedure show is
      variable digit : natural;
      variable is_known : boolean;
    begin
      for k in shown'range loop
        digit := 0;
        is_known := true;
        for bit in 3 downto 0 loop
          digit := 2 * digit;
          case y(4 * (shown'high - k) + bit) is
            when '1' => digit := digit + 1;
            when '0' => null;
            when others => is_known := false;
          end case;
        end loop;
        shown(k) := 'x';
        if is_known then
          shown(k) := DIGITS(digit + 1);
        end if;
      end loop;
      write(result, shown);
      writeline(output, result);
    end procedure show;
  begin
    while not endfile(inputs) loop
      readline(inputs, given);
      read(given, text);
      if cycle = {RESETS} then
        rst <= '0';
      end if;
      for k in text'range loop
        x({INPUT} - k) <= '0';
        if text(k) = '1' then
          x({INPUT} - k) <= '1';
        end if;
      end loop;
      wait for 1 ns;
      show;
      clk <= '1';
      wait for 1 ns;
      show;
      clk <= '0';
      wait for 1 ns;
      cycle := cycle + 1;
    end loop;
    wait;
  end process;
end architecture test;
"""


def _verilog_bench(designs: int, inputs: int) -> str:
    return f"""
`timescale 1ns/1ns
module bench;
  // In SystemVerilog this is no event, as in VHDL; that the reset begins is one.
  reg clk = 1'b0;
  reg rst = 1'b0;
  reg [{INPUT - 1}:0] x;
  wire [{OUTPUT * designs - 1}:0] y;
  reg [{INPUT - 1}:0] inputs [0:{inputs - 1}];
  integer cycle, number;
  {TOP} dut (.clk(clk), .rst(rst), .x(x), .y(y));

  task show;
    begin
      for (number = {designs - 1}; number >= 0; number = number - 1)
        $write("%h", y[number * {OUTPUT} +: {OUTPUT}]);
      $write("\\n");
    end
  endtask

  initial begin
    $readmemh("inputs.hex", inputs);
    x = {INPUT}'d0;
    #1 rst = 1'b1;
    for (cycle = 0; cycle < {inputs}; cycle = cycle + 1) begin
      if (cycle == {RESETS}) rst = 1'b0;
      x = inputs[cycle];
      #1 show;
      clk = 1'b1;
      #1 show;
      clk = 1'b0;
      #1;
    end
    $finish;
  end
endmodule
"""
