"""A target's name is enough to run a system in any simulator, and all receive the same bytes in the same cycles."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from fusesoc_firm import __version__
from fusesoc_firm.tools import manifest
from tests.house.test_main_job import ROOT, run

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("iverilog", "verilator"))), reason="Icarus Verilog or Verilator is not installed"
)
# No package of Debian has nvc.
TARGETS = ("sim", *["sim_nvc"] * bool(shutil.which("nvc", path="/usr/bin")), "sim_icarus", "sim_verilator")
PROGRAMS = {
    "sim": {"ghdl"},
    "sim_nvc": {"nvc"},
    "sim_icarus": {"ghdl", "iverilog", "vvp"},
    "sim_verilator": {"ghdl", "verilator", "g++"},
}
# With their numbers of messages: variable size and bursts, pins with motors, accelerators in Verilog.
SYSTEMS = {"quat2euler": 100, "image_pipeline": 7, "multi_type": 19, "mobile_robot": 14, "multi_type_verilog": 19}
# Without multi_type: of its hardware, all but two accelerators is that of multi_type_verilog.
CHECKED = [
    pytest.param(system, marks=pytest.mark.thorough if system == "multi_type" else ())
    for system in [*SYSTEMS, "sobel", "robotic_arm"]
]
# These simulations take less time than a compilation with optimisation.
OPTIONS = {"sim_verilator": ["--make_options=OPT_FAST=-O0"]}


def report(done: subprocess.CompletedProcess[str]) -> list[str]:
    """The host's lines, except the command for starting it again."""
    lines = done.stdout.splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("seed "))
    end = next(number for number, line in enumerate(lines) if re.match("PASS|FAIL", line))
    return [lines[start].partition(";")[0], *lines[start + 1 : end + 1]]


def of_a_third(project: Path) -> Path:
    """The mobile robot with each third of its commands: each takes Icarus Verilog a second."""
    shutil.copytree(ROOT / "specs" / "mobile_robot", project / "specs" / "mobile_robot")
    for name in ("fusesoc_firm", "cores", "generators"):
        (project / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "fusesoc.conf", project)
    stimuli = project / "specs" / "mobile_robot" / "stimuli.yaml"
    commands = [line for line in stimuli.read_text().splitlines() if line.startswith("-")]
    stimuli.write_text("\n".join(commands[::3]))
    return project


@pytest.mark.one_in(5)
@pytest.mark.parametrize("system", CHECKED[: len(SYSTEMS)])
def test_all_simulators_receive_the_same(system: str, tmp_path: Path) -> None:
    project = of_a_third(tmp_path / "project") if system == "mobile_robot" else ROOT
    reports, received = [], []
    # GHDL and nvc do not read Verilog: there, `sim` is `sim_icarus`.
    for target in TARGETS[-2:] if system.endswith("_verilog") else TARGETS:
        done = run(system, tmp_path / "build", *OPTIONS.get(target, ()), project=project, target=target)
        print(done.stdout)
        assert done.returncode == 0
        reports.append(report(done))
        work = tmp_path / "build" / f"robot_sys_{system}_{__version__}" / target
        received.append((work / "received.txt").read_bytes())
        assert PROGRAMS[target] <= manifest.read(work).keys()
    assert reports[0][-1] == f"PASS {SYSTEMS[system]}/{SYSTEMS[system]}"
    assert received[0].count(b"< id ") == SYSTEMS[system]
    assert received[1:] == received[:1] * (len(received) - 1)
    assert reports[1:] == reports[:1] * (len(reports) - 1)


@pytest.fixture(scope="module")
def build_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("simulators") / "build"


@pytest.mark.check
def test_another_seed(build_root: Path) -> None:
    first = run("quat2euler", build_root, "--SEED=7", "--STALL_PERCENT=60", target="sim_icarus")
    assert "seed 7, stalls 60 %, 8 bits; to repeat: +SEED=7 +STALL_PERCENT=60" in first.stdout
    assert "PASS 100/100" in first.stdout
    ghdl = run("quat2euler", build_root, "--sim_options=-gSEED=7 -gSTALL_PERCENT=60")
    assert report(first) == report(ghdl)


@pytest.mark.check
def test_a_wrong_answer_fails_by_exit_status(build_root: Path, tmp_path: Path) -> None:
    expected = build_root / f"robot_sys_sobel_{__version__}" / "sim_icarus" / "expected.txt"
    assert run("sobel", build_root, target="sim_icarus").returncode == 0
    text = expected.read_text()
    frame = text.index("\n  ") + len("\n  00 ")
    wrong = tmp_path / "wrong.txt"
    # A byte of the first frame's payload.
    place = frame + len("00 00 00 00 ")
    wrong.write_text(f"{text[:place]}{'00' if text[place : place + 2] != '00' else '11'}{text[place + 2 :]}")
    for target in ("sim_icarus", "sim_verilator"):
        done = run("sobel", build_root, *OPTIONS.get(target, ()), f"--EXPECTED_FILE={wrong}", target=target)
        assert done.returncode != 0
        assert "FAIL 6/7" in done.stdout.splitlines()


@pytest.mark.one_in(7)
@pytest.mark.parametrize("system", CHECKED)
def test_lint_is_clean(system: str, build_root: Path) -> None:
    done = run(system, build_root, target="lint")
    assert done.returncode == 0, done.stdout


@pytest.mark.check
def test_what_a_simulator_cannot_do_is_said(build_root: Path) -> None:
    done = run("quat2euler_hls", build_root, target="sim_icarus")
    assert done.returncode != 0
    assert "icarus cannot simulate 'QuaternionToEuler_type', which has the type HLS" in done.stdout
    assert "--target=sim" in done.stdout
