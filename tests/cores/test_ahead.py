"""The queue between a subscriber's steps and its message side: no word is lost, and a word passes in every cycle."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

BENCH, PART = "firm_axis_ahead_tb", "firm_axis_ahead"
DEPTHS = [5, 8, 16, 21]
SEED = seeded(20261130) % 10000


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("ahead"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    _analyse_bench(library)
    return library


def _analyse_bench(library: Library) -> None:
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize(("writer", "reader", "drop"), [(0, 60, 0), (40, 40, 0), (70, 10, 0), (20, 50, 3)])
def test_words_arrive_in_order(library: Library, depth: int, writer: int, reader: int, drop: int) -> None:
    print(f"seed {SEED}")
    generics: dict[str, Generic] = {
        "DEPTH": depth,
        "SEED": SEED,
        "WRITER_STALL_PERCENT": writer,
        "READER_STALL_PERCENT": reader,
        "DROP_PERCENT": drop,
    }
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, result.output
    assert "PASS 3000 words in " in result.output


def test_a_word_passes_in_every_cycle(library: Library) -> None:
    result = library.run(BENCH, {"DEPTH": 8})
    assert result.exit_code == 0, result.output
    (cycles,) = (int(line.split()[4]) for line in result.output.splitlines() if line.startswith("PASS"))
    assert cycles <= 3000 + 8


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(PART, {"BITS": 16, "DEPTH": 8})
    _analyse_bench(library)
    generics: dict[str, Generic] = {"DEPTH": 8, "SEED": SEED, "WRITER_STALL_PERCENT": 30, "READER_STALL_PERCENT": 40}
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("depth", DEPTHS)
def test_there_is_no_latch(library: Library, depth: int) -> None:
    assert library.latches(PART, {"DEPTH": depth}) == []


@pytest.mark.parametrize(("generic", "value", "legal"), [("BITS", 0, "1 or more"), ("DEPTH", 4, "5 or more")])
def test_illegal_generics_are_named(library: Library, generic: str, value: int, legal: str) -> None:
    result = library.run(PART, {generic: value})
    assert result.exit_code != 0
    assert f"{PART}: {generic} is {value}; legal: {legal}" in result.output
