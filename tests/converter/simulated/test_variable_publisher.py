"""Publishers of messages of variable size in simulation: bytes, faults of the message side, throughput, netlists."""

from __future__ import annotations

import random
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.converter.configuration import publisher_entity
from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.converter.variable_publisher import (
    VARIABLE_PUBLISHER_TEMPLATE,
    variable_publisher_configuration,
)
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.runs.verify.stimuli import EMPTY, EXTREME, TYPICAL
from fusesoc_firm.text.render import render
from tests.converter.simulated.publishers import ID, SHORT, Publisher, PublisherBench
from tests.converter.simulated.samples import case
from tests.frame.variable_samples import PACKAGE, VARIABLE
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20240607)

_FROM_DISTRIBUTIONS = {
    ROS1: """
        diagnostic_msgs/DiagnosticArray geometry_msgs/PoseArray nav_msgs/OccupancyGrid sensor_msgs/Image
        sensor_msgs/JointState sensor_msgs/LaserScan sensor_msgs/PointCloud2 std_msgs/Float64MultiArray
        std_msgs/String trajectory_msgs/JointTrajectory visualization_msgs/MarkerArray""".split(),
    ROS2: """
        diagnostic_msgs/DiagnosticArray geometry_msgs/PoseArray nav_msgs/OccupancyGrid rcl_interfaces/ParameterEvent
        sensor_msgs/Image sensor_msgs/JointState sensor_msgs/LaserScan sensor_msgs/PointCloud2
        std_msgs/Float64MultiArray std_msgs/String tf2_msgs/TFMessage trajectory_msgs/JointTrajectory
        visualization_msgs/MarkerArray""".split(),
}
# Texts alone, numbers of each size, arrays of texts and of messages, arrays in arrays, elements without bytes.
_KINDS = ("Text", "Sizes", "Texts", "Plains", "Nameds", "Tree", "Hollow", "Words")
_LEFT_OUT = ("Plain", "Nothing", "Flag", "Giant")


_AWKWARD = {ros: [name for name in VARIABLE[ros] if name.partition("/")[2] not in _LEFT_OUT] for ros in (ROS1, ROS2)}
_KIND_CASES = [(ros, f"{PACKAGE}/{name}") for ros in (ROS1, ROS2) for name in _KINDS]
_KIND_CASES += [(ROS1, f"{PACKAGE}/Times"), (ROS2, f"{PACKAGE}/Wides"), (ROS2, f"{PACKAGE}/Bounded")]
SAMPLE = [case(ros, name, 8) for ros in (ROS1, ROS2) for name in [*_FROM_DISTRIBUTIONS[ros], *_AWKWARD[ros]]]
SAMPLE += [case(ros, name, 64) for ros in (ROS1, ROS2) for name in _FROM_DISTRIBUTIONS[ros]]
SAMPLE += [case(ros, name, width) for width in WIDTHS if width > 8 for ros, name in _KIND_CASES]
# Blocks of so many words that they are selected a cycle ahead: at the end, in the middle, and in an array's elements.
LONG = [case(ROS2, "nav_msgs/Odometry", width) for width in (8, 64)]
LONG += [case(ROS1, "sensor_msgs/CameraInfo", 16), case(ROS1, "visualization_msgs/MarkerArray", 8)]
SAMPLE += LONG
TROUBLED = [case(ros, name, width) for width in (8, 64) for ros, name in _KIND_CASES]
TROUBLED += [case(ros, f"{PACKAGE}/Tree", width) for width in (16, 32, 512) for ros in (ROS1, ROS2)]
TROUBLED += [case(ros, f"sensor_msgs/{name}", 8) for ros in (ROS1, ROS2) for name in ("Image", "PointCloud2")]
TROUBLED += LONG[:1]
NETLISTS = [
    case(ROS2, "sensor_msgs/CameraInfo", 8),
    case(ROS1, "sensor_msgs/Image", 8),
    case(ROS2, "sensor_msgs/JointState", 8),
    case(ROS2, f"{PACKAGE}/Tree", 8),
    case(ROS2, f"{PACKAGE}/Sizes", 16),
    case(ROS1, f"{PACKAGE}/Nameds", 32),
    case(ROS2, f"{PACKAGE}/Wides", 64),
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> PublisherBench:
    return PublisherBench(tmp_path_factory.mktemp("publishers"))


@pytest.mark.one_in(9, 6)
@pytest.mark.parametrize(("ros", "name", "width"), SAMPLE)
def test_frames_are_those_of_rosbags(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    publisher = bench.publisher(ros, name, width)
    print(f"seed {SEED}")
    messages = [publisher.good(value) for value in publisher.values(8, random.Random(SEED))]
    publisher.run(tmp_path, messages, SEED=SEED, STALL_PERCENT=30, SINK_STALL_PERCENT=40)
    publisher.run(tmp_path, messages, SEED=SEED, LATE_READY=True)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("ros", "name", "width"), TROUBLED)
def test_faults_hurt_no_other_frame(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """A broken frame is aborted, each fault gives one error with its code, and the rest is right."""
    publisher = bench.publisher(ros, name, width)
    print(f"seed {SEED}")
    source = random.Random(f"{SEED} {name} {width}")
    messages = [publisher.faulty(value, source) for value in publisher.values(40, source, [TYPICAL], 7)]
    assert len({message.error for message in messages}) >= 3
    publisher.run(tmp_path, messages, SEED=SEED)
    publisher.run(tmp_path, messages, SEED=SEED, STALL_PERCENT=30, SINK_STALL_PERCENT=40)


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("width", [8, 32, 64, 512])
@pytest.mark.parametrize("name", ["sensor_msgs/PointCloud2", "sensor_msgs/JointState"])
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_message_goes_in_any_cycle(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """Withdrawn so many cycles after it was shown, with a whole one behind each."""
    publisher = bench.publisher(ros, name, width)
    first, second = (publisher.good(value) for value in publisher.values(2, random.Random(SEED), [TYPICAL], 3))
    cycles = min(150, 10 + 8 * len(first.payload) // width)
    withdrawn = [replace(first, lifetime=cycle, error=SHORT) for cycle in range(1, cycles)]
    messages = [each for message in withdrawn for each in (message, second)]
    publisher.run(tmp_path, messages, SEED=SEED)
    publisher.run(tmp_path, messages, SEED=SEED, SINK_STALL_PERCENT=50)


@pytest.mark.parametrize(("ros", "name", "width"), LONG[:1])
def test_a_message_goes_in_its_long_block(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """No word that was selected ahead gets into the next message."""
    publisher = bench.publisher(ros, name, width)
    source = random.Random(SEED)
    print(f"seed {SEED}")
    first, second = (publisher.good(value) for value in publisher.values(2, source, [TYPICAL], 3))
    lifetimes = source.sample(range(len(first.payload) - 680, len(first.payload)), 12)
    withdrawn = [replace(first, lifetime=cycle, error=SHORT) for cycle in lifetimes]
    publisher.run(tmp_path, [each for message in withdrawn for each in (message, second)], SEED=SEED)


@pytest.mark.one_in(11, 3)
@pytest.mark.parametrize("width", [8, 16, 64, 512])
@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize("length", [2**32 - 1, 2**31, 2**29, 300])
def test_a_length_that_is_far_too_large_ends_with_its_part(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, width: int, length: int
) -> None:
    """A `tlast` and a `last` end a part, and a frame its length: nothing goes on for 2**32 elements."""
    publisher = bench.publisher(ros, f"{PACKAGE}/Lying", width)
    value: dict[str, Any] = {"texts": ["abcde", "d"], "many": [1.5, 2.5, 3.5, 4.5], "data": bytes(range(20)), "last": 7}
    good = publisher.good(value)
    lies = []
    for name in ("texts", "many", "data"):
        lie = publisher.with_length(good, f"{name}_length", length)
        counted = good.payload.index(len(value[name]).to_bytes(4, "little"), len(publisher.frame.prefix))
        payload = good.payload[:counted] + length.to_bytes(4, "little") + good.payload[counted + 4 :]
        lies.append(replace(lie, payload=payload, error=SHORT))
    messages = [each for lie in lies for each in (lie, good)]
    publisher.run(tmp_path, messages, SEED=SEED)
    publisher.run(tmp_path, messages, SEED=SEED, STALL_PERCENT=30, SINK_STALL_PERCENT=40)


@pytest.mark.parametrize("width", [8, 16, 32])
def test_padding_ends_in_what_is_given_up(bench: PublisherBench, tmp_path: Path, width: int) -> None:
    """Bytes that are not sent any more count all the same."""
    publisher = bench.publisher(ROS2, "sensor_msgs/JointState", width)
    source = random.Random(SEED)
    messages = []
    for size in range(9):
        (value,) = publisher.values(1, source, [TYPICAL])
        value = {**value, "name": ["n" * size, "m"], "position": [1.0], "velocity": [2.0], "effort": [3.0]}
        good = publisher.good(value)
        messages += [publisher.with_early_last(value, good, 1, source), good]
    publisher.run(tmp_path, messages, SEED=SEED)


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_stream_moves_a_beat_a_cycle(bench: PublisherBench, tmp_path: Path, ros: Middleware, width: int) -> None:
    """Of two messages the longer one takes as many cycles more as it has beats more."""
    publisher = bench.publisher(ros, f"{PACKAGE}/Bytes", width)
    beats = (3, 40, 3, 1040, 3)
    messages = [publisher.good({"data": random.Random(SEED).randbytes(count * width // 8)}) for count in beats]
    result = publisher.run(tmp_path, messages, SEED=SEED)
    taken = [int(cycle) for cycle in re.findall(r"^taken \d+ cycle (\d+)$", result.output, re.MULTILINE)]
    cycles = [end - start for start, end in pairwise(taken)]
    assert (cycles[0] - cycles[1], cycles[2] - cycles[1]) == (40 - 3, 1040 - 3)


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_the_cycles_of_a_message(bench: PublisherBench, tmp_path: Path, ros: Middleware, width: int) -> None:
    """What a part costs beside its bytes: a cycle for its opening, and one for padding that the run decides on."""
    publisher = bench.publisher(ros, "sensor_msgs/JointState", width)
    value = {
        "header": {"seq": 1, "stamp": {"sec": 1, "nsec": 2}, "frame_id": "base_link"},
        "name": ["a", "bc"],
        **{name: [1.0, 2.0] for name in ("position", "velocity", "effort")},
    }
    if ros is ROS2:
        value["header"] = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "base_link"}
    result = publisher.run(tmp_path, [publisher.good(value)] * 3, SEED=SEED)
    taken = [int(cycle) for cycle in re.findall(r"^taken \d+ cycle (\d+)$", result.output, re.MULTILINE)]
    expected = {(ROS1, 8): 115, (ROS1, 64): 30, (ROS2, 8): 130, (ROS2, 64): 36}[ros, width]
    assert [end - start for start, end in pairwise(taken)] == [expected] * 2


@pytest.mark.parametrize(("ros", "name", "width"), LONG[:1])
def test_a_long_block_moves_a_beat_a_cycle(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """The words that are selected ahead take a cycle each, as the others do."""
    publisher = bench.publisher(ros, name, width)
    message = publisher.good(publisher.values(1, random.Random(SEED), [TYPICAL])[0])
    result = publisher.run(tmp_path, [message] * 3, SEED=SEED)
    taken = [int(cycle) for cycle in re.findall(r"^taken \d+ cycle (\d+)$", result.output, re.MULTILINE)]
    # Beside the id, the length and the payload: the end, and the openings and the padding of two texts.
    most = 1 + 4 + len(message.payload) + 1 + 2 * 2
    assert all(end - start <= most for start, end in pairwise(taken))


@pytest.mark.one_in(9, 3)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize(
    ("name", "include", "exclude"),
    [
        ("sensor_msgs/Image", ["data", "height"], []),
        ("sensor_msgs/Image", [], ["header", "encoding", "data"]),
        ("nav_msgs/Odometry", ["pose.covariance", "twist.twist.angular"], []),
        ("sensor_msgs/PointCloud2", ["fields.offset", "data"], []),
        ("sensor_msgs/PointCloud2", [], ["fields"]),
        ("sensor_msgs/JointState", ["header", "effort"], []),
        (f"{PACKAGE}/Tree", ["branches.leaves.id", "height"], []),
        (f"{PACKAGE}/Nameds", ["three.name"], []),
    ],
)
def test_what_is_not_used_is_empty(
    bench: PublisherBench,
    tmp_path: Path,
    ros: Middleware,
    name: str,
    include: list[str],
    exclude: list[str],
    width: int,
) -> None:
    """The frame is rosbags' of the value whose unused fields are zeros and whose unused parts are empty."""
    frame = select(bench.oracles[ros].frame(name), dict.fromkeys(include), dict.fromkeys(exclude))
    publisher = bench.of_frame(ros, name, frame, width, "_".join(["", *include, "no", *exclude]).replace(".", "_"))
    empty = publisher.values(1, random.Random(SEED), [EMPTY])[0]
    values = [
        _only_used(value, empty, include, exclude)
        for value in publisher.values(6, random.Random(SEED), [TYPICAL, EXTREME])
    ]
    publisher.run(tmp_path, [publisher.good(value) for value in values], SEED=SEED, STALL_PERCENT=20)


def _only_used(value: Any, empty: Any, include: list[str], exclude: list[str], path: str = "") -> Any:
    """The value with what is empty in place of what is not used."""
    if path in exclude:
        return empty
    if path in include:
        return value
    if isinstance(value, dict):
        inner = empty if isinstance(empty, dict) else _zeros(value)
        return {
            name: _only_used(part, inner[name], include, exclude, f"{path}.{name}".lstrip("."))
            for name, part in value.items()
        }
    below = [name for name in include if name.startswith(f"{path}.")]
    if isinstance(value, list) and below:
        return [_only_used(part, _zeros(part), include, exclude, path) for part in value]
    return value if not include else empty


def _zeros(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _zeros(part) for name, part in value.items()}
    return type(value)()


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_giant_block_of_zeros_is_one_word(bench: PublisherBench, tmp_path: Path, width: int) -> None:
    """What is not used of a large message costs neither text nor a multiplexer."""
    name = f"{PACKAGE}/Giant"
    used = select(bench.oracles[ROS2].frame(name), dict.fromkeys(["some", "name", "last"]))
    publisher = bench.of_frame(ROS2, name, used, width)
    assert len(publisher.text.splitlines()) < 480
    words = int(re.findall(r"WORDS => (\d+)", publisher.text)[0])
    assert words < 60
    value = {"before": bytes(5000), "some": 0xBEEF, "name": "ab", "behind": [0.0] * 3000, "last": 7, "odd": [0]}
    messages = [publisher.good({**value, "name": name}) for name in ("", "a", "abcdefgh")]
    publisher.run(tmp_path, messages, SEED=SEED, SINK_STALL_PERCENT=10)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize("width", [8, 64])
def test_every_message_of_the_distributions_is_analysed(
    bench: PublisherBench, tmp_path: Path, ros: Middleware, width: int
) -> None:
    oracle = bench.oracles[ros]
    library = Library("work", tmp_path)
    Library("firm", tmp_path).analyse(core_files("axis/package", "axis/axis"))
    files = []
    for name in oracle.messages():
        frame = oracle.frame(name)
        if not frame.is_fixed_size:
            entity = publisher_entity(frame)
            files.append(tmp_path / f"{entity}.vhd")
            configuration = variable_publisher_configuration(frame, width, entity)
            files[-1].write_text(render(VARIABLE_PUBLISHER_TEMPLATE, configuration), encoding="ascii")
    assert len(files) > 100
    library.analyse(files)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("ros", "name", "width"), [*NETLISTS, case(ROS1, f"{PACKAGE}/Texts", 512)])
def test_they_are_latch_free(bench: PublisherBench, ros: Middleware, name: str, width: int) -> None:
    publisher = bench.publisher(ros, name, width)
    assert publisher.library.latches(publisher.entity) == []


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("ros", "name", "width"), NETLISTS)
def test_the_netlist_does_the_same(tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    """The bench with what `ghdl --synth` made of the publisher in its place."""
    publisher = PublisherBench(tmp_path).publisher(ros, name, width)
    publisher.library.replace_by_netlist(publisher.entity, {"ID": ID})
    publisher.analyse_bench()
    source = random.Random(SEED)
    messages = [publisher.faulty(value, source) for value in publisher.values(25, source, [TYPICAL, EMPTY], 5)]
    publisher.run(tmp_path, messages, SEED=SEED, STALL_PERCENT=20, SINK_STALL_PERCENT=20)


def test_an_illegal_id_is_named(bench: PublisherBench) -> None:
    publisher: Publisher = bench.publisher(ROS1, "std_msgs/String")
    result = publisher.library.run(publisher.entity, {"ID": 256})
    assert result.exit_code != 0
    assert "std_msgs_string_to_axis: ID is 256; legal: 0 to 255" in result.output
