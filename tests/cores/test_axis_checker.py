"""The checker of AXI-Stream rules: it reports a fault of each rule, as a fault of that rule, and nothing else."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files

SEED = 20241130
# The rule is the first word.
FAULTS = (
    *(f"stable {port}" for port in ("tvalid", "tdata", "tkeep", "tlast", "tuser")),
    *(f"known {port}" for port in ("tvalid", "tready", "tdata", "tkeep", "tlast", "tuser")),
    *(f"keep {shape}" for shape in ("gap", "partial", "empty")),
    "reset",
    "abort",
)
# The bench breaks its stream once; a beat that keeps a fault until it is accepted may be reported again.
REPORT = re.compile(r"@(\d+)ns:\(assertion error\): firm_axis_checker: random frames: (\w+): (.*)$", re.MULTILINE)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    made = Library("firm", tmp_path_factory.mktemp("checker"))
    made.analyse(core_files("axis/package", "sim/checker"))
    made.analyse(core_files("sim/checker", fileset="tb"))
    return made


def reports(library: Library, width: int, **generics: str | bool) -> list[tuple[str, str]]:
    """Rule and fault of each report of a run with random handshakes."""
    seed = random.randrange(1, 2**31 - 86)
    chance = random.Random(seed)
    valid, ready = chance.choice([20, 50, 90]), chance.choice([20, 50, 80])
    print(f"-gSEED={seed} -gVALID_PERCENT={valid} -gREADY_PERCENT={ready}")
    chosen = {"SEED": seed, "WIDTH": width, "VALID_PERCENT": valid, "READY_PERCENT": ready, **generics}
    done = library.run("firm_axis_checker_tb", chosen)
    print(done.output)
    assert "PASS 4000 cycles" in done.output and done.exit_code == 0
    found = REPORT.findall(done.output)
    assert done.output.count("assertion error") == len(found)
    return [(rule, fault) for _, rule, fault in found]


@pytest.mark.parametrize("width", [8, 16, 64, 512])
def test_a_legal_stream_has_no_fault(library: Library, width: int) -> None:
    assert reports(library, width) == []


@pytest.mark.parametrize("width", [16, 64])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_each_rule_is_found(library: Library, fault: str, width: int) -> None:
    rule = fault.split(maxsplit=1)[0]
    found = reports(library, width, FAULT=fault)
    assert {name for name, _ in found} == {rule}
    # Each port and shape has its own words.
    if rule in ("stable", "known") and fault != "known tdata":
        assert fault.split()[1] in found[0][1]
    assert reports(library, width, FAULT=fault, UNCHECKED=rule) == []


def test_a_stream_without_bytes_is_legal_where_it_may_be_empty(library: Library) -> None:
    assert reports(library, 64, FAULT="keep empty", MAY_BE_EMPTY=True) == []


def test_an_illegal_width_is_refused(library: Library, tmp_path: Path) -> None:
    bench = tmp_path / "wide.vhd"
    bench.write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\nlibrary firm;\nentity wide is\nend entity wide;\n"
        "architecture simulation of wide is\n  signal low : std_logic := '0';\nbegin\n"
        '  u_checker : entity firm.firm_axis_checker\n    generic map (WIDTH => 24, NAME => "wide")\n    port map (\n'
        "      clk => low, rst_n => low, axis_tdata => (23 downto 0 => '0'), axis_tkeep => \"000\",\n"
        "      axis_tvalid => low, axis_tlast => low, axis_tready => low);\nend architecture simulation;\n"
    )
    library.analyse([bench])
    done = library.run("wide")
    assert done.exit_code and "firm_axis_checker: WIDTH is 24; legal: 8, 16, 32" in done.output
