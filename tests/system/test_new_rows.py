"""A simulator, a board and a target are added by a row or a file each, which commands, cores and builds follow."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.system.boards.board import FOLDER
from fusesoc_firm.tools.library_path import library_root

SPECS = Path(__file__).resolve().parents[2] / "specs"
# What the tables of the package would say; each process of the build begins with it.
ROWS = """\
from pathlib import Path
from fusesoc_firm.system.boards import board
from fusesoc_firm.tools.flows import FAMILIES, Family
from fusesoc_firm.tools.simulators import SIMULATORS, Live, Simulator

SIMULATORS["xcelium"] = Simulator(
    "Xcelium", reads_vhdl=True, programs=("xrun",),
    options={"xrun_options": ["-v93"]}, live=Live("-generic "),
)
FAMILIES["nexus"] = Family("Lattice Nexus", ("-noflatten",))
board.FOLDER = Path(__file__).parent / "boards"
"""
CONFIGURATION = f"""\
[library.firm]
location = {library_root()}
[library.robot]
location = robot
"""
NEW = ("sim_xcelium", "live_xcelium", "synth_nexus", "desk")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A system, a board of the package's that is called otherwise, and the rows."""
    robot = tmp_path / "robot"
    shutil.copytree(SPECS / "quat2euler", robot, ignore=shutil.ignore_patterns("quat2euler_hls.*"))
    (tmp_path / "boards").mkdir()
    text = (FOLDER / "ulx3s.yaml").read_text()
    (tmp_path / "boards" / "desk.yaml").write_text(f"description: The one on my desk\n{text.partition(chr(10))[2]}")
    (tmp_path / "sitecustomize.py").write_text(ROWS)
    (tmp_path / "fusesoc.conf").write_text(CONFIGURATION)
    return tmp_path


def firm(project: Path, *arguments: str) -> str:
    paths = os.pathsep.join([str(project), str(SPECS.parent)])
    home = {name: str(project / "home") for name in ("HOME", "XDG_CONFIG_HOME", "FUSESOC_FIRM_CACHE")}
    done = subprocess.run(
        [sys.executable, "-m", "fusesoc_firm.cli", *arguments],
        cwd=project,
        env={**os.environ, **home, "PYTHONPATH": paths},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def test_rows_and_files_are_all_that_it_takes(project: Path) -> None:
    core = project / "robot" / "quat2euler.core"
    before = yaml.safe_load(core.read_text())["targets"]
    firm(project, "system", "core", "robot/quat2euler.yaml")
    after = yaml.safe_load(core.read_text())["targets"]
    assert after.keys() - before.keys() == {*NEW}
    assert after["sim_xcelium"] == after["sim"] | {
        "flags": {"firm_launcher": True, "vhdl_host": True},
        "generate": ["system", {"simulation": {"simulator": "xcelium"}}],
    }
    assert "{ghdl,verilator,nvc,xcelium}" in firm(project, "simulator", "--help")
    firm(project, "build", "quat2euler", "--setup", "--target", *NEW)
    made = {path.parent.name: path for path in project.glob("build/*/*/*.eda.yml")}
    files = {
        name: [Path(item["name"]).name for item in yaml.safe_load(made[name].read_text())["files"]] for name in NEW
    }
    assert "quat2euler_system_tb.vhd" in files["sim_xcelium"]
    assert "quat2euler_system_live.vhd" in files["live_xcelium"]
    assert "quat2euler_system.vhd" in files["synth_nexus"]
    assert "quat2euler_desk.vhd" in files["desk"]
    assert "-v93" in (made["sim_xcelium"].parent / "xrun.f").read_text()
    assert "synth_nexus -noflatten" in (made["synth_nexus"].parent / "edalize_yosys_procs.tcl").read_text()
