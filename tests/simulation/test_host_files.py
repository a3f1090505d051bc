"""The files of the simulated host, and what its faults say about them."""

from __future__ import annotations

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.simulation.host_files import expected_text, with_field
from fusesoc_firm.simulation.reference import Response
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
    found = with_field(FAULT.format(label, byte), expected_text([response], [publisher]), [publisher])
    assert found == FAULT.format(label, byte).replace(f"byte {byte}: ", shown)
