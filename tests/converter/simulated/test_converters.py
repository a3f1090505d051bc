"""Converters of fixed-size messages in simulation: every bit, broken frames, throughput, netlists."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.converter.simulated.converters import PUBLISHER, ConverterBench, Sent, printed, troubled_frames
from tests.converter.simulated.samples import case
from tests.frame.samples import AWKWARD
from tests.hdl.frames import traffic
from tests.seeds import seeded

SEED = seeded(20240602)

_FROM_DISTRIBUTIONS = {
    ROS1: """
        actionlib/TestRequestResult geometry_msgs/Inertia geometry_msgs/Point geometry_msgs/PoseWithCovariance
        geometry_msgs/Quaternion nav_msgs/MapMetaData sensor_msgs/JoyFeedback sensor_msgs/NavSatStatus
        sensor_msgs/RegionOfInterest std_msgs/Bool std_msgs/Byte std_msgs/Duration std_msgs/Empty""".split(),
    ROS2: """
        action_msgs/GoalStatus geometry_msgs/Point geometry_msgs/Transform nav_msgs/MapMetaData
        rmw_dds_common/Gid sensor_msgs/JoyFeedback sensor_msgs/RegionOfInterest service_msgs/ServiceEventInfo
        shape_msgs/MeshTriangle statistics_msgs/StatisticDataType std_msgs/Char std_msgs/Empty
        std_msgs/Int64""".split(),
}
# Every kind of message side: nothing, a bit, gaps, and lengths that carry.
_KINDS = (
    (ROS1, "std_msgs/Empty"),
    (ROS1, "awkward_msgs/OneFlag"),
    (ROS1, "geometry_msgs/Point"),
    (ROS2, "std_msgs/Empty"),
    (ROS2, "awkward_msgs/Gaps"),
    (ROS2, "sensor_msgs/RegionOfInterest"),
    (ROS2, "awkward_msgs/Carry253"),
    (ROS2, "awkward_msgs/Carry255"),
)


# Every message at 8 bits, and every kind at every width; with broken frames where the header lies in three beats (16
# bits), in one with some payload (64), and where a whole frame does (512).
SAMPLE = [case(ros, name, 8) for ros in (ROS1, ROS2) for name in [*_FROM_DISTRIBUTIONS[ros], *AWKWARD[ros]]]
SAMPLE += [case(ros, name, width) for width in WIDTHS if width > 8 for ros, name in _KINDS]
# Frames of many beats.
SAMPLE += [case(ROS1, "awkward_msgs/Large", width) for width in (16, 64, 512)]
TROUBLED = [case(ros, name, width) for width in (8, 16, 64, 512) for ros, name in _KINDS]
NETLISTS = [
    case(ROS1, "std_msgs/Empty", 8),
    case(ROS1, "geometry_msgs/Quaternion", 8),
    case(ROS2, "awkward_msgs/Flags", 8),
    case(ROS2, "awkward_msgs/Gaps", 8),
    case(ROS2, "awkward_msgs/Carry254", 8),
    case(ROS2, "awkward_msgs/Words", 8),
    case(ROS2, "awkward_msgs/Gaps", 16),
    case(ROS2, "awkward_msgs/Carry254", 64),
    case(ROS1, "awkward_msgs/Large", 64),
    case(ROS1, "geometry_msgs/Quaternion", 512),
]
FLOWS = {
    "stalls": {"STALL_PERCENT": 35},
    "full": {"STALL_PERCENT": 0},
    "buffered": {"STALL_PERCENT": 0, "BUFFERED": True},
    "slow": {"STALL_PERCENT": 10, "TAKE_DELAY": 40},
}
# The Manager's slices, its scheduler, the subscriber, and the register of a message.
PIPELINE_CYCLES = 6
_WITHDRAWN = "withdrawn_publisher_tb"


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> ConverterBench:
    return ConverterBench(tmp_path_factory.mktemp("converters"))


@pytest.mark.one_in(5, 6)
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_messages_come_through_under_stalls(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """The ports show the values that rosbags serialised, and the publisher makes rosbags' bytes of them."""
    pair = bench.pair(ros, name, width)
    print(f"seed {SEED}")
    source = random.Random(SEED)
    values = [pair.oracle.random_value(name, source) for _ in range(8)]
    frames = [pair.sent(pair.oracle.serialise(name, value)) for value in values]
    result = pair.run(tmp_path, frames, SEED=SEED, STALL_PERCENT=40, SHOW_FIELDS=True)
    assert [int(digits, 16) for digits in printed(result, "fields")] == [pair.field_bits(value) for value in values]


@pytest.mark.one_in(7, 6)
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_no_cycle_is_lost_without_stalls(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """With room for one message between them, both converters work all the time: frames follow without a gap."""
    pair = bench.pair(ros, name, width)
    source = random.Random(SEED)
    frames = [pair.sent(pair.payload(source)) for _ in range(5)]
    result = pair.run(tmp_path, frames, BUFFERED=True)
    found = traffic(result.output)
    beats = sum(map(pair.beats, frames))
    assert (found.beats_in, found.beats_out) == (beats, beats)
    # The last message is sent after it has arrived completely.
    assert found.cycles <= beats + pair.beats(frames[-1]) + PIPELINE_CYCLES


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_a_message_that_waits_loses_nothing(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """The first beat of the next frame comes in the cycle that takes the message, and no sooner."""
    pair = bench.pair(ros, name, width)
    source = random.Random(SEED)
    payloads = [pair.payload(source) for _ in range(20)]
    result = pair.run(tmp_path, [pair.sent(payload) for payload in payloads], TAKE_DELAY=90)
    assert printed(result, "beats behind a message:") == ["1"] * 19 + ["0"]


@pytest.mark.one_in(11, 6)
@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_broken_frames_hurt_no_other(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, width: int, flow: str
) -> None:
    """Every good frame is delivered and no other; each broken one causes one error with its code."""
    pair = bench.pair(ros, name, width)
    print(f"seed {SEED}")
    frames = troubled_frames(pair, 150, random.Random(f"{SEED} {name} {flow}"))
    codes = set(pair.error_codes(frames))
    assert codes == ({1, 2, 3, 4} if ros is ROS2 else {1, 2, 3})
    assert sum(map(pair.is_good, frames)) > 30
    pair.run(tmp_path, frames, SEED=SEED, **FLOWS[flow])


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_every_length_of_a_frame(bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    """Cut behind each byte, and longer by up to five; with the length of the whole message, and with its own.

    Of a long frame the ends have to do.
    """
    pair = bench.pair(ros, name, width)
    source = random.Random(SEED)
    payload = pair.payload(source)
    whole = pair.sent(payload).body
    cut = [Sent(whole[:size]) for size in range(len(whole) + 1) if size < 12 or size > len(whole) - 8]
    extended = [Sent(whole + source.randbytes(more)) for more in range(1, 6)]
    longer = payload + source.randbytes(5)
    honest = [pair.sent(longer[:size]) for size in range(len(longer) + 1) if size < 12 or size > len(longer) - 12]
    frames = [*cut, *extended, *honest]
    assert sum(map(pair.is_good, frames)) == (2 if ros is ROS1 else 5)
    # A good frame follows each of them, to reveal the effects of a broken one.
    mixed = [each for sent in frames for each in (sent, pair.sent(pair.payload(source)))]
    pair.run(tmp_path, mixed, SEED=SEED, STALL_PERCENT=20)


@pytest.mark.parametrize("width", [8, 64])
def test_a_message_is_withdrawn_within_its_frame(bench: ConverterBench, tmp_path: Path, width: int) -> None:
    """The frame is aborted, and the next message is sent whole."""
    pair = bench.pair(ROS1, "awkward_msgs/Large", width)
    pair.library.analyse([Path(__file__).with_name(f"{_WITHDRAWN}.vhd")])
    print(f"seed {SEED}")
    result = pair.library.run(_WITHDRAWN, {"WIDTH": width, "SEED": SEED}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    ((frames, aborted),) = re.findall(r"frames (\d+), aborted (\d+)", result.output)
    assert int(frames) >= 30
    assert int(aborted) >= 10


def test_any_byte_but_zero_is_true(bench: ConverterBench, tmp_path: Path) -> None:
    """As roscpp and rospy read it. The publisher sends 1, so these cannot be compared byte by byte with what came."""
    pair = bench.pair(ROS1, "awkward_msgs/OneFlag")
    frames = [pair.sent(bytes([byte])) for byte in (0, 1, 2, 0x40, 0x80, 0xFE, 0xFF, 0)]
    result = pair.run(tmp_path, frames, SHOW_FIELDS=True)
    assert printed(result, "fields") == ["00", "01", "01", "01", "01", "01", "01", "00"]


@pytest.mark.one_in(5)
@pytest.mark.parametrize("offset", range(4))
@pytest.mark.parametrize("byte", [1, 0x80, 0xFF])
def test_a_lie_in_each_byte_of_the_length(bench: ConverterBench, tmp_path: Path, offset: int, byte: int) -> None:
    pair = bench.pair(ROS2, "awkward_msgs/Carry254")
    source = random.Random(SEED)
    good = [pair.sent(pair.payload(source) + bytes(tail)) for tail in range(4)]
    frames = []
    for sent in good:
        lie = bytearray(sent.body)
        lie[offset] = (lie[offset] + byte) % 256
        frames += [Sent(bytes(lie)), sent]
    pair.run(tmp_path, frames, SEED=SEED, STALL_PERCENT=10)


@pytest.mark.one_in(7, 6)
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_they_are_latch_free(bench: ConverterBench, ros: Middleware, name: str, width: int) -> None:
    pair = bench.pair(ros, name, width)
    for entity in pair.entities:
        assert pair.library.latches(entity) == []


@pytest.mark.one_in(8)
@pytest.mark.parametrize(("ros", "name", "width"), NETLISTS)
def test_the_netlist_does_the_same(tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    """The bench with what `ghdl --synth` made of both converters in their place."""
    pair = ConverterBench(tmp_path).pair(ros, name, width)
    subscriber, publisher = pair.entities
    pair.library.replace_by_netlist(subscriber)
    pair.library.replace_by_netlist(publisher, {"ID": PUBLISHER})
    pair.analyse_bench()
    source = random.Random(SEED)
    values = [pair.oracle.random_value(name, source) for _ in range(8)]
    frames = [pair.sent(pair.oracle.serialise(name, value)) for value in values]
    result = pair.run(tmp_path, frames, SEED=SEED, STALL_PERCENT=30, SHOW_FIELDS=True)
    assert [int(digits, 16) for digits in printed(result, "fields")] == [pair.field_bits(value) for value in values]
    count = 60 if pair.frame.payload_bytes < 100 else 15
    pair.run(tmp_path, troubled_frames(pair, count, source), SEED=SEED, STALL_PERCENT=30)
    pair.run(tmp_path, troubled_frames(pair, count, source), BUFFERED=True)


def test_an_illegal_id_is_named(bench: ConverterBench) -> None:
    pair = bench.pair(ROS1, "std_msgs/Bool")
    result = pair.library.run("std_msgs_bool_to_axis", {"ID": 256})
    assert result.exit_code != 0
    assert "std_msgs_bool_to_axis: ID is 256; legal: 0 to 255" in result.output
