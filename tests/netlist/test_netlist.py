"""The netlist in Verilog says what the VHDL says, also where GHDL 2.0 writes something else; or there is none."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.netlist import ghdl2
from fusesoc_firm.netlist.model import NetlistError
from tests.hdl.ghdl import Library
from tests.hdl.verilog import compile_verilog, netlist
from tests.seeds import seeded

ARITHMETIC = Path(__file__).parent / "data" / "arithmetic.vhd"
PORTS = {
    "quotient": 16,
    "modulus": 16,
    "rest": 16,
    "shifted": 16,
    "absolute": 16,
    "product": 32,
    "wide": 80,
    "by_bits": 16,
    "by_bit": 1,
    "turn": 16,
    "driven": 4,
}
SEED = seeded(20260131)
OFFSET = -5


def operands() -> list[tuple[int, int]]:
    print(f"operands from seed {SEED}")
    source = random.Random(SEED)
    edges = (1, 2, -1, -2, 3, -3, 0x7FFF, -0x8000, 0x4000, -0x4000, 97, -97)
    pairs = [(a, b) for a in (0, *edges) for b in edges]
    pairs += [(source.randint(-0x8000, 0x7FFF), source.choice((1, -1)) * source.randint(1, 200)) for _ in range(500)]
    # The quotient has no place.
    return [pair for pair in pairs if pair != (-0x8000, -1)]


def bits(value: int, width: int) -> int:
    return value & ((1 << width) - 1)


def answers(pairs: list[tuple[int, int]]) -> Iterator[list[int]]:
    """What VHDL says, in the order of PORTS; `turn` is a register."""
    for number, (a, b) in enumerate(pairs):
        quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        low, next_low = a % 4, a // 4 % 4
        choices = {0: a, 1: b}
        yield [
            bits(value, width)
            for value, width in zip(
                (
                    quotient,
                    a % b,
                    a - quotient * b,
                    a >> b % 16,
                    abs(a),
                    a * b,
                    0x0123456789ABCDEF0123 if a % 2 else 0x123456789ABCDEF01234,
                    choices.get(low, bits(a, 8) << 8 | bits(b, 16) >> 8),
                    {0: b % 2, 2: 0}.get(next_low, 1),
                    (a, b, OFFSET)[number % 3],
                    0b0101,
                ),
                PORTS.values(),
                strict=True,
            )
        ]


def bench(pairs: list[tuple[int, int]]) -> str:
    ports = "".join(f".{name}({name}), " for name in PORTS)
    lines = [f"    a = {bits(a, 16)}; b = {bits(b, 16)}; #1 clk = 1; #1 clk = 0; show;" for a, b in pairs]
    formats, values = " ".join(["%h"] * len(PORTS)), ", ".join(PORTS)
    return "\n".join(
        [
            "module bench;",
            "  reg clk = 0; reg [15:0] a, b;",
            *(f"  wire [{width - 1}:0] {name};" for name, width in PORTS.items()),
            f"  arithmetic dut ({ports}.clk(clk), .a(a), .b(b));",
            f'  task show; $display("{formats}", {values}); endtask',
            "  initial begin",
            *lines,
            "  end",
            "endmodule",
        ]
    )


def simulated(made: Path, pairs: list[tuple[int, int]], folder: Path) -> list[list[int]]:
    (folder / "bench.v").write_text(bench(pairs))
    output = compile_verilog("bench", [made, folder / "bench.v"], folder).run(folder).output
    return [[int(word, 16) for word in line.split()] for line in output.splitlines()]


def test_the_netlist_computes_what_the_vhdl_says(tmp_path: Path) -> None:
    pairs = operands()
    found = simulated(netlist("arithmetic", tmp_path, [ARITHMETIC], OFFSET=OFFSET), pairs, tmp_path)
    for pair, expected, got in zip(pairs, answers(pairs), found, strict=True):
        assert dict(zip(PORTS, got, strict=True)) == dict(zip(PORTS, expected, strict=True)), pair


def test_ghdl_alone_does_not(tmp_path: Path) -> None:
    """What GHDL 3 and later write as Verilog is not used either, and has other faults."""
    if not ghdl2.is_at_hand():
        pytest.skip("the faults are those of GHDL 2")
    work = Library("work", tmp_path)
    work.analyse([ARITHMETIC])
    text = work.netlist_of_ghdl("arithmetic", {"OFFSET": OFFSET}, "verilog")
    assert "abs $signed" in text
    assert re.search(r'"[01]{80}"', text)
    # What is no Verilog at all is put right, and the rest is left as it is.
    text = re.sub(r'"([01]+)"', lambda found: f"{len(found[1])}'b{found[1]}", text)
    text = re.sub(r"(\S+) <= std_logic_vector\(abs \$signed\((\S+)\)\);", r"assign \1 = \2[15] ? -\2 : \2;", text)
    (tmp_path / "raw.v").write_text(text)
    pairs = operands()
    found = simulated(tmp_path / "raw.v", pairs, tmp_path) if not is_refused(tmp_path / "raw.v") else []
    wrong = {
        name
        for expected, got in zip(answers(pairs), found, strict=False)
        for name, right, value in zip(PORTS, expected, got, strict=True)
        if right != value
    }
    assert wrong >= {"quotient", "modulus", "rest", "shifted", "by_bits", "by_bit", "driven"}


def is_refused(file: Path) -> bool:
    return subprocess.run(["iverilog", "-t", "null", str(file)], capture_output=True, check=False).returncode != 0


def entity(body: str, declarations: str = "") -> str:
    return f"""
library ieee;
use ieee.std_logic_1164.all;
entity top is
  port (clk, enable : in std_logic; a : in std_logic_vector(7 downto 0); q : out std_logic_vector(7 downto 0));
end entity;
architecture rtl of top is
  {declarations}
begin
  {body}
end architecture;
"""


COMPONENT = """
  component Inner is
    port (d : in std_logic_vector(7 downto 0); Q : out std_logic_vector(7 downto 0));
  end component;
"""
_R = "signal r : std_logic_vector(7 downto 0);"
INSTANCE = "u : Inner port map (d => a, Q => q);"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (entity("process (a, enable) begin if enable = '1' then q <= a; end if; end process;"), "latch"),
        (entity("process (a, enable) begin if enable = '1' then r <= a; end if; end process;\n  q <= r;", _R), "latch"),
        (entity("q <= a and b;"), 'no declaration for "b"'),
        (entity("q <= a;").replace("entity top", "entity other").replace("of top", "of other"), "top"),
        (entity(INSTANCE, COMPONENT), "'Inner', which is neither an entity in this build's VHDL nor a module"),
        (entity("q(6 downto 0) <= a(6 downto 0);"), "no assignment for"),
    ],
)
def test_vhdl_that_cannot_become_hardware_makes_no_netlist(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "top.vhd").write_text(text)
    # One of an earlier run must not stand in for it.
    (tmp_path / "top_netlist.v").write_text("module top; endmodule")
    with pytest.raises(NetlistError, match=re.escape(message)):
        netlist("top", tmp_path, [tmp_path / "top.vhd"])
    assert not (tmp_path / "top_netlist.v").exists()


def test_a_module_stands_in_for_a_component(tmp_path: Path) -> None:
    (tmp_path / "top.vhd").write_text(entity(INSTANCE, COMPONENT))
    inner = tmp_path / "inner.v"
    inner.write_text("module Inner (input [7:0] d, output [7:0] Q);\n  assign Q = ~d;\nendmodule\n")
    made = netlist("top", tmp_path, [tmp_path / "top.vhd"], verilog=[inner])
    assert "module Inner" not in made.read_text()
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench; wire [7:0] q; top t (.clk(1'b0), .enable(1'b0), .a(8'h5a), .q(q));\n"
        'initial #1 $display("%h", q); endmodule'
    )
    assert compile_verilog("bench", [made, inner, bench], tmp_path).run(tmp_path).output == "a5\n"


@pytest.mark.skipif(not shutil.which("verilator"), reason="Verilator is not installed")
def test_a_port_may_have_a_name_of_cpp(tmp_path: Path) -> None:
    """Verilator warns that it renames such a signal in its program."""
    source = tmp_path / "top.vhd"
    source.write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\n"
        "entity top is port (clk, abort : in std_logic; done : out std_logic); end entity;\n"
        "architecture rtl of top is begin done <= abort when rising_edge(clk); end architecture;\n",
        encoding="ascii",
    )
    made = netlist("top", tmp_path, [source])
    command = ["verilator", "--cc", "-Wno-lint", "-Wno-style", "--top-module", "top", str(made)]
    subprocess.run(command, cwd=tmp_path, check=True)
