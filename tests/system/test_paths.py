"""The places where a system's messages are searched, by every command and by the build alike."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.node.transport.built_simulator import CoreSources, _write_core
from tests.message.test_bag_definitions import record

SPEC = """\
project: {{name: robot}}
{paths}accelerators:
  - name: acc
    type: VHDL
    sources: acc.vhd
    interface:
      input:  [{{middleware: ROS2, message: thing_msgs/Thing}}]
      output: [{{middleware: ROS2, message: thing_msgs/Thing}}]
blocks:
  - {{name: a, middleware: ROS2, mode: subscriber, message: thing_msgs/Thing, outgoing: [{{name: c}}]}}
  - {{name: c, type: acc, outgoing: [{{name: b}}]}}
  - {{name: b, middleware: ROS2, mode: publisher, message: thing_msgs/Thing}}
"""
CORE = """\
CAPI=2:
name: me:sys:robot:1.0
generate:
  system: {{generator: far, parameters: {{spec: robot.yaml{parameters}}}}}
targets: {{default: {{}}}}
"""
TEXT = "uint8 found_{}\n"

Captured = pytest.CaptureFixture[str]


class Project:
    """A specification, the core beside it, and a place with the message under each way to define it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.spec = root / "robot.yaml"
        for name in ("spec", "option", "core"):
            (root / f"{name}/thing_msgs/msg").mkdir(parents=True)
            (root / f"{name}/thing_msgs/msg/Thing.msg").write_text(TEXT.format(name))

    def write(self, paths: str = "", parameters: str = "") -> None:
        self.spec.write_text(SPEC.format(paths=f"paths: {paths}\n" if paths else ""))
        (self.root / "robot.core").write_text(CORE.format(parameters=parameters))

    def run(self, capsys: Captured, *words: str) -> str:
        assert main(list(words)) == 0, capsys.readouterr().err
        return capsys.readouterr().out

    def shown(self, capsys: Captured, *options: str) -> str:
        return self.run(capsys, "system", "show", str(self.spec), *options)

    def generated(self) -> str:
        (self.root / "acc.vhd").touch()
        is_in_core = "core]" in (self.root / "robot.core").read_text()
        given = {"spec": "robot.yaml"} | ({"paths": ["core"]} if is_in_core else {})
        call = GeneratorCall("far", "me:p:a-b:1.0", str(self.root), given)
        request = make_request(call, GENERATORS["far"].parameters, lambda _: ())
        return str(GENERATORS["far"].load(request).generate().files["robot_system.vhd"].content)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    # Elsewhere than the specification, which its paths are relative to.
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "project").mkdir()
    return Project(tmp_path / "project")


def test_the_order_is_that_of_a_build(project: Project, capsys: Captured) -> None:
    (project.root / "acc.vhd").touch()
    project.write(parameters=", paths: [core]")
    assert "found_core" in project.shown(capsys)
    assert "found_core" in project.generated()
    option = ("--path", str(project.root / "option"))
    assert "found_option" in project.shown(capsys, *option)
    project.write("[spec]", ", paths: [core]")
    assert "found_spec" in project.shown(capsys)
    assert "found_spec" in project.shown(capsys, *option)
    assert "found_spec" in project.generated()
    # A core of another specification says nothing.
    project.write(parameters=", paths: [core]")
    shutil.copy(project.spec, project.root / "other.yaml")
    assert main(["system", "check", str(project.root / "other.yaml")]) == 1
    assert (
        "source its ROS workspace, or add its folder with 'paths' in the specification or core, or with --path"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("kind", ["folder", "sqlite3", "mcap"])
def test_every_command_finds_the_messages(
    project: Project, capsys: Captured, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    bag = "" if kind == "folder" else record(project.root, kind, {"thing_msgs/msg/Thing": TEXT.format("spec")}).name
    project.write(f"[{bag or 'spec'}]")
    (project.root / "robot.core").unlink()
    spec = str(project.spec)
    assert "acc.vhd" in project.run(capsys, "system", "skeleton", spec)
    assert "in_found_spec" in (project.root / "acc.vhd").read_text()
    assert "is valid" in project.run(capsys, "system", "check", spec)
    assert "found_spec" in project.shown(capsys)
    assert "thing_msgs/Thing" in project.run(capsys, "system", "diagram", spec, "--format", "dot")
    assert "generated for each line" in project.run(capsys, "system", "report", spec)
    for language in ("cpp", "python"):
        node = project.run(capsys, "system", "node", spec, "--language", language, "-o", str(project.root / language))
        files = [path.read_text() for path in Path(node.strip()).rglob("*") if path.is_file()]
        assert any("thing_msgs" in text for text in files)
    project.run(capsys, "system", "core", spec)
    assert "found_spec" in project.generated()
    # The core that is written for a simulator.
    written = _write_core(project.spec, project.root / "live", CoreSources())
    assert "robot_system" in written.path.read_text()
    # And the wizard, which extends what is right.
    monkeypatch.setattr("sys.stdin", io.StringIO("no\nno\n\n"))
    assert project.run(capsys, "system", "new", spec).count("is valid") == 2


def test_the_distribution_is_that_of_the_core(project: Project, capsys: Captured) -> None:
    # `service_msgs` came after Humble.
    text = SPEC.format(paths="").replace("thing_msgs/Thing", "service_msgs/ServiceEventInfo")
    (project.root / "acc.vhd").touch()
    project.write(parameters=", distro: humble")
    project.spec.write_text(text)
    assert main(["system", "check", str(project.spec)]) == 1
    assert "rosbags ros2_humble" in capsys.readouterr().err
    project.shown(capsys, "--distro", "jazzy")
