"""Netlists of designs made to be wrong, and of random ones, do what GHDL's simulation of the VHDL does."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.netlist import ghdl2, translation
from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.netlist.translation import Translation, translate
from tests.netlist import comparison, simulators
from tests.netlist.comparison import differences
from tests.netlist.designs import Design
from tests.netlist.faults import COMPUTED, CRASH, FAULTS, KEPT, LOST, MIXED, RESTORED, WITHOUT_MEMORIES, growing
from tests.seeds import seeded

SEED = seeded(20260214)
DESIGNS, BATCH = 200, 25


def shown(found: list[comparison.Difference]) -> str:
    return "\n".join(map(str, found[:3]))


@pytest.mark.one_in(2)
@pytest.mark.parametrize("judges", [["icarus", "yosys"], ["verilator"]], ids=["icarus_yosys", "verilator"])
def test_what_ghdl_has_wrong_is_right(judges: list[str]) -> None:
    found = differences(FAULTS, judges)
    assert not found, shown(found)


@pytest.mark.one_in(8, 3)
@pytest.mark.parametrize("first", range(0, DESIGNS, BATCH))
def test_random_designs(first: int) -> None:
    print(f"designs of seed {SEED} from {first} on; make fuzz-netlist SEED={SEED} DESIGNS={DESIGNS} repeats them")
    found = differences(comparison.designs(SEED, first, BATCH), ["icarus"])
    assert not found, shown(found)


def test_a_register_that_ghdl_takes_for_a_memory_is_not_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not differences([WITHOUT_MEMORIES], ["icarus"])


def test_a_crash_of_ghdl_is_a_sentence() -> None:
    (found,) = differences([CRASH], ["icarus"])
    assert found.kind == comparison.CRASH
    assert found.message.startswith("error: GHDL crashed without reporting a line of the VHDL: ADA.ASSERTIONS")
    assert "an integer whose range contains only one number" in found.message


@pytest.mark.parametrize("more", [2, 3])
def test_a_table_grows_elsewhere_if_ghdl_crashes(more: int) -> None:
    assert not differences([growing(more)], ["icarus"])


def test_a_table_that_ghdl_outgrows_is_an_error_and_no_wrong_netlist(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether it is one depends on the number of assignments before, and on GHDL."""
    monkeypatch.setattr(translation, "_PADDINGS", (0,))
    found = [item for more in (2, 3) for item in differences([growing(more)], ["icarus"])]
    assert bool(found) == ghdl2.is_at_hand()
    for item in found:
        assert item.kind == comparison.CRASH
        assert "GHDL 2.0 crashes if one of its tables grows" in item.message


def test_a_memory_at_which_ghdl_crashes_is_registers() -> None:
    assert not differences(comparison.designs(SEED, 13, 1), ["icarus"])


def test_a_package_brings_signed_numbers_to_a_file_that_does_not_name_them(tmp_path: Path) -> None:
    types, first, output = tmp_path / "types.vhd", tmp_path / "first.vhd", tmp_path / "first.v"
    use = "library ieee; use ieee.numeric_std.all;"
    types.write_text(f"{use}\npackage types is subtype word is signed(7 downto 0); end;\n")
    first.write_text(
        f"{use} use work.types.all;\nentity first is port (x : in word; y : out word); end;\n"
        "architecture rtl of first is begin y <= 5 - (3 - x); end;\n"
    )
    assert not translate(Translation("first", str(output), {"work": [str(types), str(first)]}, {}), tmp_path / "ghdl")
    assert len(re.findall(r"= 8'h[53] - \w+;", output.read_text())) == 2


_MEMORY = """library ieee; use ieee.std_logic_1164.all; use ieee.numeric_std.all;
entity ram is port (clk, write : in std_logic; written, read, x : in std_logic_vector(7 downto 0);
  y : out std_logic_vector(7 downto 0)); end;
architecture rtl of ram is
  type words_t is array (natural range 0 to 255) of std_logic_vector(7 downto 0);
  signal words : words_t;
  attribute syn_ramstyle : string;
  attribute mark : string;
  attribute mark of words : signal is "read by no tool";
  attribute syn_ramstyle of words : signal is "no_rw_check";
begin
  process (clk) begin if rising_edge(clk) then
    if write = '1' then words(to_integer(unsigned(written))) <= x; end if;
    y <= words(to_integer(unsigned(read)));
  end if; end process;
end;
"""


def test_a_memory_keeps_its_attributes_for_synthesis(tmp_path: Path) -> None:
    source, output = tmp_path / "ram.vhd", tmp_path / "ram.v"
    source.write_text(_MEMORY)
    assert not translate(Translation("ram", str(output), {"work": [str(source)]}, {}), tmp_path / "ghdl")
    (line,) = [line for line in output.read_text().splitlines() if "[0:255]" in line]
    assert line == '  (* syn_ramstyle = "no_rw_check" *) reg [7:0] words [0:255];'


def test_options_of_the_language_reach_the_analysis(tmp_path: Path) -> None:
    source, output = tmp_path / "ram.vhd", tmp_path / "ram.v"
    shared = "shared variable words : words_t := (others => (others => '0'));"
    text = _MEMORY.replace("signal words : words_t;", shared).replace("<= x;", ":= x;")
    source.write_text(re.sub(r"  attribute .*\n", "", text))
    strict = Translation("ram", str(output), {"work": [str(source)]}, {}, std="08")
    with pytest.raises(NetlistError, match="protected type"):
        translate(strict, tmp_path / "ghdl")
    translate(replace(strict, options=["-frelaxed"]), tmp_path / "ghdl")
    assert output.exists()


def test_an_error_has_its_place_in_the_source(tmp_path: Path) -> None:
    """Behind what a copy of the source has in addition, and behind tabs too."""
    source = tmp_path / "first.vhd"
    source.write_text(
        "-- architecture rtl of other is\nlibrary ieee;\tuse ieee.numeric_std.all;\n"
        "entity first is port (x : in signed(7 downto 0); y : out signed(7 downto 0)); end;\n"
        "architecture rtl of first is begin\ty\t<= 5 - nothing; end;\n"
    )
    with pytest.raises(NetlistError) as error:
        translate(Translation("first", str(tmp_path / "first.v"), {"work": [str(source)]}, {}), tmp_path / "ghdl")
    place, line, mark = str(error.value).split("\n")
    assert re.fullmatch(rf'{source}:4:56:(error:)? no declaration for "nothing"', place)
    assert line[mark.index("^") :] == "nothing; end;"


@pytest.mark.parametrize("designs", [LOST, COMPUTED], ids=["literal", "computed"])
def test_a_constant_that_ghdl_loses_is_refused(designs: list[Design]) -> None:
    """Each of them alone, with its place, as one that is found would hide others; a GHDL that loses none is right."""
    if not ghdl2.is_at_hand():
        assert not differences(designs, ["icarus"])
        return
    for design in designs:
        (found,) = differences([design], ["icarus"])
        assert re.match(r"\S+\.vhd:\d+:\d+: error: GHDL turns a (64|96)-bit constant into zero", found.message)
        assert found.kind == comparison.REFUSAL


def test_a_lost_constant_at_a_port_is_restored() -> None:
    assert not differences(RESTORED, ["icarus"])


def test_constants_that_ghdl_does_not_lose_are_not_refused() -> None:
    assert not differences(KEPT, ["icarus"])


def test_a_constant_beside_parts_of_its_signal_is_warned_of(tmp_path: Path) -> None:
    source, output = tmp_path / "mixed.vhd", tmp_path / "mixed.v"
    source.write_text(MIXED.text)
    warnings = translate(Translation(MIXED.name, str(output), {"work": [str(source)]}, {}), tmp_path / "ghdl")
    warning = r"\S+mixed\.vhd:\d+:\d+: warning: if one branch assigns a constant .*"
    assert re.fullmatch(warning if ghdl2.is_at_hand() else "", warnings)
    assert ghdl2.is_at_hand() or not differences([MIXED], ["icarus"])


@pytest.mark.parametrize("judge", ["icarus", "yosys"])
def test_a_wrong_netlist_is_seen(judge: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (design,) = (item for item in FAULTS if item.name == "gain")
    right = simulators.netlist

    def wrong(folder: Path) -> Path:
        made = right(folder)
        made.write_text(made.read_text().replace("32'h5d", "32'h5c"))
        return made

    monkeypatch.setattr(simulators, "netlist", wrong)
    (found,) = differences([design], [judge])
    assert found.judge == judge
    assert re.search(r"with input \d+, [0-9a-f]{32}, .* in GHDL", found.message)


def test_a_design_that_is_refused_is_told_from_others() -> None:
    text = FAULTS[0].text.replace("gain", "refused").replace("s * K", "s * nothing")
    (found,) = differences([FAULTS[1], Design("refused", "0", text), FAULTS[2]], ["icarus"])
    assert found.design.name == "refused"
    assert 'no declaration for "nothing"' in found.message


def test_one_seed_makes_one_text() -> None:
    assert comparison.designs(7, 3, 2) == comparison.designs(7, 3, 2)
    assert comparison.designs(7, 3, 1)[0].text != comparison.designs(8, 3, 1)[0].text
