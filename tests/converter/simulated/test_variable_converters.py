"""Subscribers of messages of variable size in simulation: all that comes out, broken frames, throughput, netlists."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.frame.codec import CodecError, decode, encode
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, TYPICAL
from tests.converter.simulated.samples import ORACLES, case, exchanged, framed, serialise, stimuli
from tests.converter.simulated.subscribers import LENGTH_BYTES, Subscriber, SubscriberBench
from tests.frame.samples import AWKWARD_VARIABLE
from tests.seeds import seeded

SEED = seeded(20240711)

_FROM_DISTRIBUTIONS = {
    ROS1: """
        std_msgs/String std_msgs/Header sensor_msgs/Image sensor_msgs/PointCloud2 sensor_msgs/JointState
        geometry_msgs/PoseArray diagnostic_msgs/DiagnosticArray nav_msgs/Path visualization_msgs/Marker
        trajectory_msgs/JointTrajectory""".split(),
    ROS2: """
        std_msgs/String std_msgs/Header sensor_msgs/Image sensor_msgs/PointCloud2 sensor_msgs/JointState
        geometry_msgs/PoseArray diagnostic_msgs/DiagnosticArray nav_msgs/Path visualization_msgs/Marker
        trajectory_msgs/JointTrajectory rcl_interfaces/ParameterEvent sensor_msgs/CameraInfo
        shape_msgs/SolidPrimitive""".split(),
}
_NAMES = {ros: [*_FROM_DISTRIBUTIONS[ros], *AWKWARD_VARIABLE[ros]] for ros in (ROS1, ROS2)}


def is_variable(ros: Middleware, name: str) -> bool:
    return not ORACLES[ros].frame(name).is_fixed_size


SAMPLE = [
    case(ros, name, (8, 64)[number % 2])
    for ros in (ROS1, ROS2)
    for number, name in enumerate(_NAMES[ros])
    if is_variable(ros, name)
]
SAMPLE += [case(ROS2, f"awkward_msgs/{name}", width) for name in ("Deep", "Bounded", "Halves") for width in WIDTHS]
TROUBLED = [
    case(ROS1, "std_msgs/String", 8),
    case(ROS1, "sensor_msgs/PointCloud2", 8),
    case(ROS1, "awkward_msgs/Late", 64),
    case(ROS2, "sensor_msgs/Image", 8),
    case(ROS2, "awkward_msgs/Deep", 8),
    case(ROS2, "awkward_msgs/Bounded", 8),
    case(ROS2, "awkward_msgs/Deep", 16),
    case(ROS2, "sensor_msgs/JointState", 64),
    case(ROS2, "awkward_msgs/Deep", 64),
    case(ROS2, "awkward_msgs/Hollows", 64),
    case(ROS2, "awkward_msgs/Halves", 512),
]
NETLISTS = [
    case(ROS1, "std_msgs/String", 8),
    case(ROS1, "sensor_msgs/Image", 8),
    case(ROS2, "awkward_msgs/Deep", 64),
    case(ROS2, "awkward_msgs/Halves", 16),
]


@pytest.mark.one_in(7, 6)
@pytest.mark.parametrize("stall", [0, 40])
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_messages_come_through_under_stalls(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int, stall: int
) -> None:
    """Fields, lengths, streams and elements are those that rosbags serialised, in wire order."""
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    print(f"seed {SEED}")
    frames, expected = exchanged(subscriber, ros, name, SEED, 9)
    assert subscriber.run(tmp_path, frames, SEED=SEED % 1000, STALL_PERCENT=stall) == expected


SELECTIONS = [
    (ROS2, "sensor_msgs/Image", ["height"], []),
    (ROS1, "sensor_msgs/Image", [], ["data", "header"]),
    (ROS2, "sensor_msgs/PointCloud2", ["fields.name", "is_dense"], []),
    (ROS1, "diagnostic_msgs/DiagnosticArray", ["status.values.key"], []),
    (ROS2, "diagnostic_msgs/DiagnosticArray", [], ["status.values", "header.stamp"]),
    (ROS2, "awkward_msgs/Deep", [], ["middles.pairs.value", "middles.names"]),
    (ROS2, "awkward_msgs/Halves", ["words"], []),
    (ROS1, "awkward_msgs/Wide", ["cells.pair", "first"], []),
    (ROS2, "awkward_msgs/Fixtures", ["names"], []),
    # Without any count.
    (ROS1, "actionlib_msgs/GoalID", ["stamp"], []),
]


def _run_with_cut_frames(
    subscriber: Subscriber, ros: Middleware, name: str, count: int, folder: Path
) -> tuple[list[bytes], list[str]]:
    """Send frames, each followed by a copy without its last byte; return them, and the events of the good ones."""
    source = stimuli(ros, name, SEED)
    frames: list[bytes] = []
    expected: list[str] = []
    for number in range(count):
        value = source.message(parse_name(name), KINDS[number % len(KINDS)])
        payload = serialise(ros, name, value)
        frames += [framed(payload), framed(payload)[:-1]]
        expected += subscriber.events(value, len(payload))
    events = subscriber.run(folder, frames, SEED=SEED % 1000, STALL_PERCENT=30)
    assert outcomes(events) == [True, False] * count
    messages = [line for line in expected if line.startswith("message ")]
    assert [line for line in events if line.startswith("message ")] == messages
    return frames, expected


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize(("ros", "name", "include", "exclude"), SELECTIONS)
def test_what_is_not_used_is_skipped(
    tmp_path: Path, ros: Middleware, name: str, width: int, include: list[str], exclude: list[str]
) -> None:
    """The used fields come as ever; broken frames are told by what is looked at, and by their length."""
    frame = select(ORACLES[ros].frame(name), dict.fromkeys(include), dict.fromkeys(exclude))
    subscriber = SubscriberBench(tmp_path).subscriber(frame, width)
    frames, expected = _run_with_cut_frames(subscriber, ros, name, 8, tmp_path)
    assert subscriber.run(tmp_path, frames[::2], SEED=1) == expected


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("stall", [0, 35])
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_broken_frames_hurt_no_other(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int, stall: int
) -> None:
    """Every good frame gives its message, every other one a frame_error, and the next frame is right again."""
    frame = ORACLES[ros].frame(name)
    subscriber = subscribers.subscriber(frame, width)
    print(f"seed {SEED}")
    chance = random.Random(f"{SEED} {name} {stall}")
    source = stimuli(ros, name, f"{SEED} {stall}")
    frames, expected = [], []
    for _ in range(150):
        value = source.message(parse_name(name), TYPICAL)
        body = troubled(ros, serialise(ros, name, value), chance)
        if not body and width == 8:
            continue  # at 8 bits the Manager keeps an id alone
        frames.append(body)
        expected.append(verdict(frame, body))
    events = subscriber.run(tmp_path, frames, SEED=SEED % 1000, STALL_PERCENT=stall)
    assert outcomes(events) == [message is not None for message in expected]
    assert 20 < sum(message is not None for message in expected) < len(frames) - 40
    assert set(codes(events)) >= ({1, 2, 3, 4} if ros is ROS2 else {1, 2, 3})


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_every_length_of_a_frame(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """Cut behind each byte, with the length of the whole message and with its own, a good one behind each."""
    frame = ORACLES[ros].frame(name)
    subscriber = subscribers.subscriber(frame, width)
    value = stimuli(ros, name, SEED).message(parse_name(name), TYPICAL)
    payload = serialise(ros, name, value)
    whole = framed(payload)
    cut = [whole[:size] for size in range(1, len(whole))]
    honest = [framed(payload[:size]) for size in range(len(payload))]
    longer = [framed(payload + bytes(more)) for more in (*range(6), 8, 92, 200)]
    # A header that counts a tail, of which the frame lacks a part or has too much.
    lying = [framed(payload + bytes(have), len(payload) + 92) for have in (0, 1, 3, 91, 93, 200)]
    frames = [each for body in (*cut, *honest, *longer, *lying) for each in (body, whole)]
    events = subscriber.run(tmp_path, frames, SEED=3, STALL_PERCENT=15)
    assert outcomes(events) == [verdict(frame, body) is not None for body in frames]
    message = subscriber.events(value, len(payload))
    assert [line for line in events if line.startswith("message")].count(message[-1]) >= len(frames) // 2


def test_a_cut_stream_is_closed(subscribers: SubscriberBench, tmp_path: Path) -> None:
    subscriber = subscribers.subscriber(ORACLES[ROS1].frame("std_msgs/String"), 8)
    whole = framed(b"\x05\x00\x00\x00hello")
    events = subscriber.run(tmp_path, [whole[:-2], whole])
    assert events == ["data " + b"hel".hex(), "frame_error 2", "data " + b"hello".hex(), "message 00000009 00000005"]


@pytest.mark.parametrize(
    ("payload", "code"),
    [
        (b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00", None),
        (b"\x00\x01\x00\x00\x03\x00\x00\x00hi!", 5),
        (b"\x00\x01\x00\x00\x00\x00\x00\x00", 5),
        (b"\x00\x01\x00\x00\xff\xff\xff\xffhi\x00", 1),
        (b"\x00\x00\x00\x00\x03\x00\x00\x00hi\x00", 4),
        (b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00\x00\x00\x00", None),
        (b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00\x00\x00\x00\x00", None),
        (b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00" + b"\xee" * 200, None),
    ],
)
@pytest.mark.parametrize("width", [8, 64])
def test_codes(subscribers: SubscriberBench, tmp_path: Path, payload: bytes, code: int | None, width: int) -> None:
    subscriber = subscribers.subscriber(ORACLES[ROS2].frame("std_msgs/String"), width)
    events = subscriber.run(tmp_path, [framed(payload)])
    assert codes(events) == ([] if code is None else [code])
    assert outcomes(events) == [code is None]


@pytest.mark.parametrize("width", [8, 128])
def test_a_stream_takes_a_beat_in_every_cycle(subscribers: SubscriberBench, tmp_path: Path, width: int) -> None:
    """Behind strings of any length, so that the data start in any lane."""
    subscriber = subscribers.subscriber(ORACLES[ROS1].frame("sensor_msgs/Image"), width)
    size, lanes = 8000, width // 8
    for letters in range(0, lanes, 5):
        value = stimuli(ROS1, "sensor_msgs/Image", SEED).message(parse_name("sensor_msgs/Image"), TYPICAL)
        value["encoding"], value["data"] = "x" * letters, bytes(size)
        body = framed(serialise(ROS1, "sensor_msgs/Image", value))
        frames = [body] * 2
        subscriber.run(tmp_path, frames)
        cycles = int(re.findall(r"(\d+)", (tmp_path / "cycles.txt").read_text())[0])
        beats = 2 * -(-len(body) // lanes)
        assert cycles - 2000 <= beats / 0.98 + 60


@pytest.mark.parametrize(("width", "most"), [(8, 22), (16, 9 + 4 + 1)])
def test_a_count_takes_one_cycle(subscribers: SubscriberBench, tmp_path: Path, width: int, most: int) -> None:
    """An element of a byte and four counts takes a cycle for each count, and one for its end, beside its beats."""
    name = "diagnostic_msgs/DiagnosticArray"
    subscriber = subscribers.subscriber(ORACLES[ROS1].frame(name), width)
    status = {"level": 0, "name": "", "message": "", "hardware_id": "", "values": []}
    cycles = []
    for count in (2, 12):
        value = {"header": {"seq": 0, "stamp": {"sec": 0, "nsec": 0}, "frame_id": ""}, "status": [status] * count}
        subscriber.run(tmp_path, [framed(encode(ORACLES[ROS1].frame(name), value))])
        cycles.append(int(re.findall(r"(\d+)", (tmp_path / "cycles.txt").read_text())[0]))
    assert cycles[1] - cycles[0] <= 10 * most


@pytest.mark.one_in(7, 6)
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_they_are_latch_free(subscribers: SubscriberBench, ros: Middleware, name: str, width: int) -> None:
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    assert subscriber.library.latches(subscriber.entity) == []


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("ros", "name", "width"), NETLISTS)
def test_the_netlist_does_the_same(tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    subscriber = SubscriberBench(tmp_path).subscriber(ORACLES[ros].frame(name), width)
    subscriber.library.replace_by_netlist(subscriber.entity)
    subscriber.analyse_bench()
    _run_with_cut_frames(subscriber, ros, name, 6, tmp_path)


# --- frames ----------------------------------------------------------------------------------------------------------


def troubled(ros: Middleware, payload: bytes, chance: random.Random) -> bytes:
    """A frame, good or broken by chance."""
    body = bytearray(framed(payload))
    match chance.randrange(11):
        case 0:  # ends early
            return bytes(body[: chance.randrange(len(body))])
        case 1:  # continues after its length
            return bytes(body) + chance.randbytes(chance.choice((1, 2, 3, 4, 9, 70)))
        case 2:  # a wrong length
            lie = max(0, len(payload) + chance.choice((-9, -4, -1, 1, 4, 9, 2**20)))
            return lie.to_bytes(LENGTH_BYTES, "little") + payload
        case 3:  # any byte is another one: a count, mostly
            place = chance.randrange(LENGTH_BYTES, len(body))
            body[place] ^= 1 << chance.randrange(8)
            return bytes(body)
        case 4:  # a true length of a message that is cut
            return framed(payload[: chance.randrange(len(payload) + 1)])
        case 5:  # bytes behind the last field
            return framed(payload + chance.randbytes(chance.choice((1, 2, 3, 4, 5, 8, 31, 92, 200))))
        case 6:  # something else
            return framed(chance.randbytes(chance.randrange(60)))
        case 7 if ros is ROS2:
            body[LENGTH_BYTES + chance.randrange(2)] ^= 1 << chance.randrange(8)
            return bytes(body)
    return bytes(body)


def verdict(frame: Frame, body: bytes) -> Any:
    """The message that must come of a frame, or None."""
    announced, payload = int.from_bytes(body[:LENGTH_BYTES], "little"), body[LENGTH_BYTES:]
    if len(body) < LENGTH_BYTES or announced != len(payload):
        return None
    try:
        return decode(frame, payload)
    except CodecError:
        return None


def outcomes(events: list[str]) -> list[bool]:
    """True for each message, False for each frame_error."""
    return [line.startswith("message ") for line in events if line.startswith(("message ", "frame_error "))]


def codes(events: list[str]) -> list[int]:
    """The codes of the errors."""
    return [int(line.split()[1]) for line in events if line.startswith("frame_error ")]
