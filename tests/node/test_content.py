"""The ends of messages in C++, against Python's, which tests/frame compares with independent serialisers."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from fusesoc_firm.frame.content import Content, content_of, without_tail
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from tests.frame.oracle import Oracle
from tests.frame.random_messages import random_texts
from tests.node.drivers import Driver, cpp_driver
from tests.seeds import seeded

SEED = seeded(20261129)


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("content")


def _messages(chance: random.Random) -> Iterator[tuple[Content, bytes]]:
    texts = random_texts(ROS2, chance)
    oracle, name = Oracle(ROS2, texts), [*texts][-1]
    stimuli = Stimuli(oracle.closure(name), ROS2, chance)
    content = content_of(oracle.frame(name))
    for kind in KINDS:
        yield content, oracle.serialise(name, stimuli.message(parse_name(name), kind))


def _damaged(payload: bytes, chance: random.Random) -> Iterator[bytes]:
    yield payload
    yield payload + chance.randbytes(chance.randint(1, 200))
    yield payload[: chance.randrange(len(payload))]
    place = chance.randrange(len(payload))
    yield payload[:place] + b"\xff" * 4 + payload[place + 4 :]


def test_cpp_finds_the_same_ends(driver: Driver) -> None:
    chance = random.Random(SEED)
    print(f"seed {SEED}")
    cases = [
        (content, damaged)
        for _ in range(40)
        for content, payload in _messages(chance)
        for damaged in _damaged(payload, chance)
    ]
    cases += [((), b"any bytes"), (cases[0][0], b"")]
    lines = [f"{' '.join(map(str, content))} / {payload.hex()}" for content, payload in cases]
    assert driver.answers(lines) == [str(len(without_tail(*case))) for case in cases]
