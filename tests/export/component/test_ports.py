"""The generics and ports of top units, as GHDL and Yosys read them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.export.component.model import Direction, Generic, Port
from fusesoc_firm.export.component.verilog_module import read_module
from fusesoc_firm.export.component.vhdl_entity import Entity, read_entity
from fusesoc_firm.text.diagnostics import InputError

IN, OUT, INOUT = Direction.IN, Direction.OUT, Direction.INOUT
PACKAGE = """\
library ieee;
use ieee.std_logic_1164.all;
package sizes is
  constant LANES : natural := 3;
  type pair is record a, b : std_logic; end record;
end package;
"""
ENTITY = """\
library ieee;
use ieee.std_logic_1164.all;
library parts;
use parts.sizes.all;
entity Filter is
  generic (
    WIDTH, DEPTH : positive := 8;
    NAME         : string := "x";
    IS_FAST      : boolean := true;
    GAIN         : real := 1.5;
    PERIOD       : time := 10 ns;
    SIZE         : natural := 2 ** 4
  );
  port (
    clk, rst_n : std_logic;
    a          : in std_logic_vector(0 downto 0) := (others => '1');
    b          : buffer std_logic_vector(LANES * WIDTH - 1 downto 0);
    c          : out std_logic_vector(2 * (WIDTH + 1) - 1 downto 0);
    d          : in std_ulogic_vector(0 to WIDTH - 1) := (others => '1');
    e          : in std_logic_vector(11 downto 4) := x"a5";
    f          : in std_logic := '1';
    g          : inout std_logic;
    h          : in std_logic_vector(3 downto 0) := "0101"
  );
end entity;
architecture rtl of Filter is
begin
  u_part : entity parts.part port map (clk => clk);
end architecture;
"""
PART = """\
library ieee;
use ieee.std_logic_1164.all;
entity part is port (clk : in std_logic); end entity;
architecture rtl of part is begin end architecture;
"""
OTHER = PART.replace("part", "other")


def entity(folder: Path, text: str = ENTITY, **generics: str) -> tuple[Entity, set[str]]:
    files = {"filter.vhd": text, "sizes.vhd": PACKAGE, "part.vhd": PART, "other.vhd": OTHER}
    for name, content in files.items():
        (folder / name).write_text(content, encoding="ascii")
    return read_entity("filter", folder, {"work": ["filter.vhd"], "parts": [*files][1:]}, "93", generics)


def test_ports_of_an_entity(tmp_path: Path) -> None:
    found, needed = entity(tmp_path, WIDTH="16")
    assert found.ports() == [
        Port("clk", IN),
        Port("rst_n", IN),
        Port("a", IN, (0, 0), 1),
        Port("b", OUT, (47, 0)),
        Port("c", OUT, (33, 0)),
        Port("d", IN, (0, 15), 0xFFFF),
        Port("e", IN, (11, 4), 0xA5),
        Port("f", IN, None, 1),
        Port("g", INOUT),
        Port("h", IN, (3, 0), 5),
    ]
    assert needed == {"filter.vhd", "sizes.vhd", "part.vhd"}


def test_generics_of_an_entity(tmp_path: Path) -> None:
    """A generic is free unless a width depends on it; only literals have known values."""
    known = [Generic("NAME", "string", "x"), Generic("IS_FAST", "boolean", True), Generic("GAIN", "real", 1.5)]
    width = Generic("WIDTH", "positive", 8, is_free=False)
    assert entity(tmp_path)[0].generics() == [width, Generic("DEPTH", "positive", 8), *known]
    # GHDL prints one value for generics that are declared together.
    found = entity(tmp_path, WIDTH="16")[0].generics()
    assert found == [Generic("WIDTH", "positive", 16, is_free=False), *known]
    assert entity(tmp_path, NAME="y")[0].generics()[2] == Generic("NAME", "string", "y")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("in pair", "port 'e' of 'filter' is of type pair, not a bit or a vector"),
        ("in integer", "port 'e' of 'filter' is of type integer, not a bit or a vector"),
        (
            "in std_logic_vector(LANES + 1 downto LANES)",
            "the range of port 'e' of 'filter' has no bound that is a number",
        ),
    ],
)
def test_a_port_without_words_in_ip_xact(tmp_path: Path, wrong: str, message: str) -> None:
    text = ENTITY.replace('in std_logic_vector(11 downto 4) := x"a5"', wrong)
    found, _ = entity(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        found.ports()
    assert "--view netlist" in str(caught.value)


def test_faults_in_the_sources_have_their_places(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"filter\.vhd:28:24: unit \"part\" not found"):
        entity(tmp_path, ENTITY.replace("parts.part", "work.part").replace("u_part : entity", "u_part : entity"))


MODULE = """\
module other (input a);
endmodule
module filter #(parameter WIDTH = 8, parameter NAME = "x", parameter LEAST = -2) (
  input clk, input [WIDTH-1:0] a, output reg [0:0] b, inout [3:4] c, output [9:2] d
);
  always @(posedge clk) b <= a[0];
  other o (.a(clk));
endmodule
"""


def test_ports_of_a_module(tmp_path: Path) -> None:
    path = tmp_path / "filter.v"
    path.write_text(MODULE, encoding="ascii")
    generics, ports = read_module("filter", [path], {}, {})
    # The order of parameters in Yosys' JSON is not that of the source.
    assert {item.name: (item.type, item.value, item.is_free) for item in generics} == {
        "WIDTH": ("integer", 8, False),
        "NAME": ("string", "x", False),
        "LEAST": ("integer", -2, False),
    }
    bounds = {"a": (7, 0), "c": (3, 4), "d": (9, 2)}
    assert {port.name: port.bounds for port in ports} == {"clk": None, "b": None, **bounds}
    assert [port.direction for port in ports if port.name in "bc"] == [OUT, INOUT]
    generics, ports = read_module("filter", [path], {}, {"WIDTH": "32", "NAME": "y"})
    assert {"WIDTH": 32, "NAME": "y"}.items() <= {item.name: item.value for item in generics}.items()
    assert next(port.width for port in ports if port.name == "a") == 32


def test_an_unknown_module_and_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "filter.v"
    path.write_text(MODULE, encoding="ascii")
    with pytest.raises(InputError, match="Yosys reads no module 'fliter'"):
        read_module("fliter", [path], {}, {})
    path.write_text(MODULE.replace("endmodule", "end"), encoding="ascii")
    with pytest.raises(InputError, match=r"filter\.v:2"):
        read_module("filter", [path], {}, {})


@pytest.mark.parametrize(
    ("program", "remedy"), [("ghdl", "GHDL is not installed"), ("yosys", "Yosys is not installed")]
)
def test_a_missing_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, remedy: str) -> None:
    monkeypatch.setattr("fusesoc_firm.export.component.vhdl_entity.find", lambda _: None)
    monkeypatch.setattr("fusesoc_firm.export.component.verilog_module.find", lambda _: None)
    with pytest.raises(InputError, match=remedy) as caught:
        entity(tmp_path) if program == "ghdl" else read_module("filter", [], {}, {})
    assert f"apt-get install --no-install-recommends {program}" in str(caught.value)
