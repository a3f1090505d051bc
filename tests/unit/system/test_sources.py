"""Whether an accelerator's entity is told the width, by what its source declares."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.render import render
from fusesoc_firm.system.analysis import derive
from fusesoc_firm.system.configuration import SYSTEM_TEMPLATE, system_configuration
from tests.unit.system.systems import LIBRARIES, accelerator, converter, instance, read, specification

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
