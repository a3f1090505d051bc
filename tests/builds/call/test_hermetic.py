"""Generated output depends only on declared inputs, never on other files, the place, the time or the machine.

The calls cover all applications of `specs/` with both products, one of them for every simulator and board, and some
converters.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.answer import main
from fusesoc_firm.builds.setup.cores import project_cores
from fusesoc_firm.builds.store.layout import CALL
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.tools.own_code import PACKAGE
from fusesoc_firm.tools.reads import Reads, noted

SPECS = PACKAGE.parent / "specs"
# Fixed and variable sizes, streams, both versions of ROS, a service.
CONVERTERS: tuple[Mapping[str, object], ...] = (
    {"message": "geometry_msgs/Quaternion", "ros": 1, "width": 8},
    {"message": "sensor_msgs/Image", "ros": 2, "width": 64},
    {"message": "diagnostic_msgs/DiagnosticArray", "ros": 2, "width": 32},
    {"message": "sensor_msgs/JointState", "ros": 1, "width": 512},
    {"message": "std_msgs/Empty", "ros": 2, "direction": "publisher"},
)
# The first call may leave state behind in the process.
GENERATE = """
import json, os, sys
from fusesoc_firm.builds.call.answer import main
for folder, command in json.load(sys.stdin):
    os.chdir(folder)
    if main(command, ["call.yml"]):
        sys.exit(f"{folder} failed")
"""
# The environments differ in everything that could matter: folder, date (they are 25 hours apart), language and
# encoding, order of sets, user name.
HERE = {"TZ": "Pacific/Kiritimati", "LC_ALL": "C.UTF-8", "PYTHONHASHSEED": "1", "USER": "here", "HOME": "/"}
THERE = {
    "TZ": "Pacific/Pago_Pago",
    "LC_ALL": "C",
    "PYTHONCOERCECLOCALE": "0",
    "PYTHONUTF8": "0",
    "PYTHONHASHSEED": "2",
    "USER": "there",
    "HOME": "/tmp",
}
# The result for comparison is generated once.
pytestmark = pytest.mark.xdist_group("hermetic")
IS_NAMESPACE_ALLOWED = subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode == 0


@dataclass(frozen=True)
class Generated:
    """A folder with a call in each of its numbered subfolders, answered with a store of its own."""

    folder: Path

    def files(self) -> dict[str, bytes]:
        """All written files, by name."""
        paths = [path for path in sorted((self.folder / "work").rglob("*")) if path.is_file()]
        return {
            path.relative_to(self.folder / "work").as_posix(): path.read_bytes()
            for path in paths
            if path.name != "call.yml"
        }

    def inputs(self, number: int) -> list[Path]:
        """The user's files on which the result of a call depends."""
        said = (self.folder / "work" / str(number) / "call.yml").read_text()
        notes = [json.loads(path.read_text().partition("\n")[2]) for path in self.folder.rglob(f"*{CALL}")]
        name = str(yaml.safe_load(said)["vlnv"]).split(":")[2]
        (facts,) = [note["facts"] for note in notes if note["name"] == name]
        files = [Path(file) for kind, file, state in facts if kind == "file" and state is not None]
        return [file for file in files if not file.is_relative_to(PACKAGE)]


def calls_here() -> Iterator[GeneratorCall]:
    for core in project_cores():
        for call in core.calls if core.files[0].is_relative_to(SPECS) else ():
            if _is_taken(core.vlnv.split(":")[2], call.parameters):
                yield call
    for parameters in CONVERTERS:
        yield GeneratorCall("firm", "a:b:c-converter:1", str(SPECS), parameters)


def _is_taken(application: str, parameters: Mapping[str, object]) -> bool:
    # GHDL cannot simulate Verilog.
    if application == "multi_type_verilog" and "product" in parameters:
        return parameters.get("simulator") == "icarus"
    # A node in fabric is simulated with another interconnect, which each target gives.
    if application in ("obstacle_node", "quat2euler_ethernet") and parameters.get("product") == "simulation":
        return "interconnect" in parameters and "simulator" not in parameters
    return application == "quat2euler" or not {"board", "simulator"} & parameters.keys()


def generate(
    folder: Path, asked: list[GeneratorCall], roots: list[Path], environment: Mapping[str, str], *around: str
) -> Generated:
    """Answer all calls in one process, each with its own root in place of `specs/`; the store is empty at first."""
    calls = []
    for number, (item, root) in enumerate(zip(asked, roots, strict=True)):
        work = folder / "work" / str(number)
        work.mkdir(parents=True)
        vendor, library, name, version = item.vlnv.split(":")
        call = {
            "files_root": str(root / Path(item.files_root).relative_to(SPECS)),
            # Each has a unique name, by which its note is found.
            "vlnv": f"{vendor}:{library}:{name}{number}:{version}",
            "parameters": dict(item.parameters),
        }
        (work / "call.yml").write_text(yaml.safe_dump(call))
        calls.append((str(work), item.generator))
    kept = {name: os.environ[name] for name in ("PATH",) if name in os.environ}
    paths = {"PYTHONPATH": str(PACKAGE.parent), "FUSESOC_FIRM_CACHE": str(folder / "store")}
    done = subprocess.run(
        [*around, sys.executable, "-c", GENERATE],
        input=json.dumps(calls),
        env={**kept, **paths, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return Generated(folder)


@pytest.fixture(scope="module")
def asked() -> list[GeneratorCall]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(PACKAGE.parent)
        return [*calls_here()]


@pytest.fixture(scope="module")
def here(asked: list[GeneratorCall], tmp_path_factory: pytest.TempPathFactory) -> Generated:
    folder = tmp_path_factory.mktemp("here")
    shutil.copytree(SPECS, folder / "specs")
    return generate(folder, asked, [folder / "specs"] * len(asked), HERE)


def assert_same(one: Generated, other: Generated) -> None:
    files, others = one.files(), other.files()
    assert files.keys() == others.keys()
    assert [name for name in files if files[name] != others[name]] == []


@pytest.mark.check
def test_folder_date_locale_and_hash_seed_change_nothing(
    here: Generated, asked: list[GeneratorCall], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("there") / "a longer name, with blanks"
    shutil.copytree(SPECS, folder / "specs")
    assert_same(here, generate(folder, asked, [folder / "specs"] * len(asked), THERE))


def test_nothing_of_the_machine_is_in_it(here: Generated) -> None:
    machine = re.compile("|".join(map(re.escape, (str(here.folder), str(PACKAGE), socket.gethostname(), "/tmp/"))))
    found = {name: machine.search(content.decode("latin-1")) for name, content in here.files().items()}
    assert {name: match[0] for name, match in found.items() if match} == {}


def test_with_nothing_but_the_declared_inputs_it_is_the_same(
    here: Generated, asked: list[GeneratorCall], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("limited")
    roots = [folder / "specs" / str(number) for number in range(len(asked))]
    for number, (root, item) in enumerate(zip(roots, asked, strict=True)):
        (root / Path(item.files_root).relative_to(SPECS)).mkdir(parents=True)
        for path in here.inputs(number):
            copy = root / path.relative_to(here.folder / "specs")
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
    assert_same(here, generate(folder, asked, roots, HERE))


@pytest.mark.skipif(not IS_NAMESPACE_ALLOWED, reason="this user may not make mount namespaces")
def test_what_it_reads_need_not_be_writable(
    here: Generated, asked: list[GeneratorCall], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("read_only")
    specs = folder / "specs"
    shutil.copytree(SPECS, specs)
    first = [item for item in asked if "simulator" not in item.parameters][::4]
    frozen = [specs, PACKAGE]
    mounts = [f"mount --bind '{path}' '{path}' && mount -o remount,ro,bind '{path}'" for path in frozen]
    script = " && ".join([*mounts, f"! touch '{specs}/x' 2>/dev/null", 'exec "$@"'])
    made = generate(folder, first, [specs] * len(first), HERE, "unshare", "-rm", "sh", "-c", script, "sh")
    # Their numbers differ from those among all calls.
    contents = set(here.files().values())
    written = {name: content for name, content in made.files().items() if not name.endswith(".core")}
    assert written
    assert [name for name, content in written.items() if content not in contents] == []


def test_what_is_installed_is_no_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A single module is not an input, either, in any package folder; but a file elsewhere on Python's path is."""
    for name in ("dist-packages/alone.py", "elsewhere/whole/__init__.py", "elsewhere/own.py", "text.txt"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "dist-packages"), str(tmp_path / "elsewhere"), *sys.path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    reads = Reads()
    with noted(reads):
        for module in ("alone", "whole", "own"):
            importlib.import_module(module)
        (tmp_path / "text.txt").read_text()
        (tmp_path / "written.txt").write_text("")
        with tempfile.TemporaryDirectory() as place:
            (Path(place) / "a").write_text("")
            (Path(place) / "a").read_text()
    read = {Path(file).relative_to(tmp_path) for file in reads.files if not file.endswith(".pyc")}
    assert read == {Path("elsewhere/own.py"), Path("text.txt")}


MODEL = """
{reads}
def respond(subscriber, message):
    return [("QuaternionToEuler_pub", {{"x": 0.0, "y": 0.0, "z": 0.0}})]
"""


@pytest.mark.parametrize(
    "reads",
    [
        "open(r'{table}').read()",
        "import pathlib; pathlib.Path(r'{table}').read_bytes()",
        "import os; os.read(os.open(r'{table}', os.O_RDONLY), 9)",
        "import sqlite3; sqlite3.connect(r'{table}').close()",
        # A model that ignores the failure has read the file nevertheless.
        "try:\n    open(r'{table}')\nexcept BaseException:\n    pass",
    ],
)
def test_an_undeclared_file_is_named(
    reads: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project, work = tmp_path / "project", tmp_path / "work"
    shutil.copytree(SPECS / "quat2euler", project)
    work.mkdir()
    table = project / "table.csv"
    table.write_text("1\n")
    (project / "model.py").write_text(MODEL.format(reads=reads.format(table=table)))
    monkeypatch.chdir(work)
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    files = {"spec": "quat2euler.yaml", "stimuli": "stimuli.yaml", "model": "model.py"}

    def run(**more: object) -> int:
        parameters = {"product": "simulation", **files, **more}
        call = {"files_root": str(project), "vlnv": "a:b:c-simulation:1", "parameters": parameters}
        (work / "call.yml").write_text(yaml.safe_dump(call))
        return main("far", ["call.yml"])

    assert run() == 1
    error = capsys.readouterr().err
    assert error.startswith(f"error: {table} was read, but is not listed as an input\n")
    assert "add the file to the generator's parameter 'files'" in error
    assert not list(work.glob("*.core"))
    assert not list(tmp_path.rglob("*.entry"))
    assert run(files=["table.csv"]) == 0
    assert run(files=["table.csv"]) == 0
    table.write_text("2\n")
    assert run(files=["table.csv"]) == 0
    origins = [line.split()[2] for line in capsys.readouterr().out.splitlines()]
    assert origins == ["generated", "from", "generated"]
