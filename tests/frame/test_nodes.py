"""The tree of nodes: the part of the layout that is known before there is a payload."""

from __future__ import annotations

import pytest

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Data, Fixed, Frame, Loop, Node, Pad, all_nodes
from fusesoc_firm.frame.position import Position
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from tests.frame.oracle import parsed

PACKAGE = "layout_msgs"


def frame(ros: Middleware, text: str, **others: str) -> Frame:
    texts = {f"{PACKAGE}/{name}": other for name, other in {"Main": text, **others}.items()}
    return frame_of(parse_name(f"{PACKAGE}/Main"), parsed(texts, ros))


def standard(ros: Middleware, name: str) -> Frame:
    return frame_of(parse_name(name), MessageLibrary(ros).closure(parse_name(name)))


def outline(nodes: tuple[Node, ...]) -> list[str]:
    """A word for each node, a loop's body in brackets."""
    words = []
    for node in nodes:
        match node:
            case Fixed(size):
                words.append(str(size))
            case Pad(alignment):
                words.append(f"pad{alignment}")
            case Data():
                words.append({None: "gap+", 0: ""}.get(node.padding, f"{node.padding}+") + node.ros_type)
            case Loop():
                words.append(f"({' '.join(outline(node.body))})")
    return words


@pytest.mark.parametrize(
    ("ros", "name", "expected"),
    [
        (ROS1, "sensor_msgs/Image", "12 string 8 string 5 uint8[]"),
        (ROS2, "sensor_msgs/Image", "12 string pad4 8 string 1 pad4 4 uint8[]"),
        (ROS1, "geometry_msgs/PoseArray", "12 string (56)"),
        (ROS2, "geometry_msgs/PoseArray", "12 string pad4 (pad8 56)"),
        (ROS1, "std_msgs/String", "string"),
        (ROS2, "std_msgs/String", "4 string"),
        (ROS1, "std_msgs/Empty", ""),
        (ROS2, "std_msgs/Empty", "5"),
        # A string in an array may end anywhere.
        (
            ROS2,
            "sensor_msgs/JointState",
            "12 string pad4 (pad4 string[]) pad4 gap+float64[] gap+float64[] gap+float64[]",
        ),
    ],
)
def test_messages_of_the_distributions(ros: Middleware, name: str, expected: str) -> None:
    assert " ".join(outline(standard(ros, name).nodes)) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # The prefix and a count, then four bytes up to eight: all are known.
        ("float64[] a\n", "4 4+float64[]"),
        ("uint32 x\nfloat64[] a\n", "8 float64[]"),
        # An empty array ends after its count, any other at a multiple of eight.
        ("float64[] a\nfloat64 b\n", "4 4+float64[] pad8 8"),
        ("uint32 x\nfloat64[] a\nfloat64 b\n", "8 float64[] 8"),
        ("float64[] a\nuint32 b\nuint16 c\n", "4 4+float64[] 6"),
        ("uint16[] a\nuint16 b\nuint32 c\n", "4 uint16[] 2 pad4 4"),
        # At most two more bytes: the next position is not known more exactly.
        ("uint8[<=2] a\nuint32 b\n", "4 uint8[<=2] pad4 4"),
        (
            "string s\nuint8 a\nuint16 b\nuint8 c\nuint32 d\nuint16 e\nuint8 f\nfloat64 g\n",
            "4 string 1 pad2 3 pad4 7 pad8 8",
        ),
        # Constant padding is part of the loop's run, the first of which starts at 4.
        ("Odd[] a\n", "4 (16)"),
        # Elements start at 4 or, after another element, at 1 modulo 8.
        ("Tail[] a\n", "4 (pad8 9)"),
        # An empty loop ends after its count.
        ("Eight[] a\nfloat64 b\n", "4 (pad8 8) pad8 8"),
        ("Byte[] a\nuint16 b\n", "4 (1) pad2 2"),
        ("Tail[2] a\n", "29"),
        ("Text[2] a\nuint8 b\n", "4 (pad4 string) 1"),
        ("string[2] a\n", "4 (pad4 string[2])"),
        ("string<=3[<=2] a\n", "4 (pad4 string<=3[<=2])"),
        ("Nothing a\nNothing[] b\n", "8 (1)"),
    ],
)
def test_padding_is_static_where_it_can_be(text: str, expected: str) -> None:
    others = {
        "Odd": "float64 x\nuint32 y\n",
        "Tail": "float64 x\nuint8 y\n",
        "Eight": "float64 x\n",
        "Byte": "uint8 x\n",
        "Text": "string x\n",
        "Nothing": "",
    }
    assert " ".join(outline(frame(ROS2, text, **others).nodes)) == expected


def test_elements_that_padding_parts_are_numbered_through() -> None:
    made = frame(ROS2, "string s\nCell[3] cells\n", Cell="uint8 kind\nuint16[2] pair\n")
    pieces = [leaf for node in made.nodes if isinstance(node, Fixed) for leaf in node.fields if leaf.names[1] == "kind"]
    assert [(piece.first, piece.held, piece.count) for piece in pieces] == [(0, 1, 3), (1, 2, 3)]


def test_ros_1_is_never_padded() -> None:
    library = MessageLibrary(ROS1)
    for name in library.names():
        for node in all_nodes(frame_of(name, library.closure(name)).nodes):
            assert not isinstance(node, Pad)
            assert not isinstance(node, Data) or node.padding == 0


def test_a_fixed_array_of_none_is_nothing() -> None:
    made = frame(ROS1, "string[0] a\nText[0] b\nuint8[0] c\nuint8 d\n", Text="string x\n")
    assert made.is_fixed_size
    assert [leaf.names for leaf in made.fields] == [("c",), ("d",)]
    assert made.payload_bytes == 1


def test_what_has_no_fixed_size_has_no_offsets() -> None:
    made = standard(ROS2, "std_msgs/String")
    for ask in (lambda: made.payload_bytes, lambda: made.fields, lambda: made.frame_bytes):
        with pytest.raises(ValueError, match="std_msgs/String has no fixed size"):
            ask()


def test_position() -> None:
    start = Position(8, frozenset({4}))
    assert start.padding(8) == 4
    assert start.advanced(6).residues == {2}
    assert start.repeated(2, 1).residues == {4, 6}
    assert start.repeated(1, None).residues == set(range(8))
    assert start.repeated(4, None).padding(8) is None
    assert start.repeated(4, None).padding(4) == 0
    assert start.repeated(1, 3).aligned(8).residues == {0}
