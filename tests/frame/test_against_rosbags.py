"""Our bytes and values against rosbags', for every message of fixed size in two distributions and the samples."""

from __future__ import annotations

import random

import pytest

from fusesoc_firm.frame.codec import decode, encode, used_bytes
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.frame.oracle import Oracle, is_same
from tests.frame.samples import AWKWARD
from tests.seeds import seeded

SEED = seeded(20240601)
VALUES_EACH = 12

ORACLES = {ros: Oracle(ros, AWKWARD[ros]) for ros in (ROS1, ROS2)}
MESSAGES = [
    pytest.param(ros, name, id=f"ros{ros.number}-{name}")
    for ros, oracle in ORACLES.items()
    for name in [*oracle.fixed_size_messages(), *AWKWARD[ros]]
]


def masked(payload: bytes, used: bytes) -> bytes:
    return bytes(byte if is_used else 0 for byte, is_used in zip(payload, used, strict=True))


@pytest.mark.parametrize(("ros", "name"), MESSAGES)
def test_bytes_and_values_are_those_of_rosbags(ros: Middleware, name: str) -> None:
    print(f"values from seed {SEED} and {name}")
    source = random.Random(f"{SEED} {name}")
    oracle = ORACLES[ros]
    frame = oracle.frame(name)
    for _ in range(VALUES_EACH):
        value = oracle.random_value(name, source)
        payload = oracle.serialise(name, value)
        assert encode(frame, value) == masked(payload, used_bytes(frame, payload))
        assert is_same(decode(frame, payload), value)


@pytest.mark.parametrize(("ros", "name"), MESSAGES)
def test_what_is_padding_changes_no_value(ros: Middleware, name: str) -> None:
    source = random.Random(SEED)
    oracle = ORACLES[ros]
    frame = oracle.frame(name)
    value = oracle.random_value(name, source)
    payload = encode(frame, value)
    garbage = bytes(
        byte if used else source.randrange(256) for byte, used in zip(payload, used_bytes(frame, payload), strict=True)
    )
    assert is_same(decode(frame, garbage), value)


def test_the_distributions_hold_enough() -> None:
    """A wrong filter would leave nothing to compare."""
    assert [len(ORACLES[ros].fixed_size_messages()) for ros in (ROS1, ROS2)] == [50, 49]
