"""The package that `firm pynq` writes: its names are Vivado's, its notebook runs, pip installs it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.export.pynq.driver import ENGINE
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.boards.block_design import BLOCK_DESIGN_TEMPLATE, block_design_configuration
from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.render import render
from tests.export.pynq.stand_in import SPECIFICATION, SPECS, SimpleDma, board, driver_of, installed, written

BOARDS = ("zynq7000", "zcu104", "kr260")
SYSTEMS = ("obstacle", "multi_type", "quat2euler", "joint_pid", "mobile_robot", "robotic_arm")
Captured = pytest.CaptureFixture[str]


def vivado_project(folder: Path, name: str, *, sources: str = "gen") -> Path:
    """The folder of a build, with what Vivado writes."""
    project = folder / "build"
    bitstream = project / f"robot_sys_pair_0.2.0.runs/impl_1/{name}_wrapper.bit"
    description = project / f"robot_sys_pair_0.2.0.{sources}/sources_1/bd/{name}/hw_handoff/{name}.hwh"
    for path, content in ((bitstream, b"\0\1"), (description, b"<EDKSYSTEM/>")):
        path.parent.mkdir(parents=True)
        path.write_bytes(content)
    return project


def notebook(package: Path) -> Any:
    (path,) = package.glob("notebooks/*.ipynb")
    assert path.stem == package.name
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", BOARDS)
def test_the_names_are_those_of_the_block_design(tmp_path: Path, name: str) -> None:
    package = written(tmp_path, board=name)
    system = load_beside(tmp_path / "pair.yaml", needs_sources=False).system
    script = render(BLOCK_DESIGN_TEMPLATE, block_design_configuration(system, read_board(name), Fraction(10**8)))
    assert re.findall(r"^create_bd_design (\w+)$", script, re.MULTILINE) == [package.name]
    assert re.findall(r"^create_bd_cell .*axi_dma (\w+)$", script, re.MULTILINE) == [ENGINE]
    assert f"{package.name}.bit" in (package / "__init__.py").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_bitstream_has_the_name_of_the_target_s_top_level(tmp_path: Path, name: str) -> None:
    """FuseSoC gives it to Vivado, which names the bitstream after it."""
    core = read_core(SPECS / name / f"{name}.core")
    targets = core.section("targets")
    for each in {*BOARDS} & {*targets}:
        spec = str(SPECS / name / f"{name}.yaml")
        assert main(["pynq", spec, "--board", each, "-o", str(tmp_path / each)]) == 0
        (package,) = (path.parent for path in tmp_path.glob(f"{each}/*/__init__.py"))
        place = f"<project>.runs/impl_1/{targets[each]['toplevel']}.bit"
        assert place in (tmp_path / each / "README.md").read_text(encoding="utf-8")
        assert targets[each]["toplevel"] == f"{package.name}_wrapper"


@pytest.mark.parametrize("sources", ["gen", "srcs"])
def test_the_files_of_a_build_are_copied(tmp_path: Path, sources: str) -> None:
    project = vivado_project(tmp_path, "pair_zynq7000", sources=sources)
    package = written(tmp_path, "--build", str(project))
    assert (package / "pair_zynq7000.bit").read_bytes() == b"\0\1"
    assert (package / "pair_zynq7000.hwh").read_bytes() == b"<EDKSYSTEM/>"


def test_a_table_has_ids_messages_and_their_definitions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another class than that of the generator reads the definitions."""
    driver = driver_of(written(tmp_path), monkeypatch)
    system = load_beside(tmp_path / "pair.yaml", needs_sources=False).system
    for table, topics in ((driver.SUBSCRIBERS, system.subscribers), (driver.PUBLISHERS, system.publishers)):
        assert {name: tuple(item) for name, item in table.items()} == {
            topic.block: (topic.id, str(topic.frame.message), topic.frame.ros.number) for topic in topics
        }
    paths = {str(path.relative_to(driver.MESSAGES)) for path in driver.MESSAGES.rglob("*.msg")}
    assert paths == {
        "ros2/builtin_interfaces/msg/Time.msg",
        "ros2/geometry_msgs/msg/Point.msg",
        "ros2/geometry_msgs/msg/PointStamped.msg",
        "ros2/std_msgs/msg/Header.msg",
    }
    assert (driver.WIDTH, driver.LONGEST, driver.IS_PREEMPTIVE) == (32, None, False)


@pytest.mark.parametrize("name", SYSTEMS)
def test_codecs_of_the_package_are_those_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    spec = SPECS / name / f"{name}.yaml"
    assert main(["pynq", str(spec), "--board", "zcu104", "-o", str(tmp_path / "overlay")]) == 0
    made = driver_of(tmp_path / "overlay" / f"{name}_zcu104", monkeypatch)
    loaded = load_beside(spec, needs_sources=False)
    wanted = {topic.block: hash_of(topic, loaded) for topic in (*loaded.system.subscribers, *loaded.system.publishers)}
    found = made.over(SimpleDma(), np.zeros)
    assert {block: item.hash for block, item in (found.subscribers | found.publishers).items()} == wanted


def hash_of(topic: Converter, loaded: LoadedSystem) -> str:
    """The text that both ends of a topic compare."""
    definitions = loaded.libraries[topic.frame.ros].closure(topic.frame.message)
    return signature(topic.frame.message, definitions)


def test_the_notebook_is_valid_and_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    package = written(tmp_path, "--build", str(vivado_project(tmp_path, "pair_zynq7000")))
    found = notebook(package)
    nbformat.validate(found)
    text = "\n".join("".join(cell["source"]) for cell in found["cells"] if cell["cell_type"] == "markdown")
    for block in ("left", "right", "left_out", "right_out"):
        assert f"`{block}`" in text
    installed(package, monkeypatch)
    names: dict[str, Any] = {}
    results: list[Any] = []
    with board(monkeypatch) as stand_in:
        for cell in found["cells"]:
            if cell["cell_type"] == "code":
                results.append(run_cell("".join(cell["source"]), names))
    assert stand_in.loaded == [(str(package / "pair_zynq7000.bit"), True)]
    message = names["message"]
    assert ("left_out", message) in results
    assert [("left_out", message)] * 10 in results


def run_cell(source: str, names: dict[str, Any]) -> Any:
    """Run a cell; return the value of its last line, as Jupyter shows it."""
    *lines, last = source.splitlines()
    exec("\n".join(lines), names)
    try:
        return eval(last, names)
    except SyntaxError:
        exec(last, names)
        return None


@pytest.mark.check
def test_pip_installs_all_files(tmp_path: Path) -> None:
    package = written(tmp_path, "--build", str(vivado_project(tmp_path, "pair_zynq7000")))
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "-w", str(tmp_path), str(package.parent)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if not name.startswith("pair_zynq7000-")}
        (entries,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
        assert "[pynq.notebooks]\npair_zynq7000 = pair_zynq7000.notebooks" in archive.read(entries).decode()
    wanted = {str(path.relative_to(package.parent)) for path in package.rglob("*") if path.is_file()}
    assert inside == wanted


@pytest.mark.parametrize(
    ("words", "text", "message"),
    [
        (("--board", "ulx3s"), SPECIFICATION, "board 'ulx3s' has no processor that runs Linux"),
        (("--board", "zcu105"), SPECIFICATION, "unknown board 'zcu105'"),
        (("--build", "nowhere"), SPECIFICATION, "nowhere has no pair_zynq7000.bit"),
        ((), SPECIFICATION.replace("width: 32", "width: 32, idBytes: 2"), "idBytes: 2"),
        ((), SPECIFICATION.replace("left_out, middleware", "left_outer, middleware"), "left_out"),
    ],
)
def test_faults(tmp_path: Path, capsys: Captured, words: tuple[str, ...], text: str, message: str) -> None:
    spec = tmp_path / "pair.yaml"
    spec.write_text(text, encoding="utf-8")
    assert main(["pynq", str(spec), "--board", "zynq7000", "-o", str(tmp_path / "overlay"), *words]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "overlay").exists()
