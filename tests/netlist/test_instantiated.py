"""Verilog instantiates entities in VHDL: each set of parameters in use is translated, others are refused."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from fusesoc_firm.netlist.instantiated import entities
from fusesoc_firm.netlist.model import NetlistError
from tests.hdl.ghdl import core_files
from tests.hdl.verilog import compile_verilog, netlist
from tests.seeds import seeded

SEED = seeded(20261129)
ACC = {name: core_files(f"acc/{name}/{name}") for name in ("cordic", "fixed", "float", "float64", "image")}
FIRM = [*core_files("axis/package", "axis/axis"), *(path for files in ACC.values() for path in files)]

STEP = """
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity step is
  generic (
    BITS, FACTOR : integer := 4;  -- of the number
    IS_DOWN      : boolean := false;
    START        : std_logic_vector(2 downto 0) := "011"
  );
  port (
    A   : in  std_logic_vector(BITS - 1 downto 0);
    sum : out std_logic_vector(BITS downto 0));
end entity;

architecture rtl of step is
begin
  add : process (A)
    variable number : signed(BITS downto 0);
  begin
    number := resize(signed(A), BITS + 1);
    if IS_DOWN then
      number := number - FACTOR;
    else
      number := number + FACTOR;
    end if;
    sum <= std_logic_vector(number + signed(resize(unsigned(START), BITS + 1)));
  end process add;
end architecture;
"""


def test_each_set_of_parameters_is_translated(tmp_path: Path) -> None:
    (tmp_path / "step.vhd").write_text(STEP)
    inner = tmp_path / "inner.v"
    inner.write_text(
        "module inner #(parameter WIDTH = 6) (input [WIDTH-1:0] a, output reg [WIDTH:0] s);\n"
        "  step #(.BITS(WIDTH), .FACTOR(-3)) u (.A(a), .sum(t));\n  wire [WIDTH:0] t;\n"
        "  always @(t) s = t;\nendmodule\n"
    )
    top = tmp_path / "top.v"
    top.write_text(
        "module top (input [7:0] a, output [4:0] p, output [8:0] q, output [6:0] r, output [8:0] s);\n"
        "  step u_p (.A(a[3:0]), .sum(p));\n"
        "  step #(.BITS(8), .IS_DOWN(1), .START(3'b101)) u_q (.A(a), .sum(q));\n"
        "  inner u_r (.a(a[5:0]), .s(r));\n"
        "  inner #(.WIDTH(8)) u_s (.a(a), .s(s));\nendmodule\n"
    )
    made = netlist("top", tmp_path, [tmp_path / "step.vhd"], verilog=[inner, top])
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench; wire signed [4:0] p; wire signed [8:0] q, s; wire signed [6:0] r;\n"
        "top t (.a(8'd7), .p(p), .q(q), .r(r), .s(s));\n"
        'initial #1 $display("%0d %0d %0d %0d", p, q, r, s); endmodule'
    )
    icarus = compile_verilog("bench", [made, inner, top, bench], tmp_path)
    assert icarus.run(tmp_path).output == "14 8 7 7\n"
    words = ["verilator", "--lint-only", "-Wall", "-Wno-DECLFILENAME", "--top-module", "top"]
    done = subprocess.run([*words, *map(str, [made, inner, top])], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.check
@pytest.mark.parametrize("further", ["", "  step u_q (.A(a[3:0]), .sum(q));\n"])
def test_yosys_needs_no_translation_of_defaults_without_use(tmp_path: Path, further: str) -> None:
    """Yosys checks a module with its defaults, too, whether or not an instance relies on them."""
    (tmp_path / "step.vhd").write_text(STEP)
    top = tmp_path / "top.v"
    top.write_text(
        "module top (input [7:0] a, output [8:0] p, output [4:0] q);\n"
        f"  step #(.BITS(8), .FACTOR(2)) u_p (.A(a), .sum(p));\n{further}endmodule\n"
    )
    made = netlist("top", tmp_path, [tmp_path / "step.vhd"], verilog=[top])
    script = f"read_verilog {made} {top}; hierarchy -check -top top"
    done = subprocess.run(["yosys", "-q", "-p", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("instance", "message"),
    [
        (
            "step #(.BITZ(8)) u (.A(a), .sum(q));",
            "top.v:3:20: error: 'step' has no parameter 'BITZ'; it has: BITS, FACTOR",
        ),
        ("step #(.BITS(8)) u (a, q);", "'step' is in VHDL, so connect its ports by name"),
        ('step #(.BITS("wide")) u (.A(a), .sum(q));', "the parameter 'BITS' must be a number, not 'wide'"),
    ],
)
def test_an_instance_that_is_not_legal_makes_no_netlist(tmp_path: Path, instance: str, message: str) -> None:
    (tmp_path / "step.vhd").write_text(STEP)
    (tmp_path / "top.v").write_text(f"module top (input [7:0] a, output [8:0] q);\n\n  {instance}\nendmodule\n")
    with pytest.raises(NetlistError, match=re.escape(message)):
        netlist("top", tmp_path, [tmp_path / "step.vhd"], verilog=[tmp_path / "top.v"])


def test_vhdl_and_verilog_contain_each_other(tmp_path: Path) -> None:
    """A component in Verilog instantiates an entity that the VHDL around it instantiates with other generics."""
    (tmp_path / "step.vhd").write_text(STEP)
    (tmp_path / "outer.vhd").write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\n"
        "entity outer is port (a : in std_logic_vector(7 downto 0); q, r : out std_logic_vector(8 downto 0)); end;\n"
        "architecture rtl of outer is\n"
        "  component inner is\n    generic (FACTOR : integer);\n"
        "    port (a : in std_logic_vector(7 downto 0); q : out std_logic_vector(8 downto 0));\n  end component;\n"
        "begin\n  u : inner generic map (FACTOR => 5) port map (a => a, q => q);\n"
        "  v : entity work.step generic map (BITS => 8) port map (a => a, sum => r);\nend architecture;\n"
    )
    inner = tmp_path / "inner.v"
    inner.write_text(
        "module inner #(parameter FACTOR = 1) (input [7:0] a, output [8:0] q);\n"
        "  step #(.BITS(8), .FACTOR(2 * FACTOR)) u (.A(a), .sum(q));\nendmodule\n"
    )
    made = netlist("outer", tmp_path, [tmp_path / "step.vhd", tmp_path / "outer.vhd"], verilog=[inner])
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench; wire [8:0] q, r; outer o (.a(8'd20), .q(q), .r(r));\n"
        'initial #1 $display("%0d %0d", q, r); endmodule'
    )
    assert compile_verilog("bench", [made, inner, bench], tmp_path).run(tmp_path).output == "33 27\n"


def test_an_entity_below_verilog_keeps_the_generics_of_what_is_below_it(tmp_path: Path) -> None:
    """A module in Verilog, an entity, a module with a parameter, and an entity again."""
    (tmp_path / "step.vhd").write_text(STEP)
    (tmp_path / "middle.vhd").write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\n"
        "entity middle is generic (BY : integer := 2);\n"
        "port (a : in std_logic_vector(7 downto 0); q : out std_logic_vector(8 downto 0)); end;\n"
        "architecture rtl of middle is\n"
        "  component inner is\n    generic (FACTOR : integer);\n"
        "    port (a : in std_logic_vector(7 downto 0); q : out std_logic_vector(8 downto 0));\n  end component;\n"
        "begin\n  u : inner generic map (FACTOR => BY + 1) port map (a => a, q => q);\nend architecture;\n"
    )
    inner = tmp_path / "inner.v"
    inner.write_text(
        "module inner #(parameter FACTOR = 1) (input [7:0] a, output [8:0] q);\n"
        "  step #(.BITS(8), .FACTOR(FACTOR)) u (.A(a), .sum(q));\nendmodule\n"
    )
    top = tmp_path / "top.v"
    top.write_text(
        "module top (input [7:0] a, output [8:0] q, output [8:0] r);\n"
        "  middle #(.BY(6)) u (.a(a), .q(q));\n  middle #(.BY(9)) v (.a(a), .q(r));\nendmodule\n"
    )
    made = netlist("top", tmp_path, [tmp_path / "step.vhd", tmp_path / "middle.vhd"], verilog=[inner, top])
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench; wire [8:0] q, r; top o (.a(8'd20), .q(q), .r(r));\n"
        'initial #1 $display("%0d %0d", q, r); endmodule'
    )
    assert compile_verilog("bench", [made, inner, top, bench], tmp_path).run(tmp_path).output == "30 33\n"


def test_results_in_verilog_are_those_of_ieee_754(tmp_path: Path) -> None:
    """Products and comparisons of float32 and float64 in one module."""
    print(f"operands from seed {SEED}")
    source = np.random.default_rng(SEED)
    lines, expected = [], []
    for bits, kind, unsigned in ((32, np.float32, np.uint32), (64, np.float64, np.uint64)):
        digits = bits // 4
        for _ in range(40):
            a, b = (source.integers(0, 1 << bits, dtype=unsigned, endpoint=False) for _ in range(2))
            x, y = a.view(kind), b.view(kind)
            with np.errstate(all="ignore"):
                product = np.multiply(x, y)
            number = f"{product.view(unsigned):0{digits}x}" if not np.isnan(product) else "7fc00000"
            number = "7ff8000000000000" if np.isnan(product) and bits == 64 else number
            order = f"{float(x) < float(y):d}{float(x) == float(y):d}{float(x) > float(y):d}"
            lines.append(f"    f{bits}({bits}'h{a:x}, {bits}'h{b:x});")
            expected.append(f"{number} {order}")
    top = tmp_path / "top.v"
    top.write_text(
        "module top #(parameter E = 8, parameter M = 23) (input clk, input rst_n, input valid, input [E+M:0] a,\n"
        "  input [E+M:0] b, output done, output [E+M:0] product, output less, output equal, output greater);\n"
        "  wire first;\n"
        "  firm_float_multiply #(.EXPONENT_BITS(E), .MANTISSA_BITS(M)) u_product (.clk(clk), .rst_n(rst_n),\n"
        "    .in_valid(valid), .in_ready(), .in_a(a), .in_b(b), .out_valid(done), .out_ready(1'b1),\n"
        "    .out_number(product));\n"
        "  firm_float_compare #(.EXPONENT_BITS(E), .MANTISSA_BITS(M)) u_order (.clk(clk), .rst_n(rst_n),\n"
        "    .in_valid(valid), .in_ready(), .in_a(a), .in_b(b), .out_valid(first), .out_ready(1'b1),\n"
        "    .out_less(less), .out_equal(equal), .out_greater(greater), .out_unordered());\n"
        "endmodule\n"
        "module both (input clk, input rst_n, input valid, input [63:0] a, input [63:0] b, output [1:0] done,\n"
        "  output [31:0] single, output [63:0] double, output [2:0] short_order, output [2:0] order);\n"
        "  top u_single (clk, rst_n, valid, a[31:0], b[31:0], done[0], single, short_order[2], short_order[1],\n"
        "    short_order[0]);\n"
        "  top #(11, 52) u_double (clk, rst_n, valid, a, b, done[1], double, order[2], order[1], order[0]);\n"
        "endmodule\n"
    )
    made = netlist("both", tmp_path, [], FIRM, [top])
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench;\n  reg clk = 0, rst_n = 0, valid = 0; reg [63:0] a, b; reg [2:0] kept;\n"
        "  wire [1:0] done; wire [31:0] single; wire [63:0] double; wire [2:0] short_order, order;\n"
        "  both u (clk, rst_n, valid, a, b, done, single, double, short_order, order);\n"
        "  always #5 clk = !clk;\n"
        "  task start(input [63:0] x, input [63:0] y);\n    begin\n      @(negedge clk) a = x; b = y; valid = 1;\n"
        "      @(negedge clk) valid = 0;\n    end\n  endtask\n"
        "  task f32(input [31:0] x, input [31:0] y);\n    begin\n      start(x, y); kept = short_order;\n"
        '      wait (done[0]) #1 $display("%h %b", single, kept);\n'
        "      repeat (20) @(negedge clk);\n    end\n  endtask\n"
        "  task f64(input [63:0] x, input [63:0] y);\n    begin\n      start(x, y); kept = order;\n"
        '      wait (done[1]) #1 $display("%h %b", double, kept);\n'
        "      repeat (20) @(negedge clk);\n    end\n  endtask\n"
        "  initial begin\n    repeat (3) @(negedge clk); rst_n = 1;\n" + "\n".join(lines) + "\n    $finish(0);\n  end\n"
        "endmodule\n"
    )
    icarus = compile_verilog("bench", [made, top, bench], tmp_path)
    assert icarus.run(tmp_path).output.splitlines() == expected


@pytest.mark.check
@pytest.mark.parametrize("kind", ACC)
def test_every_operation_is_usable_from_verilog(tmp_path: Path, kind: str) -> None:
    """In Icarus, Verilator and Yosys; entities inside of operations have generics without a default."""
    names = {path.stem for path in ACC[kind]}
    known = entities({"firm": [*map(str, FIRM)]})
    operations = [name for name in names & known.keys() if all(item.default for item in known[name].generics.values())]
    assert operations
    top = tmp_path / "top.v"
    top.write_text("\n".join(["module top;", *(f"  {name} u_{name} ();" for name in operations), "endmodule", ""]))
    made = netlist("top", tmp_path, [], FIRM, [top])
    compile_verilog("top", [made, top], tmp_path)
    lint = ["verilator", "--lint-only", "-Wno-lint", "--top-module", "top", str(made), str(top)]
    script = f"read_verilog {made} {top}; hierarchy -check -top top; proc"
    for words in (lint, ["yosys", "-q", "-p", script]):
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_words_of_the_interface_are_no_entities(tmp_path: Path) -> None:
    """Comments, components and configurations are not declarations of entities."""
    path = tmp_path / "a.vhd"
    path.write_text(STEP + "\n-- entity other is\nconfiguration c of step is for rtl end for; end;\n")
    found = entities({"work": [str(path)]})
    assert list(found) == ["step"]
    assert {name: (item.type, item.default) for name, item in found["step"].generics.items()} == {
        "BITS": ("integer", "4"),
        "FACTOR": ("integer", "4"),
        "IS_DOWN": ("boolean", "false"),
        "START": ("std_logic_vector", '"011"'),
    }
    assert [found["step"].spelt(port) for port in ("a", "sum")] == ["A", "sum"]
