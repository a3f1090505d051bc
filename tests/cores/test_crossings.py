"""The crossings between clocks and widths alone: every byte and message, at any ratio of the clocks.

The synchronisers are those for simulation, which delay at random what changes close to an edge. That they, and the
check of the netlist, find what they are there for is shown by breaking the crossings.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cores.crossing_paths import Domains, unsynchronised
from tests.hdl.ghdl import CORES, Generic, Library, core_files
from tests.recall import RunResult
from tests.seeds import seeded

SEED = seeded(20240922)
STREAM, MESSAGE = "firm_cdc_stream_tb", "firm_cdc_message_tb"
WIDTHS = [(8, 8), (8, 64), (64, 8), (512, 128)]
# Cycles of one clock in one of the other.
RATIOS = [0.1, 0.31, 0.97, 1.0, 1.04, 3.3, 10.0]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("crossings"))


def _library(directory: Path, *, is_sure: bool = False) -> Library:
    """All cores; with the synchronisers of the hardware if they are to be `is_sure`."""
    library = Library("firm", directory)
    library.analyse(core_files(*_cores(is_sure=is_sure)))
    library.analyse(core_files("cdc/cdc", fileset="tb"))
    return library


def _cores(*, is_sure: bool) -> tuple[str, ...]:
    return ("axis/package", "axis/axis", "cdc/sync" if is_sure else "sim/sync", "cdc/cdc", "sim/checker", "sim/host")


def periods(ratio: float, source: random.Random) -> dict[str, Generic]:
    """Two periods in ps of about this ratio, with no common divisor to speak of."""
    own = source.randrange(5000, 15000)
    return {"S_PERIOD_PS": own, "M_PERIOD_PS": round(own * ratio * source.uniform(0.995, 1.005))}


def run(library: Library, bench: str, **generics: Generic) -> RunResult:
    print(generics)
    return library.run(bench, generics)


def passes(library: Library, bench: str, **generics: Generic) -> bool:
    result = run(library, bench, **generics)
    print(result.output)
    return result.exit_code == 0 and "PASS " in result.output


# --- streams -------------------------------------------------------------------------------------------------------


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize(("s_width", "m_width"), WIDTHS)
def test_a_stream_keeps_its_bytes(library: Library, s_width: int, m_width: int, ratio: float) -> None:
    source = random.Random(SEED)
    widths: dict[str, Generic] = {"S_WIDTH": s_width, "M_WIDTH": m_width}
    for percent in (0, 30, 70):
        seed = source.randrange(1, 10**6)
        clocks = periods(ratio, source)
        assert passes(library, STREAM, **widths, **clocks, SEED=seed, STALL_PERCENT=percent, STREAMS=60)


@pytest.mark.one_in(9, 3)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize(("s_width", "m_width"), WIDTHS)
def test_a_stream_goes_at_the_pace_of_the_slower_end(
    library: Library, s_width: int, m_width: int, ratio: float
) -> None:
    """A beat a cycle there; in a long stream no pause for the pointers' way."""
    source = random.Random(SEED + 1)
    for _ in range(3):
        generics: dict[str, Generic] = {"S_WIDTH": s_width, "M_WIDTH": m_width, "SEED": source.randrange(1, 10**6)}
        long = 100 * max(s_width, m_width) // 8 - 1
        assert passes(library, STREAM, **generics, **periods(ratio, source), LONGEST=long, STREAMS=3, SLACK=3)


@pytest.mark.parametrize("depth", [4, 8, 64])
def test_a_fifo_of_any_depth(library: Library, depth: int) -> None:
    for seed, percent in ((1, 0), (2, 50)):
        clocks = periods(0.7, random.Random(SEED + depth))
        assert passes(library, STREAM, DEPTH=depth, SEED=seed, STALL_PERCENT=percent, STREAMS=60, **clocks)


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize(("s_width", "m_width"), [*WIDTHS, (8, 16), (16, 8), (8, 512), (512, 8)])
def test_the_resizer_loses_no_cycle(library: Library, s_width: int, m_width: int) -> None:
    generics: dict[str, Generic] = {"PART": "resizer", "S_WIDTH": s_width, "M_WIDTH": m_width}
    assert passes(library, STREAM, **generics, LONGEST=1000, SLACK=0)
    for seed, percent in ((1, 30), (2, 70)):
        assert passes(library, STREAM, **generics, SEED=seed, STALL_PERCENT=percent)


# --- messages ------------------------------------------------------------------------------------------------------


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize(("s_width", "m_width"), [(8, 8), (8, 64), (64, 8)])
def test_messages_cross_in_their_order(library: Library, s_width: int, m_width: int, ratio: float) -> None:
    source = random.Random(SEED + 2)
    for percent in (0, 50):
        generics: dict[str, Generic] = {"S_WIDTH": s_width, "M_WIDTH": m_width, "STALL_PERCENT": percent}
        seed = source.randrange(1, 10**6)
        assert passes(library, MESSAGE, **generics, **periods(ratio, source), SEED=seed, MESSAGES=60)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("ratio", RATIOS)
def test_messages_of_fixed_size_follow_each_other(library: Library, ratio: float) -> None:
    """Seven cycles of each clock at most, on average."""
    source = random.Random(SEED + 6)
    clocks = periods(ratio, source)
    most = 7 * sum(period for period in clocks.values() if isinstance(period, int))
    assert passes(library, "firm_cdc_rate_tb", **clocks, SEED=source.randrange(1, 10**6), MOST_PS=most)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("ratio", RATIOS)
def test_a_withdrawn_message_leaves_nothing_behind(library: Library, ratio: float) -> None:
    source = random.Random(SEED + 3)
    for width, percent in ((8, 0), (64, 40)):
        generics: dict[str, Generic] = {"M_WIDTH": width, "STALL_PERCENT": percent, "SEED": source.randrange(1, 10**6)}
        assert passes(library, MESSAGE, **generics, **periods(ratio, source), WITHDRAW_PERCENT=50)


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("is_at_sink", [False, True])
@pytest.mark.parametrize("ratio", RATIOS)
def test_a_reset_of_one_cycle_meets_messages(library: Library, ratio: float, is_at_sink: bool) -> None:
    source = random.Random(SEED + 4)
    for width in (8, 64):
        generics: dict[str, Generic] = {"S_WIDTH": width, "IS_RESET_AT_SINK": is_at_sink, "WITHDRAW_PERCENT": 10}
        generics |= {"SEED": source.randrange(1, 10**6), "RESET_PERCENT": 30, "STALL_PERCENT": 20}
        assert passes(library, MESSAGE, **generics, **periods(ratio, source), MESSAGES=100)


# --- what is broken is found ---------------------------------------------------------------------------------------

# A part, what stands in it, and what stands there instead.
Fault = tuple[str, Sequence[tuple[str, str]]]

BINARY: Fault = (
    "firm_cdc_stream",
    (
        (
            "return std_logic_vector(pointer xor ('0' & pointer(POINTER_BITS-1 downto 1)));",
            "return std_logic_vector(pointer);",
        ),
        ("(not read_seen(POINTER_BITS-1 downto POINTER_BITS-2))", "(not read_seen(POINTER_BITS-1))"),
        ("& read_seen(POINTER_BITS-3 downto 0)", "& read_seen(POINTER_BITS-2 downto 0)"),
    ),
)
_SYNCED = "synced <= stages_r((STAGES-1)*BITS-1 downto (STAGES-2)*BITS);"
NO_SYNCHRONISER: Fault = (
    "firm_cdc_sync",
    ((_SYNCED, "synced <= level;"),),
)
ONE_STAGE: Fault = (
    "firm_cdc_sync",
    ((_SYNCED, "synced <= first_r;"),),
)
IN_MESSAGES: dict[str, Fault] = {
    "fields are not held": (
        "firm_cdc_message",
        (("m_fields        <= fields_r;", "m_fields        <= s_fields;"),),
    ),
    "levels in any order": (
        "firm_cdc_message",
        (("visible(place) <= before;", "visible(place) <= before or requested(place);"),),
    ),
    "pulses may be lost": ("firm_cdc_message", (("if is_seen = '1' then", "if true then"),)),
    "parts are not waited for": ("firm_cdc_message", ((" and s_part_idle = ALL_PARTS", ""),)),
    "levels fall one by one": ("firm_cdc_message", (("and not is_fallen;", ";"),)),
    "shown in a reset": ("firm_cdc_message", (("before := m_rst_n and m_enable", "before := m_enable"),)),
    "the last beat is taken at once": (
        "firm_cdc_stream",
        (
            ("is_drained when last_r = '1' else not is_full and not wide_tlast;", "not is_full;"),
            ("(write and wide_tlast) or (last_r and wide_tvalid and not is_drained);", "'0';"),
        ),
    ),
    "what was withdrawn stays": ("firm_cdc_stream", (("(word_tready or not m_open)", "word_tready"),)),
    "half a beat stays": ("firm_axis_resize", (("rst_n = '0' or is_open = '0' or (taken", "rst_n = '0' or (taken"),)),
    "beats before the message": (
        "firm_cdc_stream",
        (
            ("s_axis_tvalid and (s_enable or last_r)", "s_axis_tvalid"),
            ("narrow_ready and (s_enable or last_r)", "narrow_ready"),
        ),
    ),
}


def broken(directory: Path, fault: Fault, *, is_sure: bool = False) -> Library:
    """All cores, one of them with a fault."""
    part, changes = fault
    (path,) = (file for file in core_files(*_cores(is_sure=is_sure)) if file.stem == part)
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    directory.mkdir(exist_ok=True)
    changed = directory / f"{part}.vhd"
    changed.write_text(text, encoding="utf-8")
    library = Library("firm", directory)
    library.analyse(changed if file == path else file for file in core_files(*_cores(is_sure=is_sure)))
    library.analyse(core_files("cdc/cdc", fileset="tb"))
    return library


@pytest.mark.one_in(3)
@pytest.mark.parametrize("fault", IN_MESSAGES)
def test_what_is_broken_is_found(tmp_path: Path, fault: str) -> None:
    library = broken(tmp_path, IN_MESSAGES[fault])
    source = random.Random(SEED + 5)
    runs = (
        run(
            library, MESSAGE, **periods(ratio, source), SEED=seed, M_WIDTH=32, S_WIDTH=8, STALL_PERCENT=percent,
            WITHDRAW_PERCENT=40, RESET_PERCENT=10, IS_RESET_AT_SINK=seed % 2 == 0,
        )
        for ratio in (0.1, 0.97, 10.0) for seed, percent in ((1, 0), (2, 50), (3, 20), (4, 80))
    )  # fmt: skip
    assert any(result.exit_code != 0 for result in runs)


@pytest.mark.one_in(1)
def test_a_pointer_in_binary_is_found_by_unsure_synchronisers_only(tmp_path: Path) -> None:
    unsure, sure = broken(tmp_path / "unsure", BINARY), broken(tmp_path / "sure", BINARY, is_sure=True)
    clocks = periods(0.97, random.Random(SEED))
    assert not passes(unsure, STREAM, **clocks)
    assert passes(sure, STREAM, **clocks)


# --- netlists ------------------------------------------------------------------------------------------------------

# The first letter of a port is its side.
DOMAINS = Domains({"s_clk": "s", "m_clk": "m"}, lambda port: port[0], held=("fields_r",))
GENERICS: dict[str, dict[str, Generic]] = {
    "firm_cdc_message": {"SEGMENTS": 3, "FIELD_BITS": 20, "PARTS": 2},
    "firm_cdc_stream": {"S_WIDTH": 16, "M_WIDTH": 8},
}


@pytest.mark.check
@pytest.mark.parametrize("entity", GENERICS)
def test_every_path_between_the_clocks_is_synchronised(tmp_path: Path, entity: str) -> None:
    library = _library(tmp_path, is_sure=True)
    verilog = library.synthesise(entity, GENERICS[entity], "verilog")
    assert unsynchronised(verilog, entity, tmp_path, DOMAINS) == []


# Synthesis to gates without initial values, which keep Yosys from merging registers, and the registers after it.
EQUAL = (
    "proc; flatten; setattr -unset init w:*; opt -full; memory_map; simplemap t:$*dff* t:$xor t:$add; techmap; "
    "opt_clean; tee -o before.txt select -count t:$_*DFF*; "
    "opt -full -share_all; opt_clean; tee -o after.txt select -count t:$_*DFF*"
)


@pytest.mark.skipif(not shutil.which("yosys"), reason="Yosys is not installed")
@pytest.mark.parametrize("entity", ["firm_cdc_stream", "firm_cdc_message"])
def test_no_register_equals_another(tmp_path: Path, entity: str) -> None:
    """Synthesis might keep one of two, and its name would not be that in the constraints."""
    verilog = _library(tmp_path, is_sure=True).synthesise(entity, GENERICS[entity], "verilog")
    (tmp_path / "netlist.v").write_text(verilog, encoding="utf-8")
    script = f"read_verilog netlist.v; hierarchy -top {entity}; {EQUAL}"
    subprocess.run(["yosys", "-q", "-p", script], cwd=tmp_path, check=True)
    before, after = ((tmp_path / f"{name}.txt").read_text() for name in ("before", "after"))
    assert before == after
    assert int(before.split()[0]) > 30


@pytest.mark.parametrize(
    ("entity", "registers"),
    [("firm_cdc_stream", ("write_gray_r", "read_gray_r")), ("firm_cdc_message", ("request_r", "answer_r"))],
)
def test_no_tool_merges_registers_that_constraints_name(entity: str, registers: tuple[str, str]) -> None:
    text = (CORES / "cdc" / "rtl" / f"{entity}.vhd").read_text(encoding="ascii")
    kept = {
        attribute: set(re.split(r",\s*", names))
        for attribute, names in re.findall(r"attribute (\w+) of (.*?)\s*: signal is", text)
    }
    # Of Vivado, Quartus (twice) and Synplify with its relatives.
    assert kept == {key: {*registers} for key in ("dont_touch", "preserve", "dont_merge", "syn_preserve")}


@pytest.mark.check
@pytest.mark.parametrize("fault", [NO_SYNCHRONISER, ONE_STAGE], ids=["none", "one stage"])
@pytest.mark.parametrize("entity", GENERICS)
def test_a_missing_synchroniser_is_found(tmp_path: Path, entity: str, fault: Fault) -> None:
    verilog = broken(tmp_path, fault, is_sure=True).synthesise(entity, GENERICS[entity], "verilog")
    assert unsynchronised(verilog, entity, tmp_path, DOMAINS)


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("entity", "part"), [("firm_cdc_stream", "crossing"), ("firm_axis_resize", "resizer")])
@pytest.mark.parametrize(("s_width", "m_width"), [(8, 8), (8, 32), (32, 8)])
def test_the_netlist_of_a_stream_does_the_same(
    tmp_path: Path, s_width: int, m_width: int, entity: str, part: str
) -> None:
    library = _library(tmp_path, is_sure=True)
    widths: dict[str, Generic] = {"S_WIDTH": s_width, "M_WIDTH": m_width}
    library.replace_by_netlist(entity, widths)
    bench = CORES / "cdc" / "tb" / f"{STREAM}.vhd"
    if part == "resizer":
        # The other part has resizers of other widths.
        text = bench.read_text(encoding="utf-8")
        start, end = text.index("    u_stream : "), text.index("  end generate crossing;")
        bench = tmp_path / "bench.vhd"
        bench.write_text(text[:start] + text[end:], encoding="utf-8")
    library.analyse([bench])
    clocks = periods(0.7, random.Random(SEED)) if part == "crossing" else {}
    assert passes(library, STREAM, **widths, **clocks, PART=part, STALL_PERCENT=40, STREAMS=60)


def test_the_netlist_of_a_message_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path, is_sure=True)
    # The bench has it with two kinds of generics; a netlist has one.
    library.replace_by_netlist("firm_cdc_message", {"SEGMENTS": 3, "FIELD_BITS": 32, "PARTS": 2})
    bench = (CORES / "cdc" / "tb" / f"{MESSAGE}.vhd").read_text(encoding="utf-8")
    inner = bench.replace("  u_element : entity firm.firm_cdc_message\n", "  u_element : entity firm.inner_message\n")
    assert inner != bench
    source = (CORES / "cdc" / "rtl" / "firm_cdc_message.vhd").read_text(encoding="utf-8")
    (tmp_path / "inner.vhd").write_text(source.replace("firm_cdc_message", "inner_message"), encoding="utf-8")
    (tmp_path / "bench.vhd").write_text(inner, encoding="utf-8")
    library.analyse([tmp_path / "inner.vhd", tmp_path / "bench.vhd"])
    for ratio in (0.3, 3.3):
        clocks = periods(ratio, random.Random(SEED))
        assert passes(library, MESSAGE, **clocks, STALL_PERCENT=30, WITHDRAW_PERCENT=20, MESSAGES=100)


@pytest.mark.one_in(5)
@pytest.mark.parametrize(
    ("entity", "generics"),
    [
        ("firm_cdc_sync", {"BITS": 5}),
        ("firm_cdc_reset", {}),
        ("firm_cdc_message", {}),
        ("firm_cdc_message", {"SEGMENTS": 4, "FIELD_BITS": 300, "PARTS": 5}),
        *(("firm_cdc_stream", {"S_WIDTH": s, "M_WIDTH": m}) for s, m in WIDTHS),
        *(("firm_axis_resize", {"S_WIDTH": s, "M_WIDTH": m}) for s, m in WIDTHS),
    ],
)
def test_there_is_no_latch(tmp_path: Path, entity: str, generics: dict[str, Generic]) -> None:
    assert _library(tmp_path, is_sure=True).latches(entity, generics) == []


@pytest.mark.parametrize(
    ("entity", "generics", "words"),
    [
        ("firm_cdc_sync", {"BITS": 0}, "BITS is 0; legal: 1 or more"),
        ("firm_cdc_sync", {"STAGES": 1}, "STAGES is 1; legal: 2 or more"),
        ("firm_cdc_message", {"SEGMENTS": 0}, "SEGMENTS is 0; legal: 1 or more"),
        ("firm_cdc_message", {"FIELD_BITS": 0}, "FIELD_BITS is 0; legal: 1 or more"),
        ("firm_cdc_message", {"PARTS": 0}, "PARTS is 0; legal: 1 or more"),
        ("firm_cdc_stream", {"DEPTH": 12}, "DEPTH is 12; legal: powers of two, 4 or more"),
        ("firm_cdc_stream", {"DEPTH": 2}, "DEPTH is 2; legal: powers of two, 4 or more"),
        ("firm_axis_resize", {"S_WIDTH": 24}, "S_WIDTH is 24 and M_WIDTH is 64; legal: 8, 16"),
    ],
)
def test_an_illegal_generic_is_named(library: Library, entity: str, generics: dict[str, Generic], words: str) -> None:
    result = library.run(entity, generics)
    assert result.exit_code != 0
    assert f"{entity}: {words}" in result.output
