"""The package of a node in C++, without a compiler: what stands in its table, and which systems have one."""

from __future__ import annotations

import ast
import re
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.core.request import Request
from fusesoc_firm.message.library import libraries
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.node.package.cpp_package import HEADERS, cpp_package, generated_files, headers
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import accelerator, converter, instance, messages, specification

SPECS = Path(__file__).parents[2] / "specs"
# As `rosmsg md5` has them, and the hash as `ros2 topic info --verbose` shows it.
QUATERNION_MD5 = "a779879fadf0160734f906b8c19c7004"
RANGE_HASH = "RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"


def load(spec: Path, *paths: Path) -> LoadedSystem:
    return load_system(spec, libraries(list(paths), {}, None), needs_sources=False)


def written(folder: Path, text: str, *paths: Path) -> LoadedSystem:
    path = folder / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    return load(path, *paths)


def rows(source: str) -> list[tuple[str, ...]]:
    """Id, name, type and signature of each topic in a table."""
    *found, diagnostics = re.findall(r'^ +(\d+|\{\}), "(.*)", "(.*)",\n +"(.*)",', source, re.MULTILINE)
    assert diagnostics[:2] == ("{}", "/diagnostics")
    return found


def definition(source: str, constant: str) -> str:
    """The text of a definition: its literals are also Python's."""
    literals = source.partition(f"{constant}[] =\n")[2].partition(";\n")[0]
    return b"".join(ast.literal_eval("b" + line.strip().replace("\\?", "?")) for line in literals.split("\n")).decode()


def loop(name: str, message: str, ros: str) -> str:
    """Two converters with nothing between."""
    return converter(f"{name}_in", "subscriber", message, f"{name}_out", ros=ros) + converter(
        f"{name}_out", "publisher", message, ros=ros
    )


def test_the_table_of_a_node_for_ros_1() -> None:
    files = cpp_package(load(SPECS / "quat2euler/quat2euler.yaml"))
    source = files["src/quat2euler_node.cpp"]
    assert rows(source)[0] == ("0", "QuaternionToEuler_sub", "geometry_msgs/Quaternion", QUATERNION_MD5)
    assert [row[1] for row in rows(source)] == ["QuaternionToEuler_sub", "QuaternionToEuler_pub"]
    assert "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n" in definition(source, "kGeometryMsgsQuaternion")
    assert "run<firm::Ros1>" in source
    assert "<depend>roscpp</depend>" in files["package.xml"] and files["package.xml"].count("<exec_depend>") == 1
    assert "find_package(catkin" in files["CMakeLists.txt"]
    assert "include/firm/ros1.hpp" in files and "include/firm/ros2.hpp" not in files


def test_the_table_of_a_node_for_ros_2() -> None:
    files = cpp_package(load(SPECS / "obstacle/obstacle.yaml"))
    source = files["src/obstacle_node.cpp"]
    assert rows(source)[0] == ("0", "distance", "sensor_msgs/msg/Range", RANGE_HASH)
    assert "run<firm::Ros2>" in source and 'R"' not in source
    for line in (
        "<depend>rcl</depend>",
        "<exec_depend>sensor_msgs</exec_depend>",
        "<build_type>ament_cmake</build_type>",
    ):
        assert line in files["package.xml"]
    assert "rcl::rcl" in files["CMakeLists.txt"]
    assert "include/firm/ros2.hpp" in files and "include/firm/ros1.hpp" not in files


def test_a_package_is_named_once(tmp_path: Path) -> None:
    """The library of a node for ROS 2 needs a package of messages as well."""
    text = specification(loop("state", "lifecycle_msgs/State", "ROS2"))
    listed = cpp_package(written(tmp_path, text))["package.xml"]
    assert listed.count("depend>lifecycle_msgs<") == 1


@pytest.mark.parametrize("topic", ["/arm/left", "arm/left", "groundtruth"])
def test_a_topic_of_its_own_name_keeps_it(tmp_path: Path, topic: str) -> None:
    """ROS resolves a relative one; a block's name is one, also where VHDL would not have it."""
    text = specification(loop("point", "Point", "ROS").replace("mode: subscriber", f"topic: {topic}, mode: subscriber"))
    source = cpp_package(written(tmp_path, text.replace("point_out", "out")))["src/robot_node.cpp"]
    assert [row[1] for row in rows(source)] == [topic, "out"]


def test_the_files_say_nothing_of_when_and_where(tmp_path: Path) -> None:
    copies = []
    for name in ("one", "other"):
        shutil.copytree(SPECS / "multi_type", tmp_path / name)
        copies.append(cpp_package(load(tmp_path / name / "multi_type.yaml")))
    assert copies[0] == copies[1]


def test_all_that_is_included_is_there() -> None:
    files = cpp_package(load(SPECS / "quat2euler/quat2euler.yaml"))
    sources = [text for path, text in files.items() if path.endswith(("pp", ".h"))]
    included = {name for text in sources for name in re.findall(r"#include <(firm/.*)>", text)}
    assert included and {f"include/{name}" for name in included} <= {*files}


@pytest.mark.parametrize("spec", ["quat2euler/quat2euler.yaml", "obstacle/obstacle.yaml"])
def test_the_headers_are_those_of_the_product(spec: str) -> None:
    """Where ROS is, packages are compiled with a header that is compiled from those, once for all."""
    files = cpp_package(load(SPECS / spec))
    product = {f"include/{path.relative_to(HEADERS)}": path.read_bytes() for path in headers()}
    package = {path: text.encode() for path, text in files.items() if path.startswith("include/")}
    assert len(package) > 10
    assert package == {path: product[path] for path in package}


def test_a_definition_may_hold_what_ends_a_string_or_a_line(tmp_path: Path) -> None:
    folder = tmp_path / "odd_msgs/msg"
    folder.mkdir(parents=True)
    odd = 'string END = a)msg" b\\n ??/ \f c \v d \x85 e \u2028 \u00e9 // */ \n'
    (folder / "Odd.msg").write_text(f"{odd}uint8 x\n", encoding="utf-8", newline="")
    text = specification(loop("odd", "odd_msgs/Odd", "ROS"))
    source = cpp_package(written(tmp_path, text, tmp_path / "odd_msgs"))["src/robot_node.cpp"]
    assert source.isascii() and "??/" not in source
    shown = definition(source, "kOddMsgsOdd")
    assert shown == f"# odd_msgs/Odd (ROS 1)\n\n{odd.rstrip()}\n\nuint8 x\n"


def test_nested_messages_are_part_of_a_definition() -> None:
    source = cpp_package(load(SPECS / "multi_type/multi_type.yaml"))["src/multi_type_node.cpp"]
    twist = definition(source, "kGeometryMsgsTwistStamped")
    separator = "\n" + "=" * 80 + "\nMSG: "
    assert sorted(part.splitlines()[0] for part in twist.split(separator)[1:]) == [
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
        "std_msgs/Header",
    ]


@pytest.mark.parametrize(
    ("text", "ros", "message"),
    [
        (
            specification(loop("one", "Point", "ROS") + loop("two", "Vector3", "ROS2")),
            None,
            "the topics of 'robot' use ROS 1 and ROS 2, but a C++ node supports only one ROS version",
        ),
        (specification(loop("one", "Point", "ROS")), 2, "the topics of 'robot' use ROS 1, not ROS 2"),
        (specification(loop("one", "Point", "ROS2")), 1, "the topics of 'robot' use ROS 2, not ROS 1"),
    ],
)
def test_what_no_node_can_serve_is_refused(tmp_path: Path, text: str, ros: int | None, message: str) -> None:
    loaded = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        cpp_package(loaded, middleware_of(ros) if ros else None)
    assert messages(caught.value) == [message]


def test_blocks_in_software_have_ids_of_their_own(tmp_path: Path) -> None:
    """A topic goes to hardware and software, software to a topic and to hardware, which goes to software."""
    blocks = (
        converter("sub", "subscriber", "Point", "hard", "think")
        + instance("think", "thinker", "late", "pub")
        + instance("hard", "actor", "idle")
        + instance("idle", "idler", "rest")
        + instance("late", "actor", "last")
        + "".join(converter(name, "publisher", "Point") for name in ("pub", "rest", "last"))
    )
    types = accelerator("actor", "Point", "Point")
    types += "".join(accelerator(name, "Point", "Point", "ROS-SW", f"{name}.py") for name in ("thinker", "idler"))
    loaded = written(tmp_path, specification(blocks, types))
    source = cpp_package(loaded)["src/robot_node.cpp"]
    assert [(row[0], row[1]) for row in rows(source)] == [("0", "sub"), ("0", "last"), ("{}", "pub"), ("{}", "rest")]
    assert "    2,  // subscribers\n    2,  // publishers\n" in source
    ports = re.findall(r'^ +\{ "(.*)", (.*) \},$', source, re.MULTILINE)
    assert ports == [("sub", "{}"), ("", "1"), ("", "1"), ("pub", "{}"), ("rest", "{}")]


def test_a_generated_system_has_its_node_beside_it(tmp_path: Path) -> None:
    shutil.copytree(SPECS / "obstacle", tmp_path / "obstacle")
    request = Request(
        "far",
        "test:sys:obstacle-system:0",
        tmp_path / "obstacle",
        {"spec": "obstacle.yaml", "product": "system", "board": None, "paths": None, "distro": None},
    )
    loaded = GENERATORS["far"].load(request)
    core = loaded.generate()
    node = {path: file for path, file in core.files.items() if path.startswith("node/")}
    assert {path.removeprefix("node/"): file.content for path, file in node.items()} == cpp_package(
        load(tmp_path / "obstacle/obstacle.yaml")
    )
    assert {file.file_type for file in node.values()} == {"user"}
    # An edit of theirs makes the core anew.
    assert {*headers()} <= {*loaded.inputs}


def test_a_generated_system_that_no_node_can_serve_has_none(tmp_path: Path) -> None:
    text = specification(loop("one", "Point", "ROS") + loop("two", "Vector3", "ROS2"))
    assert generated_files(written(tmp_path, text)) == {}
