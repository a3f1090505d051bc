"""The schedulers of robot:sched against models in their benches."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.sim.ghdl import Library, core_files

REQUESTERS = [1, 2, 3, 5, 16, 256]
SEED = 20240503

BENCH = "firm_sched_fixed_priority_tb"
ENTITY = "firm_sched_fixed_priority"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("sched"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/axis", "sched/fixed_priority"))
    library.analyse(core_files("sched/fixed_priority", fileset="tb"))
    return library


@pytest.mark.parametrize("pause", [20, 60, 95])
@pytest.mark.parametrize("requesters", REQUESTERS)
def test_it_follows_the_model(library: Library, requesters: int, pause: int) -> None:
    tasks = 5 if requesters == 256 else 100
    generics = {"REQUESTERS": requesters, "SEED": SEED, "TASKS": tasks, "PAUSE_PERCENT": pause}
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, f"{generics}\n{result.output}"
    assert "PASS" in result.output


@pytest.mark.parametrize("longest", [1, 4])
@pytest.mark.parametrize("requesters", REQUESTERS)
def test_no_cycle_is_lost_without_pauses(library: Library, requesters: int, longest: int) -> None:
    generics = {"REQUESTERS": requesters, "SEED": SEED, "MAX_BEATS": longest, "PAUSE_PERCENT": 0, "STALL_PERCENT": 0}
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, result.output
    figures = re.search(r"PASS (\d+) beats in (\d+) cycles", result.output)
    assert figures, result.output
    # The first request is shown in the first cycle, granted in the second, and its first beat is in the third.
    assert int(figures[2]) == int(figures[1]) + 2


@pytest.mark.parametrize("requesters", [1, 2, 5, 16])
def test_the_netlist_does_the_same(tmp_path: Path, requesters: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(ENTITY, {"REQUESTERS": requesters})
    library.analyse(core_files("sched/fixed_priority", fileset="tb"))
    result = library.run(BENCH, {"REQUESTERS": requesters, "SEED": SEED, "TASKS": 50})
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("requesters", REQUESTERS)
def test_it_is_latch_free(library: Library, requesters: int) -> None:
    assert library.latches(ENTITY, {"REQUESTERS": requesters}) == []


@pytest.mark.parametrize("requesters", [0, 257])
def test_illegal_generics_are_named(library: Library, requesters: int) -> None:
    result = library.run(ENTITY, {"REQUESTERS": requesters})
    assert result.exit_code != 0
    assert f"{ENTITY}: REQUESTERS is {requesters}; legal: 1 to 256" in result.output
