"""Each reusable core has a target for each of its test benches, and all of them pass in FuseSoC."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.plan import make_plan
from fusesoc_firm.builds.setup.pool import Pool
from tests.hdl.ghdl import CORES, core_description, core_files


def benches() -> dict[str, dict[str, Any]]:
    """The targets with a flow of each core, by its name."""
    found = {}
    for path in sorted(CORES.rglob("*.core")):
        core = core_description(path)
        targets = {name: target for name, target in core["targets"].items() if "flow" in target}
        if targets:
            found[core["name"]] = targets
    return found


def tops(targets: Mapping[str, Mapping[str, Any]]) -> set[str]:
    return {str(target["toplevel"]).rpartition(".")[2] for target in targets.values()}


@pytest.mark.parametrize("path", sorted(CORES.rglob("*.core")), ids=lambda path: path.stem)
def test_every_bench_is_the_top_of_a_target(path: Path) -> None:
    core = core_description(path)
    named = core_files(str(path.relative_to(CORES).with_suffix("")), fileset="tb") if "tb" in core["filesets"] else []
    files = {file.stem for file in named if file.stem.endswith("_tb")}
    assert files == tops(benches().get(core["name"], {}))


def test_no_bench_is_without_a_core() -> None:
    tests = {path.stem for path in CORES.rglob("tb/*") if path.stem.endswith("_tb")}
    assert tests == set().union(*map(tops, benches().values()))


@pytest.mark.check
@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
def test_all_of_them_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "fusesoc.conf").write_text(f"[library.cores]\nlocation = {CORES}\n")
    monkeypatch.chdir(tmp_path)
    # The launcher is tested elsewhere.
    monkeypatch.setenv("EDALIZE_LAUNCHER", "")
    wanted = [(core, name) for core, targets in benches().items() for name in targets if name.startswith("sim")]
    plan = make_plan([core for core, name in wanted if name == "sim"], ["sim"])
    folders = {build.core: build.work_root.parent for build in plan.builds}
    plan = replace(plan, builds=tuple(Build(core, name, folders[core] / name) for core, name in wanted))
    failed = {}
    for outcome in Pool((), 2, print).run(plan):
        log = outcome.build.log.read_text(encoding="utf-8")
        if not outcome.is_good or "FAIL" in log:
            failed[str(outcome.build)] = log[-2000:]
    assert not failed, "\n\n".join(failed.values())
