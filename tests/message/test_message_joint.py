"""Joint texts of a message and its nested messages, in both directions; rosbags is the reference."""

from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_types_from_msg

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.joint import joint_text, signature_of_text
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from tests.typestores import typestore

STORES = {ROS1: Stores.ROS1_NOETIC, ROS2: Stores.ROS2_JAZZY}
LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_message_reads_back_with_its_signature(ros: Middleware) -> None:
    library = LIBRARIES[ros]
    for name in library.names():
        definitions = library.closure(name)
        assert signature_of_text(name, joint_text(name, definitions), ros) == signature(name, definitions), name


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_rosbags_reads_the_same_types(ros: Middleware) -> None:
    library, store = LIBRARIES[ros], typestore(STORES[ros])
    for name in library.names():
        text = joint_text(name, library.closure(name))
        for type_, (constants, fields) in get_types_from_msg(text, f"{name.package}/msg/{name.name}").items():
            known = store.fielddefs[type_]
            kept = [field for field in known[1] if field[0] != "structure_needs_at_least_one_member"]
            assert (constants, fields) == (known[0], kept), type_


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_what_rosbags_writes_has_the_same_signature(ros: Middleware) -> None:
    library, store = LIBRARIES[ros], typestore(STORES[ros])
    for name in library.names():
        text, _ = store.generate_msgdef(f"{name.package}/msg/{name.name}", ros_version=ros.number)
        assert signature_of_text(name, text, ros) == signature(name, library.closure(name)), name


def test_another_spelling_is_the_same_message() -> None:
    name = parse_name("nav_msgs/Path")
    library = LIBRARIES[ROS1]
    text = joint_text(name, library.closure(name))
    other = text.replace("std_msgs/Header ", "Header ").replace("MSG: ", "MSG:  ").replace("=\nMSG", "= \r\nMSG")
    assert other != text
    assert signature_of_text(name, other, ROS1) == signature_of_text(name, text, ROS1)


@pytest.mark.parametrize("text", ["float64\n", "own_msgs/Missing a\n", f"int8 a\n{'=' * 80}\nMSG: nowhere\nint8 b\n"])
def test_a_text_that_defines_nothing(text: str) -> None:
    assert signature_of_text(parse_name("own_msgs/A"), text, ROS2) is None
