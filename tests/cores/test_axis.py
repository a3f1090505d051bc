"""The parts of robot:axis:firm_axis that a stream passes unchanged, and the synthesis of all of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.netlist import ghdl2
from tests.hdl.frames import random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic, GhdlError, Library, core_files
from tests.seeds import seeded

WIDTHS = [8, 64, 512]
SEED = seeded(20240501)

# Cycles that the first beat needs through the part.
LATENCY = {"register_slice": 1, "fifo": 2}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("axis"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    library.analyse(core_files("axis/axis", fileset="tb"))
    return library


def _write_files(directory: Path, width: int) -> int:
    """Frames of 5 bytes to some beats; the number of beats."""
    frames = random_frames(range(256), 100, 4 * width // 8, SEED)
    write_stimulus(directory / "stimulus.txt", (frame.to_bytes() for frame in frames))
    write_expected(directory / "expected.txt", ((n, frame.to_bytes()) for n, frame in enumerate(frames)))
    return sum(frame.beats(width) for frame in frames)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("part", LATENCY)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_part_keeps_a_stream_under_stalls(library: Library, tmp_path: Path, part: str, width: int) -> None:
    _write_files(tmp_path, width)
    for stall in (20, 50, 80):
        generics: dict[str, Generic] = {"PART": part, "WIDTH": width, "SEED": SEED, "STALL_PERCENT": stall, "DEPTH": 5}
        result = library.run("firm_axis_pipe_tb", generics, directory=tmp_path)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == "PASS 100/100"


@pytest.mark.one_in(2)
@pytest.mark.parametrize("part", LATENCY)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_part_takes_a_beat_a_cycle(library: Library, tmp_path: Path, part: str, width: int) -> None:
    beats = _write_files(tmp_path, width)
    result = library.run("firm_axis_pipe_tb", {"PART": part, "WIDTH": width}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert traffic(result.output).cycles == beats + LATENCY[part]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("part", LATENCY)
@pytest.mark.parametrize("stall", [20, 50, 80])
def test_a_part_leaves_no_gap_behind_a_stall(library: Library, tmp_path: Path, part: str, stall: int) -> None:
    _write_files(tmp_path, 16)
    generics: dict[str, Generic] = {"PART": part, "WIDTH": 16, "SEED": SEED, "SINK_STALL_PERCENT": stall}
    result = library.run("firm_axis_pipe_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("part", "depth", "capacity"), [("register_slice", 16, 2), ("fifo", 2, 3), ("fifo", 13, 14)])
def test_a_part_holds_what_it_says(library: Library, tmp_path: Path, part: str, depth: int, capacity: int) -> None:
    _write_files(tmp_path, 8)
    generics: dict[str, Generic] = {"PART": part, "DEPTH": depth, "CAPACITY": capacity}
    result = library.run("firm_axis_pipe_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("depth", [2, 3, 16])
def test_the_fifo_works_at_any_depth(library: Library, tmp_path: Path, depth: int) -> None:
    _write_files(tmp_path, 16)
    generics: dict[str, Generic] = {"PART": "fifo", "WIDTH": 16, "DEPTH": depth, "SEED": SEED, "STALL_PERCENT": 40}
    result = library.run("firm_axis_pipe_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("part", LATENCY)
def test_the_netlist_of_a_part_does_the_same(tmp_path: Path, part: str) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(f"firm_axis_{part}", {"WIDTH": 32, **({"DEPTH": 6} if part == "fifo" else {})})
    # The bench also has parts that use this one.
    library.analyse(path for path in core_files("axis/axis") if path.stem != f"firm_axis_{part}")
    library.analyse(core_files("axis/axis", fileset="tb"))
    _write_files(tmp_path, 32)
    generics: dict[str, Generic] = {"PART": part, "WIDTH": 32, "DEPTH": 6, "SEED": SEED, "STALL_PERCENT": 40}
    result = library.run("firm_axis_pipe_tb", generics)
    assert result.exit_code == 0, result.output


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("count", [1, 2, 3, 5, 16, 256])
def test_every_part_is_latch_free(library: Library, width: int, count: int) -> None:
    assert library.latches("firm_axis_select", {"WORDS": count, "WIDTH": width}) == []
    assert library.latches("firm_axis_select_ahead", {"WORDS": count, "WIDTH": width, "GROUP_BITS": 2}) == []
    assert library.latches("firm_axis_demux", {"WIDTH": width, "DESTINATIONS": count}) == []
    assert library.latches("firm_axis_mux", {"WIDTH": width, "SOURCES": count}) == []
    assert library.latches("firm_axis_fifo", {"WIDTH": width, "DEPTH": count + 1}) == []
    assert library.latches("firm_axis_register_slice", {"WIDTH": width}) == []


_LATCHES = """
library ieee; use ieee.std_logic_1164.all;
entity level is port (gate, data : in std_logic; q : out std_logic); end;
architecture rtl of level is begin process (gate, data) begin if gate = '1' then q <= data; end if; end process; end;

library ieee; use ieee.std_logic_1164.all;
entity choice is port (index : in std_logic_vector(1 downto 0); data : in std_logic; q : out std_logic); end;
architecture rtl of choice is begin
  process (index, data) begin
    case index is when "00" => q <= data; when "01" => q <= not data; when others => q <= '0'; end case;
  end process;
end;
"""


@pytest.mark.parametrize(("entity", "has_latch"), [("level", True), ("choice", ghdl2.is_at_hand())])
def test_the_search_for_latches_finds_one(tmp_path: Path, entity: str, has_latch: bool) -> None:
    """GHDL 2 makes one of a choice that has none."""
    source = tmp_path / "latches.vhd"
    source.write_text(_LATCHES, encoding="ascii")
    library = Library("work", tmp_path)
    library.analyse([source])
    assert bool(library.latches(entity)) == has_latch


@pytest.mark.parametrize(
    ("entity", "generics", "legal"),
    [
        ("firm_axis_register_slice", {"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_fifo", {"WIDTH": 1024}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_fifo", {"DEPTH": 1}, "2 or more"),
        ("firm_axis_demux", {"WIDTH": 12}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_demux", {"DESTINATIONS": 0}, "1 to 65536"),
        ("firm_axis_demux", {"DESTINATIONS": 65537}, "1 to 65536"),
        ("firm_axis_mux", {"WIDTH": 20}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_mux", {"SOURCES": 0}, "1 to 256"),
        ("firm_axis_mux", {"SOURCES": 257}, "1 to 256"),
    ],
)
def test_illegal_generics_are_named(library: Library, entity: str, generics: dict[str, int], legal: str) -> None:
    result = library.run(entity, generics)
    assert result.exit_code != 0
    (name, value) = next(iter(generics.items()))
    assert f"{entity}: {name} is {value}; legal: {legal}" in result.output


def test_a_fault_in_a_source_is_reported(tmp_path: Path) -> None:
    source = tmp_path / "broken.vhd"
    source.write_text("entity broken is\n", encoding="ascii")
    with pytest.raises(GhdlError, match=r"broken\.vhd:2"):
        Library("work", tmp_path).analyse([source])
