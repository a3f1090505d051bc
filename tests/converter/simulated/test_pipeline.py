"""Subscribers of variable size with register slices, and with fields that are stored a cycle late.

The messages and faults are those of the subscribers without them. Latencies are stated in cycles.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from fusesoc_firm.converter.pipeline import BORDERS, FULL, NONE, PIPELINES, pipeline_of
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import TYPICAL
from tests.converter.simulated.samples import ORACLES, case, exchanged, framed, serialise, stimuli
from tests.converter.simulated.subscribers import SubscriberBench
from tests.converter.simulated.test_variable_converters import codes, outcomes, troubled, verdict
from tests.seeds import seeded

SEED = seeded(20261123)
CASES = [
    case(ROS2, "awkward_msgs/Deep", 64),
    case(ROS1, "diagnostic_msgs/DiagnosticArray", 8),
    case(ROS2, "sensor_msgs/JointState", 16),
    case(ROS1, "sensor_msgs/PointCloud2", 32),
    case(ROS2, "awkward_msgs/Halves", 512),
    case(ROS2, "sensor_msgs/Image", 128),
    case(ROS2, "nav_msgs/Odometry", 64),
    case(ROS2, "awkward_msgs/Deep", 8),
    case(ROS1, "awkward_msgs/Late", 64),
]


@pytest.fixture(scope="module", params=[BORDERS, FULL])
def bench(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> SubscriberBench:
    return SubscriberBench(tmp_path_factory.mktemp("subscribers"), request.param)


@pytest.mark.one_in(6, 3)
@pytest.mark.parametrize(("ros", "name", "width"), CASES)
def test_messages_come_through(bench: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    subscriber = bench.subscriber(ORACLES[ros].frame(name), width)
    print(f"seed {SEED}")
    frames, expected = exchanged(subscriber, ros, name, SEED, 12)
    for stall in 0, 40:
        assert subscriber.run(tmp_path, frames, SEED=SEED % 1000, STALL_PERCENT=stall) == expected
    assert subscriber.library.latches(subscriber.entity) == []


@pytest.mark.one_in(6, 3)
@pytest.mark.parametrize(("ros", "name", "width"), CASES)
def test_broken_frames_hurt_no_other(
    bench: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    frame = ORACLES[ros].frame(name)
    subscriber = bench.subscriber(frame, width)
    print(f"seed {SEED}")
    chance, source = random.Random(f"{SEED} {name}"), stimuli(ros, name, SEED)
    bodies = [
        troubled(ros, serialise(ros, name, source.message(parse_name(name), TYPICAL)), chance) for _ in range(100)
    ]
    frames = [body for body in bodies if body]
    events = subscriber.run(tmp_path, frames, SEED=SEED % 1000, STALL_PERCENT=35)
    assert outcomes(events) == [verdict(frame, body) is not None for body in frames]
    assert codes(events)


def test_a_stream_takes_a_beat_in_every_cycle(bench: SubscriberBench, tmp_path: Path) -> None:
    frame = ORACLES[ROS1].frame("sensor_msgs/Image")
    value = stimuli(ROS1, "sensor_msgs/Image", SEED).message(parse_name("sensor_msgs/Image"), TYPICAL)
    value["data"] = bytes(8000)
    body = framed(encode(frame, value))
    bench.subscriber(frame, 64).run(tmp_path, [body] * 2)
    assert _cycles(tmp_path) - 2000 <= 2 * -(-len(body) // 8) / 0.98 + 60


def test_an_element_costs_no_further_cycle(tmp_path: Path) -> None:
    """The difference between 2 and 12 elements, with a sink that takes each at once."""
    name = "diagnostic_msgs/DiagnosticArray"
    frame = ORACLES[ROS1].frame(name)
    status = {"level": 0, "name": "", "message": "", "hardware_id": "", "values": []}
    of_ten = {}
    for pipeline in PIPELINES:
        (tmp_path / pipeline).mkdir()
        subscriber = SubscriberBench(tmp_path / pipeline, pipeline).subscriber(frame, 16)
        cycles = []
        for count in 2, 12:
            value = {"header": {"seq": 0, "stamp": {"sec": 0, "nsec": 0}, "frame_id": ""}, "status": [status] * count}
            subscriber.run(tmp_path, [framed(encode(frame, value))])
            cycles.append(_cycles(tmp_path))
        of_ten[pipeline] = cycles[1] - cycles[0]
    assert of_ten == dict.fromkeys(PIPELINES, of_ten[NONE])


def test_the_default_follows_the_bytes_of_fields() -> None:
    oracle = ORACLES[ROS2]
    large, small = oracle.frame("nav_msgs/Odometry"), oracle.frame("sensor_msgs/JointState")
    assert [pipeline_of(frame) for frame in (large, small)] == [FULL, NONE]
    assert [pipeline_of(frame, least=BORDERS) for frame in (large, small)] == [FULL, BORDERS]
    assert [pipeline_of(frame, given=NONE, least=BORDERS) for frame in (large, small)] == [NONE, NONE]


def _cycles(directory: Path) -> int:
    return int(re.findall(r"(\d+)", (directory / "cycles.txt").read_text(encoding="ascii"))[0])
