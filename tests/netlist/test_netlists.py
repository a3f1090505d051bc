"""Netlists of designs made to be wrong, and of random ones, do what GHDL's simulation of the VHDL does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.netlist.translation import Translation, translate
from tests.netlist import comparison, simulators
from tests.netlist.comparison import differences
from tests.netlist.designs import Design
from tests.netlist.faults import FAULTS, LOST, MIXED, WITHOUT_MEMORIES

SEED = 20260214
DESIGNS = 200


def shown(found: list[comparison.Difference]) -> str:
    return "\n".join(map(str, found[:3]))


@pytest.mark.one_in(2)
@pytest.mark.parametrize("judges", [["icarus", "yosys"], ["verilator"]], ids=["icarus_yosys", "verilator"])
def test_what_ghdl_has_wrong_is_right(judges: list[str]) -> None:
    found = differences(FAULTS, judges)
    assert not found, shown(found)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("first", range(0, DESIGNS, DESIGNS // 8))
def test_random_designs(first: int) -> None:
    print(f"designs of seed {SEED} from {first} on; make fuzz-netlist SEED={SEED} DESIGNS={DESIGNS} repeats them")
    found = differences(comparison.designs(SEED, first, DESIGNS // 8), ["icarus"])
    assert not found, shown(found)


def test_a_register_that_ghdl_takes_for_a_memory_is_not_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not differences([WITHOUT_MEMORIES], ["icarus"])


def test_a_subtraction_is_found_beside_a_package_that_other_files_need(tmp_path: Path) -> None:
    """GHDL refuses to analyse such a file alone; columns and lines are those of the file, behind tabs too."""
    file, other, output = tmp_path / "first.vhd", tmp_path / "other.vhd", tmp_path / "first.v"
    use = "library ieee; use ieee.numeric_std.all; use work.types.all;"
    file.write_text(
        "-- Some words on it.\nlibrary ieee; use ieee.numeric_std.all;\n"
        "package types is subtype word is signed(7 downto 0); end;\n"
        f"{use} use work.steps.all;\nentity first is port (x : in word; y : out word); end;\n"
        "architecture rtl of first is begin y\t<= step(5 - (3 - x)); end;\n"
    )
    other.write_text(
        f"{use}\npackage steps is function step(x : word) return word; end;\n"
        "package body steps is function step(x : word) return word is begin return x + 1; end; end;\n"
    )
    sources = {"work": [str(file), str(other)]}
    assert not translate(Translation("first", str(output), sources, {}), tmp_path / "ghdl")
    assert len(re.findall(r"= 8'h[53] - \w+;", output.read_text())) == 2


def test_a_constant_that_ghdl_loses_is_refused() -> None:
    found = {item.design.name: item.message for item in differences(LOST, ["icarus"])}
    assert found.keys() == {item.name for item in LOST}
    for message in found.values():
        assert re.match(r"\S+\.vhd:\d+:\d+: error: GHDL turns a constant of (64|96) bits into zero", message)


def test_a_constant_beside_parts_of_its_signal_is_warned_of(tmp_path: Path) -> None:
    source, output = tmp_path / "mixed.vhd", tmp_path / "mixed.v"
    source.write_text(MIXED.text)
    warnings = translate(Translation(MIXED.name, str(output), {"work": [str(source)]}, {}), tmp_path / "ghdl")
    assert re.fullmatch(r"\S+mixed\.vhd:\d+:\d+: warning: if one branch assigns a constant .*", warnings)


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
