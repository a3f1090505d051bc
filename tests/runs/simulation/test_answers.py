"""Wrong bytes of a simulation as wrong fields, from the files of the simulated host."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.answers import Answer, read_answers, surplus, with_values
from fusesoc_firm.runs.simulation.host_files import expected_text, stimulus_text
from fusesoc_firm.runs.simulation.reference import Response
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter

LIBRARY = MessageLibrary(ROS2)


def converters(type_: str) -> tuple[Converter, Converter]:
    """A subscriber and a publisher of a type."""
    name = parse_name(type_)
    frame = frame_of(name, LIBRARY.closure(name))
    return Converter("sub", frame, 0), Converter("pub", frame, 0)


def answers(folder: Path, type_: str) -> list[Answer]:
    sub, pub = converters(type_)
    return read_answers(folder, [sub], [pub])


def run(folder: Path, type_: str, expected: dict[str, Any], received: dict[str, Any]) -> list[str]:
    """Write the files of a simulation whose second response is wrong, and return the texts of the faults."""
    sub, pub = converters(type_)
    frame = pub.frame
    right, wrong = (encode(frame, completed(frame, value)) for value in (expected, received))
    message = decode(frame, right)
    (folder / "stimulus.txt").write_text(stimulus_text([Stimulus(sub, right, message)] * 2, [sub]))
    text = expected_text([Response(pub, right, message, cause) for cause in (0, 1)], [pub])
    (folder / "expected.txt").write_text(text)
    sent = [pack_frame(0, payload) for payload in (right, wrong)]
    (folder / "received.txt").write_text("".join(f"< id 00\n  {part.hex()}\n" for part in sent))
    label = text.splitlines()[0].removeprefix("< @0 ")
    faults = [
        f"fault in cycle {offset}: '{label}': byte {offset}: expected {one:02x}, got {other:02x}"
        for offset, (one, other) in enumerate(zip(*sent, strict=False))
        if one != other
    ]
    more = [f"and {len(faults) - 10} more faults"] if len(faults) > 10 else []
    return with_values([*faults[:10], *more], answers(folder, type_))


@pytest.mark.parametrize(
    ("type_", "expected", "received", "lines"),
    [
        (
            "geometry_msgs/TwistStamped",
            {"twist": {"linear": {"x": 1.0}, "angular": {"z": 1.0}}},
            {"twist": {"linear": {"x": 1.1}, "angular": {"z": 2.0}}},
            ["twist.linear.x: expected 1.0, got 1.1", "twist.angular.z: expected 1.0, got 2.0"],
        ),
        (
            "sensor_msgs/Imu",
            {},
            {"orientation_covariance": [0.0, 1.1, 1.1] * 3, "linear_acceleration": {"z": 9.81}},
            [
                "orientation_covariance[1]: expected 0.0, got 1.1, and 5 more elements",
                "linear_acceleration.z: expected 0.0, got 9.81",
            ],
        ),
        ("geometry_msgs/Point", {"x": 0.0}, {"x": -0.0}, ["x: expected 0.0, got -0.0"]),
        ("std_msgs/String", {"data": "ab"}, {"data": "aé"}, ["byte 1: ", 'data: expected "ab", got "a\\xe9"']),
    ],
)
def test_a_wrong_message_has_a_line_for_each_wrong_field(
    tmp_path: Path, type_: str, expected: dict[str, Any], received: dict[str, Any], lines: list[str]
) -> None:
    for line, wanted in zip(run(tmp_path, type_, expected, received), lines, strict=True):
        assert "byte" in wanted or ": 'pub' for message 1: " in line
        assert wanted in line


def test_a_byte_whose_value_looks_equal_is_kept(tmp_path: Path) -> None:
    (line,) = run(tmp_path, "geometry_msgs/Point", {"x": math.nan}, {"x": -math.nan})
    assert line.endswith("': byte 16: expected 7f, got ff")


def test_at_most_ten_fields_are_shown_and_the_other_bytes_are_counted(tmp_path: Path) -> None:
    fields = {"x": 0.3, "y": 0.7, "z": 1.1}
    received = {
        "orientation": fields | {"w": 1.0},
        "orientation_covariance": [1.0] * 9,
        "angular_velocity": fields,
        "angular_velocity_covariance": [1.0] * 9,
        "linear_acceleration": fields,
    }
    lines = run(tmp_path, "sensor_msgs/Imu", {"orientation": {"w": 0.0}}, received)
    assert len(lines) == 11 and "linear_acceleration.x: expected 0.0, got 0.3" in lines[9]
    # All eight bytes of 0.7 and 1.1 differ from those of 0.0.
    assert lines[10] == "and 16 more faults"


def test_an_undefined_byte_has_no_value(tmp_path: Path) -> None:
    (fault,) = run(tmp_path, "geometry_msgs/Point", {}, {"x": 2.0})[:1]
    assert fault.endswith("x: expected 0.0, got 2.0")
    path = tmp_path / "received.txt"
    path.write_text(path.read_text().replace("40", "xx"))
    fault = "fault in cycle 9: 'pub geometry_msgs/Point x=0.0 y=0.0 z=0.0': byte 16: expected 00, got XX"
    assert with_values([fault], answers(tmp_path, "geometry_msgs/Point")) == [fault]


def test_other_faults_and_those_without_files_are_kept(tmp_path: Path) -> None:
    faults = [
        "fault in cycle 9: 'pub geometry_msgs/Point x=1.0': byte 9: expected 00, got 01",
        "missing: frame",
        "and 3 more faults",
    ]
    assert with_values(faults, answers(tmp_path, "geometry_msgs/Point")) == faults


def test_answers_without_a_message_are_counted(tmp_path: Path) -> None:
    """The host reports each byte of a wrong answer first, and shows few faults."""
    _, pub = converters("std_msgs/Bool")
    run(tmp_path, "std_msgs/Bool", {"data": True}, {"data": True})
    assert [*surplus(tmp_path, [pub])] == []
    received = tmp_path / "received.txt"
    received.write_text(received.read_text() * 2 + "< id 07\n  07\n")
    (told,) = surplus(tmp_path, [pub])
    assert told.startswith("'pub' sent 2 answers more than the 2 expected; likely, ")
