"""Frames that their sender aborts: they are reported with code 10 and not delivered, the next one is right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.converter.simulated.samples import ORACLES, case, framed, typical
from tests.converter.simulated.subscribers import Beat, Subscriber, SubscriberBench
from tests.seeds import seeded

SEED = seeded(20261125)
WIDTHS = (8, 16, 32, 64, 128, 256, 512)
TYPES = [
    (ROS1, "std_msgs/UInt16"),
    (ROS1, "geometry_msgs/Pose"),
    (ROS1, "std_msgs/String"),
    (ROS1, "sensor_msgs/JointState"),
    (ROS1, "awkward_msgs/Late"),
    (ROS2, "geometry_msgs/Transform"),
    (ROS2, "sensor_msgs/Image"),
    (ROS2, "std_msgs/Header"),
    (ROS2, "awkward_msgs/Bounded"),
    (ROS2, "awkward_msgs/Deep"),
]


def aborted(subscriber: Subscriber, frame: bytes, place: int) -> list[Beat]:
    """The frame's first bytes, up to a place; the last beat aborts it."""
    *before, last = subscriber.beats(frame[:place])
    return [*before, replace(last, is_aborted=True)]


@pytest.mark.one_in(7, 6)
@pytest.mark.parametrize(
    ("ros", "name", "width"),
    [
        case(ros, name, width)
        for place, (ros, name) in enumerate(TYPES)
        for width in (*WIDTHS[place % 7 :], *WIDTHS[: place % 7])
    ],
)
def test_an_aborted_frame_is_not_delivered(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """After every byte of it, its last one included; a good frame follows each."""
    print(f"seed {SEED}")
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    frame = framed(typical(ros, name, SEED))
    good = subscriber.beats(frame)
    message = subscriber.run_beats(tmp_path, good)
    places = range(1, len(frame) + 1)
    beats = [beat for place in places for beat in (*aborted(subscriber, frame, place), *good)]
    for stall in (0, 30):
        events = subscriber.run_beats(tmp_path, beats, SEED=SEED % 1000, STALL_PERCENT=stall, BROKEN_BEATS=True)
        reports = [place for place, event in enumerate(events) if event.startswith("frame_error")]
        assert [events[place] for place in reports] == [f"frame_error {Fault.ABORTED.value}"] * len(places)
        assert all(events[place + 1 : place + 1 + len(message)] == message for place in reports)
        assert sum(event.startswith("message") for event in events) == len(places)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [16, 64])
@pytest.mark.parametrize("name", ["geometry_msgs/Point", "sensor_msgs/JointState"])
def test_an_abort_may_come_with_no_byte(subscribers: SubscriberBench, tmp_path: Path, name: str, width: int) -> None:
    """Nor does `tuser` before the last beat say anything."""
    subscriber = subscribers.subscriber(ORACLES[ROS1].frame(name), width)
    good = subscriber.beats(framed(typical(ROS1, name, SEED)))
    message = subscriber.run_beats(tmp_path, good)
    report = f"frame_error {Fault.ABORTED.value}"
    for place in range(1, len(good)):
        null = Beat(bytes(width // 8), 0, is_last=True, is_aborted=True)
        marked = [*(replace(beat, is_aborted=True) for beat in good[:-1]), good[-1]]
        events = subscriber.run_beats(tmp_path, [*good[:place], null, *marked], BROKEN_BEATS=True)
        assert events[events.index(report) + 1 :] == message
