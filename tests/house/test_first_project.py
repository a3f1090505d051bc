"""`firm init` and `firm sim` as a new user types them, in a folder that FuseSoC knows nothing of."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = [sys.executable, "-m", "fusesoc_firm.cli"]


def firm(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command of `firm` with a home of its own."""
    environment = os.environ | {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "COLUMNS": "100"}
    done = subprocess.run(
        [*COMMAND, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    print(done.stdout, done.stderr)
    return done


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A new project."""
    done = firm(tmp_path, "init", "turn", "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Vector3")
    assert done.returncode == 0
    return tmp_path / "turn"


def test_a_project_passes(project: Path) -> None:
    done = firm(project, "sim", "--seed", "5", "--waves")
    lines = done.stdout.splitlines()
    assert done.returncode == 0
    assert lines[0] == "robot:sys:turn:0.1.0 in GHDL, seed 5, stalls 25 %, 8 bits"
    assert lines[1].split() == ["message", "cycles", "latency", "sent", "received"]
    assert "sub x=0.5 y=1.0 z=1.5" in lines[2] and "pub x=0.5 y=1.0 z=1.5" in lines[2]
    assert lines[-1] == "PASS 3/3"
    (waves,) = (line.removeprefix("waves: ") for line in lines if line.startswith("waves: "))
    assert (project / waves).stat().st_size > 0
    (log,) = (line.removeprefix("log:").strip() for line in lines if line.startswith("log:"))
    assert "PASS 3/3" in (project / log).read_text()


@pytest.mark.parametrize(
    ("language", "lines"),
    [
        ("python", ["edit: turn/python/turn.py (the computation)", "next: cd turn && firm sim"]),
        ("software", ["edit: turn/software/turn.py (the computation)", "next: cd turn && firm sim"]),
        ("hls", ["hardware: AMD Vitis HLS builds the function; 'firm sim' needs only g++ and GHDL"]),
    ],
)
def test_each_language_says_where_it_runs(tmp_path: Path, language: str, lines: list[str]) -> None:
    words = ("--subscribe", "geometry_msgs/Point", "--publish", "geometry_msgs/Vector3", "--language", language)
    done = firm(tmp_path, "init", "turn", *words)
    assert done.returncode == 0
    assert {*lines} <= {*done.stdout.splitlines()}
    if language == "hls":
        assert "Vitis HLS" in (tmp_path / "turn" / "hls" / "turn.cpp").read_text().splitlines()[2]


@pytest.mark.check
@pytest.mark.parametrize(("tool", "content"), [("icarus", b"Icarus Verilog"), ("verilator", b" in_x [63:0] $end")])
def test_waves_of_all_simulators(project: Path, tool: str, content: bytes) -> None:
    """Without the option, the file is not written again."""
    done = firm(project, "sim", "--tool", tool, "--waves")
    assert done.returncode == 0
    (found,) = re.findall(r"^waves: (.*)", done.stdout, re.MULTILINE)
    waves = project / found
    assert content in waves.read_bytes()
    waves.unlink()
    assert firm(project, "sim", "--tool", tool).returncode == 0
    assert not waves.exists()


@pytest.mark.check
def test_a_fault_in_the_model_and_in_the_accelerator(project: Path) -> None:
    model, source = project / "model.py", project / "rtl" / "turn.vhd"
    model.write_text(model.read_text().replace('message["x"]', '-message["x"]'))
    done = firm(project, "sim")
    assert done.returncode == 1
    assert "fault in cycle" in done.stdout and done.stdout.splitlines()[-1] == "FAIL 0/3"
    assert firm(project, "sim", "-q").stdout == "FAIL 0/3\n"
    right = source.read_text()
    source.write_text(right.replace("out_x <= in_x;", "out_x <= in_q;"))
    done = firm(project, "sim")
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("rtl/turn.vhd:") and 'no declaration for "in_q"' in done.stderr
    source.write_text(right)
    model.write_text("def respond(:")
    done = firm(project, "sim")
    assert done.returncode == 1 and "model.py:1:" in done.stderr
