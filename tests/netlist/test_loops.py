"""Combinational loops are found to the bit, through gates and through instances, and named."""

from __future__ import annotations

import random
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.netlist.translation import Translation, find_loops
from tests.hdl.loop_tools import found_by_others
from tests.hdl.verilog import loops, netlist
from tests.netlist.test_ghdlsynth import Build
from tests.seeds import seeded

SEED = seeded(20260611)
BITS = 24

DESIGN = """
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity design is
  port (clk, a, b : in std_logic; index : in std_logic_vector(1 downto 0); y : out std_logic_vector(7 downto 0));
end entity;

architecture rtl of design is
  signal v, w : std_logic_vector(7 downto 0);
  signal r    : std_logic;
begin
  register_bit : process (clk)
  begin
    if rising_edge(clk) then
      r <= v(7);
    end if;
  end process register_bit;
{}
  y <= v;
end architecture;
"""
# Statements, and what is said of them.
DESIGNS = {
    # Bits of one vector in a row are no loop.
    "v <= v(6 downto 0) & a; w <= v;": "",
    "v <= v(6 downto 0) & r; w <= v;": "",
    "v <= v(6 downto 0) & v(7); w <= v;": "'v'",
    "v <= v(6 downto 0) & (a and w(0)); w(0) <= b or v(0); w(7 downto 1) <= v(7 downto 1);": "'w', 'v'",
    # A sum's carry leads upwards only.
    "w <= std_logic_vector(unsigned(v) + 1); v <= w(6 downto 0) & a;": "",
    "w <= std_logic_vector(unsigned(v) + 1); v <= a & w(7 downto 1);": "'w', 'v'",
    "v <= w when a = '1' else (others => b); w <= (others => r) when b = '1' else v;": "'w', 'v'",
    "v <= (others => '1') when unsigned(w) > 3 else (others => a); w <= (others => b) when v(3) = '1' else x\"00\";": (
        "'w', 'v'"
    ),
    # The element's number selects among the same bits of all elements.
    'w <= v(5 downto 0) & a & b; v <= x"00" when index = "00" else w;': "",
}

STAGE = """
library ieee;
use ieee.std_logic_1164.all;

entity {} is
  port (clk, in_valid, out_ready : in std_logic; in_ready, out_valid : out std_logic);
end entity;

architecture rtl of {} is
begin
{}
end architecture;
"""
TOP = """
library ieee;
use ieee.std_logic_1164.all;

entity top is
  port (clk, valid : in std_logic; ready : out std_logic);
end entity;

architecture rtl of top is
  signal middle_valid, middle_ready, last : std_logic;
begin
  u_first : entity work.first
    port map (clk => clk, in_valid => valid, in_ready => ready, out_valid => middle_valid, out_ready => middle_ready);
  u_second : entity work.second
    port map (clk => clk, in_valid => middle_valid, in_ready => middle_ready, out_valid => last, out_ready => last);
end architecture;
"""
# The second stage may wait for a valid.
WAITS = "  out_valid <= in_valid;\n  in_ready <= in_valid and out_ready;"


def found(folder: Path, **texts: str) -> list[str]:
    """The loops of the last of these designs."""
    files = []
    for name, text in texts.items():
        files.append(folder / f"{name}.vhd")
        files[-1].write_text(text, encoding="ascii")
    return loops(files[-1].stem, folder, files)


needs_others = pytest.mark.skipif(
    not (shutil.which("yosys") and shutil.which("verilator")), reason="no yosys or no verilator"
)


@needs_others
@pytest.mark.parametrize("has_loop", [True, False])
def test_yosys_and_verilator_find_a_loop_through_instances(tmp_path: Path, has_loop: bool) -> None:
    """The first stage's ready waits for the second's, which waits for a valid."""
    valid = "in_valid and out_ready" if has_loop else "in_valid"
    first = STAGE.format("first", "first", f"  out_valid <= {valid};\n  in_ready <= out_ready;")
    stages = {"first": first, "second": STAGE.format("second", "second", WAITS)}
    top = TOP.replace("out_ready => last", "out_ready => clk")
    files = []
    for name, text in {**stages, "top": top}.items():
        files.append(tmp_path / f"{name}.vhd")
        files[-1].write_text(text, encoding="ascii")
    said = found_by_others("top", netlist("top", tmp_path, files))
    assert [sentence.partition(":")[0] for sentence in said] == (["Yosys", "Verilator"] if has_loop else []), said


@pytest.mark.parametrize("statements", DESIGNS)
def test_a_loop_of_signals_is_named(tmp_path: Path, statements: str) -> None:
    said = found(tmp_path, design=DESIGN.format(statements))
    assert bool(said) == bool(DESIGNS[statements]), said
    if said:
        (sentence,) = said
        names = sorted(DESIGNS[statements].split(", "))
        assert sorted(sentence.partition("combinational loop in 'design': ")[2].split(", ")) == names
        assert sentence.startswith(f"{tmp_path}/design.vhd:")


@needs_others
@pytest.mark.parametrize(("address", "has_loop"), [("w", False), ("v", True)])
def test_a_memory_depends_on_the_address_of_each_port_alone(tmp_path: Path, address: str, has_loop: bool) -> None:
    """The second port reads at what the first one shows, or at what it shows itself; all searches tell it."""
    memory = "  type words_t is array (0 to 3) of std_logic_vector(7 downto 0);\n  signal words : words_t;\n"
    statements = f"""
  write : process (clk)
  begin
    if rising_edge(clk) then
      words(to_integer(unsigned(index))) <= v;
    end if;
  end process write;
  w <= words(to_integer(unsigned(index)));
  v <= words(to_integer(unsigned({address}(1 downto 0))));
"""
    text = DESIGN.replace("  signal r    : std_logic;\n", f"  signal r    : std_logic;\n{memory}")
    assert bool(found(tmp_path, design=text.format(statements))) == has_loop
    others = found_by_others("design", netlist("design", tmp_path, [tmp_path / "design.vhd"]))
    assert [sentence.partition(":")[0] for sentence in others] == (["Yosys", "Verilator"] if has_loop else [])


def test_the_ports_of_a_loop_through_instances_are_named(tmp_path: Path) -> None:
    """First those of the stage whose valid waits for a ready, though the other comes first in the loop."""
    said = found(
        tmp_path,
        first=STAGE.format("first", "first", "  in_ready <= out_ready;\n  out_valid <= in_valid and out_ready;"),
        second=STAGE.format("second", "second", WAITS),
        top=TOP,
    )
    line = TOP[: TOP.index("  u_first")].count("\n") + 1
    (sentence,) = said
    assert sentence == (
        f"{tmp_path}/top.vhd:{line}:3: error: combinational loop in 'top': 'out_valid' of 'u_first' depends on its "
        "'out_ready', which depends on it through 'u_second' (from 'in_valid' to 'in_ready')"
    )


@pytest.mark.parametrize(
    "first",
    [
        "  in_ready <= out_ready;\n  out_valid <= in_valid;",
        "  in_ready <= out_ready;\n  out_valid <= in_valid and out_ready when rising_edge(clk);",
    ],
)
def test_stages_that_keep_the_rule_or_have_a_register_make_no_loop(tmp_path: Path, first: str) -> None:
    stages = {"first": first, "second": WAITS}
    assert not found(tmp_path, **{name: STAGE.format(name, name, text) for name, text in stages.items()}, top=TOP)


def test_an_instance_that_is_connected_to_itself_is_named(tmp_path: Path) -> None:
    second = STAGE.format("second", "second", WAITS.replace("valid <= in_valid", "valid <= in_valid and out_ready"))
    first = STAGE.format("first", "first", "  in_ready <= out_ready;\n  out_valid <= in_valid;")
    (said,) = found(tmp_path, first=first, second=second, top=TOP)
    assert said.endswith("'out_valid' of 'u_second' depends on its 'out_ready', which is connected to it")


@pytest.mark.skipif(not shutil.which("yosys"), reason="no yosys")
@pytest.mark.parametrize(("valid", "has_loop"), [("in_valid & out_ready", True), ("in_valid", False)])
def test_a_loop_through_a_module_in_verilog_is_found(tmp_path: Path, valid: str, has_loop: bool) -> None:
    """Its ports are in another order than the component's."""
    ports = "input clk, output in_ready, input out_ready, output out_valid, input in_valid"
    text = f"module First ({ports}); assign out_valid = {valid}; assign in_ready = out_ready; endmodule\n"
    module = tmp_path / "first.v"
    module.write_text(text, encoding="ascii")
    component = (
        "component first is\n    port (clk, in_valid, out_ready : in std_logic; in_ready, out_valid : out std_logic);"
    )
    top = TOP.replace("entity work.first", "first").replace("begin", f"  {component}\n  end component;\nbegin", 1)
    files = {"second": STAGE.format("second", "second", WAITS), "top": top}
    for name, content in files.items():
        (tmp_path / f"{name}.vhd").write_text(content, encoding="ascii")
    libraries = {"work": [f"{tmp_path}/{name}.vhd" for name in files]}
    told = find_loops(Translation("top", "", libraries, {}, verilog=[str(module)]), tmp_path / "work")
    assert ["'out_valid' of 'u_first' depends on its 'out_ready'" in item for item in told] == [True] * has_loop


def is_cyclic(sources: Mapping[int, Sequence[int]]) -> bool:
    """Whether an element remains after all whose sources are gone have been removed, again and again."""
    left = dict(sources)
    while ready := [bit for bit, needed in left.items() if not set(needed) & set(left)]:
        for bit in ready:
            del left[bit]
    return bool(left)


def test_random_connections_of_bits(tmp_path: Path) -> None:
    """All in one netlist, half of them with a loop."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    texts, expected = {}, []
    for number in range(40):
        sources = {bit: chance.sample(range(BITS), chance.randint(1, 2)) for bit in range(BITS)}
        stored = set(chance.sample(range(BITS), BITS // 2))
        expected.append(is_cyclic({bit: [] if bit in stored else needed for bit, needed in sources.items()}))
        edge = {bit: " when rising_edge(clk)" if bit in stored else "" for bit in sources}
        lines = [
            f"  v({bit}) <= a xor {' xor '.join(f'v({source})' for source in needed)}{edge[bit]};"
            for bit, needed in sources.items()
        ]
        name = f"part_{number}"
        texts[name] = (
            f"library ieee;\nuse ieee.std_logic_1164.all;\nentity {name} is\n"
            f"  port (clk, a : in std_logic; y : out std_logic_vector({BITS - 1} downto 0));\nend entity;\n"
            f"architecture rtl of {name} is\n  signal v : std_logic_vector({BITS - 1} downto 0);\nbegin\n"
            + "\n".join(lines)
            + "\n  y <= v;\nend architecture;\n"
        )
    names = list(texts)
    instances = "\n".join(f"  u_{name} : entity work.{name} port map (clk, a, y({n}));" for n, name in enumerate(names))
    texts["whole"] = (
        "library ieee;\nuse ieee.std_logic_1164.all;\npackage p is\n"
        f"  type all_t is array (0 to {len(names) - 1}) of std_logic_vector({BITS - 1} downto 0);\nend package;\n"
        "library ieee;\nuse ieee.std_logic_1164.all;\nuse work.p.all;\n"
        "entity whole is\n  port (clk, a : in std_logic; y : out all_t);\nend entity;\n"
        f"architecture rtl of whole is\nbegin\n{instances}\nend architecture;\n"
    )
    said = found(tmp_path, **texts)
    assert 5 < sum(expected) < 35
    with_loop = [any(f"in '{name}':" in sentence for sentence in said) for name in names]
    assert with_loop == expected


def test_a_build_that_refuses_loops_names_them(tmp_path: Path) -> None:
    """Others translate them, since a simulator may run them."""
    build = Build(tmp_path)
    build.edit(
        "adder.vhd", "begin\n  add :", "  signal x, z : std_logic;\nbegin\n  x <= z and a(0);\n  z <= x;\n  add :"
    )
    build.edit("adder.vhd", "    is_named <= '0';", "    is_named <= x;")
    assert build.run().returncode == 0
    build.edam["flow_options"]["ghdlsynth_refuse_loops"] = True
    done = build.run()
    assert done.returncode != 0
    assert "error: combinational loop in 'adder': 'x', 'z'" in done.stdout or "'z', 'x'" in done.stdout


def test_a_lost_net_is_no_loop(tmp_path: Path) -> None:
    (tmp_path / "design.vhd").write_text(DESIGN.format("v <= w;"), encoding="ascii")
    with pytest.raises(NetlistError):
        netlist("design", tmp_path, [tmp_path / "design.vhd"])
    assert not loops("design", tmp_path, [tmp_path / "design.vhd"])
