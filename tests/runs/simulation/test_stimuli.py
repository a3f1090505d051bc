"""Stimuli out of YAML: what a value may look like, and where each fault is shown."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.stimuli import Stimulus, read_stimuli
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.text.diagnostics import InputError

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}


def frame(message: str, ros: Middleware = ROS1) -> Frame:
    name = parse_name(message)
    return frame_of(name, LIBRARIES[ros].closure(name))


SUBSCRIBERS = (
    Converter("point", frame("geometry_msgs/Point"), 0),
    Converter("byte", frame("std_msgs/UInt8"), 1),
    Converter("long", frame("std_msgs/Int64"), 2),
    Converter("single", frame("std_msgs/Float32"), 3),
    Converter("flag", frame("std_msgs/Bool"), 4),
    Converter("nothing", frame("std_msgs/Empty"), 5),
    Converter("pose", frame("geometry_msgs/PoseWithCovariance"), 6),
    Converter("state", frame("geometry_msgs/Pose", ROS2), 7),
)


def read(folder: Path, text: str) -> list[Stimulus]:
    path = folder / "stimuli.yaml"
    path.write_text(text, encoding="utf-8")
    return read_stimuli(path, SUBSCRIBERS)


def value(folder: Path, block: str, word: str) -> Any:
    (stimulus,) = read(folder, f"- {block}: {{data: {word}}}\n")
    return stimulus.message["data"]


def faults(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as raised:
        read(folder, text)
    return str(raised.value).replace(f"{folder}/", "")


def test_messages_come_in_order_with_their_payload(tmp_path: Path) -> None:
    found = read(
        tmp_path, "- point: {x: 1, y: 2.5, z: -3}\n- byte: {data: 7}\n- point: {z: 0, y: 0, x: 0}\n- nothing:\n"
    )
    assert [item.subscriber.block for item in found] == ["point", "byte", "point", "nothing"]
    assert [item.payload for item in found] == [struct.pack("<3d", 1, 2.5, -3), b"\x07", bytes(24), b""]
    assert found[0].message == {"x": 1.0, "y": 2.5, "z": -3.0}


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_what_the_subscriber_has_no_port_for_may_be_left_out(ros: Middleware, tmp_path: Path) -> None:
    """Numbers, texts and arrays, and parts of the elements of an array; what is given is sent."""
    name = parse_name("sensor_msgs/PointCloud2")
    whole = frame_of(name, LIBRARIES[ros].closure(name))
    used = select(whole, {"width": None, "fields.offset": None})
    path = tmp_path / "stimuli.yaml"
    path.write_text("- cloud: {width: 7, height: 3, fields: [{offset: 4}, {offset: 8, name: y}]}\n", encoding="utf-8")
    (stimulus,) = read_stimuli(path, [Converter("cloud", used, 0)])
    assert decode(whole, stimulus.payload) == stimulus.message
    assert (stimulus.message["width"], stimulus.message["height"], stimulus.message["data"]) == (7, 3, b"")
    assert [(part["offset"], part["name"], part["count"]) for part in stimulus.message["fields"]] == [
        (4, "", 0),
        (8, "y", 0),
    ]
    path.write_text("- cloud: {height: 3, fields: [{name: y}]}\n", encoding="utf-8")
    (stimulus,) = read_stimuli(path, [Converter("cloud", used, 0)])
    assert (stimulus.message["width"], stimulus.message["height"]) == (0, 3)
    assert [(part["offset"], part["name"]) for part in stimulus.message["fields"]] == [(0, "y")]


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_field_may_be_left_out(ros: Middleware, tmp_path: Path) -> None:
    """Of messages of fixed and variable size, with ports for all fields; alone or together."""
    path = tmp_path / "stimuli.yaml"
    for message in (
        "sensor_msgs/Imu",
        "sensor_msgs/PointCloud2",
        "diagnostic_msgs/DiagnosticArray",
        "nav_msgs/Odometry",
    ):
        subscriber = Converter("sub", frame(message, ros), 0)
        path.write_text("- sub:\n- sub: {}\n- sub: {header: {frame_id: map}}\n", encoding="utf-8")
        nothing, empty, named = read_stimuli(path, [subscriber])
        assert nothing == empty
        assert not any(byte for byte in nothing.payload[len(subscriber.frame.prefix) :] if byte not in (0, 1))
        assert named.message == {**empty.message, "header": {**empty.message["header"], "frame_id": "map"}}
    path.write_text("- sub: {status: [{name: a, values: [{key: k}, {}]}, {level: 2}]}\n", encoding="utf-8")
    (stimulus,) = read_stimuli(path, [Converter("sub", frame("diagnostic_msgs/DiagnosticArray", ros), 0)])
    first, second = stimulus.message["status"]
    assert first["values"] == [{"key": "k", "value": ""}, {"key": "", "value": ""}]
    assert (first["name"], second["name"], second["level"], second["values"]) == ("a", "", 2, [])


def test_what_is_left_out_of_a_fixed_message_is_its_default(tmp_path: Path) -> None:
    used = select(frame("geometry_msgs/Pose", ROS2), {"position.y": None})
    path = tmp_path / "stimuli.yaml"
    path.write_text("- pose: {position: {y: 2, x: 1}}\n", encoding="utf-8")
    (stimulus,) = read_stimuli(path, [Converter("pose", used, 0)])
    assert stimulus.payload == b"\0\1\0\0" + struct.pack("<7d", 1, 2, *5 * [0])


def test_ros2_has_its_header(tmp_path: Path) -> None:
    text = "- state: {position: {x: 0, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}\n"
    (stimulus,) = read(tmp_path, text)
    assert stimulus.payload == b"\0\1\0\0" + bytes(48) + struct.pack("<d", 1)


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("1e-3", 1e-3),  # text to PyYAML
        ("1E3", 1000.0),
        ("-4", -4.0),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("1_000.5", 1000.5),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("inf", math.inf),
    ],
)
def test_floats(tmp_path: Path, word: str, expected: float) -> None:
    (stimulus,) = read(tmp_path, f"- point: {{x: {word}, y: 0, z: 0}}\n")
    assert stimulus.message["x"] == expected


def test_a_float32_is_rounded(tmp_path: Path) -> None:
    assert value(tmp_path, "single", "1e-1") == struct.unpack("<f", struct.pack("<f", 0.1))[0]


@pytest.mark.parametrize("word", [".nan", ".NaN", "nan"])
def test_not_a_number(tmp_path: Path, word: str) -> None:
    (stimulus,) = read(tmp_path, f"- single: {{data: {word}}}\n")
    assert stimulus.payload == b"\0\0\xc0\x7f"


@pytest.mark.parametrize(
    ("block", "word", "expected"),
    [
        ("byte", "0", 0),
        ("byte", "255", 255),
        ("byte", "0xff", 255),
        ("byte", "0b101", 5),
        ("long", "-9223372036854775808", -(2**63)),
        ("long", "9_000", 9000),
        ("flag", "true", True),
        ("flag", "False", False),
    ],
)
def test_integers_and_booleans(tmp_path: Path, block: str, word: str, expected: int) -> None:
    assert value(tmp_path, block, word) == expected


@pytest.mark.parametrize(
    ("block", "word", "message", "hint"),
    [
        ("byte", "256", "'data' must be of type uint8, not '256'", "legal here: 0 to 255"),
        ("byte", "-1", "'data' must be of type uint8, not '-1'", "legal here: 0 to 255"),
        ("byte", "1.0", "'data' must be of type uint8, not '1.0'", "legal here: 0 to 255"),
        ("byte", "017", "'data' must be of type uint8, not '017'", "legal here: 0 to 255"),
        ("byte", "true", "'data' must be of type uint8, not 'true'", "legal here: 0 to 255"),
        ("byte", "'7'", "'data' must be of type uint8, not '7'", ""),
        ("byte", "[7]", "'data' must be of type uint8, not a list", ""),
        ("byte", "", "'data' must be of type uint8, not nothing", ""),
        (
            "long",
            "9223372036854775808",
            "'data' must be of type int64",
            "legal here: -9223372036854775808 to 9223372036854775807",
        ),
        (
            "single",
            "one",
            "'data' must be of type float32, not 'one'",
            "legal here: numbers such as 1, -0.5, 1e-3, .inf, .nan",
        ),
        ("single", "1:30", "'data' must be of type float32, not '1:30'", "legal here: numbers such as"),
        (
            "single",
            "1e39",
            "'data' must be of type float32, not '1e39'",
            "the number is too large; write infinity as .inf",
        ),
        ("flag", "yes", "'data' must be of type bool, not 'yes'", "legal here: true, false"),
        ("flag", "1", "'data' must be of type bool, not '1'", "legal here: true, false"),
    ],
)
def test_a_value_that_does_not_fit(tmp_path: Path, block: str, word: str, message: str, hint: str) -> None:
    text = faults(tmp_path, f"- point: {{x: 0, y: 0, z: 0}}\n- {block}: {{data: {word}}}\n")
    column = len(f"- {block}: {{data: ") + 1
    assert text.startswith(f"stimuli.yaml:2:{column}: error: {message}")
    assert (f"\n      = {hint}" in text) is bool(hint)


def test_a_float64_that_is_too_large(tmp_path: Path) -> None:
    assert "the number is too large" in faults(tmp_path, "- point: {x: 1e400, y: 0, z: 0}\n")


def test_nested_values_and_arrays(tmp_path: Path) -> None:
    covariance = ", ".join(f"{number}e-1" for number in range(36))
    text = f"""\
- pose:
    pose: {{position: &zero {{x: 0, y: 0, z: 0}}, orientation: {{x: 0, y: 0, z: 0, w: 1}}}}
    covariance: [{covariance}]
- point: *zero
"""
    first, second = read(tmp_path, text)
    assert first.message["covariance"][35] == 3.5
    assert first.message["pose"]["orientation"]["w"] == 1.0
    assert second.message == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_every_fault_of_a_file_is_shown_where_it_is(tmp_path: Path) -> None:
    text = faults(
        tmp_path,
        """\
- pont: {x: 0}
- point: {x: 0, Y: zero, z: one}
- pose:
    pose: {position: [], orientation: {x: 0, y: 0, v: 0}}
    covariance: [0, 0]
- point: 5
- point
- point: {x: 0, x: 0, y: 0, z: 0}
- {point: {}, byte: {}}
- [point]: {}
""",
    )
    assert [line for line in text.splitlines() if ": error: " in line] == [
        "stimuli.yaml:1:3: error: 'pont' is not a subscriber",
        "stimuli.yaml:2:17: error: a geometry_msgs/Point has no field 'Y'",
        "stimuli.yaml:2:29: error: 'z' must be of type float64, not 'one'",
        "stimuli.yaml:4:22: error: 'pose.position' must be a mapping of fields, not a list",
        "stimuli.yaml:4:52: error: 'pose.orientation' has no field 'v'",
        "stimuli.yaml:5:17: error: 'covariance' must be a list of 36, not of 2",
        "stimuli.yaml:6:10: error: a geometry_msgs/Point must be a mapping of fields, not '5'",
        "stimuli.yaml:7:3: error: a stimulus must be one subscriber with its message: '- <subscriber>: {...}'",
        "stimuli.yaml:8:17: error: key 'x' is given twice",
        "stimuli.yaml:9:3: error: a stimulus must be one subscriber with its message: '- <subscriber>: {...}'",
        "stimuli.yaml:10:3: error: a list is not a subscriber",
    ]
    assert "did you mean 'point'?" in text
    assert "did you mean 'y'?" in text


def test_faults_of_form_and_of_content_come_together(tmp_path: Path) -> None:
    text = faults(tmp_path, "- pint: {x: 0}\n- point: {x: 0\n- byte: {data: 0}\n")
    assert "stimuli.yaml:1:3: error: 'pint' is not a subscriber" in text
    assert "stimuli.yaml:3:7: error: invalid YAML: expected ',' or '}', but got ':'" in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "stimuli.yaml:1:1: error: stimuli.yaml contains no message for point, byte"),
        ("[]", "stimuli.yaml:1:1: error: stimuli.yaml contains no message for point, byte"),
        ("point: {x: 0}", "stimuli.yaml:1:1: error: stimuli must be a list, not a mapping"),
        ("- &x {point: *x}", "stimuli.yaml:1:14: error: invalid YAML: the alias '*x' is inside its own value"),
    ],
)
def test_no_list_of_messages(tmp_path: Path, text: str, message: str) -> None:
    found = faults(tmp_path, text)
    assert found.startswith(message) or "has no field 'point'" in found


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    message = r"error: the stimuli .*nowhere\.yaml do not exist\n.*list of messages: '- \w+: \{<field>"
    with pytest.raises(InputError, match=message):
        read_stimuli(tmp_path / "nowhere.yaml", SUBSCRIBERS)


# --- messages of variable size ---------------------------------------------------------------------------------------

VARIABLE = (
    Converter("text", frame("std_msgs/String"), 0),
    Converter("scan", frame("sensor_msgs/LaserScan", ROS2), 1),
    Converter("status", frame("diagnostic_msgs/DiagnosticStatus", ROS2), 2),
    Converter("names", frame("sensor_msgs/JointState"), 3),
    Converter("solid", frame("shape_msgs/SolidPrimitive", ROS2), 4),
)


def read_variable(folder: Path, text: str) -> list[Stimulus]:
    path = folder / "stimuli.yaml"
    path.write_text(text, encoding="utf-8")
    return read_stimuli(path, VARIABLE)


@pytest.mark.parametrize(
    ("word", "expected"), [("hello", "hello"), ("''", ""), ("1e3", "1e3"), ("'null'", "null"), ("é🤖", "é🤖")]
)
def test_texts(tmp_path: Path, word: str, expected: str) -> None:
    (stimulus,) = read_variable(tmp_path, f"- text: {{data: {word}}}\n")
    assert stimulus.message == {"data": expected}
    assert stimulus.payload == len(expected.encode()).to_bytes(4, "little") + expected.encode()


def test_arrays_of_numbers_messages_and_texts(tmp_path: Path) -> None:
    header = "{seq: 1, stamp: {sec: 2, nsec: 3}, frame_id: map}"
    found = read_variable(
        tmp_path,
        "- status: {level: 1, name: a, message: '', hardware_id: b, values: [{key: k, value: v}, {key: '', value: w}]}"
        "\n"
        f"- names: {{header: {header}, name: [left, right], position: [1, 2.5], velocity: [], effort: []}}\n",
    )
    assert found[0].message["values"] == [{"key": "k", "value": "v"}, {"key": "", "value": "w"}]
    assert found[1].message["name"] == ["left", "right"]
    assert (found[1].message["position"], found[1].message["effort"]) == ([1.0, 2.5], [])


def test_what_does_not_fit_a_message_of_variable_size(tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        read_variable(
            tmp_path,
            "- text: {data: }\n"
            "- text: {data: [a]}\n"
            "- status: {level: 1, name: a, message: a, hardware_id: b, values: {key: k}}\n"
            "- status: {level: 1, name: a, message: a, hardware_id: b, values: [{key: k, valeu: v}]}\n"
            "- solid: {type: 1, dimensions: [1, 2, 3, 4], polygon: {points: []}}\n"
            "- text: [a]\n",
        )
    assert [(fault.source.line if fault.source else 0, fault.message) for fault in raised.value.diagnostics] == [
        (1, "'data' must be of type string, not nothing"),
        (2, "'data' must be of type string, not a list"),
        (3, "'values' must be a list, not a mapping"),
        (4, "'values[0]' has no field 'valeu'"),
        (5, "the length of 'dimensions' must be at most 3, not 4"),
        (6, "a std_msgs/String must be a mapping of fields, not a list"),
    ]


def test_a_message_that_is_too_long(tmp_path: Path) -> None:
    """The limit is the subscriber's longest payload, with the count of a text."""
    subscriber = Converter("name", frame("std_msgs/String"), 0, max_length=7)
    path = tmp_path / "stimuli.yaml"
    path.write_text("- name: {data: abc}\n- name: {data: abcd}\n", encoding="utf-8")
    with pytest.raises(InputError, match="a message has 8 bytes, but 'name' accepts 7") as raised:
        read_stimuli(path, [subscriber])
    assert f"{path}:2:9" in str(raised.value)
    assert "add 'maxLength: 8' or more to the block" in str(raised.value)
    path.write_text("- name: {data: abc}\n", encoding="utf-8")
    assert len(read_stimuli(path, [subscriber])) == 1


@pytest.mark.parametrize(
    ("ros", "message", "text", "hint"),
    [
        (ROS2, "sensor_msgs/Imu", "{header: {stamp: {nsec: 2}}}", "did you mean 'nanosec'?"),
        (ROS1, "std_msgs/Time", "{data: {nanosec: 2}}", "did you mean 'nsec'?"),
        (ROS2, "sensor_msgs/Imu", "{orientation_covariance: 1.5}", "write [1.5, ...]"),
        (ROS2, "sensor_msgs/Imu", "{orientation_covariance: {x: 1}}", ""),
    ],
)
def test_a_field_of_the_other_ros_and_a_number_for_a_list_have_cures(
    ros: Middleware, message: str, text: str, hint: str, tmp_path: Path
) -> None:
    path = tmp_path / "stimuli.yaml"
    path.write_text(f"- sub: {text}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_stimuli(path, [Converter("sub", frame(message, ros), 0)])
    assert caught.value.diagnostics[0].hint == hint
