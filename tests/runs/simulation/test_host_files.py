"""The files of the simulated host, and what its faults say about them."""

from __future__ import annotations

import re

import pytest

from fusesoc_firm.frame.codec import decode, encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.host_files import expected_text, stimulus_text, with_field
from fusesoc_firm.runs.simulation.reference import Response
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter

FAULT = "fault in cycle 9: '{}': byte {}: expected 00, got 01"


@pytest.mark.parametrize(
    ("label", "byte", "shown"),
    [
        ("pub std_msgs/String data=\"ab\"", 9, "byte 9 (data): "),
        ("pub std_msgs/String data=\"ab\"", 15, "byte 15 (data): "),
        ("pub std_msgs/String data=\"ab\"", 6, "byte 6: "),
        ("pub std_msgs/String data=\"ab\"", 2, "byte 2: "),
        ("pub std_msgs/String data=\"abc\"", 9, "byte 9: "),
    ],
)  # fmt: skip
def test_a_wrong_byte_is_named_after_its_field(label: str, byte: int, shown: str) -> None:
    name = parse_name("std_msgs/String")
    publisher = Converter("pub", frame_of(name, MessageLibrary(ROS2).closure(name)), 0)
    message = {"data": "ab"}
    response = Response(publisher, encode(publisher.frame, message), message, 0)
    text = expected_text([response], [publisher])
    found = with_field(FAULT.format(label, byte), ("", text), ([], [publisher]))
    assert found == FAULT.format(label, byte).replace(f"byte {byte}: ", shown)


def test_the_field_at_which_a_frame_stops_is_named() -> None:
    name = parse_name("geometry_msgs/PointStamped")
    topic = Converter("a", frame_of(name, MessageLibrary(ROS2).closure(name)), 0)
    message = decode(topic.frame, encode(topic.frame, completed(topic.frame, {"header": {"frame_id": "abc"}})))
    payload = encode(topic.frame, message)
    stimuli = stimulus_text([Stimulus(topic, payload, message)], [topic])
    expected = expected_text([Response(topic, payload, message, 0)], [topic])
    (label,) = re.findall("^> (.*)", stimuli, re.MULTILINE)

    def told(end: str) -> str:
        fault = f"fault in cycle 9: '{label}': {end}"
        return with_field(fault, (stimuli, expected), ([topic], [topic])).removeprefix(fault)

    # Id and length, prefix, stamp, the length of the text: 5 + 4 + 8 + 4 bytes.
    assert told("only 22 bytes taken") == ", up to header.frame_id: no block takes this field or one before it"
    assert told("only 33 bytes taken").startswith(", up to point.x: ")
    assert told("only 9 bytes taken") == ""
    assert told("stops after 21 bytes without tlast") == ", before header.frame_id"
    assert told(f"stops after {5 + len(payload)} bytes without tlast") == ""


def test_a_label_divides_arrays_of_messages() -> None:
    name = parse_name("nav_msgs/Path")
    topic = Converter("a", frame_of(name, MessageLibrary(ROS2).closure(name)), 0)
    poses = [{"pose": {"position": {"x": number}}} for number in (0.0, 1.0, 2.0)]
    message = {**completed(topic.frame, {"header": {"frame_id": "map"}, "poses": poses})}
    label = stimulus_text([Stimulus(topic, encode(topic.frame, message), message)], [topic]).splitlines()[0]
    values = 'header.frame_id="map" poses[1].pose.position.x=1.0 poses[2].pose.position.x=2.0'
    assert label == f"> a nav_msgs/Path {values}"
