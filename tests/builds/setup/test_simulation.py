"""The report of a simulation, as `firm sim` reads it from the output of FuseSoC, and its choice of a target."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.simulation import Message, Report, Wishes, simulation
from fusesoc_firm.cli import main
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.library_path import demos_root
from fusesoc_firm.tools.programs import missing, simulation_programs
from fusesoc_firm.tools.simulators import SIMULATORS

Captured = pytest.CaptureFixture[str]

OUTPUT = """\
INFO: Preparing robot:sys:turn:0.1.0
  0 > not yet a/B x=1
seed 3, stalls 25 %, 8 bits; to repeat: -gSEED=3 -gSTALL_PERCENT=25
  0 > sub geometry_msgs/Point x=1.0 y=2.0
    < pub geometry_msgs/Vector3 x=1.0
    < other geometry_msgs/Vector3 x=2.0
    93 cycles first beat in to last beat out, -4 last beat in to first beat out
  1 > sub std_msgs/Empty
fault in cycle 300: 'pub geometry_msgs/Vector3 x=1.0': byte 9: expected 00, got 12
  2 > sub geometry_msgs/Point x=1.0 y=2.0
    < pub geometry_msgs/Vector3 x=1.0
  3 > sub geometry_msgs/Point x=1.0 y=2.0
    < pub geometry_msgs/Vector3 x=1.0
2 frames in, 1 frames out, 177 cycles from the first beat in to the last beat out
in: 66 beats, 37 % of these cycles; out: 66 beats, 37 %
FAIL 1/2
ghdl:error: assertion failed
"""


def test_a_report() -> None:
    report = Report()
    for line in OUTPUT.splitlines():
        report.add(line)
    assert report.title == "seed 3, stalls 25 %, 8 bits"
    assert report.messages == [
        Message(0, "sub x=1.0 y=2.0", ["pub x=1.0", "other x=2.0"], 93, -4),
        Message(1, "sub"),
        Message(2, "sub x=1.0 y=2.0", ["pub x=1.0"], is_wrong=True),
        # The same response, after which no fault was reported.
        Message(3, "sub x=1.0 y=2.0", ["pub x=1.0"]),
    ]
    assert [fault[:20] for fault in report.faults] == ["fault in cycle 300: "]
    assert len(report.summary) == 2
    assert (report.verdict, report.is_good) == ("FAIL 1/2", False)


def test_an_output_without_a_verdict_is_not_good() -> None:
    report = Report()
    for line in OUTPUT.splitlines()[:8]:
        report.add(line)
    assert report.verdict == "" and not report.is_good


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that FuseSoC knows no libraries in."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setenv("FUSESOC_CORES", "")
    return tmp_path


def test_the_libraries_are_found(elsewhere: Path) -> None:
    folder = demos_root() / "quat2euler"
    found = simulation("robot:sys:quat2euler", folder, Wishes(seed=7, has_waves=True, options="-gSTALL_PERCENT=0"))
    assert (found.build.target, found.simulator) == ("sim", "ghdl")
    assert found.options == ("--sim_options=-gSEED=7 --wave=waves.ghw -gSTALL_PERCENT=0",)
    assert found.waves == found.build.work_root / "waves.ghw"
    assert str(folder.resolve()) in os.environ["FUSESOC_CORES"].split(":")
    assert (elsewhere / "build" / "FUSESOC_IGNORE").exists()
    verilog = simulation("robot:sys:quat2euler", folder, Wishes("icarus", 7, options="--STALL_PERCENT=0"))
    assert (verilog.build.target, verilog.options) == ("sim_icarus", ("--SEED=7", "--STALL_PERCENT=0"))
    with_waves = {
        tool: simulation("robot:sys:quat2euler", folder, Wishes(tool, has_waves=True))
        for tool in SIMULATORS
        if not missing(simulation_programs(tool))
    }
    assert with_waves["icarus"].options == ("--WAVES=waves.fst",)
    assert with_waves["verilator"].options == ("--WAVES=waves.vcd", "--verilator_options=--trace")
    with pytest.raises(InputError, match="unknown core 'robot:sys:nothing'"):
        simulation("robot:sys:nothing", folder, Wishes())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "which system? This folder has no .core file with a system"),
        (["robot.yaml"], "there is no file robot.yaml"),
        (["alone.yaml"], "no core for alone.yaml is beside it"),
    ],
)
def test_a_system_that_is_not_there(elsewhere: Path, capsys: Captured, arguments: list[str], said: str) -> None:
    (elsewhere / "alone.yaml").touch()
    assert main(["sim", *arguments]) == 1
    assert said in capsys.readouterr().err
