"""Beats that break the rules of frames: their frame is reported with code 8 and skipped, the next one is right."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.converter.simulated.samples import ORACLES, case, framed, typical
from tests.converter.simulated.subscribers import LENGTH_BYTES, Beat, SubscriberBench
from tests.seeds import seeded

SEED = seeded(20261123)
# At 8 bits, every beat holds its byte.
WIDTHS = (16, 32, 64, 128, 256, 512)
TYPES = [
    (ROS1, "std_msgs/UInt16"),
    (ROS1, "geometry_msgs/Pose"),
    (ROS1, "std_msgs/String"),
    (ROS1, "sensor_msgs/JointState"),
    (ROS2, "geometry_msgs/Quaternion"),
    (ROS2, "geometry_msgs/Transform"),
    (ROS2, "sensor_msgs/Image"),
    (ROS2, "std_msgs/Header"),
    (ROS2, "awkward_msgs/Bounded"),
    (ROS2, "awkward_msgs/Deep"),
]


def broken(beats: Sequence[Beat], place: int, lanes: int, chance: random.Random) -> Iterator[list[Beat]]:
    """The frame with a holed, a null and a short beat at a place, and with a null beat in front of it.

    A last beat with fewer bytes only ends the frame early.
    """
    before, beat, after = list(beats[:place]), beats[place], list(beats[place + 1 :])
    full = (1 << lanes) - 1
    # A lane below the highest one is missing; the last beat ends with its byte.
    high = beat.keep.bit_length() - 1 if beat.is_last else chance.randrange(1, lanes)
    if high > 0:
        yield [*before, replace(beat, keep=((2 << high) - 1) & ~(1 << chance.randrange(high))), *after]
    elif lanes > 2:
        yield [*before, replace(beat, keep=0b101), *after]
    yield [*before, Beat(chance.randbytes(lanes), 0, is_last=False), beat, *after]
    if not beat.is_last:
        yield [*before, replace(beat, keep=0), *after]
        yield [*before, replace(beat, keep=full >> chance.randrange(1, lanes)), *after]


@pytest.mark.one_in(6, 6)
@pytest.mark.parametrize(
    ("ros", "name", "width"),
    [
        case(ros, name, width)
        for place, (ros, name) in enumerate(TYPES)
        for width in (*WIDTHS[place % 6 :], *WIDTHS[: place % 6])
    ],
)
def test_a_broken_beat_costs_its_frame_alone(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    """At every place of a frame, a good frame after each."""
    print(f"seed {SEED}")
    chance = random.Random(f"{SEED} {name} {width}")
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    good = subscriber.beats(framed(typical(ros, name, SEED)))
    message = subscriber.run_beats(tmp_path, good)
    frames = [frame for place in range(len(good)) for frame in broken(good, place, width // 8, chance)]
    beats = [beat for frame in frames for beat in (*frame, *good)]
    for stall in (0, 30):
        events = subscriber.run_beats(tmp_path, beats, SEED=SEED % 1000, STALL_PERCENT=stall, BROKEN_BEATS=True)
        reports = [place for place, event in enumerate(events) if event.startswith("frame_error")]
        assert [events[place] for place in reports] == [f"frame_error {Fault.BROKEN_BEAT.value}"] * len(frames)
        assert all(events[place + 1 : place + 1 + len(message)] == message for place in reports)
        assert sum(event.startswith("message") for event in events) == len(frames)


@pytest.mark.parametrize("width", [16, 64])
@pytest.mark.parametrize(("ros", "name"), [(ROS1, "std_msgs/String"), (ROS1, "geometry_msgs/Point")])
def test_a_null_beat_after_the_payload_is_one_too_many(
    subscribers: SubscriberBench, tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    lanes = width // 8
    subscriber = subscribers.subscriber(ORACLES[ros].frame(name), width)
    text = b"\x0b\x00\x00\x00hello world" if name == "std_msgs/String" else bytes(range(24))
    good = subscriber.beats(len(text).to_bytes(LENGTH_BYTES, "little") + text)
    message = subscriber.run_beats(tmp_path, good)
    null = Beat(bytes(lanes), 0, is_last=True)
    longer = [*good[:-1], replace(good[-1], is_last=False), null]
    for stall in (0, 40):
        events = subscriber.run_beats(tmp_path, [*longer, *good], STALL_PERCENT=stall, BROKEN_BEATS=True)
        code = Fault.LONG_FRAME if good[-1].keep == (1 << lanes) - 1 else Fault.BROKEN_BEAT
        at = events.index(f"frame_error {code.value}")
        assert events[at + 1 :] == message
