"""The merge of messages alone: every message of each source passes once and whole, and every source has its turn."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files

BENCH = "firm_message_merge_tb"
COUNTS = [1, 2, 3, 5]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("merge"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    return library


@pytest.mark.one_in(6)
@pytest.mark.parametrize("sources", COUNTS)
@pytest.mark.parametrize(("seed", "stall_percent"), [(1, 20), (2, 50), (3, 90)])
@pytest.mark.parametrize("withdraw_percent", [0, 20])
def test_random_sources(library: Library, sources: int, seed: int, stall_percent: int, withdraw_percent: int) -> None:
    print(f"seed {seed}, stalls {stall_percent} %")
    generics = {"SOURCES": sources, "SEED": seed, "STALL_PERCENT": stall_percent, "WITHDRAW_PERCENT": withdraw_percent}
    if stall_percent > 50:
        generics["MESSAGES"] = 50
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, result.output
    assert "PASS" in result.output


@pytest.mark.parametrize("sources", COUNTS)
@pytest.mark.parametrize("is_alone", ["false", "true"])
def test_a_message_a_cycle(library: Library, sources: int, is_alone: str) -> None:
    result = library.run(BENCH, {"SOURCES": sources, "IS_ALONE": is_alone})
    assert result.exit_code == 0, result.output
    assert "PASS 1000 messages in 1000 cycles" in result.output


@pytest.mark.parametrize("sources", [2, 5])
def test_the_netlist_does_the_same(tmp_path: Path, sources: int) -> None:
    library = _library(tmp_path)
    generics = {"SOURCES": sources, "FIELD_BITS": 24, "OFFERS": 2, "TAKES": 2}
    library.replace_by_netlist("firm_message_merge", generics)
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    result = library.run(BENCH, {"SOURCES": sources, "SEED": 4, "STALL_PERCENT": 40, "WITHDRAW_PERCENT": 5})
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("sources", [*COUNTS, 16])
def test_there_is_no_latch(library: Library, sources: int) -> None:
    assert library.latches("firm_message_merge", {"SOURCES": sources, "FIELD_BITS": 192}) == []


@pytest.mark.parametrize("generic", ["SOURCES", "FIELD_BITS", "OFFERS", "TAKES"])
def test_an_illegal_generic_is_named(library: Library, generic: str) -> None:
    result = library.run("firm_message_merge", {generic: 0})
    assert result.exit_code != 0
    assert f"firm_message_merge: {generic} is 0; legal: 1 or more" in result.output
