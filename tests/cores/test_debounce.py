"""The debouncer of buttons: one change of its output for each press and release, however the contacts bounce."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20261128)


@pytest.mark.parametrize("sync", ["cdc/sync", "sim/sync"])
@pytest.mark.parametrize("cycles", [6, 20, 300])
def test_a_press_counts_once(tmp_path: Path, sync: str, cycles: int) -> None:
    print(f"-gSEED={SEED} -gCYCLES={cycles}")
    library = Library("firm", tmp_path)
    library.analyse(core_files(sync, "cdc/debounce"))
    library.analyse(core_files("cdc/debounce", fileset="tb"))
    done = library.run("firm_debounce_tb", {"SEED": SEED, "CYCLES": cycles})
    assert done.exit_code == 0 and "PASS 100 changes" in done.output, done.output


def test_the_netlist_of_it_does_the_same(tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("cdc/sync", "cdc/debounce"))
    assert library.latches("firm_debounce", {"CYCLES": 20}) == []
    library.replace_by_netlist("firm_debounce", {"CYCLES": 20})
    library.analyse(core_files("cdc/debounce", fileset="tb"))
    done = library.run("firm_debounce_tb", {"SEED": 7})
    assert done.exit_code == 0 and "PASS 100 changes" in done.output, done.output


def test_too_few_cycles_are_refused(tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("cdc/sync", "cdc/debounce"))
    library.analyse(core_files("cdc/debounce", fileset="tb"))
    done = library.run("firm_debounce_tb", {"CYCLES": 3})
    assert done.exit_code and "firm_debounce: CYCLES is 3; legal: 4 and more" in done.output
