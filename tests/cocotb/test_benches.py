"""Benches in cocotb of a converter and of a new project; the page's own example in three simulators."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY
from tests.house.test_verdicts import builds_with_verilator

pytestmark = pytest.mark.skipif(not find_spec("cocotb"), reason="cocotb is not installed")

PAGE = REPOSITORY / "docs" / "how-to" / "test-with-cocotb.md"
MANY = """
from fusesoc_firm.cocotb import Stalls
from fusesoc_firm.cocotb.cycles import number_of

CUT = b"\\0\\1\\0\\0" + bytes(20)


@cocotb.test()
async def a_broken_frame_has_its_code(dut):
    point = await converter(dut, "geometry_msgs/Point")
    point.send_payload(CUT)
    sent = point.send({"z": float("inf")})
    assert await point.receive_fault() == 1
    assert await point.receive() == sent


@cocotb.test()
async def all_inputs_are_driven(dut):
    await converter(dut, "geometry_msgs/Point", stalls=Stalls(percent=0))
    for name in ("tdata", "tkeep", "tuser", "tvalid", "tlast"):
        assert number_of(getattr(dut, f"s_axis_{name}")) == 0


@cocotb.test(expect_fail=True)
async def a_broken_frame_fails_a_test_that_expects_a_message(dut):
    point = await converter(dut, "geometry_msgs/Point")
    point.send_payload(CUT)
    await point.receive()


@cocotb.test(expect_fail=True)
async def another_message_fails(dut):
    point = await converter(dut, "geometry_msgs/Point")
    point.send({"x": 1.0})
    assert await point.receive() == {"x": 1.0, "y": 0.0, "z": 1.0}


@cocotb.test(expect_fail=True)
async def a_missing_message_fails(dut):
    point = await converter(dut, "geometry_msgs/Point")
    await point.receive(limit=100)
"""
PUBLISHER = """
@cocotb.test()
async def each_frame_is_received(dut):
    point = await converter(dut, "geometry_msgs/Point", stalls=Stalls(60, seed=3))
    sent = [point.send({"x": number / 3, "y": -2.5}) for number in range(20)]
    assert [await point.receive() for _ in sent] == sent
"""


def blocks() -> dict[str, str]:
    """The files that the page writes, by name."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^Write `(\S+)`:\n\n((?:    .*\n|\n)+)", text, re.MULTILINE)
    return {name: re.sub(r"^    ", "", block, flags=re.MULTILINE) for name, block in found}


@pytest.fixture
def library(tmp_path: Path) -> Path:
    for name, text in blocks().items():
        (tmp_path / name).write_text(text)
    settings = "[main]\nignored_dirs = build\n"
    places = {"firm": library_root(), "acme": "."}
    libraries = (f"[library.{name}]\nlocation = {place}\n" for name, place in places.items())
    (tmp_path / "fusesoc.conf").write_text(settings + "".join(libraries))
    return tmp_path


def run(folder: Path, target: str) -> str:
    """Run a target without the observation of its steps, which takes most of the time; return its log."""
    command = [sys.executable, "-m", "fusesoc_firm.cli", "build", "--target", target, "--verbose"]
    (core,) = folder.glob("*.core")
    name = re.findall(r"^name: (\S+)", core.read_text(), re.MULTILINE)[0]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(folder / "store")}
    done = subprocess.run([*command, name], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_example_has_ten_lines() -> None:
    assert len(blocks()["test_point.py"].strip().splitlines()) <= 10


@pytest.mark.parametrize("target", ["test", "test_icarus", "test_verilator"])
def test_the_example_passes(library: Path, target: str) -> None:
    if target == "test_verilator" and not builds_with_verilator():
        pytest.skip("cocotb 2 does not build with Verilator before 5.036")
    log = run(library, target)
    assert re.search(r"TESTS=1 PASS=1 FAIL=0", log)
    assert re.search(r"^stalls: 25 % of the cycles, seed=\d+$", log, re.MULTILINE)


@pytest.mark.check
def test_what_a_bench_reports(library: Path) -> None:
    with (library / "test_point.py").open("a") as bench:
        bench.write(MANY)
    assert "TESTS=6 PASS=6 FAIL=0" in run(library, "test")


@pytest.mark.check
def test_a_publisher(library: Path) -> None:
    core, bench = library / "point.core", library / "test_point.py"
    core.write_text(core.read_text().replace("axis_to_geometry_msgs_point", "geometry_msgs_point_to_axis"))
    bench.write_text(bench.read_text().replace("import converter", "import Stalls, converter") + PUBLISHER)
    assert "TESTS=2 PASS=2 FAIL=0" in run(library, "test")


@pytest.mark.check
def test_the_bench_of_a_new_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--in", "sensor_msgs/Imu", "--out", "geometry_msgs/Vector3Stamped"]
    assert main(["init", "tilt", *options, "--bench", "cocotb"]) == 0
    assert "TESTS=1 PASS=1 FAIL=0" in run(tmp_path / "tilt", "test_cocotb")
    model = tmp_path / "tilt" / "model.py"
    model.write_text(f"{model.read_text()}\n\ndef respond(subscriber, message):\n    return [('pub', {{}})]\n")
    with pytest.raises(AssertionError, match="TESTS=1 PASS=0 FAIL=1"):
        run(tmp_path / "tilt", "test_cocotb")
