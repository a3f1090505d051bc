"""The steps of converters of variable size, and the segments of their values."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from fusesoc_firm.converter.message_ports import message_ports, message_side
from fusesoc_firm.converter.program import (
    Block,
    Close,
    Count,
    Header,
    Open,
    Program,
    Scope,
    Step,
    Stream,
    Tail,
    comment,
    publisher_program,
    subscriber_program,
)
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from tests.frame.oracle import parsed

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}


def standard(ros: Middleware, name: str) -> Frame:
    return frame_of(parse_name(name), LIBRARIES[ros].closure(parse_name(name)))


def made(ros: Middleware, text: str, **others: str) -> Frame:
    texts = {f"program_msgs/{name}": other for name, other in {"Main": text, **others}.items()}
    return frame_of(parse_name("program_msgs/Main"), parsed(texts, ros))


def outline(program: Program) -> list[str]:
    """A word for each step, with the segment that it completes."""
    return [_word(step) for step in program.steps]


def _word(step: Step) -> str:
    size = str(step.size) if isinstance(step, Block) else ""
    segment = getattr(step, "completes", None)
    mark = "" if segment is None else "!" * len(segment.scope) + str(segment.number)
    about = "" if isinstance(step, Header | Tail) else comment(step)
    return " ".join(filter(None, [type(step).__name__ + size, about, mark]))


def variable_frames(ros: Middleware) -> Iterator[Frame]:
    for name in LIBRARIES[ros].names():
        frame = frame_of(name, LIBRARIES[ros].closure(name))
        if not frame.is_fixed_size:
            yield frame


def test_an_array_of_messages_with_strings() -> None:
    assert outline(subscriber_program(standard(ROS1, "sensor_msgs/PointCloud2")))[5:13] == [
        "Block8 height, width",
        "Count fields",
        "Open fields 1",
        "Count fields.name",
        "Open fields.name !0",
        "Stream fields.name",
        "Block9 fields.offset, fields.datatype, fields.count !1",
        "Close fields",
    ]


def test_a_part_is_opened_before_its_padding() -> None:
    assert outline(subscriber_program(made(ROS2, "string s\nfloat64[] a\n")))[-6:] == [
        "Padding a zero and padding to a multiple of 4",
        "Count a",
        "Open a 1",
        "Padding padding to a multiple of 8",
        "Stream a",
        "End",
    ]


def test_segment_0_is_there_without_a_field() -> None:
    program = subscriber_program(made(ROS1, "string[2] names\n"))
    assert outline(program)[:3] == ["Header", "Open names 0", "Count names"]


def test_behind_the_last_used_part_is_a_tail() -> None:
    frame = select(standard(ROS2, "sensor_msgs/Image"), {"height": None})
    words = outline(subscriber_program(frame))
    assert words[-4:] == ["Block8 height 0", "Tail", "Drop", "End"]
    assert "Stream header.frame_id" in words


def test_what_is_not_used_is_constant_to_a_publisher() -> None:
    frame = select(made(ROS2, 'string a "hi"\nuint32 x 7\nuint8[] b [1, 2]\nuint8 c\n'), {"c": None})
    blocks = [step for step in publisher_program(frame).steps if isinstance(step, Block)]
    data = bytearray(sum(step.size for step in blocks))
    start = 0
    for block in blocks:
        for offset, constant in block.constants:
            data[start + offset : start + offset + len(constant)] = constant
        start += block.size
    # rosbags' bytes of the values, with the padding that a Padding step would add left out.
    assert bytes(data) == (b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00\x07\x00\x00\x00\x02\x00\x00\x00\x01\x02\x00")


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_both_converters_have_the_same_segments(ros: Middleware) -> None:
    """Each used field, length and element has the same bit on both sides, for any selection of fields."""
    chance = random.Random(20240715)
    for frame in variable_frames(ros):
        names = [dotted(step.part.names) for step in subscriber_program(frame).steps if isinstance(step, Open)]
        for chosen in (None, {chance.choice(names): None}):
            selected = select(frame, chosen)
            sides = [_told(program(selected)) for program in (subscriber_program, publisher_program)]
            assert sides[0] == sides[1]


def _told(program: Program) -> dict[tuple[str, ...], tuple[Scope, int]]:
    """The segment of each used field and count."""
    found: dict[tuple[str, ...], tuple[Scope, int]] = {}
    for step in program.steps:
        if isinstance(step, Block) and step.segment:
            found |= {leaf.names: (step.segment.scope, step.segment.number) for leaf in step.fields}
        elif isinstance(step, Count) and step.segment and step.part.is_used:
            found[(*step.part.names, "count", type(step.part).__name__)] = step.segment.scope, step.segment.number
    return found


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_step_leads_on_to_the_end(ros: Middleware) -> None:
    for frame in variable_frames(ros):
        program = subscriber_program(frame)
        for place, step in enumerate(program.steps):
            match step:
                case Open():
                    behind = program.steps[program.behind(place) - 1]
                    assert isinstance(behind, Stream | Close | Open)
                case Close():
                    assert program.body(place) <= place


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_names_of_ports_are_distinct_and_stay_with_other_fields(ros: Middleware) -> None:
    for frame in variable_frames(ros):
        ports = [port.name.lower() for port in message_ports(frame, 8)]
        assert len(set(ports)) == len(ports)
        first = next(iter(frame.names))
        kept = {port.name for port in message_ports(select(frame, None, {first: None}), 8)}
        assert kept <= {port.name for port in message_ports(frame, 8)}


def test_a_name_gives_way_to_a_port() -> None:
    side = message_side(made(ROS1, "uint8[] data\nuint32 data_length\nuint8 payload_length\nuint8 clk\n"))
    assert [part.name for part in side.parts] == ["data", "data_length_2", "payload_length_2", "clk_2"]


@pytest.mark.parametrize("word", ["closing_1", "elements_1", "elements_1_sum", "step_is_open", "step_r", "left_0_r"])
def test_names_that_the_templates_number_are_taken(word: str) -> None:
    side = message_side(made(ROS1, f"uint8[] data\nuint8 {word}\n"))
    assert [part.name for part in side.parts] == ["data", f"{word}_2"]
