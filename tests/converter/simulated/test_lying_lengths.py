"""Headers that announce 2**32-1 bytes: they are refused at once with code 7, and hold up nobody."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.frame.length import DEFAULT_LONGEST, longest_payload
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.converter.simulated.samples import ORACLES, case, framed, typical
from tests.converter.simulated.subscribers import SubscriberBench
from tests.seeds import seeded

SEED = seeded(20261124)
LIE = 2**32 - 1
WIDTHS = (8, 16, 32, 64, 128, 256, 512)
TYPES = [
    (ROS1, "std_msgs/String"),
    (ROS1, "sensor_msgs/JointState"),
    (ROS1, "sensor_msgs/Image"),
    (ROS1, "awkward_msgs/Late"),
    (ROS2, "std_msgs/Header"),
    (ROS2, "sensor_msgs/Image"),
    (ROS2, "geometry_msgs/PoseArray"),
    (ROS2, "awkward_msgs/Bounded"),
    (ROS2, "awkward_msgs/Deep"),
    (ROS2, "awkward_msgs/Fixtures"),
]


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), [case(ros, name, width) for ros, name in TYPES for width in WIDTHS])
def test_a_lying_length_is_refused(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """Good frames around it come through; nothing of the refused frame leaves, and it costs no more than its beats."""
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    payload = typical(ros, name, SEED)
    good, lie = framed(payload), framed(payload, LIE)
    message = subscriber.run(tmp_path, [good])
    alone = cycles(tmp_path)
    report = f"frame_error {Fault.TOO_LONG.value}"
    assert subscriber.run(tmp_path, [good, lie, good]) == [*message, report, *message]
    assert cycles(tmp_path) - alone <= 2 * (len(subscriber.beats(good)) + 64) + (alone - 2000)
    assert subscriber.run(tmp_path, [good, lie, good], SEED=7, STALL_PERCENT=40) == [*message, report, *message]


@pytest.mark.parametrize("width", [8, 64])
def test_the_limit_is_the_longest_payload(subscribers: SubscriberBench, tmp_path: Path, width: int) -> None:
    """One byte more than the bounds, or the default, is refused; lengths up to it are faults of other kinds."""
    for ros, name in ((ROS2, "std_msgs/String"), (ROS2, "awkward_msgs/Bounded")):
        frame = ORACLES[ros].frame(name)
        payload, longest = typical(ros, name, SEED), longest_payload(frame)
        frames = [framed(payload, length) for length in (longest, longest + 1, 2**31, len(payload))]
        events = subscribers.subscriber(frame, width).run(tmp_path, frames)
        reports = [event for event in events if event.startswith("frame_error")]
        assert reports[1:] == [f"frame_error {Fault.TOO_LONG.value}"] * 2
        assert reports[0] != reports[1]
        assert events[-1].startswith("message")
    assert longest_payload(ORACLES[ROS2].frame("std_msgs/String")) == DEFAULT_LONGEST


def cycles(directory: Path) -> int:
    return int((directory / "cycles.txt").read_text().split()[1])
