"""Messages as cores: definitions for the cores that depend on the one that carries them, as FuseSoC runs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root

BASE = """\
CAPI=2:
name: me:msgs:base:1.0
filesets: {base: {depend: ["robot:firm:generators"]}}
generate: {messages: {generator: firm_messages, parameters: {paths: [msg]}}}
targets: {default: {filesets: [base], generate: [messages]}}
"""
ARM = """\
CAPI=2:
name: me:msgs:arm:1.0
filesets: {base: {depend: ["robot:firm:generators", "me:msgs:base"]}}
generate: {messages: {generator: firm_messages, parameters: {paths: [.], messages: [me:msgs:base]}}}
targets: {default: {filesets: [base], generate: [messages]}}
"""
TOP = """\
CAPI=2:
name: me:p:top:1.0
filesets: {base: {depend: ["robot:firm:generators", "me:msgs:arm"]}}
generate: {pose: {generator: firm, parameters: {message: arm_msgs/Pose, ros: 2, messages: [me:msgs:arm]}}}
targets:
  default: {filesets: [base], generate: [pose], toplevel: x, flow: generic, flow_options: {tool: yosys, arch: ice40}}
"""
FILES = {
    "base/base.core": BASE,
    "base/msg/base_msgs/msg/Angle.msg": "uint16 milliradians\n",
    "arm/arm.core": ARM,
    "arm/arm_msgs/msg/Pose.msg": "base_msgs/Angle base\nbase_msgs/Angle elbow\n",
    "top/top.core": TOP,
}


class Project:
    """Three cores, each in a folder of its own, and FuseSoC's set-up of the last."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for name, text in FILES.items():
            self.write(name, text)
        places = {"p": ".", "firm": library_root() / "generators", "cores": library_root() / "cores"}
        self.write("fusesoc.conf", "".join(f"[library.{name}]\nlocation = {place}\n" for name, place in places.items()))

    def write(self, name: str, text: str) -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def set_up(self) -> subprocess.CompletedProcess[str]:
        fusesoc = shutil.which("fusesoc", path=str(Path(sys.executable).parent))
        assert fusesoc
        return subprocess.run(
            [fusesoc, "run", "--setup", "--build-root", str(self.root.parent / "build"), "me:p:top"],
            cwd=self.root,
            capture_output=True,
            text=True,
            check=False,
            env=os.environ
            | {
                "FUSESOC_FIRM_PYTHON": sys.executable,
                "PYTHONPATH": str(library_root().parents[1]),
                "FUSESOC_FIRM_CACHE": str(self.root.parent / "store"),
                "HOME": str(self.root.parent),
            },
        )

    def origins(self) -> dict[str, str]:
        """What was generated, and what came from the store."""
        done = self.set_up()
        assert done.returncode == 0, done.stderr
        lines = [
            line.split() for line in done.stdout.splitlines() if line.startswith(("firm: ", "far: ", "firm_messages: "))
        ]
        return {words[1]: words[2] for words in lines}

    def converter(self) -> str:
        (path,) = (self.root.parent / "build").rglob("src/*/axis_to_arm_msgs_pose.vhd")
        return path.read_text()


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path / "project")


def test_messages_of_a_core_and_of_those_behind_it_are_found(project: Project) -> None:
    made = {"base-messages": "generated", "arm-messages": "generated", "top-pose": "generated"}
    assert project.origins() == made
    assert "elbow_milliradians : out std_logic_vector(15 downto 0)" in " ".join(project.converter().split())
    assert project.origins() == dict.fromkeys(made, "from")
    project.write("base/msg/base_msgs/msg/Angle.msg", "uint32 milliradians\n")
    assert project.origins() == made
    assert "elbow_milliradians : out std_logic_vector(31 downto 0)" in " ".join(project.converter().split())


def test_a_copied_definition_is_of_no_template(project: Project, capsys: pytest.CaptureFixture[str]) -> None:
    project.origins()
    (path,) = (project.root.parent / "build").rglob("generator_cache/me_msgs_base*/base_msgs/msg/Angle.msg")
    assert main(["why", str(path)]) == 1
    assert "does not come from a template\n      = it is a copy of " in capsys.readouterr().err


def test_a_core_that_is_not_depended_on_has_no_messages_here(project: Project) -> None:
    assert project.set_up().returncode == 0
    # Those of the run before are still there.
    project.write("top/top.core", TOP.replace(', "me:msgs:arm"', ""))
    done = project.set_up()
    assert done.returncode != 0
    assert f"{project.root}/top/top.core:4:" in done.stderr + done.stdout
    assert "core 'me:msgs:arm' provides no messages" in done.stderr + done.stdout


@pytest.mark.check
def test_a_core_of_a_similar_name_is_another_one(project: Project) -> None:
    """FuseSoC's folders have names in which a core's and an instance's cannot be told apart."""
    similar = (
        BASE.replace("me:msgs:base", "me:msgs:arm-messages")
        .replace("messages: {", "again: {")
        .replace("[messages]", "[again]")
    )
    project.write("similar/similar.core", similar)
    project.write("similar/msg/arm_msgs/msg/Other.msg", "uint8 a\n")
    top = TOP.replace('"me:msgs:arm"]}}', '"me:msgs:arm", "me:msgs:arm-messages"]}}').replace(
        "arm_msgs/Pose", "arm_msgs/Other"
    )
    project.write("top/top.core", top)
    done = project.set_up()
    assert done.returncode != 0
    assert "unknown message 'arm_msgs/Other'" in done.stderr + done.stdout


def test_a_core_without_messages_is_a_fault(project: Project) -> None:
    project.write("base/empty/a.txt", "")
    project.write("base/base.core", BASE.replace("[msg]", "[empty]"))
    done = project.set_up()
    assert done.returncode != 0
    assert "base-messages has no messages" in done.stderr + done.stdout


def test_without_a_run_they_are_found_where_they_lie(
    project: Project, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(project.root)
    monkeypatch.setenv("HOME", str(project.root.parent))
    assert main(["lock", "me:p:top"]) == 0
    lock = yaml.safe_load((project.root / "top/top.lock").read_text())
    assert list(lock["messages"]) == ["arm_msgs/Pose (ROS 2)", "base_msgs/Angle (ROS 2)"]
    project.write("top/top.core", TOP.replace("messages: [me:msgs:arm]", "messages: [me:p:top]"))
    capsys.readouterr()
    assert main(["lock", "me:p:top"]) == 1
    assert "'me:p:top' is not a known core with messages" in capsys.readouterr().err


# --- by a specification -------------------------------------------------------------------------------------------

SPECIFICATION = """\
project: {name: robot}
paths: ["me:msgs:arm"]
blocks:
  - {name: a, middleware: ROS2, mode: subscriber, message: arm_msgs/Pose, outgoing: [{name: b}]}
  - {name: b, middleware: ROS2, mode: publisher, message: arm_msgs/Pose}
"""
SYSTEM = TOP.replace("robot:firm:generators", "robot:firm:firm_system").replace(
    "pose: {generator: firm, parameters: {message: arm_msgs/Pose, ros: 2, messages: [me:msgs:arm]}}",
    "pose: {generator: far, parameters: {spec: robot.yaml}}",
)


def test_a_specification_names_cores_for_the_build_and_for_commands(
    project: Project, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project.write("top/robot.yaml", SPECIFICATION)
    project.write("top/top.core", SYSTEM)
    made = {"base-messages": "generated", "arm-messages": "generated", "top-pose": "generated"}
    assert project.origins() == made
    assert "elbow_milliradians : out std_logic_vector(15 downto 0)" in " ".join(project.converter().split())
    assert project.origins() == dict.fromkeys(made, "from")
    project.write("base/msg/base_msgs/msg/Angle.msg", "uint32 milliradians\n")
    assert project.origins() == made
    # Without a run, FuseSoC's libraries are searched.
    monkeypatch.chdir(project.root)
    monkeypatch.setenv("HOME", str(project.root.parent))
    spec = project.root / "top/robot.yaml"
    assert main(["system", "check", str(spec)]) == 0
    assert main(["lock", "me:p:top"]) == 0
    lock = yaml.safe_load((project.root / "top/top.lock").read_text())
    assert list(lock["messages"]) == ["arm_msgs/Pose (ROS 2)", "base_msgs/Angle (ROS 2)"]
    capsys.readouterr()
    assert main(["system", "core", str(spec), "-o", str(project.root / "new.core")]) == 0
    assert "me:msgs:arm" in (project.root / "new.core").read_text()
    # The system's core does not depend on it.
    project.write("top/top.core", SYSTEM.replace(', "me:msgs:arm"', ""))
    done = project.set_up()
    assert done.returncode != 0
    assert f"{spec}:2:9: error: core 'me:msgs:arm' provides no messages" in done.stderr + done.stdout
    spec.write_text(SPECIFICATION.replace("me:msgs:arm", "me:msgs:none"))
    capsys.readouterr()
    assert main(["system", "check", str(spec)]) == 1
    assert f"{spec}:2:9: error: 'me:msgs:none' is not a known core with messages" in capsys.readouterr().err
