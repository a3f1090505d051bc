"""The text of a message's package; what its constants are worth is for tests/converter/simulated/test_constants.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.converter.converter_core import load
from fusesoc_firm.converter.sources import constants_sources
from fusesoc_firm.core.request import Plain, Request
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from tests.expected import check_expected
from tests.frame.oracle import parsed

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
LONGEST_LINE = 120
GOLDEN = Path(__file__).parent / "golden"

KINDS = """\
uint8 IN=1
bool YES=true
uint64 WIDE=4294967296
float32 HALF=0.5
string NAME=a\t\N{EURO SIGN}
wstring EMPTY=""
Inner inner
Inner[2] pair
"""
TEXTS = {"awkward_msgs/Kinds": KINDS, "awkward_msgs/Inner": "int8 LOW=-1\nint8 value\n"}


def text_of(ros: Middleware, name: str) -> str:
    message = parse_name(name)
    definitions = parsed(TEXTS, ros) if name in TEXTS else LIBRARIES[ros].closure(message)
    (file,) = constants_sources([(message, definitions)])
    assert file.path == f"{name.replace('/', '_').lower()}_pkg.vhd"
    return file.text


@pytest.mark.parametrize(
    ("ros", "name"),
    [
        (ROS1, "diagnostic_msgs/DiagnosticStatus"),
        (ROS1, "bond/Constants"),
        (ROS1, "sensor_msgs/PointCloud2"),
        (ROS2, "geometry_msgs/Point"),
        (ROS2, "awkward_msgs/Kinds"),
    ],
)
def test_golden_files(ros: Middleware, name: str) -> None:
    file = f"ros{ros.number}_{name.replace('/', '_').lower()}_pkg.vhd"
    check_expected(GOLDEN / file, text_of(ros, name))


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_the_text_is_clean(ros: Middleware) -> None:
    for name in LIBRARIES[ros].names():
        text = text_of(ros, str(name))
        code = re.sub(r"--.*", "", text)
        assert text.isascii()
        assert text.endswith("end package;\n")
        assert not re.search(r"__|\w_\b|\t", code), name
        assert not re.search(r"[ \t]$", text, re.MULTILINE), name
        assert "\n\n\n" not in text
        assert "{{" not in text
        # A declaration is as long as its name.
        rest = [line for line in text.splitlines() if not line.startswith("  constant ")]
        assert max(map(len, rest)) <= LONGEST_LINE, name


def test_a_message_without_constants_has_its_signature() -> None:
    definitions = LIBRARIES[ROS2].closure(parse_name("geometry_msgs/Point"))
    assert f'"{signature(parse_name("geometry_msgs/Point"), definitions)}"' in text_of(ROS2, "geometry_msgs/Point")


def test_long_names_put_their_comments_above() -> None:
    long = "A" * 50
    name = parse_name("my_msgs/Long")
    definitions = parsed({"my_msgs/Long": f"uint64 {long}=1\nuint8 B=2\n"}, ROS1)
    (file,) = constants_sources([(name, definitions)])
    lines = file.text.splitlines()
    assert f"  -- uint64 {long}=1" in lines
    assert f'  constant B{" " * 49} : std_logic_vector(7 downto 0)  := x"02";' in lines
    assert max(map(len, lines)) <= LONGEST_LINE


def test_the_versions_of_one_message_have_packages_of_two_names() -> None:
    name = parse_name("std_msgs/Header")
    files = list(constants_sources([(name, LIBRARIES[ros].closure(name)) for ros in (ROS1, ROS2)]))
    assert [file.path for file in files] == ["std_msgs_header_ros1_pkg.vhd", "std_msgs_header_ros2_pkg.vhd"]
    assert all(f"package {file.path.removesuffix('.vhd')} is\n" in file.text for file in files)


def test_the_package_is_the_first_file_of_a_core(tmp_path: Path) -> None:
    parameters: dict[str, Plain] = {"message": "geometry_msgs/Point", "ros": 1, "direction": "both", "width": 8}
    core = load(Request("firm", "me:robots:arm-point:1.0", tmp_path, parameters)).generate()
    assert list(core.files) == [
        "geometry_msgs_point_pkg.vhd",
        "axis_to_geometry_msgs_point.vhd",
        "geometry_msgs_point_to_axis.vhd",
    ]
