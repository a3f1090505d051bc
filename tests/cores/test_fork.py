"""The fork of messages alone: every sink has every message once, in its own time, and none waits for another."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files

BENCH = "firm_message_fork_tb"
COUNTS = [1, 2, 3, 5]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("fork"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    return library


@pytest.mark.one_in(5)
@pytest.mark.parametrize("sinks", COUNTS)
@pytest.mark.parametrize(("seed", "stall_percent"), [(1, 20), (2, 50), (3, 90)])
def test_random_readiness(library: Library, sinks: int, seed: int, stall_percent: int) -> None:
    print(f"seed {seed}, stalls {stall_percent} %")
    result = library.run(BENCH, {"SINKS": sinks, "SEED": seed, "STALL_PERCENT": stall_percent})
    assert result.exit_code == 0, result.output
    assert "PASS 1000 messages in " in result.output


@pytest.mark.one_in(3)
@pytest.mark.parametrize("sinks", COUNTS)
@pytest.mark.parametrize(("seed", "stall_percent"), [(5, 30), (6, 80)])
def test_a_withdrawn_message_leaves_nothing_behind(library: Library, sinks: int, seed: int, stall_percent: int) -> None:
    print(f"seed {seed}, stalls {stall_percent} %")
    generics = {"SINKS": sinks, "SEED": seed, "STALL_PERCENT": stall_percent, "WITHDRAW_PERCENT": 20}
    if stall_percent > 50:
        generics["MESSAGES"] = 50
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("sinks", COUNTS)
def test_a_message_a_cycle(library: Library, sinks: int) -> None:
    result = library.run(BENCH, {"SINKS": sinks})
    assert result.exit_code == 0, result.output
    assert "PASS 1000 messages in 1000 cycles" in result.output


@pytest.mark.parametrize("sinks", [2, 5])
def test_a_blocked_sink_stops_the_source_but_no_other_sink(library: Library, sinks: int) -> None:
    result = library.run(BENCH, {"SINKS": sinks, "BLOCKED": 50})
    assert result.exit_code == 0, result.output
    assert "PASS 1000 messages in 1050 cycles" in result.output


@pytest.mark.parametrize("sinks", [2, 5])
def test_the_netlist_does_the_same(tmp_path: Path, sinks: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_message_fork", {"SINKS": sinks, "SEGMENTS": 3})
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    result = library.run(BENCH, {"SINKS": sinks, "SEED": 4, "STALL_PERCENT": 40, "WITHDRAW_PERCENT": 5})
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("sinks", [*COUNTS, 256])
def test_there_is_no_latch(library: Library, sinks: int) -> None:
    assert library.latches("firm_message_fork", {"SINKS": sinks}) == []


@pytest.mark.parametrize("sinks", [0, -1])
def test_an_illegal_generic_is_named(library: Library, sinks: int) -> None:
    result = library.run("firm_message_fork", {"SINKS": sinks})
    assert result.exit_code != 0
    assert f"firm_message_fork: SINKS is {sinks}; legal: 1 or more" in result.output


def test_an_illegal_number_of_segments_is_named(library: Library) -> None:
    result = library.run("firm_message_fork", {"SEGMENTS": 0})
    assert result.exit_code != 0
    assert "firm_message_fork: SEGMENTS is 0; legal: 1 or more" in result.output
