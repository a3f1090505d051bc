"""The checker of AXI-Stream rules: it reports a fault of each rule, as a fault of that rule, and nothing else."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import compile_verilog
from tests.seeds import seeded

SEED = seeded(20241130)
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
    chance = random.Random(f"{SEED} {width} {generics}")
    seed = chance.randrange(1, 2**31 - 86)
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


# --- the checker in Verilog ----------------------------------------------------------------------------------------

IN_VERILOG = re.compile(r"^@(\d+)ns: firm_axis_checker: random frames: (\w+): (.*)$", re.MULTILINE)
# The bench's signals in the order of a line of cycles.txt.
SIGNALS = ("rst_n", "tvalid", "tready", "tlast", "tuser", "tkeep", "tdata")


def cycles(dump: str) -> list[str]:
    """The bench's signals before each rising edge of its clock, in bits, from a dump of a simulation."""
    codes = dict(re.findall(r"^\$var reg \d+ (\S+) (\w+)(?:\[\d+:0\])? \$end", dump, re.MULTILINE))
    values: dict[str, str] = {}
    found = []
    for moment in re.split(r"^#\d+\n", dump.partition("$enddefinitions $end")[2], flags=re.MULTILINE):
        changes = {
            codes[code]: bits
            for bits, code in re.findall(r"^b?([01xXuU]+) ?(\S+)$", moment, re.MULTILINE)
            if code in codes
        }
        if changes.get("clk") == "1":
            found.append("".join(values[name] for name in SIGNALS))
        values |= {name: bits.lower().replace("u", "x") for name, bits in changes.items()}
    return found


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("fault", ["none", *FAULTS])
def test_the_checker_in_verilog_finds_the_same(library: Library, tmp_path: Path, fault: str, width: int) -> None:
    if width == 8 and fault in ("stable tkeep", "keep gap"):
        pytest.skip("a stream of one byte has no such fault")
    seed = random.Random(f"{SEED} {fault} {width}").randrange(1, 2**31 - 86)
    print(f"-gSEED={seed}")
    generics: dict[str, Generic] = {"SEED": seed, "WIDTH": width, "FAULT": fault}
    done = library.run("firm_axis_checker_tb", generics, options=[f"--vcd={tmp_path / 'dump.vcd'}"])
    wanted = REPORT.findall(done.output)
    assert bool(wanted) is (fault != "none")
    lines = cycles((tmp_path / "dump.vcd").read_text(encoding="ascii"))
    assert len(lines) == 4000
    (tmp_path / "cycles.txt").write_text("\n".join(lines), encoding="ascii")
    assert replayed(tmp_path, WIDTH=width) == wanted
    if wanted:
        rule = wanted[0][1].upper()
        assert replayed(tmp_path, WIDTH=width, **{rule: 0}) == []


def replayed(folder: Path, **parameters: Generic) -> list[tuple[str, str, str]]:
    """Time, rule and fault of each report of the checker in Verilog for the cycles in `folder`."""
    files = [*core_files("sim/verilog_checker"), Path(__file__).with_name("axis_replay.v")]
    printed = compile_verilog("axis_replay", files, folder, parameters).run(folder).output
    assert "PASS 4000 cycles" in printed
    return IN_VERILOG.findall(printed)
