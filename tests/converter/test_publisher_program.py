"""The steps of a publisher: executed for a value, they produce the bytes of rosbags."""

from __future__ import annotations

import random
import struct
from typing import Any

import pytest

from fusesoc_firm.converter.message_ports import message_ports, message_side, segment_count
from fusesoc_firm.converter.program import (
    Block,
    Close,
    Count,
    End,
    Header,
    Open,
    Padding,
    Program,
    Scope,
    Segment,
    Step,
    Stream,
    publisher_program,
    subscriber_program,
)
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.model import Data, DataKind, Frame, Loop
from fusesoc_firm.frame.select import select
from fusesoc_firm.frame.values import leaf_of, part_of, units_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from tests.frame.oracle import Oracle
from tests.frame.test_layout import layout
from tests.frame.variable_samples import PACKAGE, VARIABLE
from tests.seeds import seeded

SEED = seeded(20240609)


class Walk:
    """A walk through a program with the values of a message."""

    def __init__(self, program: Program, value: Any) -> None:
        self.program = program
        self.payload = bytearray()
        # The value of each enclosing scope, and the remaining elements of each loop.
        self.values: list[tuple[Any, int]] = [(value, 0)]
        self.waiting: dict[int, list[Any]] = {}

    def run(self) -> bytes:
        """The payload."""
        place = 0
        while not isinstance(self.program.steps[place], End):
            place = self.step(place)
        return bytes(self.payload)

    def step(self, place: int) -> int:
        """Execute a step and return the next one."""
        step = self.program.steps[place]
        match step:
            case Block():
                self.payload += self.block(step)
            case Padding(alignment=alignment, closes_text=closes_text):
                self.payload += bytes(closes_text)
                self.payload += bytes(-(len(self.payload) - len(self.program.frame.prefix)) % alignment)
            case Count(part=part):
                terminator = part.terminator if isinstance(part, Data) else 0
                self.payload += (self.count(part) + terminator).to_bytes(4, "little")
            case Open(part=part):
                return self.open(place, part)
            case Stream(part=part):
                self.payload += self.data(part)
            case Close(loop=loop):
                return self.close(place, loop)
        return place + 1

    def block(self, block: Block) -> bytes:
        data = bytearray(block.size)
        for offset, constant in block.constants:
            data[offset : offset + len(constant)] = constant
        for leaf in block.fields:
            elements = leaf_of(self.values[-1][0], leaf, self.values[-1][1])
            held = elements[leaf.first : leaf.first + leaf.held]
            for offset, element in zip(leaf.offsets, held, strict=True):
                struct.pack_into(f"<{leaf.type.code}", data, offset, element)
        return bytes(data)

    def found(self, part: Data | Loop) -> Any:
        value, depth = self.values[-1]
        return part_of(value, part, depth)

    def data(self, part: Data) -> bytes:
        if part.kind is DataKind.ARRAY:
            return struct.pack(f"<{len(self.found(part))}{part.element.code}", *self.found(part))
        return bytes(units_of(part, self.found(part)))

    def count(self, part: Data | Loop) -> int:
        return len(self.data(part)) // part.element.size if isinstance(part, Data) else len(self.found(part))

    def open(self, place: int, part: Data | Loop) -> int:
        if not self.count(part):
            return self.program.behind(place)
        if isinstance(part, Loop) and part.body:
            first, *rest = self.found(part)
            self.waiting[len(self.values)] = rest
            self.values.append((first, len(part.path)))
        return place + 1

    def close(self, place: int, loop: Loop) -> int:
        self.values.pop()
        waiting = self.waiting[len(self.values)]
        if not waiting:
            return place + 1
        self.values.append((waiting.pop(0), len(loop.path)))
        return self.program.body(place)


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_message_is_that_of_rosbags(ros: Middleware) -> None:
    oracle = Oracle(ros, VARIABLE[ros])
    names = [*oracle.messages(), *(name for name in VARIABLE[ros] if not name.endswith(("Wides", "Giant")))]
    print(f"seed {SEED}")
    source = random.Random(SEED)
    done = 0
    for name in names:
        frame = oracle.frame(name)
        if frame.is_fixed_size:
            continue
        stimuli = Stimuli(oracle.closure(name), ros, source)
        for kind in KINDS:
            value = stimuli.message(parse_name(name), kind)
            assert Walk(publisher_program(frame), value).run() == oracle.serialise(name, value), (name, kind)
            done += 1
    assert done > 300


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_what_is_not_used_is_sent_as_its_default(ros: Middleware) -> None:
    """Select each field of every message alone; unused fields are zeros, empty texts and empty arrays."""
    oracle = Oracle(ros, VARIABLE[ros])
    source = random.Random(SEED)
    for name in (f"{PACKAGE}/Tree", f"{PACKAGE}/Nameds", f"{PACKAGE}/Sizes", "sensor_msgs/PointCloud2"):
        whole = oracle.frame(name)
        stimuli = Stimuli(oracle.closure(name), ros, source)
        for path in whole.names:
            frame = select(whole, {path: None})
            value = stimuli.message(parse_name(name), "typical")
            empty = stimuli.message(parse_name(name), "empty")
            expected = oracle.serialise(name, {**empty, path: value[path]})
            assert Walk(publisher_program(frame), value).run() == expected, (name, path)


def test_defaults_of_unused_fields_are_constants() -> None:
    """rosbags drops defaults, so the codec provides the expected bytes."""
    text = "string name 'ab'\nuint8 x 7\nfloat64[] many [1.5, -2]\nint16[3] three [1, 2, 3]\n"
    text += "string[] s ['x', 'yz']\nuint8 y\n"
    frame = select(layout(ROS2, text), {"y": None})
    steps = publisher_program(frame).steps
    assert not any(isinstance(step, Stream | Open | Count) for step in steps)
    assert Walk(publisher_program(frame), {"y": 5}).run() == encode(frame, {"y": 5})


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_both_directions_have_the_same_segments(ros: Middleware) -> None:
    oracle = Oracle(ros, VARIABLE[ros])
    for name in [*oracle.messages(), *VARIABLE[ros]]:
        whole = oracle.frame(name)
        if whole.is_fixed_size:
            continue
        first, *_ = whole.names
        for frame in (whole, select(whole, {first: None}), select(whole, {}, {first: None})):
            publisher, subscriber = publisher_program(frame), subscriber_program(frame)
            scopes: list[Scope] = [(), *(step.scope for step in publisher.steps if isinstance(step, Close))]
            for scope in scopes:
                assert publisher.segments(scope) == subscriber.segments(scope), (name, scope)
            assert _segments(publisher) == _segments(subscriber), name
            assert publisher.segments() == segment_count(frame) >= 1


def _segments(program: Program) -> set[tuple[object, Segment]]:
    """The segment of each value."""
    found: set[tuple[object, Segment]] = set()
    for step in program.steps:
        match step:
            case Block(fields=fields, segment=segment):
                assert segment is not None or not fields
                found |= {(leaf.path, segment) for leaf in fields if segment}
            case Count(part=part, segment=segment) if part.is_used:
                assert segment is not None
                found.add((part.path, segment))
    return found


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_each_segment_is_completed_once(ros: Middleware) -> None:
    oracle = Oracle(ros, VARIABLE[ros])
    for name in oracle.messages():
        frame = oracle.frame(name)
        if not frame.is_fixed_size:
            steps = publisher_program(frame).steps
            completed = [step.completes for step in steps if isinstance(step, Header | Block | Open) and step.completes]
            assert len(completed) == len(set(completed)), name
            assert {segment for _, segment in _segments(publisher_program(frame))} <= set(completed), name


def test_the_steps_of_an_array_of_messages() -> None:
    frame = layout(ROS2, "E[] e\nuint8 z\n", {"p/E": "string s\nfloat64[] f\nuint8 x\n"})
    program = publisher_program(frame)
    assert [_short(step) for step in program.steps] == [
        *("Header", "Block", "Count e", "Open e"),
        *("Padding", "Count e.s", "Open e.s", "Stream e.s"),
        *("Padding", "Count e.f", "Open e.f", "Padding", "Stream e.f", "Block"),
        *("Close e", "Block", "End"),
    ]
    assert (program.behind(3), program.behind(6), program.behind(10)) == (15, 8, 13)
    assert program.body(14) == 4


def test_names_do_not_meet_those_of_the_publisher() -> None:
    """Names that the architecture needs, and the names of second fields, are distinct."""
    text = "uint8 step_2\nuint8[] word\nuint8 place_r\nuint8 all_words\nuint8[] is_done\nuint8 is_done_length\n"
    names = {port.name for port in message_ports(layout(ROS1, text), 8)}
    assert {"step_2", "word_length", "place_r_2", "all_words_2", "is_done_length", "is_done_length_2"} <= names


def test_an_array_of_messages_without_bytes_has_a_length_only() -> None:
    frame = layout(ROS1, "N[] n\nstring s\n", {"p/N": ""})
    names = [port.name for port in message_ports(frame, 8)]
    assert [name for name in names if name.startswith("n_")] == ["n_length"]
    assert not message_side(frame).element(_loop(frame)).loop.body
    assert Walk(publisher_program(frame), {"n": [{}, {}], "s": "a"}).run().hex() == "020000000100000061"


def _loop(frame: Frame) -> Loop:
    return next(node for node in frame.nodes if isinstance(node, Loop))


def _short(step: Step) -> str:
    part = getattr(step, "part", getattr(step, "loop", None))
    return f"{type(step).__name__} {'.'.join(part.names) if part else ''}".strip()
