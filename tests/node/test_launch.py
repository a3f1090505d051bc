"""Launch files and the packages that contain them: in ROS 1 read by roslaunch, in ROS 2 with stand-ins for its API."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import types
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from fusesoc_firm.cli import main
from tests.node.fake_node import loaded
from tests.ros.action_simulator import HERE as ROS_TESTS
from tests.ros.action_simulator import in_ros2
from tests.system.systems import accelerator, converter, instance, specification

PACKAGE = "robot_node"


def system(folder: Path, ros: str, *others: str) -> Path:
    """A specification with a topic of its own; there may be further versions of ROS."""
    blocks = converter("in", "subscriber", "Point", "out", ros=ros).replace("name: in", "name: in, topic: /imu/data", 1)
    blocks += converter("out", "publisher", "Point", ros=ros)
    for other in others:
        blocks += converter("a", "subscriber", "Vector3", "z", ros=other)
        blocks += converter("z", "publisher", "Vector3", ros=other)
    loaded(folder, specification(blocks))
    return folder / "spec.yaml"


def package(folder: Path, ros: str, language: str) -> Path:
    """The package of the node, in a folder with nothing else."""
    (folder / "written").mkdir()
    output = folder / "packages" / PACKAGE
    spec = str(system(folder / "written", ros))
    assert main(["system", "node", spec, "--language", language, "-o", str(output)]) == 0
    return output


@pytest.mark.parametrize("language", ["cpp", "python"])
@pytest.mark.parametrize(
    ("ros", "needed"),
    [("ROS", {"catkin", "roslaunch"}), ("ROS2", {"ament_cmake", "launch_ros", "diagnostic_msgs", "geometry_msgs"})],
)
def test_a_package_names_what_it_needs(tmp_path: Path, language: str, ros: str, needed: set[str]) -> None:
    files = package(tmp_path, ros, language)
    tree = ET.parse(files / "package.xml").getroot()
    libraries = {
        "cpp": {"ROS": ["roscpp"], "ROS2": ["rcl", "rcl_lifecycle", "lifecycle_msgs"]},
        "python": {"ROS": ["rospy"], "ROS2": ["rclpy"]},
    }
    assert {node.text for node in tree if node.tag.endswith("depend")} == {*needed, *libraries[language][ros]}
    lines = (files / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "install(DIRECTORY launch DESTINATION" in lines
    if language == "python":
        assert f"install(PROGRAMS {PACKAGE}.py DESTINATION" in lines
        assert os.access(files / f"{PACKAGE}.py", os.X_OK)


def test_functions_keep_the_node_beside_them(tmp_path: Path) -> None:
    (tmp_path / "soft.py").write_text("def soft(message):\n    return message\n", encoding="utf-8")
    blocks = converter("in", "subscriber", "Point", "turn") + instance("turn", "soft", "out")
    blocks += converter("out", "publisher", "Point")
    blocks += converter("a", "subscriber", "Pose", "z") + converter("z", "publisher", "Pose")
    loaded(tmp_path, specification(blocks, accelerator("soft", "Point", "Point", "ROS-SW", "soft.py")))
    spec, output = str(tmp_path / "spec.yaml"), tmp_path / "node"
    assert main(["system", "node", spec, "--language", "python", "-o", str(output)]) == 0
    lines = (output / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "file(CREATE_LINK" in lines and "PROGRAMS" not in lines


def test_topics_of_two_versions_make_no_package(tmp_path: Path) -> None:
    spec = str(system(tmp_path, "ROS", "ROS2"))
    assert main(["system", "node", spec, "--language", "python", "-o", str(tmp_path / "node")]) == 0
    assert [path.name for path in (tmp_path / "node").iterdir()] == [f"{PACKAGE}.py"]


@pytest.mark.skipif(not shutil.which("roslaunch"), reason="roslaunch is not installed (python3-roslaunch)")
@pytest.mark.parametrize("language", ["cpp", "python"])
def test_roslaunch_reads_the_file(tmp_path: Path, language: str) -> None:
    """The program is a stand-in: `--args` prints how roslaunch would start it."""
    files = package(tmp_path, "ROS", language)
    program = files / (PACKAGE if language == "cpp" else f"{PACKAGE}.py")
    program.touch()
    program.chmod(0o755)
    given = ("transport:=pipe:cat x", "name:=turner", "namespace:=arm", "options:=--restart --drain 7")
    line = launched(tmp_path, "/arm/turner", *given)
    assert 'ROS_NAMESPACE="/arm"' in line
    assert line.endswith(
        f"{program} --transport pipe:cat x --restart --drain 7 /imu/data:=/imu/data out:=out __name:=turner"
    )
    line = launched(tmp_path, "/robot", "transport:=uart:/dev/ttyUSB1:1000000", "in_topic:=raw", "out_topic:=/turned")
    assert line.endswith(f"{program} --transport uart:/dev/ttyUSB1:1000000 /imu/data:=raw out:=/turned __name:=robot")


@pytest.mark.skipif(not shutil.which("roslaunch"), reason="roslaunch is not installed (python3-roslaunch)")
def test_roslaunch_renames_services_and_actions(tmp_path: Path) -> None:
    line = launched(tmp_path, "/arm", "transport:=x", "count_action:=/left/count", package=served(tmp_path, "arm", 1))
    ends = ("goal", "cancel", "status", "feedback", "result")
    assert " ".join(f"count/{end}:=/left/count/{end}" for end in ends) in line
    package = served(tmp_path, "camera", 1)
    line = launched(tmp_path, "/camera", "transport:=x", "set_camera_info_service:=store", package=package)
    assert " set_camera_info:=store" in line


def test_ros_2_renames_services_and_actions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ends = ("feedback", "status", "send_goal", "cancel_goal", "get_result")
    renamed = [(f"count/_action/{end}", f"/left/count/_action/{end}") for end in ends]
    package = served(tmp_path, "arm", 2)
    (node,) = described(tmp_path, package, {"transport": "x", "count_action": "/left/count"}, monkeypatch)
    assert sorted(node["remappings"]) == sorted(renamed)
    package = served(tmp_path, "camera", 2)
    (node,) = described(tmp_path, package, {"transport": "x", "set_camera_info_service": "store"}, monkeypatch)
    assert node["remappings"] == [("set_camera_info", "store")]


def served(folder: Path, system: str, version: int) -> str:
    """The package of the node of tests/ros/arm or tests/ros/camera."""
    shutil.copytree(ROS_TESTS / system, folder / system, dirs_exist_ok=True)
    spec = folder / system / f"{system}.yaml"
    if version == 2:
        text = in_ros2(spec.read_text(encoding="utf-8"))
        spec.write_text(text.replace("SetCameraInfoRe", "SetCameraInfo_Re"), encoding="utf-8")
    output = folder / "packages" / f"{system}_node"
    assert main(["system", "node", str(spec), "--language", "cpp", "--ros", str(version), "-o", str(output)]) == 0
    (output / f"{system}_node").touch(0o755)
    return f"{system}_node"


def launched(folder: Path, node: str, *arguments: str, package: str = PACKAGE) -> str:
    file = f"{package.removesuffix('_node')}.launch"
    environment = {**os.environ, "ROS_PACKAGE_PATH": str(folder / "packages"), "ROS_HOME": str(folder / "home")}
    command = ["roslaunch", "--args", node, package, file, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def stand_ins(values: Mapping[str, str]) -> dict[str, types.ModuleType]:
    """The part of ros2/launch and ros2/launch_ros that the file uses, with these arguments on the command line."""

    def declared(name: str, default_value: str | None = None, description: str = "") -> tuple[str, str]:
        found = values.get(name, default_value)
        assert found is not None, f"{name} needs a value ({description})"
        return name, found

    class Configuration:
        def __init__(self, name: str) -> None:
            self.name = name

        def perform(self, context: Mapping[str, str]) -> str:
            return context[self.name]

    def described(entities: list[Any]) -> list[dict[str, Any]]:
        functions = [entity for entity in entities if callable(entity)]
        context = dict(entity for entity in entities if not callable(entity))
        assert {*values} <= {*context}
        return [node for function in functions for node in function(context)]

    def opaque(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return function

    names: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": described},
        "launch.actions": {"DeclareLaunchArgument": declared, "OpaqueFunction": opaque},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": dict},
    }
    made = {name: types.ModuleType(name) for name in names}
    for name, members in names.items():
        vars(made[name]).update(members)
    return made


def described(
    folder: Path, package: str, values: Mapping[str, str], monkeypatch: pytest.MonkeyPatch
) -> list[dict[str, Any]]:
    """The nodes that a launch file of ROS 2 starts."""
    (file,) = (folder / "packages" / package / "launch").iterdir()
    text = file.read_text(encoding="utf-8")
    ast.parse(text, feature_version=(3, 8))
    for name, module in stand_ins(values).items():
        monkeypatch.setitem(sys.modules, name, module)
    names: dict[str, Any] = {}
    exec(compile(text, file.name, "exec"), names)
    found: list[dict[str, Any]] = names["generate_launch_description"]()
    return found


@pytest.mark.parametrize("language", ["cpp", "python"])
def test_ros_2_starts_the_node(tmp_path: Path, language: str, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path, "ROS2", language)
    values = {"transport": "pipe:cat 'a  b'", "namespace": "arm", "options": "--trace 'a b.csv'", "in_topic": "raw"}
    assert described(tmp_path, PACKAGE, values, monkeypatch) == [
        {
            "package": PACKAGE,
            "executable": PACKAGE if language == "cpp" else f"{PACKAGE}.py",
            "name": "robot",
            "namespace": "arm",
            "output": "screen",
            "arguments": ["--transport", "pipe:cat 'a  b'", "--trace", "a b.csv"],
            "remappings": [("/imu/data", "raw"), ("out", "out")],
        }
    ]
