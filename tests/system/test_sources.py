"""Whether an accelerator's entity or module is told the width, by what its source declares."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.hardware.configuration import SYSTEM_TEMPLATE, system_configuration
from fusesoc_firm.text.render import render
from tests.system.systems import LIBRARIES, accelerator, converter, instance, read, specification

BLOCKS = (
    converter("s", "subscriber", "Point", "a")
    + instance("a", "mix", "p")
    + converter("p", "publisher", "Point")
)  # fmt: skip
GENERIC = "generic map (\n      WIDTH => 64\n    )"


def top_level(folder: Path, source: str) -> str:
    text = specification(BLOCKS, accelerator("mix", "Point", "Point"), "{name: robot, width: 64}")
    found, faults = read(folder, text)
    (folder / "acc.vhd").write_text(source, encoding="utf-8")
    return render(SYSTEM_TEMPLATE, system_configuration(derive(found, folder, LIBRARIES, faults)))


@pytest.mark.parametrize(
    "source",
    [
        "entity mix is generic (WIDTH : integer := 8); port (clk : in std_logic); end;",
        "ENTITY Mix IS\n  GENERIC (\n    DEPTH : natural := max(2, 3);\n    width : natural);\n  PORT (clk : in bit);",
        "entity mix is generic (constant WIDTH : integer); end entity;",
        "entity mix is generic (DEPTH, WIDTH : integer); port (clk : in bit);",
        "entity other is port (clk : in bit); end; entity mix is generic (WIDTH : integer := 8); port (",
    ],
)
def test_a_generic_gets_the_width(tmp_path: Path, source: str) -> None:
    text = top_level(tmp_path, source)
    start = text.index("u_a : entity work.mix")
    assert GENERIC in text[start : text.index("port map", start)]


@pytest.mark.parametrize(
    "source",
    [
        "",
        "entity mix is port (WIDTH : in bit); end;",
        "entity mix is generic (MAX_WIDTH : integer := 8; DEPTH : integer := WIDTH); port (clk : in std_logic);",
        "entity mix is -- generic (WIDTH : integer);\n port (clk : in bit);",
        "entity mix is generic (-- WIDTH : integer;\n DEPTH : integer); port (clk : in bit);",
        "entity other is generic (WIDTH : integer := 8); port (clk : in bit); end; entity mix is port (clk : in bit);",
        "entity mixer is generic (WIDTH : integer := 8); port (clk : in bit);",
    ],
)
def test_others_do_not(tmp_path: Path, source: str) -> None:
    text = top_level(tmp_path, source)
    start = text.index("u_a : entity work.mix")
    assert text[start:].split("\n")[1].strip() == "port map ("


def verilog_top_level(folder: Path, source: str) -> str:
    text = specification(BLOCKS, accelerator("mix", "Point", "Point", "Verilog", "acc.v"), "{name: robot, width: 64}")
    found, faults = read(folder, text)
    (folder / "acc.v").write_text(source, encoding="utf-8")
    return render(SYSTEM_TEMPLATE, system_configuration(derive(found, folder, LIBRARIES, faults)))


@pytest.mark.parametrize(
    "source",
    [
        "module mix #(parameter WIDTH = 8) (input clk); endmodule",
        "module other; endmodule\nmodule mix #(\n  parameter A = 4, // of it\n  WIDTH = 8)\n (input clk);\nendmodule",
        "module mix(clk); parameter A = 1, WIDTH = 8; input clk; endmodule",
    ],
)
def test_a_parameter_gets_the_width(tmp_path: Path, source: str) -> None:
    text = verilog_top_level(tmp_path, source)
    start = text.index("u_a : component mix")
    assert GENERIC in text[start : text.index("port map", start)]
    declaration = text[text.index("component mix is") : text.index("end component;")]
    assert "generic (\n      WIDTH : integer\n    );" in declaration


@pytest.mark.parametrize(
    "source",
    [
        "module mix (input clk); localparam WIDTH = 8; endmodule",
        "module mix /* #(parameter WIDTH = 8) */ (input clk); // parameter WIDTH = 8;\nendmodule",
        "module mix #(parameter MAX_WIDTH = 8, DEPTH = WIDTH == 8) (input clk); endmodule",
        "module other #(parameter WIDTH = 8) (); endmodule module mix (input clk); endmodule",
        "module Mix #(parameter WIDTH = 8) (input clk); endmodule",
    ],
)
def test_other_modules_do_not(tmp_path: Path, source: str) -> None:
    text = verilog_top_level(tmp_path, source)
    start = text.index("u_a : component mix")
    assert text[start:].split("\n")[1].strip() == "port map ("


def test_a_component_has_the_ports_of_an_entity(tmp_path: Path) -> None:
    text = verilog_top_level(tmp_path, "")
    declaration = text[text.index("component mix is") : text.index("end component;")]
    ports = [line.replace(" ", "").rstrip(";") for line in declaration.split("port (")[1].splitlines() if ":" in line]
    vector = "std_logic_vector(63downto0)"
    assert ports == [
        "clk:instd_logic",
        "rst_n:instd_logic",
        *(f"in_{name}:in{vector}" for name in "xyz"),
        "in_segment_valid:instd_logic_vector(0downto0)",
        "in_msg_valid:instd_logic",
        "in_msg_ready:outstd_logic",
        *(f"out_{name}:out{vector}" for name in "xyz"),
        "out_segment_valid:outstd_logic_vector(0downto0)",
        "out_msg_ready:instd_logic",
    ]
    assert "entity work.mix" not in text
