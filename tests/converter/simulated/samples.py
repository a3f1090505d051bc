"""What the tests of converters in simulation share: cases, and typical messages as frames."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, TYPICAL, Stimuli
from tests.converter.simulated.subscribers import LENGTH_BYTES, Subscriber
from tests.frame.oracle import Oracle
from tests.frame.samples import AWKWARD_VARIABLE

ORACLES = {ros: Oracle(ros, AWKWARD_VARIABLE[ros]) for ros in (ROS1, ROS2)}


def case(ros: Middleware, name: str, width: int) -> Any:
    return pytest.param(ros, name, width, id=f"ros{ros.number}-{name}-{width}")


def stimuli(ros: Middleware, name: str, seed: object) -> Stimuli:
    return Stimuli(ORACLES[ros].closure(name), ros, random.Random(f"{seed} {name}"))


def typical(ros: Middleware, name: str, seed: int) -> bytes:
    """The payload of a typical message."""
    return encode(ORACLES[ros].frame(name), stimuli(ros, name, seed).message(parse_name(name), TYPICAL))


def framed(payload: bytes, length: int | None = None) -> bytes:
    """A frame without the id; its header announces the payload's length, or another one."""
    return (len(payload) if length is None else length).to_bytes(LENGTH_BYTES, "little") + payload


def serialise(ros: Middleware, name: str, value: Mapping[str, Any]) -> bytes:
    """What rosbags makes of a value; it knows no wstring, for which our codec stands in, checked elsewhere."""
    if name == "awkward_msgs/Unicode":
        return encode(ORACLES[ros].frame(name), value)
    return ORACLES[ros].serialise(name, value)


def exchanged(
    subscriber: Subscriber, ros: Middleware, name: str, seed: int, count: int
) -> tuple[list[bytes], list[str]]:
    """Frames of messages of all kinds, and the events that must come out of a subscriber."""
    source = stimuli(ros, name, seed)
    frames, expected = [], []
    for number in range(count):
        value = source.message(parse_name(name), KINDS[number % len(KINDS)])
        payload = serialise(ros, name, value)
        frames.append(framed(payload))
        expected += subscriber.events(value, len(payload))
    return frames, expected
